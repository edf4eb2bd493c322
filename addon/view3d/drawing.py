"""Text, panels, colour bars and lines over a 3D viewport, in the pixels of its region, (0, 0) the lower left corner.

For handlers of "POST_PIXEL". Positions and extents are pixels. Sizes of text and widths of lines are points; the
interface's resolution scale converts them to pixels, as `pixels` does for other sizes. Colours are RGB or
RGBA, by default those of the user's theme. Text without a panel behind it has a shadow, to be legible over
anything.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import gpu
    from perfect_bvh import TreeBoxes


Color = Sequence[float]
Point = tuple[float, float]

FONT = 0  # the interface's own
TEXT_SIZE = 11.0
LINE_HEIGHT = 1.5  # of the size of the text
MARGIN = 8.0  # between a drawing and the edges of a region or of a panel, in points
CORNER_STEPS = 4
TICK = 3.0
# Regions that lie over the main one, and from which side they do.
SIDES = {"TOOLS": "left", "UI": "right", "HEADER": "top", "TOOL_HEADER": "top", "ASSET_SHELF": "bottom"}


@dataclass(frozen=True, slots=True)
class Rect:
    """Pixels of a region: left and bottom included, right and top not."""

    left: float
    bottom: float
    right: float
    top: float


def make_batch(kind: str, indices: Any = None, **columns: npt.NDArray[Any]) -> gpu.types.GPUBatch:
    """Makes a batch of vertices with these columns, (N,) or (N, C), by the names that shaders have for them."""
    import gpu

    layout = gpu.types.GPUVertFormat()
    widths = {name: 1 if values.ndim == 1 else values.shape[1] for name, values in columns.items()}
    slots = [layout.attr_add(id=name, comp_type="F32", len=widths[name], fetch_mode="FLOAT") for name in columns]
    vertices = gpu.types.GPUVertBuf(layout, len(columns["pos"]))
    for slot, values in zip(slots, columns.values(), strict=True):
        vertices.attr_fill(slot, np.ascontiguousarray(values, np.float32))
    if indices is None:
        return gpu.types.GPUBatch(type=kind, buf=vertices)
    return gpu.types.GPUBatch(type=kind, buf=vertices, elem=gpu.types.GPUIndexBuf(type=kind, seq=indices))


# Measures ------------------------------------------------------------------------------------------------------------


def pixels(points: float) -> float:
    """How many pixels something of the interface takes, that has this size at a resolution scale of 1."""
    return points * bpy.context.preferences.system.ui_scale


def text_size(text: str, size: float = TEXT_SIZE) -> tuple[float, float]:
    """The (width, height) of a line in pixels; the height is that of all lines of this size."""
    import blf

    blf.size(FONT, pixels(size))
    return blf.dimensions(FONT, text)[0], pixels(size * LINE_HEIGHT)


def free_rect(area: bpy.types.Area, region: bpy.types.Region) -> Rect:
    """The part of a 3D viewport's main region that no toolbar, sidebar or header lies over.

    region: one of the area's "WINDOW" regions; in a quad view there are four.
    """
    left, bottom, right, top = 0.0, 0.0, float(region.width), float(region.height)
    for other in area.regions:
        side = SIDES.get(other.type)
        if side is None or not _is_over(other, region):
            continue
        if side == "left":
            left = max(left, other.x + other.width - region.x)
        elif side == "right":
            right = min(right, other.x - region.x)
        elif side == "top":
            top = min(top, other.y - region.y)
        else:
            bottom = max(bottom, other.y + other.height - region.y)
    return Rect(left, bottom, max(left, right), max(bottom, top))


def _is_over(other: bpy.types.Region, region: bpy.types.Region) -> bool:
    """Whether a visible region shares pixels with another. A hidden region has at most one pixel."""
    if other.width <= 1 or other.height <= 1:
        return False
    beside = other.x >= region.x + region.width or other.x + other.width <= region.x
    return not (beside or other.y >= region.y + region.height or other.y + other.height <= region.y)


# Colours -------------------------------------------------------------------------------------------------------------


def panel_color() -> tuple[float, ...]:
    """Behind text, RGBA: that of the theme's menus, dense enough to read on."""
    red, green, blue, alpha = bpy.context.preferences.themes[0].user_interface.wcol_menu_back.inner
    return red, green, blue, max(alpha, 0.85)


def panel_text_color() -> tuple[float, ...]:
    """Returns the colour of text on a panel, RGBA: that of text in menus."""
    return (*bpy.context.preferences.themes[0].user_interface.wcol_menu_item.text, 1.0)


def view_text_color() -> tuple[float, ...]:
    """Text over the view itself, RGBA; it has a shadow."""
    return (*bpy.context.preferences.themes[0].view_3d.space.text_hi, 1.0)


def with_alpha(color: Color) -> tuple[float, ...]:
    """RGBA of RGB or RGBA."""
    return tuple(color) if len(color) == 4 else (*color, 1.0)


# Drawing -------------------------------------------------------------------------------------------------------------


def draw_text(x: float, y: float, text: str, size: float = TEXT_SIZE, color: Color | None = None) -> None:
    """A line of text that begins at x on the base line y. With no colour it is the view's, and has a shadow."""
    import blf

    blf.size(FONT, pixels(size))
    blf.position(FONT, round(x), round(y), 0.0)
    chosen = view_text_color() if color is None else with_alpha(color)
    blf.color(FONT, *chosen)
    if color is None:
        shade = 0.0 if sum(chosen[:3]) > 1.5 else 1.0
        blf.enable(FONT, blf.SHADOW)
        blf.shadow(FONT, 5, shade, shade, shade, 0.9)
        blf.shadow_offset(FONT, 1, -1)
    blf.draw(FONT, text)
    blf.disable(FONT, blf.SHADOW)


def draw_rect(x: float, y: float, w: float, h: float, color: Color, radius: float = 0.0) -> None:
    """A filled rectangle from its lower left corner. radius: of its corners, in pixels."""
    _draw(_rounded(x, y, w, h, radius), "TRI_FAN", with_alpha(color))


def draw_panel(x: float, y: float, w: float, h: float) -> None:
    """A rectangle as menus have it, to write on with `panel_text_color`."""
    draw_rect(x, y, w, h, panel_color(), pixels(4.0))


def draw_text_panel(x: float, y: float, lines: Sequence[str], size: float = TEXT_SIZE) -> None:
    """Draw lines of text on a panel of their size (see `text_panel_size`); (x, y) is its lower left corner."""
    width, height = text_panel_size(lines, size)
    draw_panel(x, y, width, height)
    margin, step = pixels(MARGIN), text_size("", size)[1]
    for number, line in enumerate(reversed(lines)):
        draw_text(x + margin, y + margin + number * step + 0.2 * step, line, size, panel_text_color())


def text_panel_size(lines: Sequence[str], size: float = TEXT_SIZE) -> tuple[float, float]:
    """The (width, height) in pixels of what `draw_text_panel` draws."""
    widths = [text_size(line, size)[0] for line in lines]
    return max(widths, default=0.0) + 2 * pixels(MARGIN), len(lines) * text_size("", size)[1] + 2 * pixels(MARGIN)


def draw_bar(
    x: float,
    y: float,
    w: float,
    h: float,
    labels: Sequence[tuple[float, str]],
    colors: Sequence[Color],
    color: Color | None = None,
    size: float = TEXT_SIZE,
) -> None:
    """A colour bar from left to right, with numbers under it.

    labels: (position from 0 to 1, text there). colors: two or more, at even distances.
    color: of the text.
    """
    step = w / (len(colors) - 1)
    corners = [(x + step * (place // 2), y + h * (place % 2)) for place in range(2 * len(colors))]
    _draw_smooth(corners, [with_alpha(stop) for stop in colors for _ in range(2)])
    mark = view_text_color() if color is None else color
    for place, label in labels:
        middle = x + w * place
        draw_rect(round(middle - 0.5), y - pixels(TICK), max(1.0, round(pixels(1.0))), pixels(TICK), mark)
        width = text_size(label, size)[0]
        left = min(max(middle - width / 2, x), x + w - width)  # the first and the last stay within the bar's ends
        draw_text(left, y - pixels(TICK + 1.0 + size), label, size, color)


def draw_lines_2d(points: Sequence[Point], color: Color, width: float = 1.0, *, is_closed: bool = False) -> None:
    """A line through points, smooth at its edges. width: in points."""
    if len(points) < 2:
        return
    ends = [(x, y, 0.0) for x, y in ([*points, points[0]] if is_closed else points)]
    with blended():
        draw_shape("POLYLINE_UNIFORM_COLOR", "LINE_STRIP", {"pos": ends}, with_alpha(color), width)


@contextmanager
def blended() -> Iterator[None]:
    """Drawings within this are blended with the background by their opacity."""
    import gpu

    gpu.state.blend_set("ALPHA")
    try:
        yield
    finally:
        gpu.state.blend_set("NONE")


def draw_shape(name: str, kind: str, content: dict[str, Any], color: Color | None = None, width: float = 0.0) -> None:
    """Draws vertices once, by one of Blender's shaders. content: their columns. width: of lines, in points."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    shader = gpu.shader.from_builtin(name)
    batch = batch_for_shader(shader, kind, content)
    shader.bind()
    if width:
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("lineWidth", pixels(width))
    if color is not None:
        shader.uniform_float("color", color)
    batch.draw(shader)


def _draw(points: Sequence[Point], kind: str, color: Color) -> None:
    with blended():
        draw_shape("UNIFORM_COLOR", kind, {"pos": [(px, py, 0.0) for px, py in points]}, color)


def _draw_smooth(points: Sequence[Point], colors: Sequence[Color]) -> None:
    content = {"pos": [(px, py, 0.0) for px, py in points], "color": colors}
    with blended():
        draw_shape("SMOOTH_COLOR", "TRI_STRIP", content)


def _rounded(x: float, y: float, w: float, h: float, radius: float) -> list[Point]:
    """The corners of a convex shape, counter-clockwise."""
    radius = min(radius, w / 2, h / 2)
    if radius <= 0.0:
        return [(x, y), (x + w, y), (x + w, y + h), (x, y + h)]
    points = []
    centres = ((x + w - radius, y + h - radius), (x + radius, y + h - radius), (x + radius, y + radius))
    for quarter, (cx, cy) in enumerate((*centres, (x + w - radius, y + radius))):
        for step in range(CORNER_STEPS + 1):
            angle = math.pi / 2 * (quarter + step / CORNER_STEPS)
            points.append((cx + radius * math.cos(angle), cy + radius * math.sin(angle)))
    return points


# Box lines -----------------------------------------------------------------------------------------------------------
# Boxes as lines with colors, in arrays for a graphics card. Does not depend on Blender.
#
# A box is eight vertices and twelve lines. Its colour shows its depth in the tree, the share of it that its siblings
# cover as well, or its cost.


Float32Array = npt.NDArray[np.float32]

# Corner i takes the upper bound on axis a where bit a of i is set; lines join corners that differ in one bit.
CORNERS = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
EDGES = np.array([(a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit], np.int32)

# From least to most: blue, cyan, green, yellow, red.
RAMP = np.array([(0.1, 0.2, 1.0), (0.0, 0.75, 0.95), (0.1, 0.8, 0.2), (1.0, 0.85, 0.1), (1.0, 0.1, 0.05)])
OPACITY = 0.85
# What costs less than the dearest box by more than this has the first colour.
COST_DECADES = 4.0
# More are too dense to be distinguished, and would delay the drawing of every viewport.
MOST_BOXES = 100_000


@dataclass(frozen=True, slots=True)
class BoxLines:
    """N boxes. positions: (8N, 3) float32. colors: (8N, 4) float32 RGBA. lines: (12N, 2) int32, rows of positions."""

    positions: Float32Array
    colors: Float32Array
    lines: npt.NDArray[np.int32]


def box_lines(boxes: TreeBoxes, color_by: str) -> BoxLines:
    """The lines of all boxes. color_by: "LEVEL", "OVERLAP" or "COST"."""
    count = len(boxes)
    bounds = boxes.boxes.astype(np.float32)
    positions = np.empty((count, 8, 3), np.float32)
    for axis in range(3):
        positions[:, :, axis] = bounds[:, CORNERS[:, axis], axis]
    firsts = np.arange(0, 8 * count, 8, dtype=np.int32)
    return BoxLines(
        positions=positions.reshape(-1, 3),
        colors=np.repeat(ramp_colors(shares(boxes, color_by)), 8, axis=0),
        lines=(firsts[:, None, None] + EDGES).reshape(-1, 2),
    )


def shares(boxes: TreeBoxes, color_by: str) -> npt.NDArray[np.float64]:
    """Returns (N,) the position of each box on the ramp, 0 to 1."""
    if color_by == "LEVEL":
        return boxes.levels / max(boxes.depth, 1)
    if color_by == "OVERLAP":
        return np.clip(boxes.overlaps.astype(np.float64), 0.0, 1.0)
    costs = boxes.costs.astype(np.float64)
    dearest = costs.max(initial=0.0)
    if not dearest > 0.0:
        return np.zeros(len(costs))
    decades = np.log10(np.maximum(costs / dearest, 10.0**-COST_DECADES))
    return 1.0 + decades / COST_DECADES


def ramp_colors(places: npt.NDArray[Any]) -> Float32Array:
    """(N, 4) float32 RGBA for places on the ramp from 0 to 1."""
    stops = np.linspace(0.0, 1.0, len(RAMP))
    colors = np.empty((len(places), 4), np.float32)
    for channel in range(3):
        colors[:, channel] = np.interp(places, stops, RAMP[:, channel])
    colors[:, 3] = OPACITY
    return colors
