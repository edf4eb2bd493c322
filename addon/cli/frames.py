"""One frame of a file after the other, rendered and written as images, on one scale of greys where there is one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments import CommandError
from .blender import render_job

if TYPE_CHECKING:
    import bpy
    import numpy as np
    import numpy.typing as npt

    from ..image.still import Frame


def render_frame(
    scene: bpy.types.Scene,
    number: int,
    progress: Callable[[float], bool],
    is_simulated: bool = False,
    for_viewport: bool = False,
) -> Frame | None:
    """A frame of a scene; None if it was stopped. progress: called with 0 to 1, False stops. Errors: CommandError."""
    from ..engine import RenderJob
    from ..live.scene_view import go_to_frame

    go_to_frame(scene, number, is_simulated or for_viewport)
    job = RenderJob(progress=progress, for_viewport=for_viewport)
    render_job(scene, job)
    if job.is_cancelled:
        return None
    if job.frame is None:
        raise CommandError(f"frame {number}: the engine gave no image")
    return job.frame


class ImageWriter:
    """Writes frames of a scene in its mode; distances as greys, near white, far black, on the first one's scale."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        from ..settings.modes import mode_of_render

        self._scene = scene
        self._mode = mode_of_render(scene)
        self.range: tuple[float, float] | None = None

    def has_scale(self, suffix: str) -> bool:
        """Whether files of this kind show distances on a scale that is that of the first frame."""
        return self._mode.has_range and suffix.lower() != ".exr"

    def save(self, path: Path, frame: Frame) -> None:
        """The image of a frame. Errors: CommandError."""
        from ..image.saving import save_image

        image = self._grey(frame) if self.has_scale(path.suffix) else frame.images["combined"]
        try:
            save_image(path, frame.cut(image), self._scene, self._mode)
        except OSError as error:
            raise CommandError(error.strerror or str(error)) from error

    def measure(self, frame: Frame) -> None:
        """Takes the scale of this frame, unless there is one."""
        from perfect_bvh.render import NO_DEPTH

        if self.range is None:
            distances = frame.images["combined"][..., 0]
            hit = distances[(distances > 0.0) & (distances < NO_DEPTH)]  # what lies outside of a border has none
            self.range = (float(hit.min()), float(hit.max())) if hit.size else (0.0, 1.0)

    def _grey(self, frame: Frame) -> npt.NDArray[np.float32]:
        import numpy as np
        from perfect_bvh.render import depth_to_grey

        self.measure(frame)
        image = frame.images["combined"]
        greys = depth_to_grey(image[..., 0], *self.range)
        return np.stack([greys, greys, greys, image[..., 3]], axis=-1)


def warnings_of(frame: Frame) -> tuple[str, ...]:
    """What a frame lacks, and what went wrong, as sentences."""
    report = frame.statistics.report
    return (*report.warnings, *map(str, report.not_shown), *frame.statistics.complaints)
