"""Images without noise: what was traced, denoised as a plan says. What fails leaves the image as it was, and says why.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..settings.denoisers import denoiser_libraries
from ..support.memory import check_fits
from .plan import GUIDES, NOISY, RenderPlan

if TYPE_CHECKING:
    from collections.abc import Callable

    from perfect_bvh import Denoiser
    from perfect_bvh.denoise import DenoiseQuality

Image = npt.NDArray[np.float32]

# How well images are denoised, from so many samples a pixel on; viewports as if they had one. What takes longer is
# worth it where it is a small part of the whole: a network of twice the size lowers errors by some 3 %, of five times
# by as much again (of images 480 pixels wide in 0.3 and 1.3 s more). Guides are blended from so many samples that
# nothing is gained by denoising them first.
QUALITIES: tuple[tuple[int, DenoiseQuality], ...] = ((1, "fast"), (16, "balanced"), (64, "high"))
# Of OpenImageDenoise: the images, and what the layers of its network hold; it cuts large images into tiles.
BYTES_A_PIXEL, MOST_BYTES = 1100, 3 << 30


@dataclass(frozen=True, slots=True)
class Denoised:
    """What came of it.

    image: without noise, or as it was. name: of what has denoised it, None if nothing has. complaint: if it is not as
    it should be, why, as a sentence for the user.
    """

    image: Image
    name: str | None
    milliseconds: float
    complaint: str | None = None


class ImageDenoiser:
    """Denoises the images of one plan, as often as they become better; what takes time to set up is kept.

    Made on Blender's main thread or within a render.

    samples: how many each pixel has; 1 where that changes, see `QUALITIES`.
    """

    def __init__(self, plan: RenderPlan, samples: int = 1) -> None:
        self._plan = plan
        self._quality = next(quality for least, quality in reversed(QUALITIES) if samples >= least)
        self._libraries = denoiser_libraries()  # Blender is asked here: images may be denoised on any thread
        self._denoiser: Denoiser | None = None

    def denoise(
        self,
        images: Mapping[str, npt.NDArray[Any]],
        noise: Mapping[str, npt.NDArray[Any]] | None,
        progress: Callable[[float], object] | None = None,
    ) -> Denoised:
        """A new image from "combined" and `GUIDES`, all of the plan's size. From any thread.

        noise: of "combined" and `NOISY`, see `perfect_bvh.restore_detail`; None as long as there is a single round of
        samples. progress: called with the share done, 0 to 1, False cancels.

        Raises `perfect_bvh.Cancelled` and nothing else.
        """
        import perfect_bvh

        started = time.perf_counter()
        raw: Image = images["combined"]
        try:
            image, denoiser = self._denoise(images, noise, progress)
        except perfect_bvh.Cancelled:
            raise
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._denoiser = None  # the next one may have more luck
            reason = str(problem) or "there is no memory left"
            return Denoised(raw, None, _since(started), f"The image is not denoised: {reason}")
        complaint = None
        if denoiser.complaints:
            complaint = f"{denoiser.name} denoises in place of another: {'; '.join(denoiser.complaints)}"
        return Denoised(image, denoiser.name, _since(started), complaint)

    def denoise_coarse(
        self, images: Mapping[str, npt.NDArray[Any]], progress: Callable[[float], object] | None = None
    ) -> Image:
        """The same for all or some rows of a coarse image; they stay where it fails: the full image will say why."""
        import perfect_bvh

        raw: Image = images["combined"]
        try:
            return self._make((raw.shape[1], raw.shape[0])).denoise(**_arguments(images), progress=progress)
        except perfect_bvh.Cancelled:
            raise
        except (ValueError, perfect_bvh.EngineError, MemoryError):
            return raw

    def _denoise(
        self,
        images: Mapping[str, npt.NDArray[Any]],
        noise: Mapping[str, npt.NDArray[Any]] | None,
        progress: Callable[[float], object] | None,
    ) -> tuple[Image, Denoiser]:
        raw: Image = images["combined"]
        left, right, bottom, top = self._plan.window
        part = slice(len(raw) - top, len(raw) - bottom), slice(left, right)
        denoiser = self._denoiser
        if denoiser is None:
            denoiser = self._denoiser = self._make((right - left, top - bottom))
        seen = {name: image[part] for name, image in images.items() if name in ("combined", *GUIDES)}
        errors = None if noise is None else {name: noise[name][part] for name in ("combined", NOISY)}
        made = _without_noise(denoiser, seen, errors, progress)
        if made.shape == raw.shape:
            return made, denoiser
        whole = raw.copy()
        whole[part] = made
        return whole, denoiser

    def _make(self, size: tuple[int, int]) -> Denoiser:
        import perfect_bvh

        byte_count = min(size[0] * size[1] * BYTES_A_PIXEL, MOST_BYTES)
        check_fits("Denoising it", byte_count, "choose a smaller size")
        return perfect_bvh.Denoiser(
            size,
            prefilter="none",
            quality=self._quality,
            threads=self._plan.settings.threads,
            libraries=self._libraries,
        )


def _without_noise(
    denoiser: Denoiser,
    images: Mapping[str, Image],
    noise: Mapping[str, Image] | None,
    progress: Callable[[float], object] | None,
) -> Image:
    """What is no noise is put back, where it is known how much of that there is."""
    import perfect_bvh
    from perfect_bvh._batches import share_of

    given = _arguments(images)
    if noise is None:
        return denoiser.denoise(**given, progress=progress)
    denoised = denoiser.denoise(**given, progress=share_of(progress, 0.0, 0.5))
    other = given | {"color": given["color"] - noise[NOISY]}
    again = denoiser.denoise(**other, progress=share_of(progress, 0.5, 0.5))
    guides = {"albedo": given["albedo"], "normal": given["normal"]}
    return perfect_bvh.restore_detail(images["combined"], noise["combined"], denoised, again, **guides)


def _arguments(images: Mapping[str, Image]) -> dict[str, Image]:
    """Of a denoiser, by its names."""
    return {name.removeprefix("denoising_"): images[name] for name in GUIDES}


def _since(started: float) -> float:
    return (time.perf_counter() - started) * 1e3
