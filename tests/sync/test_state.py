"""The engine's scene after any series of updates equals one that was filled afresh; nothing more is edited."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from perfect_bvh_addon.sync.records import CameraRecord, MaterialRecord, MeshRecord, SceneRecord
from perfect_bvh_addon.sync.state import SceneState
from sync.fakes import FailureError, FakeScene, Shown, StaleError, mesh, record

MESHES = [mesh("a"), mesh("b", 5)]
SHOWN = [
    Shown("a", 1),
    Shown("b", 2, x=1.0),
    Shown("a", 3, x=2.0),
    *(Shown("b", 2, x=10.0 + index, parent=9, persistent_id=(index,)) for index in range(4)),
]


def base() -> SceneRecord:
    return record(MESHES, SHOWN)


def state() -> tuple[SceneState, FakeScene]:
    made = SceneState(FakeScene)
    assert isinstance(made.scene, FakeScene)
    return made, made.scene


def fresh(target: SceneRecord) -> list[Any]:
    """What an empty scene holds after one update."""
    made, scene = state()
    made.update(target)
    return scene.answer()


def moved() -> SceneRecord:
    return record(MESHES, [Shown("a", 1, x=-7.0), *SHOWN[1:]])


def deformed() -> SceneRecord:
    return record([mesh("a", shift=2.0), MESHES[1]], SHOWN)


def more_triangles() -> SceneRecord:
    return record([mesh("a", 3), MESHES[1]], SHOWN)


def other_triangles() -> SceneRecord:
    turned = replace(MESHES[0], triangles=MESHES[0].triangles[:, ::-1].copy())
    return record([turned, MESHES[1]], SHOWN)


def masked() -> SceneRecord:
    return record(MESHES, [Shown("a", 1, mask=1), *SHOWN[1:]])


def object_removed() -> SceneRecord:
    return record(MESHES, SHOWN[1:])


def mesh_removed() -> SceneRecord:
    return record(MESHES[1:], [item for item in SHOWN if item.mesh == "b"])


def object_added() -> SceneRecord:
    return record([*MESHES, mesh("c", 4)], [Shown("c", 4), *SHOWN])


def swapped() -> SceneRecord:
    return record(MESHES, [Shown("b", 1), *SHOWN[1:]])


def swapped_and_last_user_gone() -> SceneRecord:
    return record(MESHES[1:], [replace_mesh(item, "b") for item in SHOWN])


def replace_mesh(item: Shown, key: str) -> Shown:
    return Shown(key, item.uid, item.x, item.mask, item.parent, item.persistent_id)


def fewer_instances() -> SceneRecord:
    return record(MESHES, SHOWN[:-2])


def more_instances() -> SceneRecord:
    extra = [Shown("b", 2, x=50.0 + index, parent=9, persistent_id=(100 + index,)) for index in range(3)]
    return record(MESHES, [*SHOWN, *extra])


def reordered() -> SceneRecord:
    return record(MESHES[::-1], SHOWN[::-1])


def empty() -> SceneRecord:
    return record([], [])


def everything_at_once() -> SceneRecord:
    shown = [Shown("b", 1, x=3.0), Shown("c", 3), *SHOWN[4:], Shown("c", 2, x=1.0, mask=5), Shown("c", 8)]
    return record([mesh("c"), mesh("b", 5, shift=1.0)], shown)


TARGETS: dict[str, Callable[[], SceneRecord]] = {
    function.__name__: function
    for function in (
        base,
        moved,
        deformed,
        more_triangles,
        other_triangles,
        masked,
        object_removed,
        mesh_removed,
        object_added,
        swapped,
        swapped_and_last_user_gone,
        fewer_instances,
        more_instances,
        reordered,
        empty,
        everything_at_once,
    )
}

# What a change from base() may call, beside commit.
CALLS = {
    "base": [],
    "moved": ["set_transforms"],
    "deformed": ["set_usage", "update_mesh"],
    "more_triangles": ["set_usage", "replace_mesh"],
    "other_triangles": ["set_usage", "replace_mesh"],
    "masked": ["set_masks"],
    "object_removed": ["remove_instances"],
    "mesh_removed": ["remove_instances", "remove_mesh"],
    "object_added": ["add_mesh", "add_instances"],
    "swapped": ["remove_instances", "add_instances"],
    "swapped_and_last_user_gone": ["remove_instances", "remove_mesh", "add_instances"],
    "fewer_instances": ["remove_instances"],
    "more_instances": ["add_instances"],
    "reordered": [],
    "empty": ["remove_instances", "remove_mesh", "remove_mesh"],
}


@pytest.mark.parametrize("name", CALLS)
def test_only_the_difference_is_edited(name: str) -> None:
    made, scene = state()
    made.update(base())
    scene.calls.clear()
    made.update(TARGETS[name]())
    assert scene.calls == [*CALLS[name], "commit"]


@pytest.mark.parametrize("first", TARGETS)
@pytest.mark.parametrize("second", TARGETS)
def test_a_synced_scene_equals_a_fresh_one(first: str, second: str) -> None:
    """Content and tie-breaking orders alike, from each state to each other."""
    made, scene = state()
    made.update(TARGETS[first]())
    made.update(TARGETS[second]())
    assert scene.answer() == fresh(TARGETS[second]())
    assert_ids_are_right(made, TARGETS[second]())


def assert_ids_are_right(made: SceneState, target: SceneRecord) -> None:
    """Each instance of the record has the id under which the engine shows that mesh in that place."""
    scene = made.scene
    assert isinstance(scene, FakeScene)
    instances = target.instances
    assert len(made.instance_ids) == len(scene.instances) == len(instances)
    for row, instance_id in enumerate(made.instance_ids):
        held = scene.instances[int(instance_id)]
        np.testing.assert_array_equal(held.transform, instances.transforms[row])
        assert held.mask == instances.masks[row]
        assert held.mesh == made.mesh_ids[instances.mesh_indices[row]]


def test_a_long_series_of_updates_ends_right(rng: np.random.Generator) -> None:
    made, scene = state()
    names = list(TARGETS)
    for index in rng.integers(0, len(names), 300):
        target = TARGETS[names[index]]()
        made.update(target)
        assert scene.answer() == fresh(target)
    assert_ids_are_right(made, target)


def test_ids_last_while_the_instance_does() -> None:
    made, _ = state()
    made.update(base())
    before = made.instance_ids.copy()
    for change in (moved, deformed, more_triangles, masked, base):
        made.update(change())
        np.testing.assert_array_equal(made.instance_ids, before)
    made.update(object_removed())
    np.testing.assert_array_equal(made.instance_ids, before[1:])
    made.update(base())
    assert made.instance_ids[0] not in before
    np.testing.assert_array_equal(made.instance_ids[1:], before[1:])


def test_a_mesh_counts_as_deforming_once_it_was_seen_to() -> None:
    made, scene = state()
    made.update(base())
    made.update(deformed())
    made.update(mesh_removed())
    made.update(base())
    usages = {key: scene.meshes[int(made.mesh_ids[row])].usage for row, key in enumerate(("a", "b"))}
    assert usages == {"a": "deforming", "b": "static"}


def test_the_records_guess_is_the_first_hint() -> None:
    made, scene = state()
    made.update(record([replace(MESHES[0], usage="changing")], [Shown("a", 1)]))
    assert next(iter(scene.meshes.values())).usage == "changing"


def test_what_the_commit_is_told() -> None:
    made, scene = state()
    made.update(base())
    assert scene.commit_keywords == {}

    def progress(share: float) -> bool:
        return True

    made.update(base(), expected_rays=1000, progress=progress)
    assert scene.commit_keywords == {"expected_rays": 1000, "progress": progress}


# Failures ------------------------------------------------------------------------------------------------------------

FAILING_CALLS = sorted({call for calls in CALLS.values() for call in calls})


@pytest.mark.parametrize("after", [False, True], ids=["before its work", "after its work"])
@pytest.mark.parametrize("call", FAILING_CALLS)
@pytest.mark.parametrize("target", TARGETS)
def test_after_a_failed_edit_the_next_update_is_right(call: str, after: bool, target: str) -> None:
    made, scene = state()
    made.update(base())
    scene.fail_at, scene.fail_after = call, after
    try:
        made.update(everything_or(call))
    except FailureError:
        with pytest.raises(StaleError):
            scene.answer()
        assert made.scene is not scene
        assert made.record is None
    else:
        pytest.fail(f"{call} was not called")
    made.update(TARGETS[target]())
    assert isinstance(made.scene, FakeScene)
    assert made.scene.answer() == fresh(TARGETS[target]())
    assert_ids_are_right(made, TARGETS[target]())
    with pytest.raises(StaleError):
        scene.answer()


def everything_or(call: str) -> SceneRecord:
    """A change of base() that makes the call."""
    name = next(name for name, calls in CALLS.items() if call in calls)
    return TARGETS[name]()


@pytest.mark.parametrize("target", TARGETS)
def test_after_a_cancelled_commit_the_next_update_is_right_and_builds_on_it(target: str) -> None:
    made, scene = state()
    made.update(base())
    scene.fail_at = "commit"
    with pytest.raises(FailureError):
        made.update(everything_at_once())
    with pytest.raises(StaleError, match="did not succeed"):
        scene.answer()
    report = made.update(TARGETS[target]())
    assert made.scene is scene
    assert scene.answer() == fresh(TARGETS[target]())
    assert report.finishes_earlier_update
    assert report.has_changes
    assert not made.update(TARGETS[target]()).finishes_earlier_update


def test_a_bad_record_changes_nothing() -> None:
    made, scene = state()
    made.update(base())
    scene.calls.clear()
    with pytest.raises(ValueError, match="same key"):
        made.update(record([mesh("a"), mesh("a", 3)], [Shown("a", 1)]))
    assert scene.calls == []
    made.update(base())
    assert scene.answer() == fresh(base())


# Reports -------------------------------------------------------------------------------------------------------------


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
    assert reasons["mesh_removed"]["a"] == ("removed", "nothing shows it any more")
    assert reasons["mesh_removed"]["b"] == ("kept", "same triangles, same positions")


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
