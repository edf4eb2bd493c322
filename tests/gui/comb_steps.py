"""Hair that is combed by the mouse in Rendered shading: the viewport shows it bent."""

from __future__ import annotations

import bpy
import numpy as np
import numpy.typing as npt
from addon_state import finished, settings, space
from driver import Step, area_pixels, at_rest, check, screenshot, wait_until
from example_steps import open_example
from hands import drag, handled, hover, set_viewport_size
from places import area_of, context_of, middle_of, region_of

STRANDS, POINTS = 40, 9


def hair_fence() -> bpy.types.Object:
    """Strands from z = 0 straight up to 1, side by side along x, -1 to 1."""
    data = bpy.data.hair_curves.new("Fence")
    data.add_curves([POINTS] * STRANDS)
    places = np.zeros((STRANDS, POINTS, 3), np.float32)
    places[..., 0] = np.linspace(-1.0, 1.0, STRANDS)[:, None]
    places[..., 2] = np.linspace(0.0, 1.0, POINTS)
    data.attributes["position"].data.foreach_set("vector", places.ravel())
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(STRANDS * POINTS, 0.008, np.float32))
    data.update_tag()
    obj = bpy.data.objects.new("Fence", data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def places_of(obj: bpy.types.Object) -> npt.NDArray[np.float32]:
    places = np.empty((STRANDS, POINTS, 3), np.float32)
    obj.data.attributes["position"].data.foreach_get("vector", places.reshape(-1))
    return places


def look_from_the_front() -> None:
    view = space().region_3d
    view.view_perspective, view.view_rotation = "ORTHO", (0.5**0.5, 0.5**0.5, 0.0, 0.0)
    view.view_location, view.view_distance = (0.0, 0.0, 0.6), 3.0
    view.update()


def take_a_comb(radius: int) -> None:
    """The brush that combs, with this width in pixels, otherwise as Blender ships it."""
    with bpy.context.temp_override(**context_of(area_of("VIEW_3D"))):
        bpy.ops.brush.asset_activate(
            asset_library_type="ESSENTIALS",
            relative_asset_identifier="brushes/essentials_brushes-curve_sculpt.blend/Brush/Comb",
        )
    tools = bpy.context.tool_settings
    paint = tools.curves_sculpt
    check(paint.brush is not None and paint.brush.curves_sculpt_brush_type == "COMB", f"the brush is {paint.brush}")
    unified = getattr(paint, "unified_paint_settings", None) or tools.unified_paint_settings
    unified.size = paint.brush.size = radius
    paint.brush.strength = 1.0


def view_pixels() -> npt.NDArray[np.int16]:
    """The viewport on the screen: (H, W, 3), rows from the top."""
    area = area_of("VIEW_3D")
    region = region_of(area)
    seen = area_pixels(area).reshape(area.height, area.width, -1)[..., :3].astype(np.int16)
    top, left = area.y + area.height - region.y - region.height, region.x - area.x
    return seen[top : top + region.height, left : left + region.width]


def share_shown(places: npt.NDArray[np.float32], seen: npt.NDArray[np.int16], empty: npt.NDArray[np.int16]) -> float:
    """Which of the points (..., 3) have something on the screen, there or a pixel away."""
    differs = np.abs(seen - empty).max(axis=-1) > 5
    height, width = differs.shape
    near = np.pad(differs, 1)
    near = np.logical_or.reduce([near[y : y + height, x : x + width] for y in range(3) for x in range(3)])
    matrix = np.array(space().region_3d.perspective_matrix)
    flat = places.reshape(-1, 3) @ matrix[:2, :3].T + matrix[:2, 3]  # orthographic
    check(np.abs(flat).max() < 1.0, f"points lie outside the region of {width} x {height} pixels")
    x, y = ((flat * (1.0, -1.0) + 1.0) / 2.0 * (width, height)).astype(int).T
    return float(near[y, x].mean())


def comb() -> Step:
    yield from open_example("gears")
    yield from set_viewport_size(960, 540)
    scene, area = bpy.context.scene, area_of("VIEW_3D")
    space().overlay.show_overlays, settings().samples = False, 4
    for item in scene.objects:
        if item.type != "LIGHT":
            item.hide_set(True)
    look_from_the_front()
    obj = hair_fence()
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    with bpy.context.temp_override(**context_of(area)):
        bpy.ops.object.mode_set(mode="SCULPT_CURVES")
    take_a_comb(radius=120)
    obj.hide_set(True)
    yield from finished("without hair")
    yield from at_rest(area)
    empty = view_pixels()
    obj.hide_set(False)
    yield from finished("hair")
    yield from at_rest(area)
    before = places_of(obj)
    share = share_shown(before[:, :-1], view_pixels(), empty)
    check(share > 0.9, f"{share:.2f} of the straight hair is shown where it is")

    region, (middle, height) = region_of(area), middle_of(area)
    hover(middle, height)
    yield from handled()
    for y in (0.02, 0.1):  # one stroke of the comb above the other
        level = height + y * region.height
        yield from drag(1, (middle - 0.25 * region.width, level), (middle + 0.25 * region.width, level), steps=24)
    yield from wait_until(lambda: np.abs(places_of(obj) - before).max() > 0.1, "the comb moves no point", seconds=20.0)
    yield from finished("combed")
    yield from at_rest(area)
    seen, after = view_pixels(), places_of(obj)
    screenshot("combed")
    moved = float((after - before)[:, -1, 0].mean())
    share, old = share_shown(after[:, :-1], seen, empty), share_shown(before[:, -2], seen, empty)
    print(f"MEASURED combed hair shown where it is: {share:.2f}, where it was: {old:.2f}; tips moved by {moved:.2f}")
    check(moved > 0.1, f"the comb moves tips by {moved:.3f} to the right")
    check(share > 0.9 and old < 0.5, f"{share:.2f} of the hair is shown where it is, {old:.2f} where it was")
    with bpy.context.temp_override(**context_of(area)):
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from finished("out of sculpt mode")
