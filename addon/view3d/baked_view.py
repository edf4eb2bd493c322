"""What a bake's colours mean: a scale, the value under the mouse, and when the sun shines there.

In 3D viewports with Solid shading and the color Attribute, while the colours of the active object are a bake's. When
the sun shines is known for the last bake of this session.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from bpy_extras import view3d_utils

from ..settings.preferences import redraw_viewports
from . import pointer
from .baked_colors import RAMP, Meaning, meaning_of, ramp_colors, value_at
from .drawing import MARGIN, draw_bar, draw_panel, draw_text, free_rect, panel_text_color, pixels, text_size
from .legend import OneShown, Scale, Section, is_main
from .pointer import Pointed, view_of

STOPS = 4  # steps between numbers of the scale
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
CHART_WIDTH, ROW, ROW_GAP, NAME_WIDTH, SUM_WIDTH = 190.0, 11.0, 2.0, 30.0, 52.0  # in points


@dataclass(frozen=True, slots=True)
class SunTimes:
    """When the sun shone on the faces of a bake.

    visible: by a mesh's session uid (F, D / 8) uint8, a bit for each direction, the first one highest.
    times, hours: (D,) the directions' clock times and lengths.
    """

    visible: dict[int, npt.NDArray[np.uint8]]
    times: npt.NDArray[np.datetime64]
    hours: npt.NDArray[np.float64]

    def chart(
        self, uid: int, face: int, value: float
    ) -> tuple[list[str], npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
        """Return the names of the months, (M, 24) the share of each clock hour with sun, and (M,) the months' hours.

        value: the face's hours, as its mesh has them now. None if these are not those of the bake, since the mesh has
        changed; for a mesh or a face that was not baked, and for directions that last more than an hour each.
        """
        bits = self.visible.get(uid)
        if bits is None or not 0 <= face < len(bits) or self.hours.max(initial=0.0) > 1.0 + 1e-9:
            return None
        shines = np.unpackbits(bits[face])[: len(self.hours)] * self.hours
        if not abs(float(shines.sum()) - value) <= 1e-5 * max(value, 1.0):
            return None
        months = self.times.astype("datetime64[M]").astype(int) % 12
        clock = self.times.astype("datetime64[h]").astype(int) % 24
        days = np.unique(self.times.astype("datetime64[D]")).astype("datetime64[M]").astype(int) % 12
        table, counts = np.zeros((12, 24)), np.bincount(days, minlength=12)
        np.add.at(table, (months, clock), shines)
        rows = np.flatnonzero(counts)
        return [MONTHS[row] for row in rows], table[rows] / counts[rows, None], table[rows].sum(axis=1)


last_sun: OneShown[SunTimes] = OneShown()
_face: tuple[int, int, float] | None = None  # that the mouse was last over: its mesh's session uid, index and value
_pointed: Pointed | None = None
_lines: list[str] = []


def shown_meaning(context: bpy.types.Context, obj: bpy.types.Object | None) -> Meaning | None:
    """Return what an object's colours mean in the context's 3D viewport; None where it does not show a bake's."""
    space: Any = context.space_data
    if space.shading.type != "SOLID" or space.shading.color_type != "VERTEX" or not space.overlay.show_overlays:
        return None
    return None if obj is None or obj.type != "MESH" else meaning_of(obj.data)


def _main_meaning(context: bpy.types.Context) -> Meaning | None:
    """Return what the colours mean of the active object, or of the first selected one that shows a bake."""
    objects = (context.object, *context.view_layer.objects.selected)
    return next((found for obj in objects if (found := shown_meaning(context, obj)) is not None), None)


def sections(context: bpy.types.Context) -> list[Section]:
    """Return the sections of a viewport's legend that describe the bake of the active or the selected objects."""
    meaning = _main_meaning(context)
    if meaning is None:
        return []
    span = meaning.most - meaning.least
    form = ",.0f" if span >= 100.0 else ".3g"
    labels = tuple((stop / STOPS, f"{meaning.least + span * stop / STOPS:{form}}") for stop in range(STOPS + 1))
    caption = f"{meaning.label}, {meaning.unit}" if meaning.unit else meaning.label
    return [Section((), Scale(caption, labels), tuple(map(tuple, RAMP.tolist())))]


def tip(context: bpy.types.Context) -> tuple[tuple[int, int], list[str]] | None:
    """Return the mouse's position in the region that is being drawn, and the tip there."""
    if not _lines or _pointed is None or _pointed.region != context.region.as_pointer():
        return None
    return (_pointed.place, _lines) if _pointed.view == view_of(context) else None


def draw_chart(context: bpy.types.Context) -> None:
    """Draw when the sun shines on the face that the mouse was last over, or on the active face: a row a month."""
    if last_sun.found is None or not is_main(context.area, context.region) or _main_meaning(context) is None:
        return
    found = None if _face is None else last_sun.found.chart(*_face)
    obj = context.object
    meaning = shown_meaning(context, obj)
    if found is None and obj is not None and meaning is not None and not obj.data.is_editmode and obj.data.polygons:
        face = obj.data.polygons.active
        found = last_sun.found.chart(obj.data.session_uid, face, value_at(obj.data, meaning.attribute, face))
    if found is None:
        return
    names, shares, sums = found
    line, row, margin = text_size("")[1], pixels(ROW + ROW_GAP), pixels(MARGIN)
    width = pixels(NAME_WIDTH + CHART_WIDTH + SUM_WIDTH) + 2 * margin
    height = 2 * line + row * len(names) + 2 * margin
    free = free_rect(context.area, context.region)
    left, bottom = free.right - width - margin, free.bottom + margin
    if left < free.left or bottom + height > free.top:
        return  # the viewport is smaller than the chart
    draw_panel(left, bottom, width, height)
    color, start = panel_text_color(), left + margin + pixels(NAME_WIDTH)
    top = bottom + height - margin - line
    draw_text(left + margin, top + 0.25 * line, "Sun on this face, by clock time", color=color)
    for number, name in enumerate(names):
        y = top - (number + 1) * row
        labels = [(hour / 24, str(hour)) for hour in range(0, 25, 6)] if number == len(names) - 1 else []
        stops = ramp_colors(np.repeat(shares[number], 8), 0.0, 1.0)
        draw_bar(start, y, pixels(CHART_WIDTH), pixels(ROW), labels, stops.tolist(), color)
        draw_text(left + margin, y + pixels(1.5), name, color=color)
        draw_text(start + pixels(CHART_WIDTH + 6.0), y + pixels(1.5), f"{sums[number]:.1f} h", color=color)


class _Pointing:
    """The mouse, as far as it is over faces that show a bake."""

    def wants_pointer(self, context: bpy.types.Context) -> bool:
        return _main_meaning(context) is not None

    def on_pointer(self, context: bpy.types.Context, place: tuple[int, int]) -> None:
        global _face, _pointed, _lines
        had_tip = bool(_lines)
        _pointed, _lines = Pointed.of(context, place), []
        where = context.region, context.region_data, place
        origin, towards = (view3d_utils.region_2d_to_origin_3d(*where), view3d_utils.region_2d_to_vector_3d(*where))
        depsgraph = context.view_layer.depsgraph
        is_hit, _, _, face, obj, _ = context.scene.ray_cast(depsgraph, origin, towards)
        meaning = shown_meaning(context, obj) if is_hit else None
        mesh = None if meaning is None else obj.evaluated_get(depsgraph).data
        if meaning is not None and meaning.attribute in mesh.attributes and 0 <= face < len(mesh.polygons):
            value = value_at(mesh, meaning.attribute, face)
            number = f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
            _lines = [f"{meaning.label}: {number} {meaning.unit}".rstrip(), f"Face {face:,} of {obj.name}"]
            is_own = len(mesh.polygons) == len(obj.data.polygons)  # else modifiers make others
            _face = (obj.data.session_uid, face, value) if is_own else None
        if had_tip or _lines:
            context.region.tag_redraw()

    def on_pointer_left(self) -> None:
        global _lines
        if _lines:
            redraw_viewports()
        _lines = []


_pointing = _Pointing()


def register() -> None:
    pointer.listeners.append(_pointing)


def unregister() -> None:
    global _face, _pointed, _lines
    pointer.listeners.remove(_pointing)
    last_sun.hide()
    _face, _pointed, _lines = None, None, []
