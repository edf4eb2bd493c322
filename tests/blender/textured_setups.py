"""Materials that vary over the surface, each set up like those of `node_setups`: maps, bumps, patterns."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from blender.node_setups import add, four_colors, image_node, shader, surface


def data_image(pixels: Any, *, is_float: bool = False) -> Any:
    """An image of data instead of colours: (H, W, 3) numbers, of 8 bits each by default."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Data", width, height, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.concatenate([pixels, np.ones((height, width, 1))], axis=2).astype(np.float32).ravel())
    image.pack()
    return image


def data_node(tree: Any, pixels: Any, *, is_float: bool = False) -> Any:
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = data_image(pixels, is_float=is_float)
    return node


def waves() -> Any:
    """(32, 32): tileable heights of 0 to 1."""
    row, column = np.mgrid[0:32, 0:32] / 32.0 * 2.0 * np.pi
    return 0.5 + 0.25 * (np.sin(2.0 * column) + np.cos(row))


def normals() -> Any:
    """(32, 32, 3): the normals of `waves`, as a normal map stores them."""
    heights = waves()
    slopes = [(np.roll(heights, -1, axis) - np.roll(heights, 1, axis)) * 4.0 for axis in (1, 0)]
    vectors = np.stack([-slopes[0], -slopes[1], np.ones_like(heights)], axis=2)
    return vectors / np.linalg.norm(vectors, axis=2, keepdims=True) * 0.5 + 0.5


def link_normal(material: Any, output: Any) -> None:
    material.node_tree.links.new(output, shader(material).inputs["Normal"])


def maps_of_gloss(material: Any) -> None:
    """Textures as in glTF: roughness in an image's green, metal in its blue."""
    tree = material.node_tree
    across, up = np.meshgrid(np.linspace(0.3, 1.0, 32), np.linspace(0.0, 1.0, 32))
    maps = np.stack([np.zeros_like(across), across, up > 0.5], axis=2)
    parts = add(tree, "SeparateColor", (data_node(tree, maps).outputs[0], 0))
    tree.links.new(parts.outputs[1], shader(material).inputs["Roughness"])
    tree.links.new(parts.outputs[2], shader(material).inputs["Metallic"])


def normal_mapped(material: Any) -> None:
    tree = material.node_tree
    mapped = add(tree, "NormalMap", (data_node(tree, normals()).outputs[0], 1), Strength=0.8)
    link_normal(material, mapped.outputs[0])


def normal_mapped_metal(material: Any) -> None:
    normal_mapped(material)
    shader(material).inputs["Metallic"].default_value = 1.0
    shader(material).inputs["Roughness"].default_value = 0.4


def object_normals(material: Any) -> None:
    tree = material.node_tree
    mapped = add(tree, "NormalMap", (data_node(tree, normals(), is_float=True).outputs[0], 1), Strength=0.7)
    mapped.space = "OBJECT"
    link_normal(material, mapped.outputs[0])


def world_normals(material: Any) -> None:
    tree = material.node_tree
    mapped = add(tree, "NormalMap", (data_node(tree, normals()).outputs[0], 1), Strength=0.5)
    mapped.space = "WORLD"
    link_normal(material, mapped.outputs[0])


def bumped_by_an_image(material: Any) -> None:
    tree = material.node_tree
    heights = np.repeat(waves()[..., None], 3, axis=2)
    bump = add(tree, "Bump", Strength=0.7, Distance=0.2)
    tree.links.new(data_node(tree, heights, is_float=True).outputs[0], bump.inputs["Height"])
    link_normal(material, bump.outputs[0])


def bumped_by_noise(material: Any) -> None:
    tree = material.node_tree
    noise = add(tree, "TexNoise", Scale=2.0, Detail=0.0)
    bump = add(tree, "Bump", Strength=1.0, Distance=0.4)
    bump.invert = True
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    link_normal(material, bump.outputs[0])


def bumped_on_a_normal_map(material: Any) -> None:
    """A bump on top of a normal map."""
    tree = material.node_tree
    mapped = add(tree, "NormalMap", (data_node(tree, normals()).outputs[0], 1), Strength=0.5)
    bump = add(tree, "Bump", Strength=0.5, Distance=0.3)
    place = add(tree, "TexCoord").outputs["Object"]
    wave = add(tree, "TexWave", (place, 0), Scale=0.6)
    tree.links.new(wave.outputs[1], bump.inputs["Height"])
    tree.links.new(mapped.outputs[0], bump.inputs["Normal"])
    link_normal(material, bump.outputs[0])


def checkered(material: Any) -> None:
    tree = material.node_tree
    checker = add(tree, "TexChecker", (add(tree, "TexCoord").outputs["Object"], 0), Scale=1.1)
    checker.inputs["Color1"].default_value = (0.1, 0.7, 0.3, 1.0)
    tree.links.new(checker.outputs[0], shader(material).inputs["Base Color"])


def clouded(material: Any) -> None:
    """Noise in the mesh's own texture space, through a ramp."""
    tree = material.node_tree
    noise = add(tree, "TexNoise", (add(tree, "TexCoord").outputs["Generated"], 0), Scale=3.0)
    ramp = add(tree, "ValToRGB", (noise.outputs[0], 0))
    ramp.color_ramp.elements[0].color = (0.05, 0.1, 0.6, 1.0)
    tree.links.new(ramp.outputs[0], shader(material).inputs["Base Color"])


def bricked(material: Any) -> None:
    tree = material.node_tree
    bricks = add(tree, "TexBrick", (add(tree, "TexCoord").outputs["UV"], 0), Scale=4.0, Mortar_Size=0.05)
    tree.links.new(bricks.outputs[0], shader(material).inputs["Base Color"])


def by_place(material: Any) -> None:
    """The position in the world is the colour."""
    tree = material.node_tree
    place = add(tree, "NewGeometry").outputs["Position"]
    part = add(tree, "VectorMath", (place, 0))
    part.operation = "FRACTION"
    tree.links.new(part.outputs[0], shader(material).inputs["Base Color"])


def mixed_by_a_pattern(material: Any) -> None:
    """Metal in the dark squares, a blue surface in the others."""
    tree = material.node_tree
    checker = add(tree, "TexChecker", (add(tree, "TexCoord").outputs["UV"], 0), Scale=2.0)
    metal = add(tree, "BsdfGlossy", Roughness=0.3, Color=(0.9, 0.6, 0.2, 1.0))
    blue = add(tree, "BsdfDiffuse", Color=(0.1, 0.2, 0.8, 1.0))
    mix = add(tree, "MixShader", (checker.outputs[1], 0), (metal.outputs[0], 1), (blue.outputs[0], 2))
    tree.links.new(mix.outputs[0], surface(material))


def rimmed(material: Any) -> None:
    """Lighter at grazing angles."""
    tree = material.node_tree
    facing = add(tree, "LayerWeight", Blend=0.4).outputs[1]
    mix = add(tree, "MixRGB", (facing, 0), Color1=(0.1, 0.1, 0.5, 1.0), Color2=(0.9, 0.9, 0.6, 1.0))
    tree.links.new(mix.outputs[0], shader(material).inputs["Base Color"])


def closest_pixels(material: Any) -> None:
    tree = material.node_tree
    image = image_node(tree)
    image.image = bpy.data.images.new("Few", 4, 4)
    image.image.pixels.foreach_set(np.random.default_rng(3).random(64, np.float32))
    image.image.pack()
    image.interpolation = "Closest"
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])


def turned_round(material: Any) -> None:
    """Beyond its border the image is mirrored."""
    tree = material.node_tree
    image = image_node(tree)
    image.image, image.extension = four_colors(), "MIRROR"
    mapping = add(tree, "Mapping", (add(tree, "TexCoord").outputs["UV"], 0), Scale=(2.5, 2.5, 1.0))
    tree.links.new(mapping.outputs[0], image.inputs[0])
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])


def two_images(material: Any) -> None:
    """An image, mixed with a colour by a second image."""
    tree = material.node_tree
    first, second = image_node(tree), data_node(tree, np.repeat(waves()[..., None], 3, axis=2))
    mix = add(tree, "MixRGB", (second.outputs[0], 0), (first.outputs[0], 1), Color2=(0.9, 0.1, 0.6, 1.0))
    tree.links.new(mix.outputs[0], shader(material).inputs["Base Color"])


TEXTURED: tuple[Callable[[Any], None], ...] = (
    maps_of_gloss,
    normal_mapped,
    normal_mapped_metal,
    object_normals,
    world_normals,
    bumped_by_an_image,
    bumped_by_noise,
    bumped_on_a_normal_map,
    checkered,
    clouded,
    bricked,
    by_place,
    mixed_by_a_pattern,
    rimmed,
    closest_pixels,
    turned_round,
    two_images,
)
