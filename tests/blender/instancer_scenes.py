"""Scenes with instances from geometry nodes: alone, and mixed with instances that their geometry does not describe."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from blender.builders import (
    SQUARE,
    NodeGroup,
    collection,
    collection_instance,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
)


def place(obj: Any) -> Any:
    """Move, turn and scale an object so that rounding is visible."""
    obj.location, obj.rotation_euler, obj.scale = (0.1, 2.7, -3.3), (0.3, 1.1, 2.2), (0.7, -1.3, 1.9)
    return obj


def made_meshes() -> None:
    place(instances_on_grid("field", made_cube, 5))


def made_meshes_beside_the_own() -> None:
    place(instances_on_grid("field", made_cube, 5, keep_own=True))


def an_object() -> None:
    source = mesh_object("source", location=(0, 0, 7))
    place(instances_on_grid("field", object_info(source), 5))


def an_object_with_modifiers() -> None:
    source = place(mesh_object("source"))
    source.modifiers.new("subsurf", "SUBSURF")
    instances_on_grid("field", object_info(source), 3)


def an_object_where_it_is() -> None:
    an_object()
    place(bpy.data.objects["source"])
    nodes = bpy.data.objects["field"].modifiers[0].node_group.nodes
    next(node for node in nodes if node.bl_idname == "GeometryNodeObjectInfo").transform_space = "RELATIVE"


def far_too_large_within() -> None:
    an_object_where_it_is()
    bpy.data.objects["source"].scale = (1e25, 1, 1)
    mesh_object("fine")


def no_object() -> None:
    mesh_object("fine")
    instances_on_grid("field", object_info(None), 3)


def several_objects() -> None:
    shown = collection("shown", linked=False)
    for index in range(4):
        mesh_object(f"shape {index}", mesh_data(f"shape {index}", *SQUARE), collection=shown)

    def from_collection(group: NodeGroup) -> Any:
        info = group.node("GeometryNodeCollectionInfo", Collection=shown, Separate_Children=True, Reset_Children=True)
        return info.outputs["Instances"]

    field = place(instances_on_grid("field", from_collection, 4))
    nodes = field.modifiers[0].node_group.nodes
    on_points = next(node for node in nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    on_points.inputs["Pick Instance"].default_value = True
    index = nodes.new("GeometryNodeInputIndex")
    scramble = nodes.new("ShaderNodeMath")
    scramble.operation = "WRAP"
    field.modifiers[0].node_group.links.new(index.outputs[0], scramble.inputs[0])
    scramble.inputs[1].default_value, scramble.inputs[2].default_value = 3.0, 1.0
    field.modifiers[0].node_group.links.new(scramble.outputs[0], on_points.inputs["Instance Index"])


def several_instancers_among_others() -> None:
    mesh_object("before")
    made_meshes()
    mesh_object("between", location=(4, 4, 4)).rotation_euler.x = 0.7
    an_object()
    mesh_object("after")


def ids_of_their_own() -> None:
    field = place(instances_on_grid("field", made_cube, 4))
    tree = field.modifiers[0].node_group
    on_points = next(node for node in tree.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    set_id = tree.nodes.new("GeometryNodeSetID")
    index, scale = tree.nodes.new("GeometryNodeInputIndex"), tree.nodes.new("ShaderNodeMath")
    scale.operation, scale.inputs[1].default_value = "MULTIPLY", 7.0
    tree.links.new(index.outputs[0], scale.inputs[0])
    tree.links.new(scale.outputs[0], set_id.inputs["ID"])
    tree.links.new(on_points.inputs["Points"].links[0].from_socket, set_id.inputs["Geometry"])
    tree.links.new(set_id.outputs[0], on_points.inputs["Points"])


def materials() -> None:
    source = mesh_object("source")
    source.data.materials.append(bpy.data.materials.new("red"))
    field = place(instances_on_grid("field", object_info(source), 2))
    field.data.materials.append(bpy.data.materials.new("blue"))
    made_meshes()


def hidden_from_the_camera() -> None:
    made_meshes()
    bpy.data.objects["field"].visible_camera = False


def a_hidden_original() -> None:
    an_object()
    bpy.data.objects["source"].hide_viewport = bpy.data.objects["source"].hide_render = True


def bad_matrices() -> None:
    made_meshes()
    bpy.data.objects["field"].scale = (1e30, 1, 1)
    mesh_object("fine")


def beside_text_and_curves() -> None:
    bpy.ops.object.text_add(location=(1, 2, 3), rotation=(0.1, 0.2, 0.3))
    made_meshes()
    bpy.ops.object.text_add()
    bpy.ops.surface.primitive_nurbs_surface_sphere_add()
    bpy.ops.object.metaball_add()
    bpy.ops.object.metaball_add(location=(1, 0, 0))
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.ops.curve.primitive_bezier_circle_add()
    bpy.context.object.data.bevel_depth = 0.1
    bpy.ops.object.volume_add()


FAST: dict[str, Callable[[], None]] = {
    function.__name__: function
    for function in (
        made_meshes,
        made_meshes_beside_the_own,
        an_object,
        an_object_with_modifiers,
        an_object_where_it_is,
        far_too_large_within,
        several_objects,
        several_instancers_among_others,
        ids_of_their_own,
        materials,
        hidden_from_the_camera,
        a_hidden_original,
        bad_matrices,
        no_object,
        beside_text_and_curves,
    )
}


def nodes_of_nodes() -> None:
    instances_on_grid("field", object_info(instances_on_grid("source", made_cube, 2)), 3)


def beside_a_collection_instance() -> None:
    made_meshes()
    inner = collection("inner", linked=False)
    mesh_object("leaf", collection=inner)
    collection_instance("tree", inner)


def a_whole_collection() -> None:
    shown = collection("shown", linked=False)
    mesh_object("leaf", collection=shown)

    def whole(group: NodeGroup) -> Any:
        return group.node("GeometryNodeCollectionInfo", Collection=shown).outputs["Instances"]

    instances_on_grid("field", whole, 3)


def a_hidden_instancer() -> None:
    made_meshes_beside_the_own()
    hide_instancer(bpy.data.objects["field"])


def repeated_ids() -> None:
    ids_of_their_own()
    nodes = bpy.data.objects["field"].modifiers[0].node_group.nodes
    next(node for node in nodes if node.bl_idname == "ShaderNodeMath").inputs[1].default_value = 0.5


def object_linked_materials() -> None:
    made_meshes()
    field = bpy.data.objects["field"]
    field.data.materials.append(None)
    field.material_slots[0].link = "OBJECT"
    field.material_slots[0].material = bpy.data.materials.new("red")


def beside_particles() -> None:
    made_meshes()
    mesh_object("emitter").modifiers.new("particles", "PARTICLE_SYSTEM")


def a_curve_among_the_instances() -> None:
    data = bpy.data.curves.new("curve", "CURVE")
    data.bevel_depth = 0.2
    data.splines.new("POLY").points.add(1)
    data.splines[0].points[1].co = (1, 0, 0, 1)
    instances_on_grid("field", object_info(bpy.data.objects.new("curve", data)), 2)


def no_instances_at_all() -> None:
    group = NodeGroup("plain")
    group.show(group.input.outputs[0]).apply_to(mesh_object("plain"))


def a_collection_of_instancers_and_text() -> None:
    made_meshes()
    bpy.ops.object.text_add()
    shown = collection("shown")
    for name in ("field", "Text"):
        shown.objects.link(bpy.data.objects[name])
    collection_instance("tree", shown, location=(9, 9, 9))


def beside_instances_on_vertices() -> None:
    child, parent = mesh_object("child"), place(mesh_object("parent"))
    child.parent, parent.instance_type = parent, "VERTS"
    made_meshes()


def hide_instancer(obj: Any) -> None:
    obj.show_instancer_for_viewport = obj.show_instancer_for_render = False


def beside_hidden_instancers() -> None:
    """Two one after the other, then one of nodes, one after it, one that shows nothing, and one at the end."""
    kinds = {"first": "VERTS", "second": "FACES", "after": "VERTS", "none": "VERTS", "last": "FACES"}
    for name, kind in kinds.items():
        parent = place(mesh_object(f"{name} parent"))
        if name != "none":
            mesh_object(f"{name} child").parent = parent
        parent.instance_type = kind
        hide_instancer(parent)
        if name == "second":
            made_meshes()
            mesh_object("plain", location=(3, 3, 3))
    bpy.data.objects["none parent"].hide_viewport = True


def beside_a_hidden_instancer_of_nodes() -> None:
    a_hidden_instancer()
    instances_on_grid("other", made_cube, 3)


def listed_ones_among_others() -> None:
    repeated_ids()
    mesh_object("plain", location=(3, 3, 3))
    beside_a_collection_instance()
    beside_instances_on_vertices()
    place(bpy.data.objects["tree"])
    collection_instance("tree 2", bpy.data.collections["inner"], location=(1, 1, 1))
    an_object()
    bpy.data.objects["child"].hide_render = True


PARTLY: dict[str, Callable[[], None]] = {
    function.__name__: function
    for function in (
        beside_a_collection_instance,
        beside_particles,
        beside_instances_on_vertices,
        beside_hidden_instancers,
        beside_a_hidden_instancer_of_nodes,
        listed_ones_among_others,
    )
}


SLOW: dict[str, Callable[[], None]] = {
    function.__name__: function
    for function in (
        nodes_of_nodes,
        a_collection_of_instancers_and_text,
        a_whole_collection,
        a_hidden_instancer,
        repeated_ids,
        object_linked_materials,
        a_curve_among_the_instances,
        no_instances_at_all,
    )
}
