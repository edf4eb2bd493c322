"""What the image of a view took: the same figures as of a rendered frame, left for the panels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..image.progressive import Refinement
from ..image.still import COST_PASSES, mesh_costs
from ..settings.scene_settings import RenderSettings, read_settings
from ..statistics.frame_statistics import FrameStatistics, Source
from ..statistics.last_result import edits_of, remember

if TYPE_CHECKING:
    import bpy

    from ..live.scene_sync import SceneSync

# Which meshes the rays spend their work on is asked of one pixel in so many, each way: nobody waits for it.
COST_STEP = 4


@dataclass(frozen=True, slots=True)
class Moment:
    """What a scene was when it was read: its settings, and how often it had been edited."""

    settings: RenderSettings
    edits: int

    @staticmethod
    def now(scene: bpy.types.Scene) -> Moment:
        """This one."""
        return Moment(read_settings(scene), edits_of(scene))


def remember_view(
    source: Source, sync: SceneSync, refinement: Refinement, scene: bpy.types.Scene, moment: Moment
) -> None:
    """Leave for the panels what an image took that shows what `sync` holds. moment: when that was read."""
    remember(scene, view_statistics(source, sync, refinement, moment.settings), moment.edits)


def view_statistics(
    source: Source, sync: SceneSync, refinement: Refinement, settings: RenderSettings
) -> FrameStatistics:
    """Of an image that shows what `sync` still holds; the report is that of its last change."""
    import perfect_bvh

    assert sync.last_change is not None
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
        frame=sync.record.frame,
        size=view.size,
        settings=settings,
        report=sync.last_change,
        trace_milliseconds=refinement.seconds * 1e3,
        camera_rays=refinement.ray_count,
        mesh_costs=mesh_costs(sync, images),
        source=source,
    )
