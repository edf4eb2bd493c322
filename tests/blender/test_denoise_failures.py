"""Renders that cannot be denoised: the raw image is left, and the reason is reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from blender.denoised import ask_for_data, combined, lit_cube, render  # noqa: E402
from perfect_bvh_addon.engine import RenderJob, attend  # noqa: E402
from perfect_bvh_addon.image import denoising  # noqa: E402


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    return lit_cube()


class Failing:
    """Stands in for a denoiser, and fails."""

    complaints = ()
    name = "Failing"

    def __init__(self, problem: BaseException, at_once: bool) -> None:
        self._problem, self._at_once = problem, at_once

    def __call__(self, *_: object, **__: object) -> Failing:
        if self._at_once:
            raise self._problem
        return self

    def denoise(self, *_: object, **__: object) -> np.ndarray:
        raise self._problem


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (perfect_bvh.EngineError("it is broken"), "it is broken"),
        (MemoryError(), "there is no memory left"),
        (ValueError("no"), "no"),
    ],
)
def test_a_failure_leaves_the_raw_image_and_says_so(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, problem: BaseException, reason: str, at_once: bool
) -> None:
    ask_for_data(scene)  # so that pixels share no samples here either
    raw = combined(scene, use_denoising=False)
    monkeypatch.setattr(perfect_bvh, "Denoiser", Failing(problem, at_once))
    frame = render()
    np.testing.assert_array_equal(frame.images["combined"], raw)
    assert frame.statistics.denoiser is None
    assert frame.statistics.complaints == (f"The image is not denoised: {reason}",)


def test_too_little_memory_is_found_before(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denoising, "MOST_BYTES", 1 << 60)
    monkeypatch.setattr(denoising, "BYTES_A_PIXEL", 1 << 50)
    (complaint,) = render().statistics.complaints
    assert complaint.startswith("The image is not denoised: Denoising it needs about") and "are free" in complaint


def test_a_library_that_is_there_and_does_not_work_is_told_of(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "libOpenImageDenoise.so.2"
    broken.write_text("no library")
    monkeypatch.setattr(denoising, "denoiser_libraries", lambda: (broken,))
    frame = render()
    (complaint,) = frame.statistics.complaints
    assert complaint.startswith(f"{frame.statistics.denoiser} denoises in place of another: ")
    assert str(broken) in complaint


def test_a_render_is_cancelled_while_it_is_denoised(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perfect_bvh, "Denoiser", Failing(perfect_bvh.Cancelled("cancelled"), False))
    job = RenderJob()
    with attend(job):
        bpy.ops.render.render()
    assert job.is_cancelled and job.frame is None
