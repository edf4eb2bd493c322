"""The image that each of several viewports has to show, from a separate sync, and the pixels on the screen there."""

from __future__ import annotations

import subprocess
from typing import Any

import bpy
import numpy as np
from addon_state import module, viewports
from driver import Step, check, wait_until
from places import region_of

HEADERS = 60  # in pixels: the headers over the upper edge of a viewport
# Below the first window, which is less high while its viewport has 540 lines.
SECOND_WINDOW = {"left": 0, "top": 660, "width": 1000, "height": 340}
LEAST_LIKENESS = 0.9  # correlation of the screen's colors with the image's before the view transform


def main_window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def view_areas(window: bpy.types.Window) -> list[bpy.types.Area]:
    """Return the window's viewports from left to right."""
    areas = [area for area in window.screen.areas if area.type == "VIEW_3D"]
    return sorted(areas, key=lambda area: area.x)


def override(window: bpy.types.Window, area: bpy.types.Area) -> Any:
    return bpy.context.temp_override(window=window, area=area, region=region_of(area))


def expected_image(window: bpy.types.Window, area: bpy.types.Area) -> Any:
    """The image that an area has to show, (H, W, 4), from a sync that has read only the current state."""
    refinement, appearance = module("image.refinement"), module("sync.appearance")
    space, region = area.spaces.active, region_of(area)
    with override(window, area):
        depsgraph = bpy.context.evaluated_depsgraph_get()
        chosen = module("settings.scene_settings").read_settings(window.scene)
        sync = module("live.sync_cache").SceneSync(watch=False)
        plan = module("image.plan").plan_view(chosen, (region.width, region.height))
        sync.request(plan.attributes)
        sync.update(depsgraph, space=space)
        camera, _ = module("view3d.rendered.screen").camera_of(space.region_3d, space, depsgraph)
    view = refinement.View.of(sync, appearance.as_camera(camera), plan)
    made = refinement.Refinement(view, module("image.progressive").Pace())
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


def check_shows(window: bpy.types.Window, area: bpy.types.Area, what: str) -> Step:
    """Check that an area shows the image of its scene and view, to the bit, and on the screen. Returns the image."""
    wanted = expected_image(window, area)
    images = [found._refinement.image for found in viewports()]
    differences = [float(abs(image - wanted).max()) for image in images if image.shape == wanted.shape]
    check(0.0 in differences, f"{what}: no viewport holds the image of this view, they differ by {differences}")
    height, width = wanted.shape[:2]
    inner = slice(HEADERS, height - 8), slice(24, width - 24)
    colors = np.cbrt(np.maximum(wanted[..., :3], 0.0))
    alike = lambda: np.corrcoef(colors[inner].ravel(), on_screen(window, area)[inner].ravel())[0, 1]  # noqa: E731
    yield from wait_until(lambda: alike() > LEAST_LIKENESS, f"{what}: the screen shows something else", every=0.2)
    return wanted


def show_plainly(area: bpy.types.Area) -> None:
    """Remove everything over the image, and the frame that Blender draws for a camera."""
    space = area.spaces.active
    space.region_3d.view_perspective = "PERSP"
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_toolbar = space.show_region_ui = False
    space.shading.type = "RENDERED"


def redraw_views() -> None:
    for window in bpy.context.window_manager.windows:
        for area in view_areas(window):
            area.tag_redraw()
