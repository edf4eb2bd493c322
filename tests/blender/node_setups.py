"""Materials as users build them, each set up on a cube's `Material` with a Principled BSDF of diffuse red alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np


def new_red(name: str = "Red") -> Any:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    inputs = shader(material).inputs
    inputs["Base Color"].default_value = (0.8, 0.2, 0.2, 1.0)
    inputs["Roughness"].default_value, inputs["Specular IOR Level"].default_value = 1.0, 0.0
    return material


def shader(material: Any) -> Any:
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def surface(material: Any) -> Any:
    return material.node_tree.get_output_node("ALL").inputs["Surface"]


def add(tree: Any, kind: str, *linked: tuple[Any, int], **values: Any) -> Any:
    """Add a ShaderNode`kind`. linked: outputs, and the numbers of the inputs for them. values: of inputs, by name."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for output, place in linked:
        tree.links.new(output, node.inputs[place])
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    return node


def four_colors(has_holes: bool = False) -> Any:
    """64 x 64 pixels: a chequer of red, in halves of green, in halves of blue; every other square a hole."""
    image = bpy.data.images.new("Four", 64, 64, alpha=True)
    row, column = np.mgrid[0:64, 0:64]
    chequer = (row // 16 + column // 16) % 2
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., 0] = np.where(chequer, 0.9, 0.1)
    pixels[..., 1] = np.where(column < 32, 0.8, 0.2)
    pixels[..., 2] = np.where(row < 32, 0.7, 0.1)
    if has_holes:
        pixels[..., 3] = chequer
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def image_node(tree: Any, has_holes: bool = False) -> Any:
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = four_colors(has_holes)
    return node


def tiled(material: Any) -> None:
    """An image that is scaled, turned and moved by a Mapping node."""
    tree = material.node_tree
    image = image_node(tree)
    uv = add(tree, "TexCoord").outputs["UV"]
    values = {"Scale": (0.3, 0.6, 1.0), "Rotation": (0.0, 0.0, 0.5), "Location": (0.2, 0.1, 0.0)}
    mapping = add(tree, "Mapping", (uv, 0), **values)
    tree.links.new(mapping.outputs[0], image.inputs[0])
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])


def shadeless(material: Any) -> None:
    """An image that emits light, as a screen does."""
    tree = material.node_tree
    emission = add(tree, "Emission", (image_node(tree).outputs[0], 0), Strength=0.8)
    tree.links.new(emission.outputs[0], surface(material))


def emissive_picture(material: Any) -> None:
    tree = material.node_tree
    tree.links.new(image_node(tree).outputs[0], shader(material).inputs["Emission Color"])
    shader(material).inputs["Emission Strength"].default_value = 0.7


def cut_out_by_a_mix(material: Any) -> None:
    """A mix as for leaves: the image's alpha chooses between transparency and the surface."""
    tree = material.node_tree
    image = image_node(tree, has_holes=True)
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])
    nothing = add(tree, "BsdfTransparent").outputs[0]
    mix = add(tree, "MixShader", (image.outputs[1], 0), (nothing, 1), (shader(material).outputs[0], 2))
    tree.links.new(mix.outputs[0], surface(material))


def cut_out_by_a_mask(material: Any) -> None:
    """Transparency by an image's brightness."""
    tree = material.node_tree
    ramp = add(tree, "ValToRGB", (image_node(tree).outputs[0], 0))
    ramp.color_ramp.interpolation = "CONSTANT"
    ramp.color_ramp.elements[1].position = 0.35
    tree.links.new(ramp.outputs[0], shader(material).inputs["Alpha"])


def tinted(material: Any) -> None:
    """A picture multiplied by a colour, then changed in hue, saturation and brightness."""
    tree = material.node_tree
    mix = add(tree, "MixRGB", (image_node(tree).outputs[0], 1), Fac=1.0, Color2=(0.2, 0.3, 0.9, 1.0))
    mix.blend_type = "MULTIPLY"
    darker = add(tree, "HueSaturation", (mix.outputs[0], 4), Saturation=0.7, Value=0.8, Hue=0.6)
    tree.links.new(darker.outputs[0], shader(material).inputs["Base Color"])


def worked_out(material: Any) -> None:
    """A colour combined from numbers, one of which is computed from two others."""
    tree = material.node_tree
    half = add(tree, "Math")
    half.operation = "MULTIPLY"
    half.inputs[0].default_value, half.inputs[1].default_value = 1.2, 0.5
    color = add(tree, "CombineColor", (half.outputs[0], 1), Red=0.1, Blue=0.9)
    tree.links.new(color.outputs[0], shader(material).inputs["Base Color"])


def warm(material: Any) -> None:
    """Black body emission of 2,000 kelvin; a Value node sets the strength, low enough to limit the noise."""
    tree = material.node_tree
    tree.links.new(add(tree, "Blackbody", Temperature=2000.0).outputs[0], shader(material).inputs["Emission Color"])
    value = add(tree, "Value")
    value.outputs[0].default_value = 0.3
    tree.links.new(value.outputs[0], shader(material).inputs["Emission Strength"])


def grouped(material: Any) -> None:
    """Nested groups: the inner one shows an image multiplied by the outer one's input."""
    inner, outer = (bpy.data.node_groups.new(name, "ShaderNodeTree") for name in ("Inner", "Outer"))
    for group in (inner, outer):
        group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    inner.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    outer.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    into, out = inner.nodes.new("NodeGroupInput"), inner.nodes.new("NodeGroupOutput")
    mix = add(inner, "MixRGB", (into.outputs[0], 1), (image_node(inner).outputs[0], 2), Fac=1.0)
    mix.blend_type = "MULTIPLY"
    inner.links.new(mix.outputs[0], out.inputs[0])
    into, out = outer.nodes.new("NodeGroupInput"), outer.nodes.new("NodeGroupOutput")
    within = outer.nodes.new("ShaderNodeGroup")
    within.node_tree = inner
    outer.links.new(into.outputs[0], within.inputs[0])
    diffuse = add(outer, "BsdfDiffuse", (within.outputs[0], 0))
    outer.links.new(diffuse.outputs[0], out.inputs[0])
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = outer
    node.inputs[0].default_value = (0.9, 0.5, 0.1, 1.0)
    material.node_tree.links.new(node.outputs[0], surface(material))


def muted(material: Any) -> None:
    """A muted node does not change the colour."""
    tree = material.node_tree
    color = add(tree, "RGB")
    color.outputs[0].default_value = (0.1, 0.2, 0.9, 1.0)
    node = add(tree, "Invert", (color.outputs[0], 1))
    node.mute = True
    tree.links.new(node.outputs[0], shader(material).inputs["Base Color"])


def one_sided(material: Any) -> None:
    tree = material.node_tree
    backs, nothing = add(tree, "NewGeometry").outputs["Backfacing"], add(tree, "BsdfTransparent").outputs[0]
    mix = add(tree, "MixShader", (backs, 0), (shader(material).outputs[0], 1), (nothing, 2))
    tree.links.new(mix.outputs[0], surface(material))


def painted(material: Any) -> None:
    """A picture multiplied by the mesh's own colours; a mesh without colours is grey."""
    tree = material.node_tree
    attribute = add(tree, "VertexColor")
    attribute.layer_name = "Paint"
    mix = add(tree, "MixRGB", (attribute.outputs[0], 1), (image_node(tree).outputs[0], 2), Fac=1.0)
    mix.blend_type = "MULTIPLY"
    tree.links.new(mix.outputs[0], shader(material).inputs["Base Color"])


def painted_plainly(material: Any) -> None:
    tree = material.node_tree
    attribute = add(tree, "Attribute")
    attribute.attribute_name = "Paint"
    tree.links.new(attribute.outputs["Color"], shader(material).inputs["Base Color"])


def paint(mesh: Any, domain: str = "CORNER", kind: str = "FLOAT_COLOR") -> Any:
    """A colour attribute whose elements have different colours."""
    attribute = mesh.color_attributes.new("Paint", kind, domain)
    for index, item in enumerate(attribute.data):
        item.color = (index % 3 / 2, index % 5 / 4, index % 4 / 3, 1.0)
    return attribute


SETUPS: tuple[Callable[[Any], None], ...] = (
    tiled,
    shadeless,
    emissive_picture,
    cut_out_by_a_mix,
    cut_out_by_a_mask,
    tinted,
    worked_out,
    warm,
    grouped,
    muted,
    one_sided,
    painted,
    painted_plainly,
)
