"""The picture of the usual method as an image that a file holds, to be shown next to this engine's."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh_addon

from . import FailureCase
from .lessons import Lesson
from .scenes import stored_states
from .usual import Asked, Picture, usual_picture

SIZE = (240, 135)
STEPS = 16  # of each channel, so that the picture is small as a file


def picture_beside(scene: Any, case: FailureCase, lesson: Lesson) -> Any:
    """A packed image: the usual method's picture of the scene in its current state."""
    sync = perfect_bvh_addon.SceneSync(watch=False)
    sync.update(bpy.context.evaluated_depsgraph_get(), camera=scene.camera, size=SIZE)
    camera = sync.camera
    sync.close()
    assert camera is not None
    states = stored_states(case)[: lesson.state + 1]
    found = usual_picture(Asked(case, states, camera, lesson.mode, _rendered(scene)))
    pixels = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    pixels[..., :3] = np.round(found[::-1] * STEPS) / STEPS
    image = bpy.data.images.new(f"The usual method: {lesson.method}", *SIZE)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    image.use_fake_user = True
    return image


def _rendered(scene: Any) -> Picture:
    """The image of F12, (H, W, 3), row 0 on top."""
    render = scene.render
    before = render.resolution_x, render.resolution_y, render.filepath
    with tempfile.TemporaryDirectory() as folder:
        render.resolution_x, render.resolution_y = SIZE
        render.filepath = str(Path(folder) / "ours.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        pixels = np.array(image.pixels[:], np.float32).reshape(SIZE[1], SIZE[0], 4)
        bpy.data.images.remove(image)
    render.resolution_x, render.resolution_y, render.filepath = before
    return pixels[::-1, :, :3]
