"""One frame: from an evaluated depsgraph to images and their cost. Does not depend on RenderEngine or files."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

from ..statistics.last_result import FrameStatistics
from .denoising import Denoised, ImageDenoiser
from .plan import PassSpec, RenderPlan, Window, owners_of, trace_costs

if TYPE_CHECKING:
    from ..live.scene_sync import SceneSync
    from ..sync.records import CameraRecord
    from ..sync.report import SyncReport


Progress = Callable[[float], bool]
Tell = Callable[[str], object]
FrameSet = Callable[[int, float], object]
CameraReader = Callable[["bpy.types.Depsgraph"], "CameraRecord | None"]
Images = dict[str, npt.NDArray[Any]]

# The progress of a frame when the trees are built, and when the last sample is traced if denoising follows.
BUILT, TRACED = 0.05, 0.9


@dataclass(frozen=True, slots=True)
class Frame:
    """The result of a render.

    images: arrays of the whole frame, row 0 on top, by the renderer's pass names; "combined" is denoised if
    requested. Empty if nothing was traced.
    window: (left, right, bottom, top), the part that a file holds, in pixels from the lower left; None for all.
    """

    images: Images
    statistics: FrameStatistics
    window: Window | None = None

    def cut(self, image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Returns the part that a file holds of an image of the whole frame."""
        if self.window is None:
            return image
        left, right, bottom, top = self.window
        return image[len(image) - top : len(image) - bottom, left:right]


def warnings_of(frame: Frame) -> tuple[str, ...]:
    """Returns what a frame lacks, and its errors, as sentences."""
    report = frame.statistics.report
    return (*report.warnings, *map(str, report.not_shown), *frame.statistics.complaints)


def bring_in_step(
    sync: SceneSync,
    depsgraph: bpy.types.Depsgraph,
    plan: RenderPlan,
    *,
    progress: Progress | None = None,
    tell: Tell | None = None,
    camera: CameraReader | None = None,
    frame_set: FrameSet | None = None,
) -> SyncReport:
    """Reads the data that the plan needs from a depsgraph, and builds its trees. The arguments: see `render_frame`."""
    sync.request(plan.attributes, only=True)
    if tell is not None:
        tell("Reading")
    return sync.update(
        depsgraph,
        plan.expected_rays,
        progress=_part(progress, tell, (0.0, BUILT), lambda done: f"Building BVHs {done:.0%}"),
        camera=camera,
        size=plan.frame,
        shutter=None if plan.motion is None else (plan.motion.begin, plan.motion.end),
        frame_set=frame_set if plan.motion is not None else None,
    )


def render_frame(
    sync: SceneSync,
    depsgraph: bpy.types.Depsgraph,
    plan: RenderPlan,
    *,
    progress: Progress | None = None,
    tell: Tell | None = None,
    show: Callable[[Images], None] | None = None,
    camera: CameraReader | None = None,
    frame_set: FrameSet | None = None,
) -> Frame:
    """Synchronizes a scene with an evaluated depsgraph and traces the planned image.

    Args:
        sync: Holds the scene; data that does not change from frame to frame is not read again.
        depsgraph: The evaluated scene.
        plan: The image to trace.
        progress: Called with 0..1 of the whole frame; returning False cancels.
        tell: Called with a short text for users each time before `progress`: "Reading", "Building BVHs 40%",
            "Sample 3/16" or "Denoising".
        show: Called with the images after each round of samples.
        camera: Reads the camera of a depsgraph; None for the scene's camera.
        frame_set: Evaluates the depsgraph at another frame and subframe, for motion; None for the scene's own.

    Raises:
        ValueError: If the scene has no usable camera.
        perfect_bvh.Cancelled: If `progress` returned False.
        EngineError, MemoryError: From the engine.
    """
    report = bring_in_step(sync, depsgraph, plan, progress=progress, tell=tell, camera=camera, frame_set=frame_set)
    if sync.camera is None:
        raise ValueError(missing_camera(depsgraph.scene, sync))
    return _trace(sync, plan, depsgraph.scene.frame_current_final, report, progress, tell, show)


def _part(
    progress: Progress | None, tell: Tell | None, span: tuple[float, float], text: Callable[[float], str]
) -> Progress | None:
    """Returns the progress of a stage, from 0 to 1, as a span of the frame's. text: the name of the stage."""
    if progress is None:
        return None

    def advance(done: float) -> bool:
        if tell is not None:
            tell(text(done))
        return progress(span[0] + done * (span[1] - span[0]))

    return advance


def _trace(
    sync: SceneSync,
    plan: RenderPlan,
    frame: float,
    report: SyncReport,
    progress: Progress | None,
    tell: Tell | None,
    show: Callable[[Images], None] | None,
) -> Frame:
    """Traces the images of a synced scene, which has a camera. The arguments are those of `render_frame`."""
    import perfect_bvh

    traced = TRACED if plan.is_denoised else 1.0
    sampled = _part(progress, tell, (BUILT, traced), lambda done: f"Sample {round(done * plan.samples)}/{plan.samples}")
    denoised_part = _part(progress, tell, (traced, 1.0), lambda _: "Denoising")

    assert sync.camera is not None
    start = time.perf_counter()
    images: Images = {}
    done = 0
    noise: Images | None = {} if plan.is_denoised else None
    sampling = plan.make_sampling()
    audit_share = plan.settings.audit_share
    audit = perfect_bvh.RenderAudit(audit_share) if audit_share else None
    shutter = None if plan.motion is None else plan.motion.make_shutter(sync.camera_motion)
    for done, images in perfect_bvh.render_progressively(
        sync.scene,
        sync.camera,
        mode=plan.settings.mode,
        size=plan.size,
        samples=plan.samples,
        appearance=sync.appearance,
        passes=("combined", *plan.traced_passes),
        time_limit=plan.settings.time_limit,
        sampling=sampling,
        noise=noise,
        progress=sampled,
        shutter=shutter,
        audit=audit,
        **plan.options,
    ):
        if show is not None:
            show(images)
        # The renderer asks at intervals of time; a quick round would not be asked about at all.
        share = 1.0 if sampling is not None and sampling.is_finished else done / plan.samples
        if sampled is not None and not sampled(share) and share < 1.0:
            raise perfect_bvh.Cancelled("the render was cancelled")
    # Counting the image's cost is short, but can be cancelled.
    at_end = None if progress is None else lambda _: progress(traced)
    costs = trace_costs(sync.scene, sync.camera, plan.size, sync.appearance, plan.settings.threads, at_end, shutter)
    seconds = time.perf_counter() - start - (audit.seconds if audit else 0.0)
    is_blurred = sync.camera.lens is not None or (plan.motion is not None and plan.motion.blurs)
    if plan.is_denoised and denoised_part is not None:
        denoised_part(0.0)  # the built-in filter reports no progress
    denoised = _denoise(plan, images, noise if done > 1 else None, done, is_blurred, denoised_part)
    if progress is not None:
        progress(1.0)  # the denoiser may end without saying so; there is nothing left to cancel
    statistics = FrameStatistics(
        frame=frame,
        size=plan.size,
        settings=plan.settings,
        report=report,
        trace_milliseconds=seconds * 1e3,
        camera_rays=plan.pixel_count * done if sampling is None else sampling.ray_count,
        samples=done if sampling is None else sampling.mean_samples,
        audit=audit.result if audit else None,
        audit_milliseconds=audit.seconds * 1e3 if audit else 0.0,
        denoiser=denoised.name,
        denoise_milliseconds=denoised.milliseconds,
        complaints=() if denoised.complaint is None else (denoised.complaint,),
        owners=owners_of(sync, costs),
    )
    made = images | {"combined": denoised.image}
    shown = {name: made[name] for name in ("combined", *plan.passes)}
    return Frame(shown, statistics, plan.window if plan.is_cropped else None)


def _denoise(
    plan: RenderPlan,
    images: Images,
    noise: Images | None,
    samples: int,
    is_blurred: bool,
    progress: Progress | None,
) -> Denoised:
    """Denoises as the plan says."""
    if not plan.is_denoised:
        return Denoised(images["combined"], None, 0.0)
    return ImageDenoiser(plan, samples, is_blurred=is_blurred).denoise(images, noise, progress)


def missing_camera(scene: bpy.types.Scene, sync: SceneSync) -> str:
    """Why a scene whose sync has no camera cannot be rendered through one, as a sentence for the user."""
    # An unusable camera is the last warning.
    reason = f". {sync.warnings[-1]}" if scene.camera is not None and sync.warnings else ""
    way_out = reason or ": add one with Add > Camera, or choose one in the scene's properties"
    return f"scene {scene.name!r} has no camera that can be rendered{way_out}"


def write_passes(
    layer: bpy.types.RenderLayer,
    specs: tuple[PassSpec, ...],
    images: Images,
    window: Window,
) -> None:
    """Copies the traced images into their passes of a render result, whose rows begin at the bottom.

    specs: of the layer's passes except Combined. images: (H, W) or (H, W, channels), row 0 on top, by the renderer's
    names.
    window: (left, right, bottom, top) in pixels, from the lower left.
    """
    left, right, bottom, top = window
    sources = {"Combined": "combined"} | {spec.name: spec.source for spec in specs}
    for render_pass in layer.passes:
        source = sources.get(render_pass.name)
        if source is not None:
            image = images[source]
            part = image[::-1][bottom:top, left:right]
            render_pass.rect.foreach_set(np.ascontiguousarray(part, np.float32).ravel())
