"""Glass that absorbs light inside by volume shaders: converged patches compared with those of Cycles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import add, image_node, new_red, shader, surface  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES, SIZE, PATCH = 512, 32, 8

pytestmark = pytest.mark.skipif(bpy.app.version < (5, 0, 0), reason="Blender 4 has no nodes in a new world")


@pytest.fixture
def glass() -> Iterator[Any]:
    """The material of a cube and a sphere, in front of a floor of two colours, under an even sky."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    material = new_red("Glass")
    inputs = shader(material).inputs
    inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    inputs["Transmission Weight"].default_value, inputs["Roughness"].default_value = 1.0, 0.0
    inputs["Specular IOR Level"].default_value = 0.5
    for place, build in ((-1.1, bpy.ops.mesh.primitive_cube_add), (1.1, bpy.ops.mesh.primitive_uv_sphere_add)):
        build(location=(place, 0.0, 1.2), rotation=(0.3, 0.2, 0.5))
        bpy.context.object.scale = (0.8, 0.8, 0.8)
        bpy.context.object.data.materials.append(material)
    for place, color in ((-10.0, (0.9, 0.8, 0.7, 1.0)), (10.0, (0.2, 0.4, 0.6, 1.0))):
        floor = new_red("Floor")
        shader(floor).inputs["Base Color"].default_value = color
        bpy.ops.mesh.primitive_plane_add(size=20.0, location=(place, 0.0, -0.5))
        bpy.context.object.data.materials.append(floor)
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.9, 1.0, 1.0)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 4.0
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    yield material
    clear_syncs()
    perfect_bvh_addon.unregister()


def patches(image: np.ndarray) -> np.ndarray:
    """(4, 4, 3): the mean colour of each patch."""
    return image[..., :3].reshape(SIZE // PATCH, PATCH, SIZE // PATCH, PATCH, 3).mean(axis=(1, 3))


def volume(material: Any, node: Any) -> None:
    material.node_tree.links.new(node.outputs[0], material.node_tree.get_output_node("ALL").inputs["Volume"])


def absorbing(density: float, **surface_values: float) -> Callable[[Any], None]:
    def setup(material: Any) -> None:
        for name, value in surface_values.items():
            shader(material).inputs[name.replace("_", " ")].default_value = value
        volume(material, add(material.node_tree, "VolumeAbsorption", Density=density, Color=(0.9, 0.5, 0.2, 1.0)))

    return setup


def principled(material: Any) -> None:
    node = add(material.node_tree, "VolumePrincipled", Density=2.0, Color=(0.0, 0.0, 0.0, 1.0))
    node.inputs["Absorption Color"].default_value = (0.2, 0.8, 0.5, 1.0)
    volume(material, node)


def added(material: Any) -> None:
    """A mix of two absorbing shaders inside a Refraction BSDF."""
    tree = material.node_tree
    tree.links.new(add(tree, "BsdfRefraction", Roughness=0.2, IOR=1.3).outputs[0], surface(material))
    one, other = (
        add(tree, "VolumeAbsorption", Density=density, Color=color)
        for density, color in ((2.0, (0.9, 0.2, 0.2, 1.0)), (1.0, (0.2, 0.9, 0.2, 1.0)))
    )
    volume(material, add(tree, "MixShader", (one.outputs[0], 1), (other.outputs[0], 2), Fac=0.4))


def render_patches() -> tuple[np.ndarray, np.ndarray]:
    ours, theirs = (patches(image) for image in render_beside(bpy.context.scene, SAMPLES))
    return ours, theirs


@pytest.mark.parametrize(
    "setup",
    [
        absorbing(1.0),
        absorbing(3.0, IOR=1.1),
        absorbing(1.5, Roughness=0.4),
        absorbing(1.0, Alpha=0.5),
        principled,
        added,
    ],
    ids=["plain", "deep", "rough", "half_there", "principled", "added"],
)
def test_what_is_inside_glass_absorbs_light_as_in_cycles(glass: Any, setup: Callable[[Any], None]) -> None:
    setup(glass)
    ours, theirs = render_patches()
    assert ours.mean(axis=(0, 1)) == pytest.approx(theirs.mean(axis=(0, 1)), rel=0.02)
    assert ours == pytest.approx(theirs, rel=0.05, abs=0.005)


def test_absorption_from_place_to_place_is_its_mean(glass: Any) -> None:
    tree = glass.node_tree
    volume(glass, add(tree, "VolumeAbsorption", (image_node(tree).outputs[0], 0), Density=1.0))
    shown = render_patches()[0]
    absorbing(0.0)(glass)
    assert (shown < render_patches()[0] + 0.01).all()
