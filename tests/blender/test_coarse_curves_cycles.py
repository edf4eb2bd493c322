"""Light on coarse smooth meshes that lie close together, compared with Cycles.

Where light comes in low over a triangle, its shadow ray starts on the curved surface that the normals suggest. No other
shadow ray does, and no ray that bounces: it would start beyond the neighbours that shade it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SAMPLES, PATCH = 64, 8


@pytest.fixture
def tiles() -> Iterator[Any]:
    """A roof of tiles, eight sides each, seen from above."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for place in range(7):
        bpy.ops.mesh.primitive_cylinder_add(vertices=8, radius=0.5, depth=8.0, location=(place - 3.0, 0.0, 0.0))
        bpy.context.object.rotation_euler = (np.pi / 2, 0.0, 0.0)
        bpy.context.object.data.shade_smooth()
    bpy.ops.object.light_add(type="SUN", rotation=(0.0, 1.2, 0.3))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 3.0, 0.1
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.3, 0.3, 0.3)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 9.0))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = 160, 96
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def test_tiles_shade_one_another_as_in_cycles(tiles: Any) -> None:
    """If all rays started on the curved surfaces, the image would be a tenth brighter."""
    ours, theirs = render_beside(tiles, SAMPLES)
    assert ours[..., :3].mean() == pytest.approx(theirs[..., :3].mean(), rel=0.01)
    patches = [image.reshape(96 // PATCH, PATCH, 160 // PATCH, PATCH, 4).mean(axis=(1, 3)) for image in (ours, theirs)]
    assert np.abs(patches[0] - patches[1]).max() < 0.02
