"""Custom corner normals that differ strongly from their triangles', under suns low over the triangles and below them.

A shadow ray starts there on the curved surface that the normals suggest. All of the light depends on whether the ray
hits a triangle, its own or a neighbour.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from oracles.cycles import render_beside  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

SIZE = 48
SAMPLES = 4
TILTS = [(30,), (75,), (20, 80), (-40, 60)]  # degrees, from corner to corner
ELEVATIONS = [5, -5, -15, -30]  # degrees over the triangles


@pytest.fixture
def scene() -> Iterator[Any]:
    """Sixteen level squares, 2 x 2 metres in all, seen from straight above, and a sun."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=4, y_subdivisions=4, size=2.0)
    bpy.context.object.data.shade_smooth()
    bpy.ops.object.light_add(type="SUN")
    light = bpy.context.object.data
    light.angle, light.energy = 0.0, math.pi
    bpy.ops.object.camera_add(location=(0.0, 0.0, 5.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 1.99
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


def lean(tilts: tuple[int, ...]) -> None:
    """Turn the normals of the grid's corners about y, by these angles in turn."""
    mesh = bpy.data.objects["Grid"].data
    angles = np.radians([tilts[i % len(tilts)] for i in range(len(mesh.loops))])
    normals = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
    mesh.normals_split_custom_set(normals.tolist())


def make_of(kind: str) -> None:
    material = bpy.data.materials.new("Surface")
    material.use_nodes = True
    tree = material.node_tree
    node = tree.nodes.new(kind)
    tree.links.new(node.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    bpy.data.objects["Grid"].data.materials.append(material)


def light_from(elevation: float) -> None:
    bpy.data.objects["Sun"].rotation_euler = (0.0, math.radians(90.0 - elevation), 0.0)


@pytest.mark.parametrize("kind", ["ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent"])
@pytest.mark.parametrize("tilts", TILTS, ids=str)
def test_low_suns_light_as_much_as_in_cycles(scene: Any, tilts: tuple[int, ...], kind: str) -> None:
    lean(tilts)
    make_of(kind)
    ours, theirs = [], []
    for elevation in ELEVATIONS:
        light_from(elevation)
        images = render_beside(scene, SAMPLES)
        for image, means in zip(images, (ours, theirs), strict=True):
            means.append(float(image[..., 0].mean()))
    assert max(theirs) > 0.05 or kind == "ShaderNodeBsdfTranslucent", "the suns light nothing"
    np.testing.assert_allclose(ours, theirs, rtol=0.01, atol=0.006)
