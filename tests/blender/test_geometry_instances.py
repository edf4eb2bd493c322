"""Instances read from evaluated geometry, compared with Blender's own list, column by column and bit by bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import (
    NodeGroup,
    evaluated,
    in_render,
    mesh_object,
)
from blender.instancer_scenes import FAST, PARTLY, SLOW, beside_hidden_instancers, made_meshes, several_objects
from perfect_bvh_addon.extract import ReadCache, read_scene
from perfect_bvh_addon.extract.geometry import instancer_survey, listing
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.sync.plan import find_mismatches
from perfect_bvh_addon.sync.records import SceneRecord

pytestmark = pytest.mark.skipif(
    not hasattr(bpy.types.Object, "evaluated_geometry"), reason="Blender before 4.5 does not give its geometry"
)


def list_of(depsgraph: Any) -> SceneRecord:
    """Read the scene from Blender's list, as a reader without views does."""
    return read_scene(depsgraph, reader=ArrayReader(use_views=False))


@pytest.fixture
def no_list(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record each use of the list by a reading that should not need it."""
    used: list[str] = []
    original = listing.list_instances

    def spy(*arguments: Any) -> Any:
        used.append("list")
        return original(*arguments)

    monkeypatch.setattr("perfect_bvh_addon.extract.geometry.geometry_instances.list_instances", spy)
    return used


@pytest.mark.parametrize("name", FAST)
def test_the_same_as_the_list(scene: Any, no_list: list[str], name: str) -> None:
    FAST[name]()
    depsgraph = evaluated()
    record = read_scene(depsgraph)
    assert no_list == []
    assert len(record.instances) > 0
    expected = list_of(depsgraph)
    assert no_list == ["list"]
    assert find_mismatches(record, expected) == ()
    assert record.warnings == expected.warnings


@pytest.mark.parametrize("name", FAST)
def test_the_same_as_the_list_in_a_render(scene: Any, no_list: list[str], name: str) -> None:
    FAST[name]()

    def compare(depsgraph: Any) -> tuple[str, ...]:
        record = read_scene(depsgraph)
        assert no_list == []
        return find_mismatches(record, list_of(depsgraph))

    assert in_render(compare) == ()


@pytest.mark.parametrize("name", PARTLY)
@pytest.mark.parametrize("look", [lambda check: check(evaluated()), in_render], ids=["viewport", "render"])
def test_only_what_the_geometry_cannot_tell_is_looked_up_in_the_list(
    scene: Any, no_list: list[str], name: str, look: Callable[[Any], Any]
) -> None:
    PARTLY[name]()

    def check(depsgraph: Any) -> None:
        record = read_scene(depsgraph)
        assert no_list == []
        assert find_mismatches(record, list_of(depsgraph)) == ()
        assert len(record.instances) > 0
        del no_list[:]
        cache = ReadCache()
        again = [read_scene(depsgraph, cache=cache) for _ in range(2)]
        assert find_mismatches(again[1], again[0]) == ()
        assert again[1].instances.persistent_ids is again[0].instances.persistent_ids

    look(check)


@pytest.mark.parametrize("name", SLOW)
def test_what_the_geometry_cannot_tell_is_left_to_the_list(scene: Any, no_list: list[str], name: str) -> None:
    SLOW[name]()
    depsgraph = evaluated()
    record = read_scene(depsgraph)
    assert no_list == ["list"]
    assert find_mismatches(record, list_of(depsgraph)) == ()


def test_hidden_instancers_are_found_where_the_list_has_them(scene: Any) -> None:
    beside_hidden_instancers()
    surveyed = instancer_survey.survey(evaluated())
    names = [obj.name for obj, _ in surveyed.objects]
    found = {obj.name: names[row - 1] if row else None for row, hidden in surveyed.hidden.items() for obj in hidden}
    shown = [f"{name} parent" for name in ("first", "second", "after", "last")]
    assert set(shown) <= set(found)
    assert not set(shown) & set(names)
    parents = [entry.parent.name for entry in evaluated().object_instances if entry.is_instance]
    assert [name for name in dict.fromkeys(parents) if name != "field"] == [name for name in found if name in shown]


def test_what_nodes_are_given_from_outside_may_be_shown(scene: Any) -> None:
    given, member, user = mesh_object("given"), mesh_object("member"), mesh_object("user")
    collection = bpy.data.collections.new("collection")
    collection.objects.link(member)
    group = NodeGroup("nodes")
    sockets = [
        group.tree.interface.new_socket(kind, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        for kind in ("Object", "Collection", "Float")
    ]
    modifier = group.apply_to(user)
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    for socket, value in zip(sockets, (given, collection, 0.5), strict=True):
        if inputs is None:  # before Blender 5.2
            modifier[socket.identifier] = value
        else:
            getattr(inputs, socket.identifier).value = value
    assert list(instancer_survey._may_show(user)) == [given, member]


def test_an_older_blender_uses_the_list(scene: Any, no_list: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    made_meshes()
    depsgraph = evaluated()
    fast = read_scene(depsgraph)
    monkeypatch.setattr(instancer_survey, "_IS_SUPPORTED", False)
    assert find_mismatches(read_scene(depsgraph), fast) == ()
    assert no_list == ["list"]


def test_a_layout_that_is_not_as_expected_changes_nothing(scene: Any) -> None:
    several_objects()
    depsgraph = evaluated()
    by_elements = read_scene(depsgraph, reader=ArrayReader(verdicts={"matrices": False, "reference_indices": False}))
    assert find_mismatches(by_elements, read_scene(depsgraph)) == ()
    assert np.ptp(by_elements.instances.transforms[:, 0, 3]) > 1.0
