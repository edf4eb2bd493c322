"""The button Label Images: exact ids, masks and depths of a camera's view, written to files frame by frame.

In a window it works in steps of a timer while Blender's user continues, and Esc cancels it and keeps whole files.
Without one, or when a script calls it, it does the same in one go. The last frame's labels are shown in an open Image
Editor; no window opens for them.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
import numpy as np

from ..statistics.words import count_of, duration
from .piece_jobs import JobOperator, PiecesJob, prepare_free_folder
from .preview import set_in_editors
from .scan_request import ScannedFile, folder_of, frames_of, threads_of

if TYPE_CHECKING:
    from ..labels import Labels
    from ..labels.piece_labels import LabelPlan

PIECE = 10  # frames: the largest loss by a cancellation
OBJECTS, MASK, DEPTH = "Labels: Objects", "Labels: Mask", "Labels: Depth"  # of the images


class PERFECT_BVH_OT_label_images(JobOperator, bpy.types.Operator):
    """Steps through labelled frames in a timer."""

    bl_idname = "perfect_bvh.label_images"
    bl_label = "Label Images"
    bl_description = "Write exact object ids, masks and depth of what the camera sees. Esc cancels"
    bl_options: ClassVar = {"REGISTER"}
    doing = "Labelling"

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..extract.camera import has_camera

        settings = context.scene.perfect_bvh.label_images
        if settings.camera is None and not has_camera(context.scene):
            return "No camera: choose a Camera, or add one"
        if not settings.formats and not settings.use_coco:
            return "Nothing to output: choose a format"
        return None

    def _make_job(self, context: bpy.types.Context) -> LabelsJob:
        return LabelsJob(context.scene, context.view_layer)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        for warning in self._job.warnings:
            self._complain(warning, "WARNING")
        images = make_images(self._job.last, "" if context.object is None else context.object.name)
        text = self._job.summary(time.perf_counter() - self._started)
        if images and not set_in_editors(context, images[0]):
            text = f'{text}. The last frame is in the image "{images[0].name}": open an Image Editor to see it'
        self._conclude(text)
        return {"FINISHED"}


class LabelsJob(PiecesJob):
    """Labels of the frames that the panel asks for.

    Raises ValueError for what cannot be labelled and for a folder of other files, ImportError for a missing library,
    OSError for a folder that takes no files.
    """

    noun = "Labelling"

    def __init__(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        from ..extract.scene_in_time import has_simulations
        from ..labels.piece_labels import BEFORE, WHAT, LabelWork
        from ..live.scene_view import SceneView
        from ..pieces.piece import PieceFolder, scene_inputs

        settings, plan = scene.perfect_bvh.label_images, plan_of(scene)
        folder = folder_of(settings.folder)
        prepare_free_folder(folder)
        camera = "" if settings.camera is None else settings.camera.name
        begins = min(plan.frames) if has_simulations(scene) else None
        choices = {"size": plan.size, "category": plan.category, "layers": plan.layers, "format": list(plan.formats)}
        choices |= {"labels": [], "flow": False, "viewport": False, "no_coco": not plan.has_coco}
        choices |= {"depth_scale": plan.depth_scale, "camera": camera}
        self._file = ScannedFile(scene, view_layer)
        inputs = self._file.inputs_of(lambda arguments: scene_inputs(arguments, *choices, begins=begins), **choices)
        place = PieceFolder(folder, inputs, BEFORE, WHAT)
        work = LabelWork(SceneView("labels", scene, view_layer), plan, place, camera, self._take)
        self.last: Labels | None = None
        """Of the last frame that was labelled; None if all files were there."""
        super().__init__(work, folder, settings.use_resume)

    @property
    def warnings(self) -> list[str]:
        """Returns the warnings of all frames, each once."""
        return list(self._outcome.warnings)

    def summary(self, seconds: float) -> str:
        """Returns a sentence about the written files."""
        frames = self._outcome.counts.get("frames", 0)
        return f"Labelled {count_of(frames, 'frame')} into {self._folder}, {duration(1e3 * seconds)}"

    def _take(self, frame: int, labels: Labels) -> None:
        self._file.check_unedited(frame)
        self.last = labels


def plan_of(scene: bpy.types.Scene) -> LabelPlan:
    """Returns the plan of the panel's settings. Raises ValueError, and ImportError with the package to install."""
    from ..labels.files import FORMATS as ORDER
    from ..labels.files import check_formats
    from ..labels.piece_labels import LabelPlan

    settings = scene.perfect_bvh.label_images
    frames = frames_of(scene, settings)
    formats = tuple(name for name in ORDER if name in settings.formats)
    check_formats(formats)
    return LabelPlan(
        frames=(scene.frame_current,) if frames is None else tuple(range(frames[0], frames[1] + 1)),
        formats=formats,
        size=None if settings.use_render_size else (settings.width, settings.height),
        layers=settings.layers,
        category=settings.category.strip() or None,
        has_coco=settings.use_coco,
        piece=PIECE,
        threads=threads_of(scene),
    )


def make_images(labels: Labels | None, name: str) -> list[bpy.types.Image]:
    """Puts labels into images of Blender's: objects as colours, depth from white (near) to black, a mask.

    The mask is that of the object of this `name`, or of the one with most pixels: white where it is seen, grey where
    others hide it.
    """
    if labels is None:
        return []
    from ..scanning.point_data import colors_of_column

    height, width = labels.thing_ids.shape
    colors = colors_of_column(labels.thing_ids.ravel(), "ids").reshape(height, width, 4)
    is_there = labels.thing_ids >= 0
    depth, mask = np.zeros((2, height, width, 4), np.float32)
    depth[..., 3] = mask[..., 3] = 1.0
    if labels.things:
        largest = labels.things[int(labels.visible.areas.argmax())].name
        wanted = name if name in {thing.name for thing in labels.things} else largest
        for number in (number for number, thing in enumerate(labels.things) if thing.name == wanted):
            shades = np.where(labels.visible.image_of(number), 1.0, 0.4 * labels.amodal.image_of(number))
            mask[..., :3] = np.maximum(mask[..., :3], shades[..., None])
    if is_there.any():
        near, far = labels.depth[is_there].min(), labels.depth[is_there].max()
        grey = 1.0 - 0.9 * (labels.depth - near) / max(float(far - near), 1e-9)
        depth[..., :3] = np.where(is_there, grey, 0.0)[..., None]
    return [_store(OBJECTS, colors), _store(MASK, mask), _store(DEPTH, depth)]


def _store(name: str, pixels: Any) -> bpy.types.Image:
    height, width = pixels.shape[:2]
    image = bpy.data.images.get(name)
    if image is None or image.source != "GENERATED" or not image.is_float or image.library is not None:
        image = bpy.data.images.new(name, width, height, float_buffer=True)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
    image.update()
    return image


CLASSES = (PERFECT_BVH_OT_label_images,)
