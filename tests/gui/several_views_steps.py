"""Several viewports at once: beside each other, and of two scenes in two windows; each shows its own, whole."""

from __future__ import annotations

import gc
import subprocess
from typing import Any

import bpy
import numpy as np
from addon_state import events, finished, module, viewports
from driver import (
    Step,
    StepError,
    area_of,
    check,
    context_of,
    hover,
    middle_of,
    press_key,
    region_of,
    screenshot,
    wait_until,
)

HEADERS = 60  # in pixels: what lies over the upper edge of a viewport
# Below the first window, which is less high while its viewport has 540 lines.
SECOND_WINDOW = {"left": 0, "top": 660, "width": 1000, "height": 340}
LEAST_LIKENESS = 0.9  # correlation of the screen's colors with the image's before the view transform


def main_window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def view_areas(window: bpy.types.Window) -> list[bpy.types.Area]:
    """From left to right."""
    areas = [area for area in window.screen.areas if area.type == "VIEW_3D"]
    return sorted(areas, key=lambda area: area.x)


def override(window: bpy.types.Window, area: bpy.types.Area) -> Any:
    return bpy.context.temp_override(window=window, area=area, region=region_of(area))


def expected_image(window: bpy.types.Window, area: bpy.types.Area) -> Any:
    """(H, W, 4): what an area has to show, from a sync that has read nothing but what it shows now."""
    viewport, refinement, appearance = module("viewport"), module("refinement"), module("sync.appearance")
    space, region = area.spaces.active, region_of(area)
    with override(window, area):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        chosen = module("properties").read_settings(window.scene)
        sync = module("session").SceneSync(watch=False)
        sync.request(module("frame").needed_attributes(chosen, ()))
        sync.update(depsgraph, space=space)
        camera, _ = module("region_camera").camera_of(space.region_3d, space, depsgraph)
    size = (region.width, region.height)
    made = refinement.Refinement(viewport._view_of(sync, appearance.as_camera(camera), size, chosen), refinement.Pace())
    while not made.is_finished:
        made.step(1.0)
    return made.image


def on_screen(window: bpy.types.Window, area: bpy.types.Area) -> Any:
    """(H, W, 3) float: the colors of an area, with the headers that lie over its edges."""
    left, top = (0, 0) if window == main_window() else (SECOND_WINDOW["left"], SECOND_WINDOW["top"])
    region = region_of(area)
    place = (left + region.x, top + window.height - region.y - region.height)
    shape = f"{region.width}x{region.height}+{place[0]}+{place[1]}"
    made = subprocess.run(
        ["import", "-window", "root", "-crop", shape, "-depth", "8", "rgb:-"], check=True, capture_output=True
    )
    return np.frombuffer(made.stdout, np.uint8).reshape(region.height, region.width, 3).astype(float)


def check_shows(window: bpy.types.Window, area: bpy.types.Area, what: str) -> Any:
    """That an area shows what its own scene and view ask for: to the bit, and on the screen. Returns the image."""
    wanted = expected_image(window, area)
    images = [found._refinement.image for found in viewports()]
    differences = [float(abs(image - wanted).max()) for image in images if image.shape == wanted.shape]
    check(0.0 in differences, f"{what}: no viewport holds the image of this view, they differ by {differences}")
    height, width = wanted.shape[:2]
    inner = slice(HEADERS, height - 8), slice(24, width - 24)
    colors = np.cbrt(np.maximum(wanted[..., :3], 0.0))
    alike = np.corrcoef(colors[inner].ravel(), on_screen(window, area)[inner].ravel())[0, 1]
    check(alike > LEAST_LIKENESS, f"{what}: the screen shows something else (correlation {alike:.2f})")
    return wanted


def show_plainly(area: bpy.types.Area) -> None:
    """Nothing over the image, neither what Blender draws beside a camera's frame."""
    space = area.spaces.active
    space.region_3d.view_perspective = "PERSP"
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_toolbar = space.show_region_ui = False
    space.shading.type = "RENDERED"


def redraw_views() -> None:
    for window in bpy.context.window_manager.windows:
        for area in view_areas(window):
            area.tag_redraw()


# Beside each other ---------------------------------------------------------------------------------------------------


def show_two_viewports() -> Step:
    window = main_window()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield 0.5
    left, right = view_areas(window)
    show_plainly(left)  # Blender splits a Rendered one into a Rendered and a Solid one
    show_plainly(right)
    with override(window, right):
        bpy.ops.view3d.view_axis(type="TOP")
        bpy.ops.view3d.view_all()
    yield from finished("two viewports")
    seen = check_shows(window, left, "left viewport")
    other = check_shows(window, right, "right viewport")
    check(seen.shape != other.shape or abs(seen - other).max() > 0.05, "both viewports show the same")
    screenshot("two_viewports")


def edit_beside_two_viewports() -> Step:
    """An edit shows in both; what follows it ends."""
    window = main_window()
    left, right = view_areas(window)
    before = check_shows(window, left, "left"), check_shows(window, right, "right")
    hill = bpy.data.objects["Hill"]
    hill.location.z += 2.0
    yield from finished("an edit in two viewports")
    after = check_shows(window, left, "left, edited"), check_shows(window, right, "right, edited")
    check(all(abs(one - other).max() > 0.05 for one, other in zip(before, after, strict=True)), "the edit is not seen")
    hill.location.z -= 2.0
    yield from finished("the edit is taken back")
    again = check_shows(window, left, "left, as before"), check_shows(window, right, "right, as before")
    check(all(np.array_equal(*pair) for pair in zip(before, again, strict=True)), "not as before the edit")


def hide_in_one_of_two_viewports() -> Step:
    """Local view, filters and local collections are one viewport's: the other shows all, whoever was drawn last."""
    window = main_window()
    left, right = view_areas(window)
    whole = check_shows(window, left, "left"), check_shows(window, right, "right")
    space = right.spaces.active

    def compare(what: str) -> Step:
        for _ in range(2):
            yield from finished(what)
            check(np.array_equal(check_shows(window, left, f"{what}, left"), whole[0]), f"{what}: left is another")
            part = check_shows(window, right, f"{what}, right")
            check(abs(part - whole[1]).max() > 0.05, f"{what}: nothing is hidden at the right")
            hill.location.x += 0.0  # evaluated again, and so both are brought in step once more
            redraw_views()

    hill, tree = bpy.data.objects["Hill"], bpy.data.objects["Tree"]
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == tree)
    bpy.context.view_layer.objects.active = tree
    with override(window, right):
        bpy.ops.view3d.localview(frame_selected=False)
    yield from compare("local view")
    screenshot("local_view_beside_all")
    with override(window, right):
        bpy.ops.view3d.localview(frame_selected=False)
    space.show_object_viewport_mesh = False
    right.tag_redraw()
    yield from compare("no meshes")
    space.show_object_viewport_mesh = True
    right.tag_redraw()
    collection = bpy.data.collections.new("Apart")
    bpy.context.scene.collection.children.link(collection)
    home = hill.users_collection[0]
    collection.objects.link(hill)
    home.objects.unlink(hill)
    yield from finished("another collection")
    space.use_local_collections = True
    with override(window, right):
        index = list(bpy.context.scene.collection.children).index(collection) + 1
        bpy.ops.object.hide_collection(collection_index=index)
    yield from compare("local collections")
    screenshot("local_collections_beside_all")
    space.use_local_collections = False
    right.tag_redraw()
    home.objects.link(hill)
    bpy.data.collections.remove(collection)
    yield from finished("all collections")
    check(np.array_equal(check_shows(window, right, "all again"), whole[1]), "not as before at the right")


def join_viewports() -> Step:
    with override(main_window(), view_areas(main_window())[1]):
        bpy.ops.screen.area_close()
    yield from finished("one viewport again")
    check(len(view_areas(main_window())) == 1, "the second viewport is still there")
    check_shows(main_window(), view_areas(main_window())[0], "the viewport that stays")


# In two windows ------------------------------------------------------------------------------------------------------


def second_window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[1]


def blender_windows() -> list[str]:
    """The X server's numbers of all of Blender's windows."""
    command = ["xdotool", "search", "--onlyvisible", "--class", "blender"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()


def place_window(window: str, left: int, top: int, width: int, height: int) -> Step:
    """Blender places a window itself once it is there, so this may take more than one attempt."""
    wanted = f"X={left}\nY={top}\nWIDTH={width}\nHEIGHT={height}\n"
    for _ in range(10):
        place = ["windowsize", window, str(width), str(height), "windowmove", window, str(left), str(top)]
        # Not by `x_tool`, which may send the last word only with its next one, when the window is gone.
        subprocess.run(["xdotool", *place], check=True)
        yield 1.0
        command = ["xdotool", "getwindowgeometry", "--shell", window]
        found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        if wanted in found:
            return
    raise StepError(f"the second window is not where it should be: {found}")


def open_second_window() -> Step:
    """A main window of its own, where the first one leaves the screen free."""
    before = blender_windows()
    with bpy.context.temp_override(window=main_window()):
        bpy.ops.wm.window_new_main()
    yield 1.0
    (made,) = set(blender_windows()) - set(before)
    yield from place_window(made, **SECOND_WINDOW)


def make_second_scene() -> bpy.types.Scene:
    """Boxes that stand in a row, and of the first scene's objects the hill."""
    scene = bpy.data.scenes.new("Other")
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.mode, scene.perfect_bvh.samples = "CLAY", 4
    scene.collection.objects.link(bpy.data.objects["Hill"])
    mesh = bpy.data.meshes.new("Box")
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 3)]
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    for number in range(5):
        box = bpy.data.objects.new(f"Box {number}", mesh)
        box.location = (3.0 * number - 6.0, 0.0, 4.0)
        scene.collection.objects.link(box)
    return scene


def show_two_scenes_in_two_windows() -> Step:
    yield from open_second_window()
    first, second = main_window(), second_window()
    second.scene = make_second_scene()
    yield 0.5
    check(first.scene != second.scene, "both windows show one scene")
    (area,) = view_areas(second)
    show_plainly(area)
    with override(second, area):
        bpy.ops.view3d.view_all()
    yield from finished("two scenes")
    check_shows(first, view_areas(first)[0], "first window")
    check_shows(second, view_areas(second)[0], "second window")
    screenshot("two_scenes")


def edit_in_two_scenes() -> Step:
    """What belongs to one scene lets the other's image stand; what belongs to both shows in both."""
    first, second = main_window(), second_window()
    images = {}

    def look(what: str) -> Step:
        yield from finished(what)
        for window in (first, second):
            images[window.scene.name] = check_shows(window, view_areas(window)[0], f"{what}, {window.scene.name}")

    yield from look("before")
    before, kept = dict(images), {id(found._refinement) for found in viewports()}
    bpy.data.objects["Box 2"].location.z += 2.0
    yield from look("a box of the second scene moved")
    check(np.array_equal(images[first.scene.name], before[first.scene.name]), "the first scene shows the second's edit")
    check(abs(images["Other"] - before["Other"]).max() > 0.05, "the second scene does not show its edit")
    check(kept & {id(found._refinement) for found in viewports()}, "the first scene's image was begun anew")
    before = dict(images)
    bpy.data.objects["Hill"].location.z -= 1.0
    yield from look("the hill of both scenes moved")
    for name, image in before.items():
        check(abs(images[name] - image).max() > 0.05, f"{name} does not show the edit of what both scenes have")
    bpy.data.objects["Hill"].location.z += 1.0
    yield from look("the hill is back")
    for name, image in before.items():
        check(np.array_equal(images[name], image), f"{name} is not as before")


# Renders whose scene or window goes ----------------------------------------------------------------------------------


def start_render_of(window: bpy.types.Window) -> Step:
    """With so many samples that it goes on for long."""
    scene = window.scene
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
        scene.camera.location = (0.0, 0.0, 30.0)
        scene.collection.objects.link(scene.camera)
    scene.perfect_bvh.samples = 4096
    events.clear()
    with override(window, view_areas(window)[0]):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield from wait_until(lambda: bpy.app.is_job_running("RENDER"), "the render does not begin")
    yield 1.5
    check(bpy.app.is_job_running("RENDER"), "the render is over already")


def close_a_window_while_it_renders() -> Step:
    """The render goes on or ends, as Blender likes it; Escape ends it at the latest."""
    bpy.context.preferences.view.render_display_type = "NONE"
    first, second = main_window(), second_window()
    yield from start_render_of(second)
    second.scene.perfect_bvh.samples = 4  # of viewports; the render has read its own
    with bpy.context.temp_override(window=second):
        bpy.ops.wm.window_close()
    yield 1.0
    check(len(bpy.context.window_manager.windows) == 1, "the window is still there")
    if bpy.app.is_job_running("RENDER"):
        hover(*middle_of(view_areas(first)[0]))
        yield 0.3
        yield from press_key("Escape")
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render goes on")
    gc.collect()
    yield from finished("the window that stays")
    check_shows(first, view_areas(first)[0], "the window that stays")


def delete_a_scene_while_it_renders() -> Step:
    first, other = main_window(), bpy.data.scenes["Other"]
    kept, uid = first.scene, other.session_uid
    first.scene = other
    show_plainly(view_areas(first)[0])
    yield from finished("the other scene in the window that stays")
    yield from start_render_of(first)
    with override(first, view_areas(first)[0]):
        bpy.ops.scene.delete()
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render of a deleted scene goes on")
    check("Other" not in bpy.data.scenes, "the scene is still there")
    first.scene = kept
    show_plainly(view_areas(first)[0])
    gc.collect()
    yield from finished("the scene that stays")
    check_shows(first, view_areas(first)[0], "the scene that stays")
    check(all(key[0] != uid for key in module("session")._sessions), "what was synced of a deleted scene is kept")
    bpy.context.preferences.view.render_display_type = "WINDOW"


def show_another_panorama() -> Step:
    """A kind that cannot be traced is shown in perspective, and the viewport says why; a render names the way out."""
    window, scene = main_window(), bpy.context.scene
    (area,) = view_areas(window)
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
        with override(window, area):
            bpy.ops.render.render()
    except RuntimeError as problem:
        check("choose that as its Panorama Type" in str(problem), str(problem))
    else:
        check(False, "a fisheye was rendered")
    camera.type = "PERSP"
    area.spaces.active.region_3d.view_perspective = before
    yield from finished("perspective again")
    check(shown.complaint is None, "the viewport still complains")
