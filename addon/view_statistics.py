"""What the image of a view took: the same figures as of a rendered frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .frame import COST_PASSES, FrameStatistics, Source, mesh_costs
from .properties import RenderSettings
from .refinement import Refinement

if TYPE_CHECKING:
    from .scene_sync import SceneSync
    from .sync.report import SyncReport

# Which meshes the rays spend their work on is asked of one pixel in so many, each way: nobody waits for it.
COST_STEP = 4


def view_statistics(
    source: Source,
    sync: SceneSync,
    report: SyncReport,
    refinement: Refinement,
    settings: RenderSettings,
    frame: float,
) -> FrameStatistics:
    """Of an image that shows what `sync` still holds. report: of the sync's last change."""
    import perfect_bvh

    view = refinement.view
    width, height = view.size
    images = perfect_bvh.render_passes(
        view.snapshot,
        view.camera,
        mode="cost",
        size=(max(1, width // COST_STEP), max(1, height // COST_STEP)),
        appearance=view.appearance,
        passes=COST_PASSES,
        threads=settings.threads,
    )
    return FrameStatistics(
        frame=frame,
        size=view.size,
        settings=settings,
        report=report,
        trace_milliseconds=refinement.seconds * 1e3,
        camera_rays=refinement.ray_count,
        mesh_costs=mesh_costs(sync, images),
        source=source,
    )
