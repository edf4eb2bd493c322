"""Visibility to the camera, compared with Cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest
from blender.builders import (
    SQUARE,
    NodeGroup,
    camera_object,
    collection,
    collection_instance,
    in_render,
    layer_of,
    mesh_data,
    mesh_object,
    object_info,
)
from oracles.cycles import render_image
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.records import VISIBLE_TO_CAMERA


def nothing() -> None:
    """Leave the square unchanged."""


def holdout_object() -> None:
    bpy.data.objects["square"].is_holdout = True


def holdout_collection() -> None:
    layer_of("squares").holdout = True


def indirect_only() -> None:
    layer_of("squares").indirect_only = True


def camera_invisible() -> None:
    bpy.data.objects["square"].visible_camera = False


def instanced(setting: str, value: bool, *, on_empty: bool) -> Callable[[], None]:
    def change() -> None:
        square = bpy.data.objects["square"]
        layer_of("squares").exclude = True
        empty = collection_instance("empty", bpy.data.collections["squares"])
        setattr(empty if on_empty else square, setting, value)

    return change


def instanced_in_holdout_collection() -> None:
    layer_of("squares").exclude = True
    around = collection("around")
    collection_instance("empty", bpy.data.collections["squares"], around)
    layer_of("around").holdout = True


def instanced_in_indirect_collection() -> None:
    layer_of("squares").exclude = True
    around = collection("around")
    collection_instance("empty", bpy.data.collections["squares"], around)
    layer_of("around").indirect_only = True


def shown_by_nodes(change: Callable[[], None]) -> Callable[[], None]:
    """The square is in the view layer, behind the wall, and nodes show it in front of the wall as well."""

    def act() -> None:
        square = bpy.data.objects["square"]
        square.location.z = -5.0
        group = NodeGroup("nodes")
        group.show(object_info(square)(group))
        group.apply_to(mesh_object("nodes"))
        change()

    return act


CHANGES = {
    "shown by nodes": shown_by_nodes(nothing),
    "shown by nodes, a holdout object": shown_by_nodes(holdout_object),
    "shown by nodes, in a holdout collection": shown_by_nodes(holdout_collection),
    "shown by nodes, in an indirect only collection": shown_by_nodes(indirect_only),
    "shown by nodes, camera-invisible": shown_by_nodes(camera_invisible),
    "nothing": nothing,
    "holdout object": holdout_object,
    "holdout collection": holdout_collection,
    "indirect only collection": indirect_only,
    "camera-invisible object": camera_invisible,
    "instanced": instanced("visible_camera", True, on_empty=True),
    "instance of a holdout object": instanced("is_holdout", True, on_empty=False),
    "instance by a holdout empty": instanced("is_holdout", True, on_empty=True),
    "instance of a camera-invisible object": instanced("visible_camera", False, on_empty=False),
    "instance by a camera-invisible empty": instanced("visible_camera", False, on_empty=True),
    "instance in a holdout collection": instanced_in_holdout_collection,
    "instance in an indirect only collection": instanced_in_indirect_collection,
}


@pytest.mark.parametrize("change", CHANGES)
def test_the_camera_sees_what_cycles_sees(scene: Any, change: str) -> None:
    """A square is in front of an opaque wall: Cycles shows the square, a hole, or the wall."""
    squares = collection("squares")
    mesh_object("square", painted("square", (1, 0, 0, 1)), collection=squares)
    mesh_object("wall", painted("wall", (0, 1, 0, 1)), location=(0, 0, -1)).scale = (9, 9, 9)
    camera_object().location.z = 3.0
    CHANGES[change]()

    def outcome_of(depsgraph: Any) -> str:
        record = read_scene(depsgraph)
        rows = [
            row
            for row, obj in enumerate(record.instances.object_indices)
            if record.objects[obj].name == "square"
            and record.instances.masks[row] & VISIBLE_TO_CAMERA
            and record.instances.transforms[row, 2, 3] > -1.0
        ]
        if not rows:
            return "wall"
        (row,) = rows
        return "hole" if record.objects[record.instances.object_indices[row]].holdout else "square"

    assert in_render(outcome_of) == cycles_outcome(scene)


def painted(name: str, color: tuple[float, ...]) -> Any:
    """Paint the square with an emission of one colour, so that no light is needed."""
    data = mesh_data(name, *SQUARE)
    material = bpy.data.materials.new(name)
    if material.node_tree is None:  # before Blender 5 nodes had to be switched on
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission = nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = color
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    data.materials.append(material)
    return data


def cycles_outcome(scene: Any) -> str:
    """Return the surface in the middle of Cycles' image: "square" (red), "wall" (green) or "hole" (nothing)."""
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = 1, False, "CPU"
    scene.render.film_transparent = True
    scene.render.resolution_x = scene.render.resolution_y = 8
    red, green, _, alpha = render_image(scene, "CYCLES", "Combined", "RGBA")[4, 4]
    if alpha < 0.5:
        return "hole"
    assert max(red, green) > 0.9
    return "square" if red > green else "wall"
