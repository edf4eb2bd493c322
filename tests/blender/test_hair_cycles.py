"""Fur compared with Cycles: its mean colour, channel by channel, in light from all around, before and behind.

The strands are round unless stated otherwise, straight from point to point, and do not overlap. Light that starts
inside another strand ends at its wall here, but passes it in Cycles. The means over the fur are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.hair_and_points import hair_object, make_poly  # noqa: E402
from oracles.cycles import render_beside, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES, SIZE, STRANDS = 128, 64, 1500
COLOR = {"parametrization": "COLOR", "Color": (0.8, 0.5, 0.2, 1.0)}
# Relative: 2 % of noise, and the documented agreement of 5 %. Absolute: a thousandth, for nearly black fur.
RELATIVE, ABSOLUTE = 0.06, 1e-3

FIBERS: dict[str, dict[str, Any]] = {
    "colored": COLOR,
    "sharp": {**COLOR, "Roughness": 0.15, "Radial Roughness": 0.2},
    "rough": {**COLOR, "Roughness": 0.6, "Radial Roughness": 0.7, "Coat": 0.5},
    "melanin": {"parametrization": "MELANIN", "Melanin": 0.5, "Melanin Redness": 0.6, "Tint": (0.9, 0.8, 0.7, 1.0)},
    "absorption": {"parametrization": "ABSORPTION", "Absorption Coefficient": (0.2, 0.5, 1.3)},
}


def strands() -> npt.NDArray[np.float64]:
    """(STRANDS, 5, 3): bent strands that grow out of a sphere in all directions."""
    random = np.random.default_rng(0)
    out = random.normal(size=(STRANDS, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    aside = np.cross(out, random.normal(size=(STRANDS, 3)))
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    steps = np.linspace(0.0, 1.0, 5)[None, :, None]
    return out[:, None] * (0.4 + 0.6 * steps) + aside[:, None] * (0.35 * steps**2)


@pytest.fixture
def scene() -> Iterator[Any]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    fur = hair_object("Fur", strands(), np.broadcast_to(0.005 * np.linspace(1.0, 0.5, 5), (STRANDS, 5)))
    make_poly(fur.data)
    fur.data.materials.append(bpy.data.materials.new("Hair"))
    bpy.ops.object.camera_add(location=(0.0, -4.2, 0.0), rotation=(np.pi / 2, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.film_transparent = True
    scene.cycles_curves.shape = "THICK"
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = fur.data.materials[0].use_nodes = True
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def shine(scene: Any, kind: str) -> None:
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0) if kind == "world" else (0.0, 0.0, 0.0, 1.0)
    if kind == "sun":
        bpy.ops.object.light_add(type="SUN", rotation=(0.9, 0.3, 0.4))
        bpy.context.object.data.energy, bpy.context.object.data.angle = 3.0, 0.05
    elif kind == "behind":
        bpy.ops.object.light_add(type="AREA", location=(0.5, 4.0, 1.0), rotation=(-np.pi / 2 - 0.2, 0.0, 0.1))
        bpy.context.object.data.energy, bpy.context.object.data.size = 200.0, 2.0


def make_hair(scene: Any, **values: Any) -> Any:
    """A material of the shader; values: of its settings and its inputs."""
    tree = scene.objects["Fur"].data.materials[0].node_tree
    node = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    for name, value in values.items():
        if name in {"model", "parametrization"}:
            setattr(node, name, value)
        else:
            next(socket for socket in node.inputs if socket.identifier == name).default_value = value
    tree.links.new(node.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    return node


def means(scene: Any) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the fur's mean colours, (3,) each, ours and Cycles'."""
    ours, theirs = (image[..., :3].sum(axis=(0, 1)) / image[..., 3].sum() for image in render_beside(scene, SAMPLES))
    return ours, theirs


@pytest.mark.parametrize("light", ["world", "sun", "behind"])
@pytest.mark.parametrize("fiber", FIBERS)
def test_fur_has_the_colour_that_cycles_gives_it(scene: Any, fiber: str, light: str) -> None:
    shine(scene, light)
    make_hair(scene, model="CHIANG", **FIBERS[fiber])
    ours, theirs = means(scene)
    assert theirs[0] > 5.0 * ABSOLUTE, "there is something to be seen"
    assert ours == pytest.approx(theirs, rel=RELATIVE, abs=ABSOLUTE)


@pytest.mark.parametrize("light", ["world", "sun", "behind"])
def test_fur_of_ribbons_has_the_colour_that_cycles_gives_it(scene: Any, light: str) -> None:
    scene.cycles_curves.shape = "RIBBONS"
    shine(scene, light)
    make_hair(scene, model="CHIANG", **COLOR)
    ours, theirs = means(scene)
    assert ours == pytest.approx(theirs, rel=RELATIVE, abs=ABSOLUTE)


@pytest.mark.parametrize(("shape", "offset"), [("THICK", 0.0), ("THICK", 0.035), ("RIBBONS", 0.035)])
def test_white_fur_in_a_white_room_is_not_to_be_seen(scene: Any, shape: str, offset: float) -> None:
    """Rays to the bright room, and rays that find it by themselves, lose no light on their way out of strands."""
    scene.cycles_curves.shape = shape
    shine(scene, "none")
    bpy.ops.mesh.primitive_ico_sphere_add(radius=10.0, subdivisions=3)
    material = bpy.data.materials.new("Bright")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(emission.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    bpy.context.object.data.materials.append(material)
    values = {"parametrization": "ABSORPTION", "Absorption Coefficient": (0.0, 0.0, 0.3), "Offset": offset}
    make_hair(scene, model="CHIANG", **values)
    scene.cycles.max_bounces = scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 200
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 64, False
    image = render_passes(scene, "PERFECT_BVH").combined
    assert image[..., :2].mean() == pytest.approx(1.0, abs=1e-3)
    assert image[..., :2] == pytest.approx(1.0, abs=0.1)
    assert image[..., 2].min() < 0.6, "what absorbs is seen"


def test_linked_colours_count(scene: Any) -> None:
    """A colour from nodes counts like a constant one."""
    shine(scene, "world")
    node = make_hair(scene, model="CHIANG", **COLOR)
    typed, _ = means(scene)
    tree = node.id_data
    color = tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = COLOR["Color"]
    node.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    tree.links.new(color.outputs[0], node.inputs["Color"])
    assert means(scene)[0] == pytest.approx(typed, rel=1e-3)
