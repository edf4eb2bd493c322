"""Substitutes for nodes and settings of a material are reported: a flat colour, a mean, the mesh's normals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import pytest
from blender.builders import evaluated
from blender.named_rows import SHADING, into_color, link, rows, sentences, thick
from blender.node_setups import add, image_node, shader, surface
from perfect_bvh_addon.extract import read_scene


def noise(material: Any) -> Any:
    return add(material.node_tree, "AmbientOcclusion")


def into_roughness(material: Any) -> None:
    link(material, noise(material).outputs[0], "Roughness")


def into_alpha(material: Any) -> None:
    link(material, noise(material).outputs[0], "Alpha")


def into_strength(material: Any) -> None:
    link(material, noise(material).outputs[0], "Emission Strength")


def into_a_mix(material: Any) -> None:
    tree = material.node_tree
    mix = add(tree, "MixShader", (noise(material).outputs[0], 0), (shader(material).outputs[0], 1))
    tree.links.new(add(tree, "BsdfDiffuse").outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], surface(material))


def into_two_inputs(material: Any) -> None:
    node = noise(material)
    link(material, node.outputs["Color"])
    link(material, node.outputs[0], "Roughness")


def behind_a_group(material: Any) -> None:
    group = bpy.data.node_groups.new("Dirt", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    out = group.nodes.new("NodeGroupOutput")
    group.links.new(add(group, "AmbientOcclusion").outputs["Color"], out.inputs[0])
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    link(material, node.outputs[0])


def labelled(material: Any) -> None:
    node = noise(material)
    node.label = "Dirt"
    link(material, node.outputs["Color"])


def on_a_box(material: Any) -> None:
    image = image_node(material.node_tree)
    image.projection, image.interpolation, image.extension = "BOX", "Closest", "MIRROR"
    link(material, image.outputs[0])


def bumpy(material: Any) -> None:
    bump = add(material.node_tree, "Bump")
    material.node_tree.links.new(noise(material).outputs[0], bump.inputs["Height"])
    link(material, bump.outputs[0], "Normal")


def coated(material: Any) -> None:
    inputs = shader(material).inputs
    for name in ("Subsurface Weight", "Coat Weight", "Sheen Weight", "Anisotropic", "Thin Film Thickness"):
        inputs[name].default_value = 0.5


def coated_by_a_node(material: Any) -> None:
    link(material, noise(material).outputs[0], "Coat Weight")


def filmed_by_a_node(material: Any) -> None:
    link(material, noise(material).outputs[0], "Thin Film Thickness")


def not_filmed_by_a_node(material: Any) -> None:
    value = add(material.node_tree, "Value")
    value.outputs[0].default_value = 0.0
    link(material, value.outputs[0], "Thin Film Thickness")


def never_seen(material: Any) -> None:
    """A shader that a mix weights with 0."""
    tree = material.node_tree
    toon = add(tree, "BsdfToon", (noise(material).outputs["Color"], 0))
    mix = add(tree, "MixShader", (shader(material).outputs[0], 1), (toon.outputs[0], 2), Fac=0.0)
    tree.links.new(mix.outputs[0], surface(material))


def tinted_nothing(material: Any) -> None:
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfTransparent", Color=(1.0, 0.2, 0.2, 1.0)).outputs[0], surface(material))


def old_hair(material: Any) -> None:
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfHair", Color=(0.2, 0.4, 0.6, 1.0)).outputs[0], surface(material))


def distributed(material: Any) -> None:
    """Three shaders whose distribution or Fresnel is not shown, and one that is smooth."""
    tree = material.node_tree
    glossy, metal, refraction, smooth = (
        add(tree, f"Bsdf{kind}", Roughness=roughness)
        for kind, roughness in (("Anisotropic", 0.3), ("Metallic", 0.3), ("Refraction", 0.3), ("Glass", 0.0))
    )
    glossy.distribution = "ASHIKHMIN_SHIRLEY"
    metal.distribution = refraction.distribution = smooth.distribution = "BECKMANN"
    if hasattr(metal, "fresnel_type"):
        metal.fresnel_type = "PHYSICAL_CONDUCTOR"
    first, second = (
        add(tree, "MixShader", (one.outputs[0], 1), (other.outputs[0], 2))
        for one, other in ((glossy, metal), (refraction, smooth))
    )
    tree.links.new(add(tree, "MixShader", (first.outputs[0], 1), (second.outputs[0], 2)).outputs[0], surface(material))


CONDUCTOR = "the Fresnel type Physical Conductor of Metallic BSDF is unsupported; its flat colour is used"
NOISE = "Ambient Occlusion is unsupported;"
INSTEAD: tuple[tuple[Callable[[Any], None], list[str]], ...] = (
    (into_color, [f"{NOISE} its flat colour is used"]),
    (into_roughness, [f"{NOISE} Roughness 0.5 is used"]),
    (into_alpha, [f"{NOISE} an opaque surface is used"]),
    (into_strength, [f"{NOISE} no emission is used"]),
    (into_a_mix, [f"{NOISE} half of each is used"]),
    (into_two_inputs, [f"{NOISE} its flat colour is used"]),
    (behind_a_group, [f"{NOISE} its flat colour is used"]),
    (labelled, ["Dirt (Ambient Occlusion) is unsupported; its flat colour is used"]),
    (on_a_box, []),
    (bumpy, [f"{NOISE} the mesh's own normals are used"]),
    (
        coated,
        [
            "Subsurface is unsupported; a diffuse surface of its mean colour is used",
            "Thin Film is unsupported; the surface without it is used",
        ],
    ),
    (coated_by_a_node, [f"{NOISE} Coat Weight 0 is used"]),
    (filmed_by_a_node, ["Thin Film is unsupported; the surface without it is used"]),
    (not_filmed_by_a_node, []),
    (thick, ["Volume Scatter is unsupported; only its surface is used"]),
    (never_seen, []),
    (old_hair, ["Hair BSDF is unsupported; a diffuse or translucent surface is used"]),
    (
        distributed,
        [
            *([CONDUCTOR] if "fresnel_type" in bpy.types.ShaderNodeBsdfMetallic.bl_rna.properties else []),
        ],
    ),
    (tinted_nothing, ["Color of the Transparent BSDF is unsupported; white is used"]),
)


@pytest.mark.parametrize(("setup", "told"), INSTEAD, ids=lambda value: getattr(value, "__name__", ""))
def test_what_is_shown_instead_is_said(setup: Callable[[Any], None], told: list[str], material: Any) -> None:
    setup(material)
    assert sentences() == [f"Red: {text}" for text in told]
    assert all(row.session_uid == material.session_uid for row in rows())


def test_huang_is_shown_as_chiang_of_the_same_inputs(material: Any) -> None:
    tree = material.node_tree
    node = add(tree, "BsdfHairPrincipled", Roughness=0.4, Radial_Roughness=0.4, Offset=0.1, IOR=1.4)
    tree.links.new(node.outputs[0], surface(material))
    shown = []
    for model, is_named in (("HUANG", True), ("CHIANG", False)):
        node.model = model
        shown.append(read_scene(evaluated(), SHADING).materials[0])
        assert (
            "Red: the model Huang of Principled Hair BSDF is unsupported; Chiang is used" in sentences()
        ) == is_named
    assert shown[0] == shown[1]
    assert shown[0].hair is not None
    assert (shown[0].hair.fiber, shown[0].hair.roughness) == (1.0, pytest.approx((0.4, 0.4)))


@pytest.mark.parametrize(("component", "translucency"), [("Reflection", 0.0), ("Transmission", 1.0)])
def test_the_hair_bsdf_is_a_surface_of_its_colour(component: str, translucency: float, material: Any) -> None:
    old_hair(material)
    next(node for node in material.node_tree.nodes if node.type == "BSDF_HAIR").component = component
    record = read_scene(evaluated(), SHADING).materials[0]
    assert (record.hair, record.translucency) == (None, translucency)
    assert (record.translucent_color if translucency else record.base_color) == pytest.approx((0.2, 0.4, 0.6))


def test_modes_that_show_no_materials_name_none(material: Any) -> None:
    into_color(material)
    assert read_scene(evaluated()).not_shown == ()
