"""What users ask of motion blur: of objects and cameras Cycles' own switches and steps, where Cycles is enabled."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from ..sync.moments import MotionSettings
from ..sync.records import SceneRecord

_DEFAULT_STEPS = 3  # of Cycles: one at either end of the shutter, one in its middle
_MOST_STEPS = 129  # of Cycles, beyond which it asks for no more


def read_motion_settings(record: SceneRecord, camera: Any, steps: int | None) -> MotionSettings:
    """Of a scene's objects, and of its camera: the original object, None if it is none or cannot move.

    steps: of what has no number of its own; None: Cycles' default.
    """
    count = _DEFAULT_STEPS if steps is None else steps
    if not hasattr(bpy.types.Object, "cycles"):
        objects = [(count, True)] * len(record.objects)
        of_camera = count
    else:
        originals = {obj.session_uid: obj for obj in bpy.data.objects}
        found = (originals.get(obj.session_uid) for obj in record.objects)
        objects = [(count, True) if obj is None else _of_object(obj, count, steps is not None) for obj in found]
        of_camera = 0 if camera is None else _of_object(camera, count, steps is not None)[0]
    return MotionSettings(
        steps=np.array([row[0] for row in objects], np.int32),
        deforms=np.array([row[1] for row in objects], np.bool_),
        camera_steps=0 if camera is None else of_camera,
        camera_name="" if camera is None else camera.name,
        camera_uid=0 if camera is None else camera.session_uid,
    )


def _of_object(obj: Any, count: int, is_asked: bool) -> tuple[int, bool]:
    """Its steps, 0 if it is not to be blurred, and whether its shape may change. is_asked: whether count is no default.

    Who never set the steps has said nothing of them.
    """
    cycles = obj.cycles
    if not cycles.use_motion_blur:
        return 0, False
    if not is_asked or cycles.is_property_set("motion_steps"):
        count = min(2 ** max(1, cycles.motion_steps) + 1, _MOST_STEPS)
    return count, bool(cycles.use_deform_motion)
