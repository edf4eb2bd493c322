"""Two viewports next to each other: each shows its own image, complete."""

from __future__ import annotations

import bpy
import numpy as np
from addon_state import finished, module
from driver import Step, area_pixels, at_rest, check, redrawn, screenshot, wait_until
from places import area_of, context_of
from shown_images import check_shows, main_window, override, redraw_views, show_plainly, view_areas


def check_both(window: bpy.types.Window, left: str, right: str) -> Step:
    """Returns both images."""
    one, other = view_areas(window)
    return (yield from check_shows(window, one, left)), (yield from check_shows(window, other, right))


def show_two_viewports() -> Step:
    window = main_window()
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield from redrawn()
    left, right = view_areas(window)
    show_plainly(left)  # Blender splits a Rendered one into a Rendered and a Solid one
    show_plainly(right)
    with override(window, right):
        bpy.ops.view3d.view_axis(type="TOP")
        bpy.ops.view3d.view_all()
    yield from finished("two viewports")
    seen = yield from check_shows(window, left, "left viewport")
    other = yield from check_shows(window, right, "right viewport")
    check(seen.shape != other.shape or abs(seen - other).max() > 0.05, "both viewports show the same")
    screenshot("two_viewports")


def edit_beside_two_viewports() -> Step:
    """An edit shows in both; the work that follows it ends."""
    window = main_window()
    before = yield from check_both(window, "left", "right")
    hill = bpy.data.objects["Hill"]
    hill.location.z += 2.0
    yield from finished("an edit in two viewports")
    after = yield from check_both(window, "left, edited", "right, edited")
    check(all(abs(one - other).max() > 0.05 for one, other in zip(before, after, strict=True)), "the edit is not seen")
    hill.location.z -= 2.0
    yield from finished("the edit is taken back")
    again = yield from check_both(window, "left, as before", "right, as before")
    check(all(np.array_equal(*pair) for pair in zip(before, again, strict=True)), "not as before the edit")


def hide_in_one_of_two_viewports() -> Step:
    """Local view, filters and local collections are one viewport's: the other shows all, in any drawing order."""
    window = main_window()
    right = view_areas(window)[1]
    whole = yield from check_both(window, "left", "right")
    space = right.spaces.active

    def compare(what: str) -> Step:
        for _ in range(2):
            yield from finished(what)
            rest, part = yield from check_both(window, f"{what}, left", f"{what}, right")
            check(np.array_equal(rest, whole[0]), f"{what}: left is another")
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
    again = yield from check_shows(window, right, "all again")
    check(np.array_equal(again, whole[1]), "not as before at the right")


def show_boxes_in_one_of_two_viewports() -> Step:
    """Which boxes are drawn is each viewport's own, and marks no file as unsaved."""
    left, right = view_areas(main_window())
    for area in (left, right):
        area.spaces.active.overlay.show_overlays = True
    yield from finished("two viewports with overlays")
    yield from at_rest(right)
    overlays = [area.spaces.active.shading.perfect_bvh.overlay for area in (left, right)]
    before = [area_pixels(area) for area in (left, right)]
    is_dirty = bpy.data.is_dirty
    overlays[1].show_top_level, overlays[1].level = True, 1
    drawn = module("view3d.tree_overlay.overlay")._overlays
    yield from wait_until(lambda: any(o.top_level and o.top_level.shown for o in drawn.values()), "no box is drawn")
    yield from redrawn()
    check(len(drawn) == 1, f"boxes are drawn in {len(drawn)} viewports")
    check((area_pixels(right) != before[1]).mean() > 0.002, "no box is seen on the right")
    check(np.array_equal(area_pixels(left), before[0]), "the left viewport has changed")
    check(bpy.data.is_dirty == is_dirty, "the file is marked as unsaved")
    screenshot("boxes_in_one_of_two_viewports")
    overlays[0].show_active, overlays[0].level = True, 3
    yield from wait_until(lambda: len(drawn) == 2, "the boxes of the left viewport are not drawn")
    check([o.level for o in overlays] == [3, 1], "both viewports have one level")
    overlays[0].show_active = overlays[1].show_top_level = False
    yield from wait_until(lambda: not drawn, "boxes are still drawn")
    for area in (left, right):
        show_plainly(area)
    yield from redrawn()


def join_viewports() -> Step:
    with override(main_window(), view_areas(main_window())[1]):
        bpy.ops.screen.area_close()
    yield from finished("one viewport again")
    check(len(view_areas(main_window())) == 1, "the second viewport is still there")
    yield from check_shows(main_window(), view_areas(main_window())[0], "the viewport that stays")
