"""Edits that change the look of a soak's scene but not its geometry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

if TYPE_CHECKING:
    from blender.soak import Soak

MOST_LIGHTS = 3
HAIR_SHADER = "ShaderNodeBsdfHairPrincipled"


class NothingToEditError(Exception):
    """The scene has nothing that this edit applies to."""


def rename(soak: Soak) -> None:
    soak.an_object().name = soak.name("renamed")


def paint(soak: Soak) -> None:
    obj = soak.an_object("MESH")
    if len(obj.data.materials) < 3:
        obj.data.materials.append(soak.pick((None, *bpy.data.materials)))
    bpy.data.materials["red"].diffuse_color = (*np.abs(soak.vector()), 1.0)
    for polygon in obj.data.polygons:
        polygon.material_index = int(soak.number(0, 3))


def link_material_to_the_object(soak: Soak) -> None:
    slot = soak.pick(slot for obj in bpy.data.objects for slot in obj.material_slots)
    slot.link = soak.pick(("OBJECT", "DATA"))


def paint_corners(soak: Soak) -> None:
    """Change colours and a uv map: add, edit, rename or remove them."""
    mesh = soak.an_object("MESH").data
    colors, maps = mesh.color_attributes, mesh.uv_layers
    if not len(colors) or not len(maps):
        colors.new(name="soaked", type="FLOAT_COLOR", domain=soak.pick(("POINT", "CORNER")))
        maps.new(name="soaked")
    elif soak.number() > 0.5:
        soak.pick((lambda: colors.remove(colors[0]), lambda: maps.remove(maps[0])))()
    elif soak.number() > 0.5:
        soak.pick((colors, maps))[0].name = soak.pick(("soaked", "dried"))
    else:
        for item in colors[0].data:
            item.color = (*np.abs(soak.vector(0, 1)), 1.0)
    mesh.update()


def show_corners(soak: Soak) -> None:
    """Make a material show colours by some name, or stop it."""
    tree = bpy.data.materials["red"].node_tree
    shader = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None) if tree else None
    if shader is None:
        raise NothingToEditError
    for link in shader.inputs["Base Color"].links:
        tree.links.remove(link)
    if soak.number() > 0:
        node = tree.nodes.get("soaked") or tree.nodes.new("ShaderNodeAttribute")
        node.name, node.attribute_name = "soaked", soak.pick(("soaked", "dried"))
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])


def show_instances(soak: Soak) -> None:
    """Let a material show a value of each instance or stop it, and let it lose the light between facets or keep it."""
    tree = bpy.data.materials["red"].node_tree
    shader = next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None) if tree else None
    if shader is None:
        raise NothingToEditError
    shader.distribution = "GGX" if shader.distribution == "MULTI_GGX" else "MULTI_GGX"
    for link in shader.inputs["Roughness"].links:
        tree.links.remove(link)
    if soak.number() > -0.5:
        info = tree.nodes.get("instance") or tree.nodes.new("ShaderNodeObjectInfo")
        attribute = tree.nodes.get("given") or tree.nodes.new("ShaderNodeAttribute")
        info.name, attribute.name = "instance", "given"
        attribute.attribute_name, attribute.attribute_type = "weight", soak.pick(("OBJECT", "INSTANCER"))
        outputs = (*(info.outputs[name] for name in ("Random", "Alpha", "Location")), attribute.outputs["Fac"])
        tree.links.new(soak.pick(outputs), shader.inputs["Roughness"])


def dye(soak: Soak) -> None:
    """Make a material a hair material, or show its surface again."""
    material = soak.pick(bpy.data.materials)
    material.use_nodes = True
    tree = material.node_tree
    output = next((node for node in tree.nodes if node.type == "OUTPUT_MATERIAL"), None)
    if output is None:
        raise NothingToEditError
    kind = soak.pick((HAIR_SHADER, "ShaderNodeBsdfPrincipled"))
    shader = next((node for node in tree.nodes if node.bl_idname == kind), None) or tree.nodes.new(kind)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])


def change_dye(soak: Soak) -> None:
    """Change two inputs of a hair shader, and perhaps its model or parametrization."""
    trees = [material.node_tree for material in bpy.data.materials if material.node_tree]
    node = soak.pick(node for tree in trees for node in tree.nodes if node.bl_idname == HAIR_SHADER)
    if soak.number() > 1.0:
        name = soak.pick(("model", "parametrization"))
        setattr(node, name, soak.pick(item.identifier for item in node.bl_rna.properties[name].enum_items))
    for _ in range(2):
        socket = soak.pick(socket for socket in node.inputs if socket.enabled and hasattr(socket, "default_value"))
        if socket.type == "VALUE":
            socket.default_value = soak.number(0.0, 1.5)
        elif socket.type == "RGBA":
            socket.default_value = (*np.abs(soak.vector(0, 1)), 1.0)
        else:
            socket.default_value = np.abs(soak.vector(0, 1))


def give_values(soak: Soak) -> None:
    """Set the values of an object that materials may show: its colour, a property."""
    obj = soak.an_object()
    obj.color = (*np.abs(soak.vector(0, 1)), abs(soak.number(0, 1)))
    obj["weight"] = abs(soak.number(0, 1))


def look_elsewhere(soak: Soak) -> None:
    scene = bpy.context.scene
    if scene.camera is not None:
        scene.camera.location = soak.vector(5, 20)
        scene.camera.data.lens = soak.number(20, 80)
    scene.render.film_transparent = soak.number() > 0


def light(soak: Soak) -> None:
    """Add a light, or change the power, colour or kind of an existing one."""
    lights = [obj for obj in bpy.data.objects if obj.type == "LIGHT"]
    if len(lights) < MOST_LIGHTS:
        name = soak.name("light")
        obj = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        obj.location = soak.vector(3, 8)
        bpy.context.scene.collection.objects.link(obj)
        return
    data = soak.pick(lights).data
    data.energy, data.color = soak.number(1, 900), np.abs(soak.vector(0, 1))
    data.type = soak.pick(("POINT", "SUN", "SPOT", "AREA"))


def lighten_the_world(soak: Soak) -> None:
    scene = bpy.context.scene
    if scene.world is None:
        scene.world = bpy.data.worlds.new(soak.name("world"))
    scene.world.color = np.abs(soak.vector(0, 1))


LOOK_EDITS: tuple[Any, ...] = (
    rename,
    paint,
    link_material_to_the_object,
    paint_corners,
    show_corners,
    show_instances,
    dye,
    change_dye,
    give_values,
    look_elsewhere,
    light,
    lighten_the_world,
)
