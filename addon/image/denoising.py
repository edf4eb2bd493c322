"""Images without noise: a traced image is denoised as a plan says. On failure it keeps its noise, and says why.

Modules that need the native engine are imported where they are used: without it the add-on must still register.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..settings.preferences import denoiser_libraries
from ..support.memory import check_fits
from .plan import GUIDES, NOISY, RenderPlan

if TYPE_CHECKING:
    from collections.abc import Callable

    from perfect_bvh import Denoiser
    from perfect_bvh.denoise import DenoiseQuality, Prefilter

Image = npt.NDArray[np.float32]

# How images are denoised, from this number of samples a pixel on; viewports as if they had one. "high" lowers errors by
# some 10 %, which is worth it where its time is a small part of the whole (of images 480 pixels wide it takes 0.7 s
# more). With many samples, neighbours' too, the blended guides soon count as free of noise, but not where motion or a
# lens blurs them: there grain would stay in the image.
WAYS: tuple[tuple[int, DenoiseQuality, Prefilter], ...] = ((1, "fast", "fast"), (16, "high", "none"))
BLURRED: Prefilter = "accurate"  # with many samples, instead of "none"
# For the measurement of the noise that comes through, which needs only a rough result.
QUICK: DenoiseQuality = "fast"
# Memory of OpenImageDenoise: the images, and the layers of its network; it cuts large images into tiles.
BYTES_A_PIXEL, MOST_BYTES = 1100, 3 << 30


@dataclass(frozen=True, slots=True)
class Denoised:
    """The result.

    image: without noise, or unchanged. name: of the denoiser that was used, None for none. complaint: if it is not as
    it should be, why, as a sentence for the user.
    """

    image: Image
    name: str | None
    milliseconds: float
    complaint: str | None = None


class ImageDenoiser:
    """Denoises the images of one plan, as often as they become better; what takes time to set up is kept.

    Made on Blender's main thread or within a render.

    samples: how many each pixel has; 1 where that changes, see `WAYS`. is_blurred: whether motion or a lens blurs some.
    """

    def __init__(self, plan: RenderPlan, samples: int = 1, *, is_blurred: bool = False) -> None:
        self._plan = plan
        _, self._quality, self._prefilter = next(way for way in reversed(WAYS) if samples >= way[0])
        if is_blurred and self._prefilter == "none":
            self._prefilter = BLURRED
        self._libraries = denoiser_libraries()  # Blender is asked here: images may be denoised on any thread
        self._denoisers: dict[DenoiseQuality, Denoiser] = {}

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
            image = self._denoise(images, noise, progress)
        except perfect_bvh.Cancelled:
            raise
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._denoisers.clear()  # the next ones may have more luck
            reason = str(problem) or "there is no memory left"
            return Denoised(raw, None, _since(started), f"The image is not denoised: {reason}")
        complaint, denoiser = None, self._denoisers[self._quality]
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
            denoiser = self._make(self._quality, (raw.shape[1], raw.shape[0]))
            return denoiser.denoise(**_arguments(images), progress=progress)
        except perfect_bvh.Cancelled:
            raise
        except (ValueError, perfect_bvh.EngineError, MemoryError):
            return raw

    def _denoise(
        self,
        images: Mapping[str, npt.NDArray[Any]],
        noise: Mapping[str, npt.NDArray[Any]] | None,
        progress: Callable[[float], object] | None,
    ) -> Image:
        raw: Image = images["combined"]
        left, right, bottom, top = self._plan.window
        part = slice(len(raw) - top, len(raw) - bottom), slice(left, right)
        seen = {name: image[part] for name, image in images.items() if name in ("combined", *GUIDES)}
        errors = None if noise is None else {name: noise[name][part] for name in ("combined", NOISY)}
        made = self._without_noise(seen, errors, progress)
        if made.shape == raw.shape:
            return made
        whole = raw.copy()
        whole[part] = made
        return whole

    def _without_noise(
        self,
        images: Mapping[str, Image],
        noise: Mapping[str, Image] | None,
        progress: Callable[[float], object] | None,
    ) -> Image:
        """Restores real detail, if an estimate of the noise is available."""
        import perfect_bvh
        from perfect_bvh._arrays import share_of

        size = images["combined"].shape[1], images["combined"].shape[0]
        given = _arguments(images)
        if noise is None:
            return self._denoiser(self._quality, size).denoise(**given, progress=progress)
        denoised = self._denoiser(self._quality, size).denoise(**given, progress=share_of(progress, 0.0, 0.6))
        quick, part = denoised, share_of(progress, 0.6, 0.2)
        if self._quality != QUICK:
            quick = self._denoiser(QUICK, size).denoise(**given, progress=part)
        other = given | {"color": given["color"] - noise[NOISY]}
        let_through = quick - self._denoiser(QUICK, size).denoise(**other, progress=share_of(progress, 0.8, 0.2))
        guides = {"albedo": given["albedo"], "normal": given["normal"]}
        # The renderer's pixel filter is wider than the pixels that are denoised.
        clean, through = perfect_bvh.apply_pixel_filter(denoised), perfect_bvh.apply_pixel_filter(let_through)
        return perfect_bvh.restore_detail(images["combined"], noise["combined"], clean, through, **guides)

    def _denoiser(self, quality: DenoiseQuality, size: tuple[int, int]) -> Denoiser:
        """Returns a denoiser for images of the size that was requested first."""
        if quality not in self._denoisers:
            self._denoisers[quality] = self._make(quality, size)
        return self._denoisers[quality]

    def _make(self, quality: DenoiseQuality, size: tuple[int, int]) -> Denoiser:
        import perfect_bvh

        byte_count = min(size[0] * size[1] * BYTES_A_PIXEL, MOST_BYTES)
        check_fits("Denoising it", byte_count, "choose a smaller size")
        return perfect_bvh.Denoiser(
            size,
            prefilter=self._prefilter,
            quality=quality,
            threads=self._plan.settings.threads,
            libraries=self._libraries,
        )


def _arguments(images: Mapping[str, Image]) -> dict[str, Image]:
    """Returns a denoiser's arguments, by its names."""
    return {name.removeprefix("denoising_"): images[name] for name in GUIDES}


def _since(started: float) -> float:
    return (time.perf_counter() - started) * 1e3
