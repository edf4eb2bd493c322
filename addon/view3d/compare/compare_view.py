"""Two trees of one object side by side over a 3D viewport: each half shows the object with its boxes, in the same view.

The halves are separate pictures, made again only if the view, the boxes or the size change. The comparison
keeps its measurements; if the scene has changed since, a text says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import bpy

from ...events.changes import edit_count, watch_again
from ...settings.shading_settings import overlay_settings
from .. import drawing
from ..legend import DrawHandler, OneShown, close_rect, contains, draw_close
from .compare_trees import Row, heading_of, level_line, rows_of
from .half_picture import Framing, HalfPicture, background_color, frame_box

if TYPE_CHECKING:
    from .compare_trees import Comparison, Side

GAP = 12.0  # around and between the halves, in points
HEADING_SIZE, TITLE_SIZE = 12.0, 15.0
NAME_WIDTH, VALUE_WIDTH, RATIO_WIDTH = 118.0, 172.0, 50.0  # of the columns of words, in points
BETTER, WORSE = (0.35, 0.78, 0.42), (0.95, 0.45, 0.35)
DIM = 0.65  # of what names a number
LEAST_SCALE = 0.7  # of words in narrow halves
LEAST_HALF = 64.0  # of what can show anything, in points


@dataclass(slots=True)
class Shown:
    """The comparison and its viewport, by its address, and the scene's count of edits and frame at that time."""

    comparison: Comparison
    scene_uid: int
    space: int
    edits: int
    frame: int


@dataclass(slots=True)
class _Region:
    """The pictures of one region."""

    framing: Framing
    halves: tuple[HalfPicture, HalfPicture]


class _Tool(OneShown[Shown]):
    """Ends the comparison with the object, too."""

    is_unsure = False

    def forget(self) -> None:
        _regions.clear()

    def on_change(self, what: str) -> None:
        self.is_unsure = True


_regions: dict[int, _Region] = {}  # by address
_tool = _Tool()
hide = _tool.hide


def show(comparison: Comparison, scene: bpy.types.Scene, space: int, edits: int) -> None:
    """Shows it in a viewport, by its address, until `hide`. edits: the `edit_count` of the scene at the reading."""
    _tool.show(Shown(comparison, scene.session_uid, space, edits, scene.frame_current))


def shown() -> Shown | None:
    """Return the comparison, in any viewport; None if there is none."""
    return _tool.found


def shown_in(context: bpy.types.Context) -> Shown | None:
    """Return the comparison that the context's viewport shows instead of the scene; None if it shows the scene."""
    found = _tool.found
    if found is None or context.space_data is None or context.space_data.as_pointer() != found.space:
        return None
    return found if context.scene.session_uid == found.scene_uid else None


def is_old(found: Shown, scene: bpy.types.Scene) -> bool:
    """Whether the scene is another one by now, as far as is known."""
    return scene.frame_current != found.frame or edit_count(scene.session_uid) != found.edits


# Drawing -------------------------------------------------------------------------------------------------------------


def _draw() -> None:
    context = bpy.context
    found = shown_in(context)
    if found is None:
        return
    watch_again()
    if _tool.is_unsure:
        _tool.is_unsure = False
        if not any(obj.session_uid == found.comparison.shown.session_uid for obj in bpy.data.objects):
            hide()
            return
    draw_comparison(context, found)


def draw_comparison(context: bpy.types.Context, found: Shown) -> None:
    """Over all of the region that is being drawn."""
    region = context.region
    drawing.draw_rect(0.0, 0.0, region.width, region.height, background_color())
    free = drawing.free_rect(context.area, region)
    gap, step = drawing.pixels(GAP), drawing.text_size("")[1]
    columns = rows_of(found.comparison.left), rows_of(found.comparison.right, found.comparison.left)
    words = drawing.text_size("", TITLE_SIZE)[1] + (1 + max(map(len, columns))) * step
    top = free.top - gap - drawing.text_size("", HEADING_SIZE)[1]
    text_color = drawing.view_text_color()
    draw_close(close_rect(free.right, free.top), text_color)
    _draw_centered((free.left + free.right) / 2, top, _heading(context, found), HEADING_SIZE, text_color)
    bottom = free.bottom + gap + words
    middle = (free.left + free.right) / 2
    left = drawing.Rect(free.left + gap, bottom + gap, middle - gap / 2, top - gap)
    right = replace(left, left=middle + gap / 2, right=free.right - gap)
    if min(left.right - left.left, left.top - left.bottom) < drawing.pixels(LEAST_HALF):
        _draw_centered(middle, free.bottom + gap, "This region is too small", HEADING_SIZE, text_color)
        return
    pictures = _pictures_of(context, found, left)
    settings = overlay_settings(context.space_data)
    for side, rect, picture, rows in zip(
        (found.comparison.left, found.comparison.right), (left, right), pictures.halves, columns, strict=True
    ):
        picture.draw(context, rect, pictures.framing, settings)
        line = level_line(picture.level, side.depth, picture.count)
        _draw_words(side, rect, bottom, line, rows)


def _pictures_of(context: bpy.types.Context, found: Shown, rect: drawing.Rect) -> _Region:
    """Made when a region is drawn first: the object then fits, and further on the view's zoom is that of the halves."""
    address = context.region.as_pointer()
    if address not in _regions:
        size = rect.right - rect.left, rect.top - rect.bottom
        matrix = context.region_data.perspective_matrix
        framing = frame_box(found.comparison, matrix, (context.region.width, context.region.height), size)
        depth = max(found.comparison.left.depth, found.comparison.right.depth)
        left, right = (
            HalfPicture(found.comparison, side, depth) for side in (found.comparison.left, found.comparison.right)
        )
        _regions[address] = _Region(framing, (left, right))
    return _regions[address]


def _heading(context: bpy.types.Context, found: Shown) -> str:
    text = heading_of(found.comparison)
    return f"{text} (the scene has changed since)" if is_old(found, context.scene) else text


def _draw_words(side: Side, rect: drawing.Rect, top: float, level: str, rows: list[Row]) -> None:
    """Centered below a half, as a table; in narrow halves smaller, or those alone that fit."""
    bright = drawing.view_text_color()
    dim = (*bright[:3], DIM)
    room = (rect.right - rect.left) / drawing.pixels(NAME_WIDTH + VALUE_WIDTH + RATIO_WIDTH)
    scale = min(1.0, max(LEAST_SCALE, room))
    size, step = drawing.TEXT_SIZE * scale, drawing.text_size("")[1]
    middle = (rect.left + rect.right) / 2
    y = top - drawing.text_size("", TITLE_SIZE)[1] * 0.8
    _draw_centered(middle, y, side.label, TITLE_SIZE, bright)
    y -= step
    _draw_centered(middle, y, level, drawing.TEXT_SIZE, dim)
    if room < LEAST_SCALE:
        for number, text in enumerate(fitting_lines(rows, rect.right - rect.left, size), 1):
            _draw_centered(middle, y - number * step, text, size, bright)
        return
    widths = [drawing.pixels(width) * scale for width in (NAME_WIDTH, VALUE_WIDTH, RATIO_WIDTH)]
    left = middle - sum(widths) / 2
    for row in rows:
        y -= step
        drawing.draw_text(left, y, row.name, size, dim)
        drawing.draw_text(left + widths[0], y, row.value, size, bright)
        color = BETTER if row.is_better else WORSE if row.is_worse else dim
        drawing.draw_text(left + widths[0] + widths[1], y, row.ratio_text, size, color)


def fitting_lines(rows: list[Row], room: float, size: float) -> list[str]:
    """Return as lines the rows that are no wider than `room` pixels."""
    lines = [f"{row.name} {row.value}" for row in rows]
    return [line for line in lines if drawing.text_size(line, size)[0] <= room]


def _draw_centered(x: float, y: float, text: str, size: float, color: drawing.Color) -> None:
    drawing.draw_text(x - drawing.text_size(text, size)[0] / 2, y, text, size, color)


# The mouse -----------------------------------------------------------------------------------------------------------


class PERFECT_BVH_GT_compare(bpy.types.Gizmo):
    """The cross that ends it."""

    bl_idname = "PERFECT_BVH_GT_compare"

    def draw(self, context: bpy.types.Context) -> None:
        """The handler does."""

    def test_select(self, context: bpy.types.Context, location: Sequence[int]) -> int:
        """Whether the mouse is over it."""
        if shown_in(context) is None:
            return -1
        free = drawing.free_rect(context.area, context.region)
        return 0 if contains(close_rect(free.right, free.top), *location) else -1

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, tweak: set[str]) -> set[str]:
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        if not cancel:
            hide()


class PERFECT_BVH_GGT_compare(bpy.types.GizmoGroup):
    """Holds the cross."""

    bl_idname = "PERFECT_BVH_GGT_compare"
    bl_label = "Compare"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT"}  # noqa: RUF012 - as Blender wants it

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return shown_in(context) is not None

    def setup(self, context: bpy.types.Context) -> None:
        self.gizmos.new(PERFECT_BVH_GT_compare.bl_idname)


CLASSES = (PERFECT_BVH_GT_compare, PERFECT_BVH_GGT_compare)
_handler = DrawHandler(_draw, "POST_PIXEL")


def register() -> None:
    """Draw where something is compared."""
    for owner in CLASSES:
        bpy.utils.register_class(owner)
    _handler.add()


def unregister() -> None:
    """Stop drawing, and drop the comparison."""
    hide()
    _handler.remove()
    for owner in reversed(CLASSES):
        bpy.utils.unregister_class(owner)
