"""What the image of a view took: the same figures as of a rendered frame, left for the panels."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...image.costs import owners_of
from ...image.refinement import Refinement
from ...statistics.frame_statistics import FrameStatistics, Source
from ...statistics.last_result import remember

if TYPE_CHECKING:
    import bpy

    from ...live.scene_sync import SceneSync


def remember_view(
    source: Source,
    sync: SceneSync,
    refinement: Refinement,
    scene: bpy.types.Scene,
    edits: int,
    *,
    has_own_mode: bool = False,
) -> None:
    """Leave for the panels what an image took that shows what `sync` holds. edits: of the scene, when it was read."""
    remember(scene, view_statistics(source, sync, refinement, has_own_mode), edits)


def view_statistics(
    source: Source, sync: SceneSync, refinement: Refinement, has_own_mode: bool = False
) -> FrameStatistics:
    """Of a finished image that shows what `sync` still holds; the report is that of its last change."""
    assert sync.last_change is not None
    plan = refinement.view.plan
    return FrameStatistics(
        frame=sync.record.frame,
        size=plan.size,
        settings=plan.settings,
        report=sync.last_change,
        trace_milliseconds=refinement.seconds * 1e3,
        camera_rays=refinement.ray_count,
        samples=refinement.mean_samples,
        owners=owners_of(sync, refinement.costs),
        source=source,
        has_own_mode=has_own_mode,
    )
