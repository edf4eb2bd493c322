"""A scene with one object of every kind, edits of it, and the report expected after each edit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bmesh
import bpy
import numpy as np
from blender.builders import (
    SQUARE,
    camera_object,
    collection,
    collection_instance,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
)


def build_village(scene: Any) -> Any:
    """A scene with one of everything, in rows along x."""
    ground = mesh_object("ground", mesh_data("ground", *SQUARE), location=(0, 0, -2))
    ground.scale = (40, 40, 1)
    painted = mesh_data("painted")
    painted.materials.append(bpy.data.materials.new("red"))
    mesh_object("box", painted)
    shared = mesh_data("shared")
    mesh_object("left", shared, location=(3, 0, 0))
    mesh_object("right", shared, location=(5, 0, 0))
    add_posed(8.0)
    add_shaped(11.0)
    instances_on_grid("field", made_cube, 3).location = (-10, 0, 0)
    copies = instances_on_grid("copies", object_info(bpy.data.objects["box"]), 2)
    copies.location = (-10, 14, 0)
    inner = collection("inner", linked=False)
    mesh_object("leaf", collection=inner)
    mesh_object("twig", collection=inner, location=(1.5, 0, 0))
    collection_instance("tree", inner, location=(0, 6, 0))
    bpy.ops.object.text_add(location=(3, 6, 0))
    bpy.context.object.name = "text"
    bpy.ops.object.metaball_add(location=(8, 6, 0))
    bpy.context.object.name = "blob"
    camera_object("camera").location.z = 20.0
    return scene


def add_posed(x: float) -> None:
    armature = bpy.data.objects.new("bones", bpy.data.armatures.new("bones"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    posed = mesh_object("posed", location=(x, 0, 0))
    posed.vertex_groups.new(name="bone").add([1, 3], 1.0, "REPLACE")
    posed.modifiers.new("armature", "ARMATURE").object = armature


def add_shaped(x: float) -> None:
    shaped = mesh_object("shaped", location=(x, 0, 0))
    shaped.shape_key_add(name="Basis")
    key = shaped.shape_key_add(name="tall")
    key.data[3].co.z = 3.0
    key.value = 0.0
    for frame, value in ((10, 0.0), (20, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    key.value = 0.0


@dataclass(frozen=True)
class Change:
    """act: the edit. actions: the expected report of some objects. stale: whether Blender reports the edit."""

    act: Callable[[], Any]
    actions: dict[str, str]
    stale: bool = True


def thing(name: str) -> Any:
    return bpy.data.objects[name]


def setting(name: str, path: str, value: Any) -> Callable[[], None]:
    def act() -> None:
        *owners, last = path.split(".")
        target = thing(name)
        for owner in owners:
            target = getattr(target, owner)
        setattr(target, last, value)

    return act


def edit_mesh(name: str, *, update: bool) -> Callable[[], None]:
    def act() -> None:
        data = thing(name).data
        points = np.empty(len(data.vertices) * 3, np.float32)
        data.vertices.foreach_get("co", points)
        data.vertices.foreach_set("co", points * 1.5)
        if update:
            data.update()

    return act


def change_topology() -> None:
    """The same counts of vertices and triangles, but other triangles."""
    data = thing("box").data
    data.clear_geometry()
    data.from_pydata(*(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), [], ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3))))
    data.update()


def pose() -> None:
    thing("bones").pose.bones["bone"].location = (0.5, 0.2, 0.3)


def move_shape_key() -> None:
    thing("shaped").data.shape_keys.animation_data_clear()
    thing("shaped").data.shape_keys.key_blocks["tall"].value = 0.7


def node_input(name: str, node: str, socket: str, value: Any) -> Callable[[], None]:
    def act() -> None:
        nodes = thing(name).modifiers[0].node_group.nodes
        next(item for item in nodes if item.bl_idname == node).inputs[socket].default_value = value

    return act


def remove(name: str) -> Callable[[], None]:
    return lambda: bpy.data.objects.remove(thing(name))


def unlink() -> None:
    bpy.context.scene.collection.objects.unlink(thing("box"))


def swap_data() -> None:
    thing("left").data = mesh_data("another", *SQUARE)


def duplicate() -> None:
    copy = thing("box").copy()
    copy.name, copy.location = "box copy", (0, 3, 0)
    bpy.context.scene.collection.objects.link(copy)


def edit_in_edit_mode() -> None:
    bpy.context.view_layer.objects.active = thing("box")
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(thing("box").data)
    edited.verts.ensure_lookup_table()
    edited.verts[0].co = (-1, -1, -1)
    bmesh.update_edit_mesh(thing("box").data)


def color_material() -> None:
    bpy.data.materials["red"].diffuse_color = (1, 0, 0, 1)


def exclude_collection() -> None:
    made = collection("made")
    mesh_object("member", collection=made)
    bpy.context.view_layer.layer_collection.children["made"].exclude = True


CHANGES = {
    "nothing": Change(lambda: None, {"box": "kept"}, stale=False),
    "moved": Change(setting("box", "location", (1, 2, 3)), {"box": "moved", "leaf": "kept"}),
    "moved to the same place": Change(setting("box", "location", (0, 0, 0)), {"box": "kept"}),
    "rotated": Change(setting("left", "rotation_euler", (0, 0, 1)), {"left": "moved", "right": "kept"}),
    "mirrored": Change(setting("left", "scale", (-1, 1, 1)), {"left": "moved"}),
    "flattened": Change(setting("left", "scale", (1, 1, 0)), {"left": "moved"}),
    "parented": Change(lambda: setattr(thing("left"), "parent", thing("tree")), {"left": "moved"}),
    "mesh edited": Change(edit_mesh("left", update=True), {"left": "deformed", "right": "deformed", "box": "kept"}),
    "mesh edited without update()": Change(edit_mesh("left", update=False), {}, stale=bpy.app.version >= (5, 0)),
    "topology changed at equal counts": Change(change_topology, {"box": "replaced"}),
    "edited in edit mode": Change(edit_in_edit_mode, {"box": "deformed"}),
    "armature posed": Change(pose, {"posed": "deformed", "box": "kept"}),
    "shape key moved by hand": Change(move_shape_key, {"shaped": "deformed", "box": "kept"}),
    "shape key on a frame change": Change(lambda: bpy.context.scene.frame_set(15), {"shaped": "deformed"}),
    "unchanged on a frame change": Change(lambda: bpy.context.scene.frame_set(2), {"shaped": "kept", "box": "kept"}),
    "nodes moved their instances": Change(
        node_input("field", "GeometryNodeMeshGrid", "Size X", 14.0), {"field": "moved", "leaf": "kept"}
    ),
    "nodes made more instances": Change(
        node_input("field", "GeometryNodeMeshGrid", "Vertices X", 4), {"field": "recounted"}
    ),
    "nodes deformed their mesh": Change(
        node_input("field", "GeometryNodeMeshCube", "Size", (1, 1, 2)), {"field": "deformed"}
    ),
    "nodes changed their mesh's topology": Change(
        node_input("field", "GeometryNodeMeshCube", "Vertices X", 3), {"field": "replaced"}
    ),
    "nodes' object moved": Change(setting("field", "location", (-10, 0, 1)), {"field": "moved"}),
    "collection instance moved": Change(setting("tree", "location", (0, 6, 2)), {"leaf": "moved", "twig": "moved"}),
    "object inside a collection instance moved": Change(
        setting("leaf", "location", (0, 1, 0)), {"leaf": "moved", "twig": "kept"}
    ),
    "object added": Change(lambda: mesh_object("new", location=(0, 3, 0)), {"new": "added", "box": "kept"}),
    "object added to an instanced collection": Change(
        lambda: mesh_object("new", collection=bpy.data.collections["inner"], location=(0, 0, 1)),
        {"new": "added", "leaf": "kept"},
    ),
    "duplicated": Change(duplicate, {"box copy": "added", "box": "kept"}),
    "deleted": Change(remove("left"), {"left": "removed", "right": "kept"}),
    "deleted with its instances": Change(remove("tree"), {"leaf": "removed", "twig": "removed"}),
    "unlinked": Change(unlink, {"box": "recounted"}),  # nodes still show it
    "excluded": Change(exclude_collection, {"box": "kept"}),
    "hide_set": Change(lambda: thing("left").hide_set(True), {"left": "removed", "right": "kept"}),
    "hide_viewport": Change(setting("left", "hide_viewport", True), {"left": "removed", "right": "kept"}),
    "hide_render": Change(setting("left", "hide_render", True), {"left": "kept"}),
    "selected": Change(lambda: thing("box").select_set(True), {"box": "kept"}),
    "hidden from the camera": Change(setting("left", "visible_camera", False), {"left": "masked", "right": "kept"}),
    "renamed": Change(setting("left", "name", "first in the list"), {"first in the list": "kept"}),
    "data swapped": Change(swap_data, {"left": "replaced", "right": "kept"}),
    "modifier added": Change(
        lambda: thing("left").modifiers.new("m", "SUBSURF"), {"left": "replaced", "right": "kept"}
    ),
    "modifiers stacked": Change(
        lambda: thing("posed").modifiers.new("m", "SUBSURF"), {"posed": "replaced", "box": "kept"}
    ),
    "text changed": Change(setting("text", "data.body", "other"), {"text": "replaced"}),
    "metaball moved": Change(setting("blob", "location", (8, 7, 0)), {"blob": "moved"}),
    "material coloured": Change(color_material, {"box": "kept"}),
    "material slot added": Change(
        lambda: thing("left").data.materials.append(bpy.data.materials["red"]), {"left": "kept"}
    ),
}
