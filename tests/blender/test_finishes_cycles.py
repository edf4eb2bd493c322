"""Surfaces with sheen, coats, brushed and rough structure: converged patches compared with those of Cycles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, image_node, new_red, shader, surface  # noqa: E402
from blender.textured_setups import data_node, normals  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES, SIZE, PATCH = 256, 32, 8

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender 4 scatters rough diffuse light otherwise")


@pytest.fixture
def ball() -> Iterator[Any]:
    """A sphere that fills the image, under a sun and a grey sky."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, radius=2.0, rotation=(0.6, 0.3, 0.2))
    ball = bpy.context.object
    ball.data.shade_smooth()
    ball.data.materials.append(new_red("Ball"))
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, -0.7, 0.0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 2.0, 0.1
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.35, 0.4, 1.0)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2.7
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    yield ball
    clear_syncs()
    perfect_bvh_addon.unregister()


def patches(image: np.ndarray) -> np.ndarray:
    """(4, 4, 3): the mean colour of each patch."""
    return image[..., :3].reshape(SIZE // PATCH, PATCH, SIZE // PATCH, PATCH, 3).mean(axis=(1, 3))


def check(ball: Any, setup: Callable[[Any], None], within: float = 0.02, of_patch: float = 0.04) -> None:
    """Compare the means of channels, and those of patches."""
    setup(ball.data.materials[0])
    ours, theirs = (patches(image) for image in render_beside(bpy.context.scene, SAMPLES))
    assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=within)
    assert ours == pytest.approx(theirs, rel=of_patch, abs=0.004)


def principled(**values: Any) -> Callable[[Any], None]:
    """Set inputs of the Principled BSDF by name."""

    def setup(material: Any) -> None:
        inputs = shader(material).inputs
        for name, value in values.items():
            inputs[name.replace("_", " ")].default_value = value

    return setup


def node(kind: str, distribution: str | None = None, **values: Any) -> Callable[[Any], None]:
    """Use a single shader."""

    def setup(material: Any) -> None:
        made = add(material.node_tree, kind, **values)
        if distribution is not None:
            made.distribution = distribution
        material.node_tree.links.new(made.outputs[0], surface(material))

    return setup


DARK, TINT = (0.05, 0.1, 0.2, 1.0), (0.9, 0.5, 0.3, 1.0)
METAL = {"Metallic": 1.0, "Base_Color": (0.9, 0.7, 0.4, 1.0)}


@pytest.mark.parametrize("roughness", [0.3, 0.4, 0.6, 0.8, 1.0])
def test_sheen_looks_as_in_cycles(ball: Any, roughness: float) -> None:
    check(ball, principled(Base_Color=DARK, Sheen_Weight=1.0, Sheen_Roughness=roughness, Sheen_Tint=TINT))


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.7, 1.0])
def test_sheen_has_no_rings(ball: Any, roughness: float) -> None:
    """In an even white world each pixel shows the share of light that fibers reflect at one angle."""
    scene, size = bpy.context.scene, 96
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.camera.data.ortho_scale = 4.0
    scene.render.resolution_x = scene.render.resolution_y = size
    node("BsdfSheen", Color=(1.0, 1.0, 1.0, 1.0), Roughness=roughness)(ball.data.materials[0])
    ours, theirs = (image[..., 0].astype(np.float64) for image in render_beside(scene, 8))
    middles = (np.arange(size) + 0.5) / (size / 2) - 1.0
    cosines = np.sqrt(np.maximum(1.0 - np.add.outer(middles**2, middles**2), 0.0))
    rings = np.digitize(cosines, np.linspace(0.2, 1.0, 17))
    off = [(ours - theirs)[rings == ring].mean() for ring in range(1, 17)]
    assert np.abs(off).max() < 0.0015


@pytest.mark.parametrize(
    "values",
    [
        {"Coat_Weight": 1.0},
        {"Coat_Weight": 1.0, "Coat_Roughness": 0.5, "Coat_IOR": 2.2, "Base_Color": DARK},
        {"Coat_Weight": 0.7, "Coat_Roughness": 0.2, "Coat_Tint": TINT, **METAL, "Roughness": 0.4},
        {"Coat_Weight": 1.0, "Coat_Roughness": 0.0, "Coat_IOR": 1.8, **METAL, "Roughness": 0.3},
        {"Coat_Weight": 0.5, "Coat_Roughness": 0.3, "Sheen_Weight": 0.8, "Specular_IOR_Level": 0.5, "Roughness": 0.4},
    ],
)
def test_coats_look_as_in_cycles(ball: Any, values: dict[str, Any]) -> None:
    """The sun's reflection in a smooth coat is about as large as a patch."""
    check(ball, principled(**values), of_patch=0.12)


@pytest.mark.parametrize("roughness", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("color", [(0.9, 0.5, 0.1, 1.0), DARK])
def test_rough_diffuse_surfaces_look_as_in_cycles(ball: Any, roughness: float, color: Any) -> None:
    check(ball, node("BsdfDiffuse", Roughness=roughness, Color=color))
    check(ball, principled(Diffuse_Roughness=roughness, Base_Color=color))


@pytest.mark.parametrize(
    "setup",
    [
        principled(Anisotropic=0.8, Roughness=0.4, **METAL),
        principled(Anisotropic=1.0, Roughness=0.6, Anisotropic_Rotation=0.15, **METAL),
        principled(Anisotropic=0.7, Roughness=0.3, Specular_IOR_Level=1.0, Base_Color=DARK),
        node("BsdfAnisotropic", "MULTI_GGX", Anisotropy=0.6, Roughness=0.5, Rotation=0.1),
        node("BsdfAnisotropic", "GGX", Anisotropy=-0.7, Roughness=0.4),
        node("BsdfMetallic", "MULTI_GGX", Anisotropy=0.9, Roughness=0.5, Rotation=0.3),
    ],
)
def test_brushed_surfaces_look_as_in_cycles(ball: Any, setup: Callable[[Any], None]) -> None:
    """At the strongest anisotropy within 2.5 %."""
    check(ball, setup, within=0.025, of_patch=0.06)


def sheen_beside_diffuse(material: Any) -> None:
    tree = material.node_tree
    diffuse, sheen = add(tree, "BsdfDiffuse", Color=TINT), add(tree, "BsdfSheen", Roughness=0.4)
    both = add(tree, "AddShader", (sheen.outputs[0], 0), (diffuse.outputs[0], 1))
    tree.links.new(both.outputs[0], surface(material))


def sheen_mixed_with_gloss(material: Any) -> None:
    tree = material.node_tree
    gloss, sheen = add(tree, "BsdfAnisotropic", Roughness=0.4), add(tree, "BsdfSheen", Color=TINT, Roughness=0.7)
    both = add(tree, "MixShader", (sheen.outputs[0], 1), (gloss.outputs[0], 2), Fac=0.3)
    tree.links.new(both.outputs[0], surface(material))


def driven_by_images(material: Any) -> None:
    """Each parameter varies over the surface."""
    tree, inputs = material.node_tree, shader(material).inputs
    parts = add(tree, "SeparateColor", (image_node(tree).outputs[0], 0))
    names = ("Sheen Weight", "Coat Weight", "Diffuse Roughness"), ("Sheen Roughness", "Coat Roughness", "Anisotropic")
    for row in names:
        for name, output in zip(row, parts.outputs, strict=False):
            tree.links.new(output, inputs[name])
    tree.links.new(image_node(tree).outputs[0], inputs["Coat Tint"])
    inputs["Specular IOR Level"].default_value, inputs["Roughness"].default_value = 0.5, 0.5


def coated_bumps(material: Any) -> None:
    """Bumps below a smooth coat."""
    tree, inputs = material.node_tree, shader(material).inputs
    mapped = add(tree, "NormalMap", (data_node(tree, normals()).outputs[0], 1), Strength=0.5)
    tree.links.new(mapped.outputs[0], inputs["Normal"])
    inputs["Coat Weight"].default_value, inputs["Coat Roughness"].default_value = 1.0, 0.2
    inputs["Base Color"].default_value = DARK


def bumpy_coat(material: Any) -> None:
    tree, inputs = material.node_tree, shader(material).inputs
    mapped = add(tree, "NormalMap", (data_node(tree, normals()).outputs[0], 1), Strength=0.5)
    tree.links.new(mapped.outputs[0], inputs["Coat Normal"])
    inputs["Coat Weight"].default_value, inputs["Coat Roughness"].default_value = 1.0, 0.3


def brushed_along(direction: str, axis: str = "Z") -> Callable[[Any], None]:
    """The direction comes from a Tangent node."""

    def setup(material: Any) -> None:
        principled(Anisotropic=0.9, Roughness=0.5, **METAL)(material)
        tangent = add(material.node_tree, "Tangent")
        tangent.direction_type, tangent.axis = direction, axis
        material.node_tree.links.new(tangent.outputs[0], shader(material).inputs["Tangent"])

    return setup


@pytest.mark.parametrize(
    "setup",
    [
        sheen_beside_diffuse,
        sheen_mixed_with_gloss,
        driven_by_images,
        coated_bumps,
        bumpy_coat,
        brushed_along("RADIAL", "X"),
        brushed_along("RADIAL", "Y"),
        brushed_along("UV_MAP"),
    ],
)
def test_finishes_by_nodes_look_as_in_cycles(ball: Any, setup: Callable[[Any], None]) -> None:
    """Bumps below a coat are up to 3 % darker than in Cycles: a coat reflects nothing from below the bent surface."""
    check(ball, setup, within=0.03, of_patch=0.11)
