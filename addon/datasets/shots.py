"""The camera's image of a frame as a PNG file, its labels, and the camera's matrices."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

from ..image.plan import plan_layer
from ..image.saving import save_image
from ..image.still import render_frame, warnings_of
from ..labels.label_image import label_steps
from ..labels.labels import Labels, describe_camera
from ..live.scene_sync import SceneSync
from ..settings.modes import mode_of_render

if TYPE_CHECKING:
    from ..live.scene_view import SceneMoment, SceneView

OF_A_PART = (
    "The image is black outside of the render border, but labels cover all of it: crop it to the border, or switch the "
    "border off"
)


def shoot(
    view: SceneView, sync: SceneSync, frame: int | None, path: Path
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """Write the image of a frame as `perfect-bvh render` makes it, in the mode and size that the file says.

    Args:
        sync: For such images; it does not watch Blender.
        frame: None for the current one.
        path: Of the PNG file.

    Returns:
        The camera, see `describe_camera`, and what the image lacks, as sentences. Without a camera None, and nothing is
        written.

    Raises:
        ValueError: For a camera or a mode that makes no picture, OSError for the file, and the errors of the engine.
    """

    def render(moment: SceneMoment) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
        if moment.camera is None:
            return None, ()
        mode = mode_of_render(moment.scene)
        if mode.has_range:
            raise ValueError(
                f"the mode {mode.word} has no colors: choose another in the render properties, such as lit"
            )
        plan = plan_layer(moment.depsgraph)
        plan.check_memory()
        shot = render_frame(sync, moment.depsgraph, plan, frame_set=moment.frame_set)
        save_image(path, shot.cut(shot.images["combined"]), moment.scene, mode)
        width, height = plan.size
        left, right, bottom, top = shot.window or (0, width, 0, height)
        assert sync.camera is not None  # render_frame would have refused
        camera = describe_camera(sync.camera, plan.size, (slice(height - top, height - bottom), slice(left, right)))
        is_part = not plan.is_cropped and plan.window != (0, width, 0, height)
        return camera, (*warnings_of(shot), *((OF_A_PART,) if is_part else ()))

    return view.read(render, frame)


def label(
    view: SceneView, sync: SceneSync, frame: int | None, category: str | None, threads: int
) -> Generator[float, None, Labels]:
    """Label the image of a frame in steps; see `label_steps`. frame: None for the current one."""

    def begin(moment: SceneMoment) -> Generator[float, None, Labels]:
        steps = label_steps(moment.depsgraph, sync, category=category, threads=threads)
        next(steps)  # which reads Blender, as long as its moment lasts
        return steps

    return (yield from view.read(begin, frame))


def read_pixels(path: Path) -> npt.NDArray[np.uint8]:
    """Read a PNG file of 8 bits: (H, W, 3) uint8, row 0 on top."""
    image = bpy.data.images.load(str(path))
    try:
        width, height = image.size
        values = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(values)
        return np.round(values.reshape(height, width, -1)[::-1, :, :3] * 255.0).astype(np.uint8)
    finally:
        bpy.data.images.remove(image)
