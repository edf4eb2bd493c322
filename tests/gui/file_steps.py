"""Another file, an engine that cannot be loaded, the add-on switched off and on."""

from __future__ import annotations

import gc
import statistics
import sys
import time

import bpy
from addon_state import MODULE, check_shows_something, finished, image, measured, module, settings, space, viewports
from driver import Step, at_rest, check, redraw, redrawn, screenshot
from hands import set_viewport_size
from places import area_of, context_of


def open_another_file() -> Step:
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath.replace("tree_in_wind", "courtyard"))
    yield from redrawn()
    yield from set_viewport_size(960, 540)
    bpy.context.scene.render.engine = "PERFECT_BVH"
    settings().samples = 2
    space().overlay.show_overlays = False
    area_of("PROPERTIES").spaces.active.context = "RENDER"
    space().shading.type = "RENDERED"
    yield from finished("another file")
    gc.collect()
    check_shows_something(image(), "another file")


def first_image_after_an_edit() -> Step:
    """How long Blender is away for a moved object: its trees brought in step, its new image drawn and swapped.

    The step waits for the trees even where a slow machine would show its last image first.
    """
    pending_commit = module("live.pending_commit")
    before, pending_commit.BUILDING_SECONDS = pending_commit.BUILDING_SECONDS, 60.0
    obj = max((obj for obj in bpy.data.objects if obj.type == "MESH"), key=lambda obj: len(obj.data.polygons))
    times = []
    for _ in range(5):
        revisions = sum(viewport._key.revision for viewport in viewports())
        started = time.perf_counter()
        obj.location.z += 0.01
        bpy.context.view_layer.update()
        redraw()
        times.append((time.perf_counter() - started) * 1e3)
        check(sum(viewport._key.revision for viewport in viewports()) > revisions, "the first image shows no edit")
        yield from redrawn()
    pending_commit.BUILDING_SECONDS = before
    yield from finished("moved object")
    measured["first image after an edit of courtyard, ms"] = statistics.median(times)
    times = []
    for _ in range(3):
        started = time.perf_counter()
        redraw()
        times.append((time.perf_counter() - started) * 1e3)
        yield 0.1
    measured["a redraw without an edit, ms"] = statistics.median(times)


def lose_the_engine() -> Step:
    """A native module that cannot be loaded: the panel and each render say so, and Blender goes on."""
    bpy.ops.preferences.addon_disable(module=MODULE)
    names = [name for name in sys.modules if name.partition(".")[0] == "perfect_bvh"]
    kept = {name: sys.modules.pop(name) for name in names}
    sys.modules["perfect_bvh"] = None  # importing it raises ImportError, as a damaged file would
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield from redrawn()
    bpy.context.scene.render.engine = "PERFECT_BVH"
    yield from at_rest(area_of("PROPERTIES"))
    check("could not be loaded" in (module("settings.preferences").native_error() or ""), "the engine is not missed")
    screenshot("without_engine")
    try:
        with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
            bpy.ops.render.render()
    except RuntimeError as problem:
        check("could not be loaded" in str(problem), str(problem))
    else:
        check(False, "a render without the engine has succeeded")
    bpy.ops.preferences.addon_disable(module=MODULE)
    sys.modules.update(kept)
    bpy.ops.preferences.addon_enable(module=MODULE)
    bpy.context.scene.render.engine = "PERFECT_BVH"
    yield from finished("the engine is back")


def disable_and_enable() -> Step:
    bpy.ops.preferences.addon_disable(module=MODULE)
    yield from at_rest(area_of("PROPERTIES"))
    check(not hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is still there")
    screenshot("disabled")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield from redrawn()
    bpy.context.scene.render.engine = "PERFECT_BVH"
    space().shading.type = "RENDERED"
    yield from finished("enabled again")


def report() -> Step:
    for name, value in measured.items():
        print(f"MEASURED {name}: {value:.1f}", flush=True)
    yield 0.1
