"""An update's report of its work."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.look_records import MaterialRecord
from perfect_bvh_addon.sync.records import CameraRecord, MeshRecord, SceneRecord
from sync.fakes import Shown, record
from sync.targets import (
    MESHES,
    SHOWN,
    TARGETS,
    base,
    state,
)


def object_actions(target: SceneRecord) -> dict[str, tuple[str, int, int]]:
    made, _ = state()
    made.update(base())
    report = made.update(target)
    return {item.name: (item.action, item.instance_count, item.changed_count) for item in report.objects}


UNCHANGED = {"object 1": ("kept", 1, 0), "object 2": ("kept", 5, 0), "object 3": ("kept", 1, 0)}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("base", {}),
        ("moved", {"object 1": ("moved", 1, 1)}),
        ("masked", {"object 1": ("masked", 1, 1)}),
        ("deformed", {"object 1": ("deformed", 1, 1), "object 3": ("deformed", 1, 1)}),
        ("more_triangles", {"object 1": ("replaced", 1, 1), "object 3": ("replaced", 1, 1)}),
        ("object_removed", {"object 1": ("removed", 0, 1)}),
        ("mesh_removed", {"object 1": ("removed", 0, 1), "object 3": ("removed", 0, 1)}),
        ("object_added", {"object 4": ("added", 1, 1)}),
        ("swapped", {"object 1": ("replaced", 1, 1)}),
        ("fewer_instances", {"object 2": ("recounted", 3, 2)}),
        ("more_instances", {"object 2": ("recounted", 8, 3)}),
        ("reordered", {}),
    ],
)
def test_the_report_says_what_happened_to_each_object(name: str, expected: dict[str, Any]) -> None:
    assert object_actions(TARGETS[name]()) == {**UNCHANGED, **expected}


def test_the_first_report_adds_everything() -> None:
    made, _ = state()
    report = made.update(base())
    assert {item.action for item in report.objects} == {"added"}
    assert {item.action for item in report.meshes} == {"added"}
    assert report.added_count == len(SHOWN)
    assert report.has_changes
    assert report.byte_count == 1234


def test_the_report_gives_reasons_for_meshes() -> None:
    made, _ = state()
    made.update(base())
    reasons = {
        name: {item.name: (item.action, item.reason) for item in made.update(TARGETS[name]()).meshes}
        for name in ("more_triangles", "other_triangles", "deformed", "mesh_removed")
    }
    assert reasons["more_triangles"]["a"] == ("replaced", "3 triangles, 2 before")
    assert reasons["other_triangles"]["a"] == ("replaced", "2 triangles, 3 before")
    assert reasons["deformed"]["a"] == ("replaced", "as many triangles, but others")
    assert reasons["mesh_removed"]["a"] == ("removed", "no object uses it any more")
    assert reasons["mesh_removed"]["b"] == ("kept", "Blender did not evaluate it again")
    made.update(base())
    equal = replace(base(), meshes=tuple([replace(mesh) for mesh in base().meshes]))
    assert {mesh.reason for mesh in made.update(equal).meshes} == {"same triangles, same positions"}


def test_counts_add_up() -> None:
    made, _ = state()
    made.update(base())
    for name in TARGETS:
        target = TARGETS[name]()
        report = made.update(target)
        total = report.added_count + report.moved_count + report.masked_count + report.kept_count
        assert total == len(target.instances)
        assert str(report)


def test_an_update_without_a_change_says_so() -> None:
    made, _ = state()
    made.update(base())
    report = made.update(base())
    assert not report.has_changes
    assert report.kept_count == len(SHOWN)


CAMERA = CameraRecord(np.eye(4), (-1, 1, -1, 1), "perspective", 0.1, 100.0)
RED = MaterialRecord("red", 50, 0, (1.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("settings", "flag"),
    [
        ({"camera": replace(CAMERA, clip_end=50.0), "materials": (RED,)}, "camera_changed"),
        ({"camera": replace(CAMERA, matrix=np.diag([1.0, 1, 1, 1]) + 1e-9), "materials": (RED,)}, "camera_changed"),
        ({"camera": None, "materials": (RED,)}, "camera_changed"),
        ({"camera": CAMERA, "materials": (RED,), "size": (32, 18)}, "camera_changed"),
        ({"camera": CAMERA, "materials": (replace(RED, color=(0.0, 1.0, 0.0, 1.0)),)}, "materials_changed"),
        ({"camera": CAMERA, "materials": (RED,), "slots": {1: (0,)}}, "materials_changed"),
        ({"camera": CAMERA, "materials": (RED,), "film_transparent": True}, "materials_changed"),
    ],
)
def test_what_changes_the_image_but_no_geometry_is_noticed(settings: dict[str, Any], flag: str) -> None:
    made, _ = state()
    made.update(record(MESHES, SHOWN, camera=CAMERA, materials=(RED,)))
    again = made.update(record(MESHES, SHOWN, camera=replace(CAMERA, matrix=np.eye(4)), materials=(RED,)))
    assert not again.has_changes
    report = made.update(record(MESHES, SHOWN, **settings))
    flags = {name: getattr(report, name) for name in ("camera_changed", "materials_changed", "attributes_changed")}
    assert flags == {name: name == flag for name in flags}
    assert report.has_changes


@pytest.mark.parametrize("column", ["material_slots", "corner_normals", "corner_uvs", "polygon_ids"])
def test_attributes_that_change_are_noticed(column: str) -> None:
    shapes = {"material_slots": (2,), "polygon_ids": (2,), "corner_normals": (2, 3, 3), "corner_uvs": (2, 3, 2)}
    dtype = np.int32 if len(shapes[column]) == 1 else np.float32

    def with_values(value: float) -> MeshRecord:
        return replace(MESHES[0], **{column: np.full(shapes[column], value, dtype)})

    made, scene = state()
    made.update(record([with_values(0)], [Shown("a", 1)]))
    scene.calls.clear()
    report = made.update(record([with_values(1)], [Shown("a", 1)]))
    assert report.attributes_changed
    assert scene.calls == ["commit"]
    assert not made.update(record([with_values(1)], [Shown("a", 1)])).attributes_changed
