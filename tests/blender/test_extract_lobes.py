"""Shader nodes and their mixes as lobes: metal, glass, refraction, translucency and diffuse reflection."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import evaluated, mesh_object
from blender.node_setups import add, image_node, new_red, shader, surface
from blender.program_slots import slots_of
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.look_records import MaterialRecord
from perfect_bvh_addon.sync.records import AttributeRequest

RED, GREEN = (0.8, 0.2, 0.1, 1.0), (0.1, 0.6, 0.3, 1.0)


@pytest.fixture
def material() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    material = new_red()
    mesh_object("object").data.materials.append(material)
    return material


def only_material() -> MaterialRecord:
    (record,) = read_scene(evaluated(), AttributeRequest(shading=True)).materials
    return record


def show(material: Any, node: Any) -> MaterialRecord:
    material.node_tree.links.new(node.outputs[0], surface(material))
    return only_material()


def bsdf(material: Any, kind: str, color: tuple[float, ...] = RED, **values: Any) -> Any:
    return add(material.node_tree, f"Bsdf{kind}", Color=color, **values)


def mix(material: Any, first: Any, second: Any, share: float) -> Any:
    node = add(material.node_tree, "MixShader", (first.outputs[0], 1), (second.outputs[0], 2))
    node.inputs[0].default_value = share
    return node


def albedos(record: MaterialRecord) -> dict[str, np.ndarray]:
    """Return the share of each lobe in the whole surface, including colours, before any Fresnel term."""
    base = np.array(record.base_color)
    below_metal = 1.0 - record.metallic
    below_clear = below_metal * (1.0 - record.transmission)
    return {
        "metal": record.metallic * np.array(record.metal_color) * base**record.metal_power,
        "clear": below_metal
        * record.transmission
        * np.array(record.transmission_color)
        * base**record.transmission_power,
        "translucent": np.array(record.translucent_color) * base**record.translucent_power,
        "diffuse": below_clear * (1.0 - record.translucency) * base,
    }


def test_the_principled_bsdf_has_cycles_terms(material) -> None:
    inputs = shader(material).inputs
    for name, value in {"Base Color": RED, "Metallic": 0.25, "IOR": 1.8, "Transmission Weight": 0.5}.items():
        inputs[name].default_value = value
    inputs["Specular Tint"].default_value = GREEN
    record = only_material()
    assert (record.ior, record.specular_tint) == (pytest.approx(1.8), pytest.approx(GREEN[:3]))
    assert (record.even_metal, record.tinted_glass, record.plain_refraction, record.translucency) == (0, 0, 0, 0)
    lobes = albedos(record)
    np.testing.assert_allclose(lobes["metal"], 0.25 * np.array(RED[:3]), rtol=1e-5)
    np.testing.assert_allclose(lobes["clear"], 0.375 * np.sqrt(RED[:3]), rtol=1e-5)
    np.testing.assert_allclose(lobes["diffuse"], 0.375 * np.array(RED[:3]), rtol=1e-5)
    assert not lobes["translucent"].any()


@pytest.mark.parametrize(
    ("kind", "values", "lobe", "expected"),
    [
        ("Anisotropic", {"Roughness": 0.3}, "metal", {"even_metal": 1.0, "roughness": 0.3}),
        ("Glass", {"Roughness": 0.1, "IOR": 1.4}, "clear", {"tinted_glass": 1.0, "roughness": 0.1, "ior": 1.4}),
        (
            "Refraction",
            {"Roughness": 0.2, "IOR": 1.3},
            "clear",
            {"plain_refraction": 1.0, "roughness": 0.2, "ior": 1.3},
        ),
        ("Translucent", {}, "translucent", {"translucency": 1.0}),
        ("Diffuse", {}, "diffuse", {"metallic": 0.0}),
    ],
)
def test_a_simple_shader_is_one_lobe_of_its_colour(material, kind, values, lobe, expected) -> None:
    record = show(material, bsdf(material, kind, **values))
    for name, albedo in albedos(record).items():
        np.testing.assert_allclose(albedo, RED[:3] if name == lobe else (0, 0, 0), rtol=1e-5, err_msg=name)
    assert {name: getattr(record, name) for name in expected} == pytest.approx(expected)


def test_metal_has_an_edge_of_its_own(material) -> None:
    node = add(material.node_tree, "BsdfMetallic", Roughness=0.2, Edge_Tint=GREEN)
    node.inputs["Base Color"].default_value = RED
    record = show(material, node)
    assert (record.metallic, record.even_metal, record.specular_tint) == (1.0, 0.0, pytest.approx(GREEN[:3]))
    assert record.base_color == pytest.approx(RED[:3])


KINDS = ("Diffuse", "Anisotropic", "Glass", "Refraction", "Translucent")


@pytest.mark.parametrize("share", [0.25, 0.9])
@pytest.mark.parametrize("first", KINDS)
@pytest.mark.parametrize("second", KINDS)
def test_a_mix_has_as_much_of_each_lobe_as_its_shaders_bring(material, first, second, share) -> None:
    one, other = bsdf(material, first, RED), bsdf(material, second, GREEN)
    parts = [albedos(show(material, node)) for node in (one, other)]
    mixed = albedos(show(material, mix(material, one, other, share)))
    for name in mixed:
        expected = (1.0 - share) * parts[0][name] + share * parts[1][name]
        np.testing.assert_allclose(mixed[name], expected, rtol=1e-4, atol=1e-6, err_msg=name)


def test_a_mix_of_mixes_keeps_what_its_shaders_are_made_of(material) -> None:
    glass = bsdf(material, "Glass", (1.0, 1.0, 1.0, 1.0), IOR=1.33, Roughness=0.0)
    gloss = bsdf(material, "Anisotropic", (0.9, 0.9, 0.9, 1.0), Roughness=0.4)
    inner = mix(material, bsdf(material, "Diffuse"), gloss, 0.2)
    record = show(material, mix(material, inner, glass, 0.5))
    lobes = albedos(record)
    np.testing.assert_allclose(lobes["diffuse"], 0.4 * np.array(RED[:3]), rtol=1e-4)
    np.testing.assert_allclose(lobes["metal"], (0.09, 0.09, 0.09), rtol=1e-4)
    np.testing.assert_allclose(lobes["clear"], (0.5, 0.5, 0.5), rtol=1e-4)
    assert (record.ior, record.tinted_glass, record.even_metal) == pytest.approx((1.33, 1.0, 1.0))
    assert record.roughness == pytest.approx((0.1 * 0.4 + 0.5 * 0.0) / 0.6)  # weighted by the glossy lobes


def test_a_mix_loses_light_between_facets_by_what_of_it_may_keep_it(material) -> None:
    """Refraction BSDFs always lose it, so they do not count."""
    gloss, glass, plain = (bsdf(material, kind, Roughness=0.3) for kind in ("Anisotropic", "Glass", "Refraction"))
    assert show(material, mix(material, gloss, plain, 0.5)).lossy_facets == 0.0
    glass.distribution = "GGX"
    assert show(material, mix(material, glass, plain, 0.5)).lossy_facets == 1.0
    assert show(material, mix(material, gloss, glass, 0.25)).lossy_facets == pytest.approx(0.25)


def test_a_leaf_shows_its_image_on_both_sides(material) -> None:
    tree = material.node_tree
    image = image_node(tree)
    tree.links.new(image.outputs[0], shader(material).inputs["Base Color"])
    leaf = bsdf(material, "Translucent")
    tree.links.new(image.outputs[0], leaf.inputs["Color"])
    record = show(material, mix(material, shader(material), leaf, 0.3))
    assert record.program is not None
    assert set(slots_of(record.program)) == {"COLOR", "TRANSLUCENT"}
    assert record.translucency == pytest.approx(0.3)


def test_what_is_added_translucent_takes_nothing_away(material) -> None:
    leaf = bsdf(material, "Translucent", GREEN)
    inputs = (leaf.outputs[0], 0), (shader(material).outputs[0], 1)
    record = show(material, add(material.node_tree, "AddShader", *inputs))
    lobes = albedos(record)
    np.testing.assert_allclose(lobes["diffuse"], (0.8, 0.2, 0.2), rtol=1e-5)
    np.testing.assert_allclose(lobes["translucent"], GREEN[:3], rtol=1e-5)


def test_a_finish_counts_where_its_shader_is_in_a_mix(material: Any) -> None:
    """Sheen is weighted by its share, brushing by the brushed facets, rough diffuse light by the diffuse lobes."""
    tree = material.node_tree
    gloss = bsdf(material, "Anisotropic", Anisotropy=0.5, Rotation=0.25, Roughness=0.3)
    rough = bsdf(material, "Diffuse", Roughness=0.6)
    fibers = bsdf(material, "Sheen", GREEN, Roughness=0.7)
    both = mix(material, gloss, rough, 0.25)
    record = show(material, mix(material, both, fibers, 0.5))
    finish = record.finish
    assert finish.sheen == pytest.approx([0.5 * part for part in GREEN[:3]])
    assert (finish.sheen_roughness, finish.sheen_cover) == (pytest.approx(0.7), 0.0)
    assert (finish.stretch, finish.rotation) == (pytest.approx(0.5), 0.25)
    assert set(slots_of(record.program)) == {"TANGENT"}
    added = show(material, add(tree, "AddShader", (rough.outputs[0], 0), (fibers.outputs[0], 1)))
    assert added.base_color == pytest.approx(RED[:3])
    assert added.finish.sheen == pytest.approx(GREEN[:3])
    assert added.finish.diffuse_roughness == pytest.approx(0.6)
    assert show(material, shader(material)).finish is None


@pytest.mark.parametrize(
    ("kind", "names", "amount", "stretch"),
    [
        ("Principled", ("Anisotropic", "Metallic"), 0.8, (1.0 - 0.9 * 0.8) ** -0.5),
        ("Anisotropic", ("Anisotropy",), 0.4, 0.6),
        ("Anisotropic", ("Anisotropy",), -0.5, 2.0),
    ],
)
def test_anisotropy_stretches_facets(
    material: Any, kind: str, names: tuple[str, ...], amount: float, stretch: float
) -> None:
    """A node that drives the input gives the same result as a number."""
    tree = material.node_tree
    node = shader(material) if kind == "Principled" else bsdf(material, kind)
    for name, value in zip(names, (amount, 1.0), strict=False):
        node.inputs[name].default_value = value
    assert show(material, node).finish.stretch == pytest.approx(stretch)
    driven = add(tree, "Math", (image_node(tree).outputs[0], 0))
    driven.operation, driven.inputs[1].default_value = "COMPARE", amount
    doubled = add(tree, "Math", (driven.outputs[0], 0))  # 0 or 1 at each place, so that the amount is too
    doubled.operation, doubled.inputs[1].default_value = "MULTIPLY", amount
    tree.links.new(doubled.outputs[0], node.inputs[names[0]])
    assert "STRETCH" in slots_of(show(material, node).program)
