"""Random edits of a scene: one function for each edit, applied to randomly chosen objects."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from blender.builders import (
    SQUARE,
    TETRAHEDRON,
    collection_instance,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
)
from blender.soak_look_edits import LOOK_EDITS, NothingToEditError
from blender.soak_particle_edits import PARTICLE_EDITS
from blender.soak_round_edits import ROUND_ADDITIONS, ROUND_EDITS, ROUND_TYPES

if TYPE_CHECKING:
    from blender.soak import Soak

MOST_OBJECTS = 14
ADDITIONS = {  # Blender's instance list includes text, legacy curves, and the parts that nodes add to a mesh
    "objects": ("mesh", "linked", "member", "hair", "cloud"),
    "geometry": ("mesh", "linked", "member", "field", "herd", "hair", "cloud"),
    "mixed": ("mesh", "linked", "member", "field", "herd", "text", "curve", "tree", "hair", "cloud", "fur"),
}
MODIFIERS = ("SUBSURF", "ARRAY", "MIRROR", "WAVE", "SOLIDIFY", "TRIANGULATE", "DECIMATE")


def add(soak: Soak) -> None:
    if len(bpy.data.objects) > MOST_OBJECTS:
        raise NothingToEditError
    kind = soak.pick(ADDITIONS[soak.kind])
    name, place = soak.name(kind), soak.vector()
    if kind == "mesh":
        mesh_object(name, mesh_data(name, *soak.pick((SQUARE, TETRAHEDRON))), location=place)
    elif kind == "linked":
        mesh_object(name, soak.an_object("MESH").data, location=place)
    elif kind == "curve":
        data = bpy.data.curves.new(name, "CURVE")
        data.bevel_depth = 0.3
        data.splines.new("POLY").points.add(2)
        for point in data.splines[0].points:
            point.co = (*soak.vector(), 1.0)
        _link(bpy.data.objects.new(name, data))
    elif kind == "field":
        instances_on_grid(name, made_cube, 2, keep_own=bool(soak.number() > 0)).location = place
    elif kind == "herd":
        instances_on_grid(name, object_info(soak.an_object(_instanced(soak))), 2).location = place
    elif kind in OTHERS:
        OTHERS[kind](soak, name).location = place
    elif kind == "tree":
        collection_instance(name, bpy.data.collections["inner"], location=place)
    else:
        mesh_object(name, collection=bpy.data.collections["inner"], location=place)


def _some_text(_: Soak, name: str) -> Any:
    obj = _link(bpy.data.objects.new(name, bpy.data.curves.new(name, "FONT")))
    obj.data.body = "ab"
    return obj


OTHERS = {"text": _some_text, **ROUND_ADDITIONS}


def _instanced(soak: Soak) -> str:
    """Pick the type of object to instance. Only Blender's list describes instances of other types than meshes."""
    return str(soak.pick(("MESH", *ROUND_TYPES))) if soak.kind == "mixed" else "MESH"


def _link(obj: Any) -> Any:
    bpy.context.scene.collection.objects.link(obj)
    return obj


def delete(soak: Soak) -> None:
    if len(bpy.data.objects) < 6:
        raise NothingToEditError
    obj = soak.an_object()
    # Blender does not evaluate nodes again when their object is deleted, and crashes if they still show it.
    for group in bpy.data.node_groups:
        for node in group.nodes:
            if node.bl_idname == "GeometryNodeObjectInfo" and node.inputs["Object"].default_value == obj:
                node.inputs["Object"].default_value = None
    bpy.data.objects.remove(obj)


def unlink(soak: Soak) -> None:
    obj = soak.an_object()
    soak.pick(obj.users_collection).objects.unlink(obj)


def relink(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.data.objects if not obj.users_collection)
    soak.pick((bpy.context.scene.collection, bpy.data.collections["drawer"])).objects.link(obj)


def move(soak: Soak) -> None:
    soak.an_object().location = soak.vector(-6, 6)


def turn(soak: Soak) -> None:
    soak.an_object().rotation_euler = soak.vector()


def scale(soak: Soak) -> None:
    soak.an_object().scale = soak.pick(((1, 1, 1), (-1, 1, 1), (1, 1, 0), soak.vector(0.5, 2.0)))


def deform(soak: Soak) -> None:
    data = soak.an_object("MESH").data
    points = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", points)
    data.vertices.foreach_set("co", points * np.float32(soak.number(0.7, 1.4)))
    data.update()


def retopologise(soak: Soak) -> None:
    data = soak.an_object("MESH").data
    if data.shape_keys is not None:
        raise NothingToEditError
    vertices, faces = TETRAHEDRON
    faces = soak.pick((faces, faces[:3], ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3)), ((0, 1, 3, 2),)))
    data.clear_geometry()
    data.from_pydata(vertices, [], faces)
    data.update()


def edit_in_edit_mode(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.context.view_layer.objects if obj.type == "MESH" and obj.visible_get())
    bpy.context.view_layer.objects.active = obj
    import bmesh  # comes with bpy, and not before it

    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    for vertex in edited.verts:
        vertex.co.z += soak.number(-0.3, 0.3)
    bmesh.update_edit_mesh(obj.data)
    soak._check(soak.sync, bpy.context.evaluated_depsgraph_get())
    bpy.ops.object.mode_set(mode="OBJECT")


def parent(soak: Soak) -> None:
    child, owner = soak.an_object(), soak.an_object()
    above = owner
    while above is not None:
        if above == child:
            raise NothingToEditError
        above = above.parent
    child.parent = owner


def unparent(soak: Soak) -> None:
    soak.an_object().parent = None


def hide(soak: Soak) -> None:
    obj, switch = soak.an_object(), soak.pick(("hide_viewport", "hide_render", "visible_camera", "visible_shadow"))
    setattr(obj, switch, not getattr(obj, switch))


def hide_with_the_eye(soak: Soak) -> None:
    obj = soak.pick(bpy.context.view_layer.objects)
    obj.hide_set(not obj.hide_get())


def hide_an_instancer(soak: Soak) -> None:
    if soak.kind != "mixed":
        raise NothingToEditError
    obj = soak.an_object()
    obj.show_instancer_for_viewport = not obj.show_instancer_for_viewport


def exclude(soak: Soak) -> None:
    layer = soak.pick(bpy.context.view_layer.layer_collection.children)
    layer.exclude = not layer.exclude


def put_into_a_drawer(soak: Soak) -> None:
    obj = soak.an_object()
    if "drawer" not in {owner.name for owner in obj.users_collection}:
        bpy.data.collections["drawer"].objects.link(obj)


def link_data(soak: Soak) -> None:
    soak.an_object("MESH").data = soak.an_object("MESH").data


def make_single_user(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    obj.data = obj.data.copy()


def duplicate(soak: Soak) -> None:
    if len(bpy.data.objects) > MOST_OBJECTS:
        raise NothingToEditError
    copy = soak.an_object().copy()
    copy.name, copy.location = soak.name("copy"), soak.vector()
    _link(copy)


def add_modifier(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    if len(obj.modifiers) < 3:
        obj.modifiers.new("added", soak.pick(MODIFIERS))


def remove_modifier(soak: Soak) -> None:
    obj = soak.pick(obj for obj in bpy.data.objects if obj.modifiers)
    obj.modifiers.remove(soak.pick(obj.modifiers))


def switch_modifier(soak: Soak) -> None:
    modifier = soak.pick(modifier for obj in bpy.data.objects for modifier in obj.modifiers)
    modifier.show_viewport = not modifier.show_viewport


def change_nodes(soak: Soak) -> None:
    node = soak.pick(
        node
        for group in bpy.data.node_groups
        for node in group.nodes
        if node.bl_idname in {"GeometryNodeMeshGrid", "GeometryNodeMeshCube"}
    )
    if node.bl_idname == "GeometryNodeMeshGrid":
        name = soak.pick(("Size X", "Size Y", "Vertices X"))
        node.inputs[name].default_value = int(soak.number(1, 4)) if name == "Vertices X" else soak.number(3, 12)
    else:
        name = soak.pick(("Size", "Vertices X"))
        node.inputs[name].default_value = int(soak.number(2, 4)) if name == "Vertices X" else soak.vector(0.5, 2)


def change_frame(soak: Soak) -> None:
    bpy.context.scene.frame_set(int(soak.number(1, 24)))


def undo(_: Soak) -> None:
    bpy.ops.ed.undo()


def redo(soak: Soak) -> None:
    bpy.ops.ed.undo()
    if soak.number() > 0:
        soak._check(soak.sync, bpy.context.evaluated_depsgraph_get())
    bpy.ops.ed.redo()


def reopen(soak: Soak) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=soak.path, check_existing=False)
    bpy.ops.wm.open_mainfile(filepath=soak.path)


def nothing(_: Soak) -> None:
    pass


EDITS: dict[str, Callable[[Soak], None]] = {
    function.__name__: function
    for function in (
        add,
        delete,
        unlink,
        relink,
        move,
        turn,
        scale,
        deform,
        retopologise,
        edit_in_edit_mode,
        parent,
        unparent,
        hide,
        hide_with_the_eye,
        hide_an_instancer,
        exclude,
        put_into_a_drawer,
        link_data,
        make_single_user,
        duplicate,
        add_modifier,
        remove_modifier,
        switch_modifier,
        change_nodes,
        change_frame,
        undo,
        redo,
        reopen,
        nothing,
        *ROUND_EDITS,
        *PARTICLE_EDITS,
        *LOOK_EDITS,
    )
}
