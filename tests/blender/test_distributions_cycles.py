"""Rough surfaces with each distribution of facets that shaders have, in an even world, compared with Cycles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, new_red, shader, surface  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES, WHITE = 256, (1.0, 1.0, 1.0, 1.0)


@pytest.fixture
def ball() -> Iterator[Any]:
    """A sphere that fills the image, in an even world."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, radius=2.0)
    ball = bpy.context.object
    ball.data.shade_smooth()
    ball.data.materials.append(new_red("Ball"))
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2.6
    scene.render.resolution_x = scene.render.resolution_y = 16
    yield ball
    clear_syncs()
    perfect_bvh_addon.unregister()


def shown(ball: Any, kind: str, distribution: str, **values: float) -> Any:
    """Make the sphere white, with one shader of this distribution."""
    material = ball.data.materials[0]
    node = shader(material) if kind == "Principled" else add(material.node_tree, f"Bsdf{kind}")
    node.inputs["Base Color" if "Base Color" in node.inputs else "Color"].default_value = WHITE
    node.distribution = distribution
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    material.node_tree.links.new(node.outputs[0], surface(material))
    return bpy.context.scene


CLEAR = {"Transmission_Weight": 1.0, "Specular_IOR_Level": 0.5}
GLAZED = {"IOR": 2.5, "Specular_IOR_Level": 0.5}


def render_means(scene: Any) -> tuple[float, float]:
    """Return the mean brightness of our image and of Cycles'."""
    ours, theirs = render_beside(scene, SAMPLES)
    return float(ours[..., :3].mean()), float(theirs[..., :3].mean())


@pytest.mark.parametrize("distribution", ["GGX", "MULTI_GGX"])
@pytest.mark.parametrize(
    ("kind", "roughness", "values"),
    [
        ("Glass", 0.6, {}),
        ("Anisotropic", 0.6, {}),
        ("Metallic", 0.6, {}),
        ("Principled", 0.6, CLEAR),
        ("Principled", 0.9, GLAZED),
        ("Principled", 0.9, {"Metallic": 1.0}),
    ],
)
def test_facets_lose_as_much_light_as_in_cycles(
    ball: Any, kind: str, roughness: float, values: dict[str, float], distribution: str
) -> None:
    """GGX loses 10 to 55 % of the light, Multiscatter GGX at most 7 %."""
    ours, theirs = render_means(shown(ball, kind, distribution, Roughness=roughness, **values))
    assert ours == pytest.approx(theirs, rel=0.01)


@pytest.mark.parametrize(
    ("kind", "distribution"),
    [
        *((kind, "BECKMANN") for kind in ("Glass", "Anisotropic", "Metallic", "Refraction")),
        ("Anisotropic", "ASHIKHMIN_SHIRLEY"),
    ],
)
@pytest.mark.parametrize("roughness", [0.2, 0.6, 0.9])
def test_other_distributions_are_those_of_cycles(ball: Any, kind: str, distribution: str, roughness: float) -> None:
    ours, theirs = render_means(shown(ball, kind, distribution, Roughness=roughness))
    assert ours == pytest.approx(theirs, rel=0.01)


@pytest.mark.parametrize("distribution", ["GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY"])
@pytest.mark.parametrize("anisotropy", [0.0, 0.5])
def test_highlights_have_the_shape_of_those_of_cycles(ball: Any, distribution: str, anisotropy: float) -> None:
    """The highlight of a sun is compared in patches of four by four pixels; each distribution has another shape."""
    scene = shown(ball, "Anisotropic", distribution, Roughness=0.5, Anisotropy=anisotropy)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, -0.4, 0.0))
    bpy.context.object.data.angle = 0.2
    scene.world.color = (0.0, 0.0, 0.0)
    ours, theirs = (image[..., 0].reshape(4, 4, 4, 4).mean(axis=(1, 3)) for image in render_beside(scene, SAMPLES))
    assert ours == pytest.approx(theirs, rel=0.02, abs=0.003 * theirs.max())
    assert theirs.max() > 5.0 * theirs.min()
