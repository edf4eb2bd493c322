"""Blender's previews of materials, lights and worlds, which the engine makes on threads while the user works."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from driver import Step, area_pixels, at_rest, screenshot, wait_until
from places import main_area

PANELS = ("MATERIAL_PT_preview", "PERFECT_BVH_PT_world_preview", "DATA_PT_preview")
RED, GREEN = (0.9, 0.02, 0.02, 1.0), (0.02, 0.9, 0.02, 1.0)
BUTTON_PIXELS = 12_000  # more than a button that shows a color has; each preview has as many again
REMAINING_PIXELS = 3000  # of another color that a preview had before
EDITS = 15

Paint = Callable[[tuple[float, ...]], None]


@contextmanager
def opened(names: tuple[str, ...]) -> Iterator[None]:
    """Panels that a new user finds closed, below all others."""
    panels = [getattr(bpy.types, name) for name in names]
    for panel in panels:
        bpy.utils.unregister_class(panel)
        panel.bl_options = set()
        bpy.utils.register_class(panel)
    yield
    for panel in panels:
        bpy.utils.unregister_class(panel)
        panel.bl_options = {"DEFAULT_CLOSED"}
        bpy.utils.register_class(panel)


def is_mostly(area: bpy.types.Area, channel: int, not_: int) -> bool:
    """Whether a large part of an editor has this channel of red, green and blue above the others, and none another."""
    pixels = area_pixels(area).reshape(-1, 3).astype(int)

    def count(strong: int) -> int:
        others = np.delete(pixels, strong, axis=1).max(axis=1)
        return int(((pixels[:, strong] > 80) & (pixels[:, strong] * 4 > others * 5)).sum())

    return count(channel) > BUTTON_PIXELS and count(not_) < REMAINING_PIXELS


def show_previews() -> Step:
    """Each takes the color that its data-block has in the end, also if edits come faster than it is made."""
    area, layer = main_area(), bpy.context.view_layer
    active, scene, before = layer.objects.active, bpy.context.scene, area.type
    area.type = "PROPERTIES"  # the other one is too low for a panel below all others
    with opened(PANELS):
        for tab, kind in (("MATERIAL", "MESH"), ("WORLD", "MESH"), ("DATA", "LIGHT")):
            shown = [obj for obj in scene.objects if obj.type == kind and obj.visible_get()]
            layer.objects.active = next(obj for obj in shown if kind == "LIGHT" or obj.active_material is not None)
            yield from at_rest(area)
            area.spaces.active.context = tab
            yield from at_rest(area)
            yield from follow(area, tab, painter(tab, layer.objects.active))
        area.type = before
        layer.objects.active = active
        yield from at_rest(area)
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER_PREVIEW"), "a preview never ends")


def follow(area: bpy.types.Area, tab: str, paint: Paint) -> Step:
    for number in range(EDITS):
        paint((number % 3 / 3, number % 5 / 5, number % 2, 1.0))
        yield 0.03
    paint(RED)
    yield from wait_until(lambda: is_mostly(area, 0, not_=1), f"the preview in {tab} is not red", every=0.3)
    screenshot(f"preview_{tab.lower()}")
    paint(GREEN)
    yield from wait_until(lambda: is_mostly(area, 1, not_=0), f"the preview in {tab} stays red", every=0.3)


def painter(tab: str, obj: bpy.types.Object) -> Paint:
    """Sets the color of the tab's data-block."""
    if tab == "DATA":
        return lambda color: setattr(obj.data, "color", color[:3])
    block = bpy.context.scene.world if tab == "WORLD" else obj.active_material
    sockets = [socket for node in block.node_tree.nodes for socket in node.inputs if socket.type == "RGBA"]

    def paint(color: tuple[float, ...]) -> None:
        for socket in sockets:
            if socket.name in {"Color", "Base Color"} and not socket.is_linked:
                socket.default_value = color

    return paint
