"""Failure cases as files for Blender: each opens on what fails, with what to do beside it."""

from __future__ import annotations

import atexit
from functools import partial
from typing import Any

import bpy

from ..stage import light_world, open_stage
from . import CASES, find_case
from .lessons import lesson_of
from .scenes import fill_scene, frame_of
from .screens import show_lesson

ENGINE = "PERFECT_BVH"


def make(name: str) -> int:
    """Fills the file with one case; needs the add-on, which knows the settings of its engine. Returns the frame."""
    import perfect_bvh_addon

    case = find_case(name)
    lesson = lesson_of(case)
    scene: Any = open_stage(case.title)
    if not hasattr(bpy.types.Scene, "perfect_bvh"):
        perfect_bvh_addon.register()
        atexit.register(perfect_bvh_addon.unregister)  # Blender's module does not end well without
    light_world((0.6, 0.65, 0.7), 0.6)
    fill_scene(scene, case)
    scene.render.engine = ENGINE
    scene.perfect_bvh.mode = lesson.mode
    text = bpy.data.texts.new(lesson.text_name)
    text.from_string(lesson.text)
    show_lesson(text)
    return frame_of(lesson.state)


MAKERS = {f"zoo/{case.name}": partial(make, case.name) for case in CASES}
