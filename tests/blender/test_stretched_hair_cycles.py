"""Normals of hair whose object is scaled unevenly, mirrored or sheared, compared with Cycles' Normal pass.

Only pixels that show the same surface in both are compared. Strands are straight: Cycles draws a bent ribbon as a few
flat segments, so that normals differ by hundredths at even scale, too. Round strands have a constant width, because the
normals of Cycles ignore that a strand gets thinner. The ends of strands are spheres here and open in Cycles, so a tenth
of the pixels is left out. One pixel in a hundred may differ: at the edge of a strand, normals turn by hundredths within
the hundredth of a pixel that Cycles' rays come from.

Points are left out. For points, the normals of Cycles go from the centre to the surface, which is askew where a sphere
has become an ellipsoid. Ours are perpendicular to the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.hair_and_points import hair_object  # noqa: E402
from blender.particle_hair import emitter  # noqa: E402
from mathutils import Matrix  # noqa: E402
from oracles.cycles import render_cycles, render_passes  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

MATRICES = {
    "stretched": Matrix.Rotation(0.4, 4, "Z") @ Matrix.Diagonal((1.0, 1.6, 0.6, 1.0)),
    "stretched and mirrored": Matrix.Rotation(0.3, 4, "Y") @ Matrix.Diagonal((-1.5, 0.8, 1.2, 1.0)),
    "sheared": Matrix.Shear("XY", 4, (0.5, -0.4)) @ Matrix.Diagonal((1.0, 0.7, 1.0, 1.0)),
}
STRANDS = 30


def add_subject(kind: str) -> Any:
    """Straight strands around the origin, several pixels wide."""
    if kind == "particles":
        obj = emitter(squares=2, count=STRANDS, radius_scale=0.08)
        obj.data.transform(Matrix.Translation((-1.0, -1.0, 0.0)))
        return obj
    random = np.random.default_rng(4)
    roots, ways = random.uniform(-1.0, 1.0, (STRANDS, 3)), random.normal(size=(STRANDS, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    return hair_object("Hair", roots[:, None] + ways[:, None] * np.linspace(0.0, 1.0, 5)[:, None], 0.06)


@pytest.fixture
def scene() -> Iterator[Any]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(location=(0.0, -5.0, 2.0), rotation=(1.19, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y = 96, 72
    yield scene
    clear_syncs()
    perfect_bvh_addon.unregister()


@pytest.mark.parametrize("matrix", MATRICES)
@pytest.mark.parametrize(("kind", "shape"), [("particles", "RIBBONS"), ("curves", "RIBBONS"), ("curves", "THICK")])
def test_normals_are_those_of_cycles(scene: Any, kind: str, shape: str, matrix: str) -> None:
    scene.cycles_curves.shape = shape
    add_subject(kind).matrix_world = MATRICES[matrix]
    ours, theirs = render_passes(scene, "PERFECT_BVH"), render_cycles(scene)
    shown = theirs.depth < 1e9
    assert (shape == "THICK") or (shown == (ours.depth < 1e9)).mean() > 0.999
    both = shown & (np.abs(ours.depth / theirs.depth - 1.0) < 1e-4)
    assert both.sum() > 1000 and both.sum() > 0.9 * shown.sum()
    off = np.abs(ours.normal - theirs.normal).max(axis=-1)[both]
    assert np.median(off) < 2e-3
    assert (off > 0.03).mean() < 0.01
