"""The scale of the mode "cost" next to its pictures, and the cost of the camera ray under the mouse.

In viewports whose Rendered shading is ours, and over a render's result, or a view's image, in image editors.
"""

from __future__ import annotations

import bpy
import numpy as np
import numpy.typing as npt

from ..settings.preferences import native_error, redraw_viewports
from ..settings.scene_settings import ENGINE_NAME
from ..settings.shading_settings import mode_of
from ..statistics.last_result import image_mode, last_render_mode
from . import pointer
from .legend import DrawHandler, Scale, Section, draw_legend
from .pointer import Pointed, view_of
from .rendered.redraws import viewport_at

# As native/src/render/modes/shading.h has it, from the first colour to the last.
LEAST, DOUBLINGS = 2, 8
STOPS = 8 * DOUBLINGS + 1
SCALE = Scale(
    "Nodes visited and primitives tested",
    tuple((place / 4, str(LEAST << (place * DOUBLINGS // 4))) for place in range(5)),
)

_colors: tuple[tuple[float, ...], ...] = ()
_pointed: Pointed | None = None
_visits: tuple[int, int] | None = None


def is_shown(context: bpy.types.Context) -> bool:
    """Whether the context's 3D viewport shows an image in the mode "cost"."""
    space = context.space_data
    is_ours = context.engine == ENGINE_NAME and space.shading.type == "RENDERED" and native_error() is None
    return is_ours and space.overlay.show_overlays and mode_of(context.scene, space.shading) == "cost"


def section() -> Section:
    """Return the part of a legend that describes it."""
    global _colors
    if not _colors:
        from perfect_bvh import cost_to_color

        costs = [LEAST * 2.0 ** (DOUBLINGS * stop / (STOPS - 1)) for stop in range(STOPS)]
        _colors = tuple(tuple(color) for color in encoded(cost_to_color(costs)).tolist())
    return Section(("Cost of a camera ray",), SCALE, _colors)


def encoded(linear: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Scene-linear colours as the Standard view transform shows them, which the mode's files get (sRGB)."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)


def sections(context: bpy.types.Context) -> list[Section]:
    """Return the sections of a viewport's legend that describe it."""
    return [section()] if is_shown(context) else []


def tip(context: bpy.types.Context) -> tuple[tuple[int, int], list[str]] | None:
    """Return the mouse's position in the region that is being drawn, and the tip there."""
    if _pointed is None or _visits is None or _pointed.region != context.region.as_pointer():
        return None
    if not is_shown(context) or _pointed.view != view_of(context):
        return None
    nodes, primitives = _visits
    visited = f"{nodes:,} node{'' if nodes == 1 else 's'} visited"
    tested = f"{primitives:,} primitive{'' if primitives == 1 else 's'} tested"
    return _pointed.place, [visited, tested]


class _Pointing:
    """The mouse, as far as rays under it are concerned."""

    def wants_pointer(self, context: bpy.types.Context) -> bool:
        return is_shown(context)

    def on_pointer(self, context: bpy.types.Context, place: tuple[int, int]) -> None:
        global _pointed, _visits
        before, last = _visits, _pointed
        viewport = viewport_at(context.region.as_pointer())
        _pointed = Pointed.of(context, place)
        _visits = None if viewport is None else viewport.visits_at(place)
        if before is not None and last is not None and last.region != _pointed.region:
            redraw_viewports()  # where it was it is no longer
        elif before is not None or _visits is not None:
            context.region.tag_redraw()

    def on_pointer_left(self) -> None:
        global _pointed, _visits
        if _visits is not None:
            redraw_viewports()
        _pointed = _visits = None


_pointing = _Pointing()


def _draw_beside_render() -> None:
    context = bpy.context
    image = context.space_data.image
    if image is None or not context.space_data.overlay.show_overlays:
        return
    mode = last_render_mode(context.scene) if image.type == "RENDER_RESULT" else image_mode(image)
    if native_error() is None and mode == "cost":
        draw_legend(context, [section()])


_handler = DrawHandler(_draw_beside_render, "POST_PIXEL", bpy.types.SpaceImageEditor)


def register() -> None:
    _handler.add()
    pointer.listeners.append(_pointing)


def unregister() -> None:
    global _pointed, _visits
    pointer.listeners.remove(_pointing)
    _handler.remove()
    _pointed = _visits = None
