"""One frame: an evaluated depsgraph goes in, images and what they cost come out. Knows no RenderEngine and no file."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..settings.modes import find_mode
from ..settings.scene_settings import RenderSettings
from ..statistics.frame_statistics import FrameStatistics
from ..support.memory import check_fits
from ..sync.records import AttributeRequest, CameraRecord

if TYPE_CHECKING:
    import bpy

    from ..live.scene_sync import SceneSync
    from ..sync.report import SyncReport

Progress = Callable[[float], bool]
Images = dict[str, npt.NDArray[Any]]

CLAY_LIKE = frozenset({"clay", "matcap", "wireframe"})
CLAY_GREY = (0.8, 0.8, 0.8)
# Of a render at its greatest: two images, the light that is smoothed, passes, Blender's copies of them.
BYTES_A_PIXEL = 192
# What tells which meshes the camera rays spent their work on.
COST_PASSES = ("instance", "nodes_visited", "primitives_tested")


@dataclass(frozen=True, slots=True)
class Frame:
    """images: arrays of the whole frame, row 0 on top, by the renderer's pass names; empty if nothing was traced."""

    images: Images
    statistics: FrameStatistics


def needed_attributes(settings: RenderSettings, passes: tuple[str, ...]) -> AttributeRequest:
    """What a mode and its passes use; nothing else is read."""
    return AttributeRequest(
        material_slots=settings.mode in {"material", "preview"}
        or (settings.mode in CLAY_LIKE and settings.use_material_colors)
        or "material_index" in passes,
        corner_normals=settings.mode in {*CLAY_LIKE, "preview", "normal"} or "normal" in passes,
        corner_uvs=settings.mode == "uv",
        shading=settings.mode == "preview",
    )


def expected_rays(settings: RenderSettings, pixel_count: int) -> int:
    """How many rays an image of so many pixels casts at most: what building and refitting is weighed against."""
    mode = find_mode(settings.mode)
    samples = 1 if mode.has_range else settings.samples
    return pixel_count * samples * mode.rays_per_sample


def count_pixels(depsgraph: bpy.types.Depsgraph) -> int:
    """Of a render of the scene, inside its border."""
    from ..extract.camera import read_frame

    frame = read_frame(depsgraph.scene)
    left, right, bottom, top = border_pixels(frame.border, (frame.width, frame.height))
    return (right - left) * (top - bottom)


def check_size(depsgraph: bpy.types.Depsgraph) -> None:
    """Raises ValueError if there is no memory for a render of the scene."""
    from ..extract.camera import read_frame

    frame = read_frame(depsgraph.scene)
    what = f"An image of {frame.width:,} x {frame.height:,} pixels"
    check_fits(what, frame.width * frame.height * BYTES_A_PIXEL, "choose a smaller size")


def border_pixels(border: tuple[float, float, float, float], size: tuple[int, int]) -> tuple[int, int, int, int]:
    """(left, right, bottom, top) of a border given as fractions, in pixels from the lower left, as Blender rounds."""
    width, height = np.float32(size[0]), np.float32(size[1])
    left, right, bottom, top = (np.float32(edge) for edge in border)
    return int(left * width), int(right * width), int(bottom * height), int(top * height)


def render_frame(
    sync: SceneSync,
    depsgraph: bpy.types.Depsgraph,
    settings: RenderSettings,
    *,
    passes: tuple[str, ...] = (),
    progress: Progress | None = None,
    show: Callable[[Images], None] | None = None,
    trace: bool = True,
    camera: CameraRecord | None = None,
) -> Frame:
    """Bring a sync's scene in step with an evaluated depsgraph and trace it.

    passes: the renderer's names of what is wanted beside "combined". progress: called with 0..1, False cancels.
    show: called with the images each time they have become better, and at the end. trace: False to stop after
    the sync. camera: instead of the scene's.

    Raises ValueError if the scene has no usable camera, `perfect_bvh.Cancelled`, and what the engine raises.
    """
    sync.request(needed_attributes(settings, passes), only=True)
    # The bar stays at its beginning meanwhile, but a long build can be cancelled.
    report = sync.update(
        depsgraph,
        expected_rays(settings, count_pixels(depsgraph)),
        progress=None if progress is None else lambda _: progress(0.0),
        camera=camera,
    )
    if not trace:
        return Frame({}, FrameStatistics(depsgraph.scene.frame_current_final, sync.size, settings, report, 0.0, 0))
    if sync.camera is None:
        raise ValueError(missing_camera(depsgraph.scene, sync))
    return _trace(sync, settings, depsgraph.scene.frame_current_final, report, passes, progress, show)


def _trace(
    sync: SceneSync,
    settings: RenderSettings,
    frame: float,
    report: SyncReport,
    passes: tuple[str, ...],
    progress: Progress | None,
    show: Callable[[Images], None] | None,
) -> Frame:
    """The images of a scene that is in step, which has a camera. The arguments are those of `render_frame`."""
    import perfect_bvh

    assert sync.camera is not None
    start = time.perf_counter()
    images: Images = {}
    audit = perfect_bvh.RenderAudit(settings.audit_share) if settings.audit_share else None
    samples = 1 if find_mode(settings.mode).has_range else settings.samples
    for done, images in perfect_bvh.render_progressively(
        sync.scene,
        sync.camera,
        mode=settings.mode,
        size=sync.size,
        samples=samples,
        appearance=sync.appearance,
        passes=("combined", *passes, *COST_PASSES),
        progress=progress,
        threads=settings.threads,
        precision=settings.precision,  # type: ignore[arg-type]
        ao_distance=settings.ao_distance or None,
        clay_color=None if settings.use_material_colors else CLAY_GREY,
        audit=audit,
    ):
        if show is not None:
            show(images)
        # The renderer asks at intervals of time; a quick round would not be asked about at all.
        if progress is not None and not progress(done / samples) and done < samples:
            raise perfect_bvh.Cancelled("the render was cancelled")
    seconds = time.perf_counter() - start - (audit.seconds if audit else 0.0)
    left, right, bottom, top = border_pixels(sync.camera.border, sync.size)
    statistics = FrameStatistics(
        frame=frame,
        size=sync.size,
        settings=settings,
        report=report,
        trace_milliseconds=seconds * 1e3,
        camera_rays=(right - left) * (top - bottom) * samples,
        audit=audit.result if audit else None,
        audit_milliseconds=audit.seconds * 1e3 if audit else 0.0,
        mesh_costs=mesh_costs(sync, images),
    )
    return Frame({name: image for name, image in images.items() if name not in COST_PASSES}, statistics)


def missing_camera(scene: bpy.types.Scene, sync: SceneSync) -> str:
    """Why a scene whose sync has no camera cannot be rendered through one, as a sentence for the user."""
    # What is wrong with the camera that it has is the last of what could not be read.
    reason = f". {sync.warnings[-1]}" if scene.camera is not None and sync.warnings else ""
    return f"scene {scene.name!r} has no camera that can be rendered{reason}"


def mesh_costs(sync: SceneSync, images: Images) -> dict[int, float]:
    """The share of the work of all rays through pixel centres that went into those that end on each mesh, by its id."""
    seen = images["instance"].ravel()
    work = (images["nodes_visited"] + images["primitives_tested"]).ravel()
    ids, hit = sync.appearance.instances.ids, seen >= 0
    if not hit.any():
        return {}
    by_instance = np.bincount(seen[hit], weights=work[hit], minlength=int(ids.max()) + 1)[ids]
    by_mesh = np.bincount(sync.record.instances.mesh_indices, weights=by_instance)
    total = float(work.sum())
    return {int(sync.mesh_ids[row]): float(by_mesh[row]) / total for row in np.flatnonzero(by_mesh)}
