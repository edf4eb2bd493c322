"""Light that reaches a floor through glass, with Filter Glossy, compared with Cycles.

Paths that have spread see narrow lobes widened. The light that facets reflect between one another is computed before
the widening, as in Cycles: widened glass loses a little light, and does not shine.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.node_setups import new_red, shader  # noqa: E402
from blender.spheres import add_uv_sphere  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES = 128


@pytest.fixture
def floor() -> Iterator[Any]:
    """A white floor below a glass sphere that fills most of the sky; the camera sees the floor only."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    add_uv_sphere(segments=64, ring_count=32, radius=2.0, location=(0.0, 0.0, 2.2))
    ball = bpy.context.object
    ball.data.shade_smooth()
    glass = new_red("Glass")
    inputs = shader(glass).inputs
    inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    inputs["Transmission Weight"].default_value, inputs["Roughness"].default_value = 1.0, 0.0
    ball.data.materials.append(glass)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.8, 0.8, 0.8)
    bpy.ops.object.camera_add(location=(0.0, -3.5, 0.4), rotation=(1.2, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 60.0
    scene.render.resolution_x, scene.render.resolution_y = 128, 72
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


@pytest.mark.parametrize("blur", [0.0, 1.0])
def test_glass_passes_as_much_light_as_in_cycles(floor: Any, blur: float) -> None:
    floor.cycles.blur_glossy = blur
    ours, theirs = render_beside(floor, SAMPLES)
    low = slice(40, 72)  # the floor's part of the image
    assert ours[low, :, :3].mean() == pytest.approx(theirs[low, :, :3].mean(), rel=0.01)
