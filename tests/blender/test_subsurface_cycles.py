"""Subsurface scattering: the mean colour of the diffuse surface that replaces it, compared with converged Cycles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, new_red, shader, surface  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES = 128

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender 4 walks otherwise")


@pytest.fixture
def material() -> Iterator[Any]:
    """The material of a sphere that fills the image, under a sun and a grey sky."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=1.0)
    bpy.context.object.data.shade_smooth()
    material = new_red()
    bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, -0.7, 0.0))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 2.0, 0.1
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.4
    scene.render.resolution_x = scene.render.resolution_y = 16
    yield material
    clear_syncs()
    perfect_bvh_addon.unregister()


def check() -> None:
    ours, theirs = (image[..., :3].mean(axis=(0, 1)) for image in render_beside(bpy.context.scene, SAMPLES))
    assert ours == pytest.approx(theirs, rel=0.05)


@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"])
@pytest.mark.parametrize(
    ("color", "weight", "scale"),
    [
        ((0.8, 0.5, 0.3, 1.0), 1.0, 0.05),
        ((0.8, 0.5, 0.3, 1.0), 0.5, 0.3),
        ((0.9, 0.1, 0.05, 1.0), 1.0, 0.2),
    ],
)
def test_what_stands_for_it_has_its_mean_colour(
    material: Any, method: str, color: tuple[float, ...], weight: float, scale: float
) -> None:
    node = shader(material)
    node.subsurface_method = method
    values = {"Base Color": color, "Subsurface Weight": weight, "Subsurface Scale": scale, "Specular IOR Level": 0.5}
    for name, value in values.items():
        node.inputs[name].default_value = value
    check()


@pytest.mark.parametrize(("falloff", "anisotropy"), [("BURLEY", 0.0), ("RANDOM_WALK", 0.0), ("RANDOM_WALK", 0.5)])
def test_the_node_has_its_mean_colour(material: Any, falloff: str, anisotropy: float) -> None:
    node = add(material.node_tree, "SubsurfaceScattering", Color=(0.7, 0.4, 0.2, 1.0), Anisotropy=anisotropy)
    node.falloff, node.inputs["Scale"].default_value = falloff, 0.1
    material.node_tree.links.new(node.outputs[0], surface(material))
    check()


def test_metal_and_glass_keep_the_base_colour(material: Any) -> None:
    inputs = shader(material).inputs
    inputs["Subsurface Weight"].default_value = 1.0
    inputs["Metallic"].default_value, inputs["Base Color"].default_value = 0.6, (0.8, 0.3, 0.2, 1.0)
    check()
