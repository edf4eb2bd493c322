"""What the image of a view took: the same figures as of a rendered frame, left for the panels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..image.progressive import Refinement
from ..image.still import COST_PASSES, mesh_costs
from ..statistics.frame_statistics import FrameStatistics, Source
from ..statistics.last_result import remember

if TYPE_CHECKING:
    import bpy

    from ..live.scene_sync import SceneSync

# Which meshes the rays spend their work on is asked of one pixel in so many, each way: no one waits for it.
COST_STEP = 4


def remember_view(source: Source, sync: SceneSync, refinement: Refinement, scene: bpy.types.Scene, edits: int) -> None:
    """Leave for the panels what an image took that shows what `sync` holds. edits: of the scene, when it was read."""
    remember(scene, view_statistics(source, sync, refinement), edits)


def view_statistics(source: Source, sync: SceneSync, refinement: Refinement) -> FrameStatistics:
    """Of an image that shows what `sync` still holds; the report is that of its last change."""
    import perfect_bvh

    assert sync.last_change is not None
    view = refinement.view
    plan = view.plan
    width, height = plan.size
    images = perfect_bvh.render_passes(
        view.snapshot,
        view.camera,
        mode="cost",
        size=(max(1, width // COST_STEP), max(1, height // COST_STEP)),
        appearance=view.appearance,
        passes=COST_PASSES,
        threads=plan.settings.threads,
    )
    return FrameStatistics(
        frame=sync.record.frame,
        size=plan.size,
        settings=plan.settings,
        report=sync.last_change,
        trace_milliseconds=refinement.seconds * 1e3,
        camera_rays=refinement.ray_count,
        mesh_costs=mesh_costs(sync, images),
        source=source,
    )
