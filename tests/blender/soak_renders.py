"""Renders by the add-on's engine amid random edits: a render after earlier ones must equal that of a fresh add-on."""

from __future__ import annotations

import bpy
import numpy as np
import perfect_bvh_addon
from blender.builders import camera_object
from perfect_bvh_addon.engine import RenderJob, attend
from perfect_bvh_addon.image.still import Images


def find_different_passes(*, is_stopped_first: bool) -> list[str]:
    """Name the passes in which two renders differ, the renders that failed, and a stop that had no effect."""
    scene = bpy.context.scene
    engine, mode = scene.render.engine, scene.perfect_bvh.mode
    if scene.camera is None:
        camera_object("render camera")
    try:
        scene.perfect_bvh.mode, scene.perfect_bvh.samples = "PREVIEW", 2
        scene.render.use_persistent_data = True
        stopped = _render(RenderJob(progress=lambda _: False)) if is_stopped_first else None
        usual = _render(RenderJob())
        perfect_bvh_addon.unregister()
        perfect_bvh_addon.register()
        fresh = _render(RenderJob())
    finally:
        scene.render.engine, scene.perfect_bvh.mode = engine, mode
    if stopped is not None and not stopped.is_cancelled:
        return ["a render that was stopped went on"]
    if usual.frame is None or fresh.frame is None:
        return ["a render gave no image"]
    return _compare(usual.frame.images, fresh.frame.images)


def _render(job: RenderJob) -> RenderJob:
    scene = bpy.context.scene
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.use_denoising = False  # the comparison needs no denoising
    with attend(job):
        bpy.ops.render.render()
    return job


def _compare(usual: Images, fresh: Images) -> list[str]:
    if usual.keys() != fresh.keys():
        return ["the list of passes"]
    return [
        f"rendered {name}" for name, image in usual.items() if not np.array_equal(image, fresh[name], equal_nan=True)
    ]
