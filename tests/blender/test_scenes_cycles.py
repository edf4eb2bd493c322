"""The example scenes compared with Cycles: the same light at the same places, within the noise of few samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

bpy = pytest.importorskip("bpy")

from oracles.cycles import render_beside  # noqa: E402

SCENES = Path(__file__).parents[2] / "blend_scenes"
SIZE, PATCH, SAMPLES = (128, 72), 8, 64
MEAN, MEDIAN = 0.015, 0.025  # of the channels' means, and of the patches' differences


def patches(image: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(H / PATCH, W / PATCH, 3): the mean colour of each patch; no single bright sample of either counts for many."""
    height, width = image.shape[0] // PATCH, image.shape[1] // PATCH
    bright = np.minimum(image[..., :3], 4.0 * image[..., :3].mean())
    return bright.reshape(height, PATCH, width, PATCH, 3).mean(axis=(1, 3))


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.blend")))
def test_an_example_scene_looks_as_in_cycles(registered: None, name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.use_motion_blur = False  # `test_motion_blur_cycles.py` compares it
    ours, theirs = map(patches, render_beside(scene, SAMPLES))
    np.testing.assert_allclose(ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1)), rtol=MEAN)
    difference = np.abs(ours - theirs).mean(axis=-1) / (theirs.mean(axis=-1) + 0.05 * theirs.mean())
    assert np.quantile(difference, 0.95) < 0.08, np.sort(difference.ravel())[-20:]
    assert np.median(difference) < MEDIAN
