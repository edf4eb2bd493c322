"""Rendered shading of 3D viewports: modes, views, playback, edits, several at once."""

from __future__ import annotations

import gc
import math
import time

import bpy
import numpy as np
from addon_state import (
    check_shows_something,
    events,
    finished,
    image,
    is_playing,
    measured,
    settings,
    space,
    viewports,
)
from builds import is_building, watch_a_build, with_cloud
from driver import Step, StepError, check, redrawn, screenshot, wait_until
from gates import Gate
from hands import drag, hover, press_key, set_viewport_size
from places import area_of, context_of, middle_of


def region_view() -> bpy.types.RegionView3D:
    return space().region_3d


def switch_to_rendered() -> Step:
    yield from set_viewport_size(960, 540)
    space().overlay.show_overlays = False
    space().shading.type = "RENDERED"
    yield from finished("first view")
    check_shows_something(image(), "the viewport")


def show_each_mode() -> Step:
    names = [item.identifier for item in settings().bl_rna.properties["mode"].enum_items]
    images = {}
    for name in names:
        settings().mode = name
        area_of("VIEW_3D").tag_redraw()  # a script that changes a setting also has to redraw
        yield from finished(f"mode {name}")
        images[name] = image()
        if name != "UV":  # nothing here has any
            check_shows_something(images[name], name)
        screenshot(f"mode_{name.lower()}")
    for name in names[1:]:
        check(np.any(images[name] != images["PREVIEW"]), f"{name} shows what Preview shows")
    settings().mode = "PREVIEW"
    area_of("VIEW_3D").tag_redraw()
    yield from finished("mode Preview again")
    check(np.array_equal(image(), images["PREVIEW"]), "Preview shows something else the second time")


def trace_while_nobody_redraws() -> Step:
    """The image improves in the background while Blender does not draw it; then it shows by itself."""
    before, settings().samples = settings().samples, 5
    area_of("VIEW_3D").tag_redraw()
    (shown,) = viewports()
    yield from wait_until(lambda: shown._refinement.view.plan.samples == 5, "the new samples are not traced")
    deadline = time.monotonic() + 120.0
    while not shown._refinement.is_finished and time.monotonic() < deadline:
        time.sleep(0.01)  # nothing else is done on this thread, which is Blender's
    check(shown._refinement.is_finished, "nothing is traced without redraws")
    yield from wait_until(lambda: not shown.is_working, "the finished image is not shown")
    settings().samples = before
    area_of("VIEW_3D").tag_redraw()
    yield from finished("samples as before")


def orbit() -> Step:
    before = region_view().view_rotation.copy()
    x, y = middle_of(area_of("VIEW_3D"))
    yield from drag(2, (x, y), (x + 120, y - 30))
    angle = lambda: before.rotation_difference(region_view().view_rotation).angle  # noqa: E731
    yield from wait_until(lambda: angle() > math.radians(5.0), "dragging with the middle button does not orbit")
    yield from finished("after the orbit")


def look_orthographically() -> Step:
    hover(*middle_of(area_of("VIEW_3D")))
    yield from press_key("KP_5")
    yield from wait_until(lambda: region_view().view_perspective == "ORTHO", "numpad 5 does nothing")
    yield from finished("orthographic view")


def look_through_the_camera() -> Step:
    yield from press_key("KP_0")
    yield from wait_until(lambda: region_view().view_perspective == "CAMERA", "numpad 0 does nothing")
    yield from finished("camera view")


def restrict_to_a_border() -> Step:
    settings().use_viewport_denoising = False  # the denoiser would lack the pixels outside of the border
    area_of("VIEW_3D").tag_redraw()
    yield from finished("without denoising")
    whole = image()
    render_settings = bpy.context.scene.render
    render_settings.use_border = True
    render_settings.border_min_x, render_settings.border_max_x = 0.25, 0.75
    render_settings.border_min_y, render_settings.border_max_y = 0.25, 0.75
    yield from finished("border")
    part = image()
    covered = part[..., 3] > 0.0
    check(0.05 < covered.mean() < 0.4, f"the border covers {covered.mean():.2f} of the region")
    difference = abs(part - whole)[covered].max()
    check(difference < 1e-6, f"the image within a border differs by {difference}")
    screenshot("camera_border")
    render_settings.use_border = False
    settings().use_viewport_denoising = True
    area_of("VIEW_3D").tag_redraw()
    yield from finished("border taken away")


def play() -> Step:
    events.clear()
    count = lambda: events.count("frame_change_post")  # noqa: E731
    yield from press_key("space")
    yield from wait_until(count, "the animation does not play")
    first, started = count(), time.monotonic()
    yield 4.0
    yield from wait_until(lambda: count() >= first + 4, "the animation stands still")
    measured["frames per second, tree_in_wind at 960x540"] = (count() - first) / (time.monotonic() - started)
    yield from press_key("space")
    yield from wait_until(lambda: not is_playing(), "the animation still plays")
    bpy.context.scene.frame_set(1)
    yield from finished("after playing")


def edit_and_undo() -> Step:
    before = image()
    obj = next(obj for obj in bpy.context.view_layer.objects if obj.type == "MESH" and not obj.modifiers)
    area = area_of("VIEW_3D")
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.ed.undo_push(message="before the edit")
    yield from redrawn()
    with bpy.context.temp_override(**context_of(area)):
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0.0, 0.0, 1.5))
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.ops.ed.undo_push(message="edit")
    yield from finished("edit")
    check(abs(image() - before).max() > 0.05, "an edit does not show")
    screenshot("edited")
    hover(*middle_of(area))
    for _ in range(6):
        yield from press_key("ctrl+z")
        yield from finished("undo")
        if abs(image() - before).max() < 1e-6:
            break
    else:
        raise StepError("undoing does not bring the old image back")


def edit_lights_and_materials() -> Step:
    """Edits that the depsgraph does not report as objects or meshes: each must show, and disappear once undone."""
    before = image()
    light = next(obj.data for obj in bpy.context.scene.objects if obj.type == "LIGHT")
    material = bpy.data.objects["Hill"].active_material
    base_color = next(node for node in material.node_tree.nodes if "Base Color" in node.inputs).inputs["Base Color"]
    edits = ((light, "energy", light.energy * 3.0), (base_color, "default_value", (0.9, 0.1, 0.6, 1.0)))
    for owner, name, value in edits:
        old = getattr(owner, name)
        old = old[:] if hasattr(old, "__len__") else old
        setattr(owner, name, value)
        yield from finished(f"edited {name}")
        check(abs(image() - before).max() > 0.05, f"an edited {name} of {owner} does not show")
        screenshot(f"edited_{name}")
        setattr(owner, name, old)
        yield from finished(f"{name} as before")
        check(np.array_equal(image(), before), f"{name} as before, but the image is another")


def build_beside_the_viewport() -> Step:
    """A mesh whose tree takes seconds: the last image stays during the build, and changes of the view take effect."""
    before = image()

    def show(gate: Gate) -> Step:
        yield from watch_a_build("viewport", gate)
        (shown,) = viewports()
        check(shown.state.startswith("Building BVHs"), f"the viewport says {shown.state!r}")
        check(np.array_equal(image(), before), "the last image is gone before there is another")
        gate.open()
        settings().samples = 2
        yield from finished("a mesh that takes long")
        yield from wait_until(lambda: not is_building(), "a build goes on behind a finished view")
        check(np.any(image() != before), "the mesh is not shown")

    yield from with_cloud(show)
    yield from finished("the mesh is gone")
    check(np.array_equal(image(), before), "the view is not what it was before the mesh")


def show_four_views() -> Step:
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.region_quadview()
    yield from finished("quad view")
    count = len([found for found in viewports() if found._refinement.is_finished])
    check(count >= 4, f"four views, but {count} renderers")
    screenshot("quad_view")
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.region_quadview()
    yield from finished("single view")


def show_another_panorama() -> Step:
    """A kind that cannot be traced is shown in perspective, and the viewport says why; a render names the way out."""
    scene, area = bpy.context.scene, area_of("VIEW_3D")
    camera = scene.camera.data
    camera.type, camera.panorama_type = "PANO", "FISHEYE_EQUISOLID"
    before = area.spaces.active.region_3d.view_perspective
    area.spaces.active.region_3d.view_perspective = "CAMERA"
    area.spaces.active.overlay.show_overlays = True
    yield from finished("another panorama")
    gc.collect()
    (shown,) = viewports()
    check("Fisheye Equisolid panorama" in (shown.complaint or ""), f"the viewport says {shown.complaint!r}")
    check(shown._refinement.image[..., :3].std() > 0.01, "nothing is shown")
    screenshot("another_panorama")
    try:
        with bpy.context.temp_override(**context_of(area)):
            bpy.ops.render.render()
    except RuntimeError as problem:
        check("choose Equirectangular as its Panorama Type" in str(problem), str(problem))
    else:
        check(False, "a fisheye was rendered")
    camera.type = "PERSP"
    area.spaces.active.region_3d.view_perspective = before
    yield from finished("perspective again")
    check(shown.complaint is None, "the viewport still complains")
