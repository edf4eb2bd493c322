"""Visibility of objects in viewports, in renders and to rays; holdouts and camera rays as in Cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest
from blender.builders import (
    SQUARE,
    collection,
    collection_instance,
    evaluated,
    in_render,
    instances_on_grid,
    layer_of,
    made_cube,
    mesh_data,
    mesh_object,
    shown_names,
)
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync import records
from perfect_bvh_addon.sync.records import VISIBLE_TO_ALL, VISIBLE_TO_CAMERA, SceneRecord


def in_collection(name: str, **settings: Any) -> None:
    made = collection(f"{name} collection")
    mesh_object(name, collection=made)
    for key, value in settings.items():
        target = layer_of(made.name) if key.startswith("layer_") else made
        setattr(target, key.removeprefix("layer_"), value)


def with_settings(name: str, **settings: Any) -> Any:
    obj = mesh_object(name)
    for key, value in settings.items():
        setattr(obj, key, value)
    return obj


def nested_collection_hidden_above(name: str) -> None:
    above = collection(f"{name} above")
    above.hide_render = True
    mesh_object(name, collection=collection(f"{name} below", above))


def instances_of_hidden_members() -> None:
    shown = collection("members", linked=False)
    mesh_object("member", collection=shown)
    mesh_object("not rendered", collection=shown).hide_render = True
    mesh_object("not in viewports", collection=shown).hide_viewport = True
    below = collection("below", shown)
    below.hide_render = True
    mesh_object("below", collection=below)
    nested = collection("nested", linked=False)
    collection_instance("inner", shown, nested)
    collection_instance("empty", nested)
    collection_instance("empty, not rendered", shown).hide_render = True
    collection_instance("empty, not in viewports", shown).hide_viewport = True


def instanced_instancer() -> None:
    shown = collection("instancers", linked=False)
    parent = mesh_object("a", mesh_data("a", *SQUARE), shown)
    parent.instance_type, parent.show_instancer_for_render = "VERTS", False
    mesh_object("a child", collection=shown).parent = parent
    collection_instance("empty", shown)


def hidden_root() -> None:
    shown = collection("root", linked=False)
    shown.hide_render = True
    mesh_object("of hidden root", collection=shown)
    collection_instance("root empty", shown)


def instancer(name: str, kind: str = "VERTS", **settings: Any) -> None:
    parent = mesh_object(name, mesh_data(name, *SQUARE))
    parent.instance_type = kind
    for key, value in settings.items():
        setattr(parent, key, value)
    mesh_object(f"{name} child").parent = parent


# The built objects; those shown in a viewport; those shown in a render.
TABLE: dict[str, tuple[Callable[[], Any], set[str], set[str]]] = {
    "plain": (lambda: mesh_object("a"), {"a"}, {"a"}),
    "hide_render": (lambda: with_settings("a", hide_render=True), {"a"}, set()),
    "hide_viewport": (lambda: with_settings("a", hide_viewport=True), set(), {"a"}),
    "hide_set": (lambda: mesh_object("a").hide_set(True), set(), {"a"}),
    "collection hide_render": (lambda: in_collection("a", hide_render=True), {"a"}, set()),
    "collection above hide_render": (lambda: nested_collection_hidden_above("a"), {"a"}, set()),
    "collection hide_viewport": (lambda: in_collection("a", hide_viewport=True), set(), {"a"}),
    "collection eye": (lambda: in_collection("a", layer_hide_viewport=True), set(), {"a"}),
    "collection excluded": (lambda: in_collection("a", layer_exclude=True), set(), set()),
    "collection holdout": (lambda: in_collection("a", layer_holdout=True), {"a"}, {"a"}),
    "collection indirect only": (lambda: in_collection("a", layer_indirect_only=True), {"a"}, {"a"}),
    "collection instances": (
        instances_of_hidden_members,
        {
            *(f"empty/{name}" for name in ("member", "not rendered", "below")),
            *(f"empty, not rendered/{name}" for name in ("member", "not rendered", "below")),
        },
        {
            *(f"empty/{name}" for name in ("member", "not in viewports")),
            *(f"empty, not in viewports/{name}" for name in ("member", "not in viewports")),
        },
    ),
    "hidden instanced collection": (hidden_root, {"root empty/of hidden root"}, set()),
    "instancer": (
        lambda: instancer("a"),
        {"a", "a/a child", "a child"},
        {"a", "a/a child"},
    ),
    "instancer on faces": (
        lambda: instancer("a", "FACES"),
        {"a", "a/a child", "a child"},
        {"a", "a/a child"},
    ),
    "instancer not rendered": (
        lambda: instancer("a", show_instancer_for_render=False),
        {"a", "a/a child", "a child"},
        {"a/a child"},
    ),
    "instanced instancer not rendered": (instanced_instancer, {"empty/a", "empty/a child"}, {"empty/a child"}),
    "instancer not in viewports": (
        lambda: instancer("a", show_instancer_for_viewport=False),
        {"a/a child", "a child"},
        {"a", "a/a child"},
    ),
    "nodes' instancer not rendered": (
        lambda: setattr(instances_on_grid("a", made_cube), "hide_render", True),
        {"a/a"},
        set(),
    ),
    "seen by no ray": (
        lambda: with_settings(
            "a",
            visible_camera=False,
            visible_diffuse=False,
            visible_glossy=False,
            visible_transmission=False,
            visible_volume_scatter=False,
            visible_shadow=False,
        ),
        set(),
        set(),
    ),
}


@pytest.mark.parametrize("row", TABLE)
def test_the_viewport_shows(scene: Any, row: str) -> None:
    build, in_viewport, _ = TABLE[row]
    build()
    assert shown_names(read_scene(evaluated())) == in_viewport


@pytest.mark.parametrize("row", TABLE)
def test_a_render_shows(scene: Any, row: str) -> None:
    build, _, rendered = TABLE[row]
    build()
    assert shown_names(in_render(read_scene)) == rendered


@pytest.mark.parametrize("row", TABLE)
def test_render_visibility_of_a_viewport_depsgraph(scene: Any, row: str) -> None:
    """The reader shows the viewport's objects that a render shows as well, and no object that a render hides."""
    build, in_viewport, rendered = TABLE[row]
    build()
    shown = shown_names(read_scene(evaluated(), for_viewport=False))
    assert in_viewport & rendered <= shown <= rendered


def test_a_background_scene_is_rendered(scene: Any) -> None:
    other = bpy.data.scenes.new("other")
    other.collection.objects.link(mesh_object("shown", collection=False))
    hidden = mesh_object("hidden", collection=False)
    hidden.hide_render = True
    other.collection.objects.link(hidden)
    scene.background_set = other
    assert shown_names(in_render(read_scene)) == {"shown"}
    assert shown_names(read_scene(evaluated(), for_viewport=False)) == {"shown"}
    assert shown_names(read_scene(evaluated())) == {"shown", "hidden"}


# One viewport --------------------------------------------------------------------------------------------------------


@pytest.fixture
def viewport(scene: Any) -> Any:
    """Return (screen, area) of a 3D viewport, in a scene with two objects and an instance."""
    for name in ("a", "b"):
        mesh_object(name)
    shown = collection("shown", linked=False)
    mesh_object("member", collection=shown)
    collection_instance("empty", shown)
    evaluated()
    return next((screen, area) for screen in bpy.data.screens for area in screen.areas if area.type == "VIEW_3D")


def inside(screen: Any, area: Any) -> Any:
    """Make the 3D viewport the context."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    window = bpy.context.window_manager.windows[0]
    return bpy.context.temp_override(window=window, screen=screen, area=area, region=region)


def enter_local_view(screen: Any, area: Any, name: str) -> None:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == name)
    with inside(screen, area):
        bpy.ops.view3d.localview(frame_selected=False)


def test_local_view_shows_only_its_objects(viewport: Any) -> None:
    screen, area = viewport
    enter_local_view(screen, area, "a")
    space = area.spaces[0]
    assert space.local_view is not None
    assert shown_names(read_scene(evaluated(), space=space)) == {"a"}
    assert shown_names(read_scene(evaluated())) == {"a", "b", "empty/member"}


def test_local_view_is_that_of_the_viewport_that_is_asked_and_not_of_the_contexts(viewport: Any) -> None:
    """In the context of one viewport, scripts and operators update all viewports."""
    screen, area = viewport
    others = ((one, other) for one in bpy.data.screens for other in one.areas if other.type == "VIEW_3D")
    _, other = next(pair for pair in others if pair[1] != area)
    enter_local_view(screen, area, "a")
    with inside(screen, area):
        assert shown_names(read_scene(evaluated())) == {"a", "b", "empty/member"}
        assert shown_names(read_scene(evaluated(), space=other.spaces[0])) == {"a", "b", "empty/member"}
        assert shown_names(read_scene(evaluated(), space=area.spaces[0])) == {"a"}
        assert bpy.context.area == area


def test_a_viewport_hides_types_of_objects(viewport: Any) -> None:
    _, area = viewport
    space = area.spaces[0]
    assert shown_names(read_scene(evaluated(), space=space)) == {"a", "b", "empty/member"}
    space.show_object_viewport_empty = False  # an instance counts as the object that it shows, not as its instancer
    assert shown_names(read_scene(evaluated(), space=space)) == {"a", "b", "empty/member"}
    space.show_object_viewport_mesh = False
    assert shown_names(read_scene(evaluated(), space=space)) == set()


# Rays ----------------------------------------------------------------------------------------------------------------

RAYS = {
    "visible_camera": records.VISIBLE_TO_CAMERA,
    "visible_diffuse": records.VISIBLE_TO_DIFFUSE,
    "visible_glossy": records.VISIBLE_TO_GLOSSY,
    "visible_transmission": records.VISIBLE_TO_TRANSMISSION,
    "visible_volume_scatter": records.VISIBLE_TO_VOLUME,
    "visible_shadow": records.VISIBLE_TO_SHADOW,
}


def only_mask(record: SceneRecord) -> int:
    (mask,) = record.instances.masks
    return int(mask)


def test_the_bits_are_distinct_and_complete() -> None:
    assert sum(RAYS.values()) == VISIBLE_TO_ALL
    assert len(set(RAYS.values())) == len(RAYS)


@pytest.mark.parametrize("flag", RAYS)
def test_each_ray_flag_clears_its_bit(scene: Any, flag: str) -> None:
    with_settings("a", **{flag: False})
    assert only_mask(read_scene(evaluated())) == VISIBLE_TO_ALL & ~RAYS[flag]


def test_an_instance_is_seen_by_what_sees_both_it_and_its_instancer(scene: Any) -> None:
    shown = collection("shown", linked=False)
    mesh_object("a", collection=shown).visible_shadow = False
    collection_instance("empty", shown).visible_diffuse = False
    expected = VISIBLE_TO_ALL & ~records.VISIBLE_TO_SHADOW & ~records.VISIBLE_TO_DIFFUSE
    assert only_mask(read_scene(evaluated())) == expected


def test_indirect_only_collections_hide_from_the_camera(scene: Any) -> None:
    in_collection("a", layer_indirect_only=True)
    assert only_mask(read_scene(evaluated())) == VISIBLE_TO_ALL & ~VISIBLE_TO_CAMERA
