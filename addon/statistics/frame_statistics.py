"""What one image cost, however it was made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from perfect_bvh import Audit

    from ..settings.scene_settings import RenderSettings
    from ..sync.report import SyncReport
    from .owners import Owners

Source = Literal["Render", "View to Image", "Viewport"]


@dataclass(frozen=True, slots=True)
class FrameStatistics:
    """What one frame cost.

    source: what it was made for. size: (width, height). camera_rays: of all pixels in the border, 0 if untraced.
    samples: of a pixel, on average. trace_milliseconds: without those of the audit. audit: what checking a share of the
    camera rays has shown, None if it was not asked for. denoiser: its name, None if the image was not denoised;
    trace_milliseconds are without it too.
    complaints: what went wrong beside the scene itself, a sentence each.
    owners: which objects show which meshes, and how much of the camera rays' work each takes.
    has_own_mode: whether the mode is that of the viewport which it is a view of, and not the scene's.
    """

    frame: float
    size: tuple[int, int]
    settings: RenderSettings
    report: SyncReport
    trace_milliseconds: float
    camera_rays: int
    samples: float = 0.0
    audit: Audit | None = None
    audit_milliseconds: float = 0.0
    denoiser: str | None = None
    denoise_milliseconds: float = 0.0
    complaints: tuple[str, ...] = ()
    owners: Owners | None = None
    source: Source = "Render"
    has_own_mode: bool = False

    @property
    def rays_per_second(self) -> float:
        """Camera rays, with all that followed from each, a second; 0 if nothing was traced."""
        return self.camera_rays / self.trace_milliseconds * 1e3 if self.trace_milliseconds else 0.0
