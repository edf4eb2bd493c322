"""Failure cases as files for Blender: each opens on the failure, with instructions next to it."""

from __future__ import annotations

from functools import partial
from typing import Any

import bpy

from ..opening import use_engine
from ..stage import light_world, open_stage
from . import CASES, find_case
from .instructions import PICTURED
from .lessons import lesson_of
from .pictures import picture_beside
from .scenes import fill_scene, frame_of
from .screens import show_lesson

# Of a viewport, so that it shows the colours that files get.
VIEW_TRANSFORMS = {"COST": "Standard", "WIREFRAME": "Standard", "INSTANCE": "Standard", "NORMAL": "Raw"}


def make(name: str) -> int:
    """Fills the file with one case; needs the add-on, which knows the settings of its engine. Returns the frame."""
    case = find_case(name)
    lesson = lesson_of(case)
    scene: Any = open_stage(case.title)
    light_world((0.6, 0.65, 0.7), 0.6)
    fill_scene(scene, case)
    use_engine(scene)
    scene.perfect_bvh.mode = lesson.mode
    scene.view_settings.view_transform = VIEW_TRANSFORMS[lesson.mode]
    text = bpy.data.texts.new(lesson.text_name)
    text.from_string(lesson.text)
    if lesson.compare is not None:
        scene.perfect_bvh.compare.left, scene.perfect_bvh.compare.right = lesson.compare
    bpy.context.view_layer.objects.active = next(item for item in scene.objects if item.type == "MESH")
    scene.frame_set(frame_of(lesson.state))
    show_lesson(text, picture_beside(scene, case, lesson) if case.name in PICTURED else None)
    return frame_of(lesson.state)


MAKERS = {f"zoo/{case.name}": partial(make, case.name) for case in CASES}
