"""The button Bake Sun, Sky and Thickness: a value for each face of the selected meshes, shown as colours at once.

In a window it works in steps of a timer while Blender continues, and Esc cancels it. Without one, or when a script
calls it, it does the same in one go. The scene does not change before the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import bpy
import numpy as np

from ..settings.bake_choices import KINDS
from ..settings.bake_settings import options_of, sun_position_of
from ..statistics.words import duration
from ..support.files import data_library
from ..view3d.baked_colors import check_colors, color_meshes
from ..view3d.baked_view import SunTimes, last_sun
from ..view3d.legend import OneShown
from .measure import find_space
from .piece_jobs import JobOperator
from .preview import show_in_editor
from .scan_request import threads_of

if TYPE_CHECKING:
    from ..baking import Bake, DirectionTable

MOST_BYTES = 1 << 29  # of the times at which faces have sun, for the chart
IRRADIATION = "irradiation"  # the attribute of light by a weather file

last_bake: OneShown[Bake] = OneShown()  # whose values are kept where nothing has changed, until another file is loaded


class PERFECT_BVH_OT_bake_rays(JobOperator, bpy.types.Operator):
    """Steps through a bake in a timer."""

    bl_idname = "perfect_bvh.bake_rays"
    bl_label = "Bake Sun, Sky and Thickness"
    bl_description = "Cast rays from each face of the selected meshes, and show what they find as colors. Esc cancels"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    doing = "Baking"
    _space: int | None

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        settings = context.scene.perfect_bvh.bake
        if context.mode != "OBJECT":
            return "Switch to Object Mode first: values are written to meshes"
        if not any(obj.type == "MESH" for obj in context.selected_objects):
            return "Nothing selected: select the meshes whose faces get values"
        if settings.kind == "SUN_HOURS" and settings.light == "WEATHER" and not settings.weather.strip():
            return "No weather file: choose one, or measure hours of sun"
        return None

    def _make_job(self, context: bpy.types.Context) -> BakeJob:
        self._space = find_space(context)
        return BakeJob(context)

    def _hold(self, context: bpy.types.Context) -> float | None:
        from ..live.scene_view import SceneView

        return SceneView("bake", context.scene, context.view_layer).hold(self._run)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        job = self._job
        try:
            text = job.write()
        except (ValueError, ImportError, OSError) as problem:
            self._complain(problem)
            return {"CANCELLED"}
        for warning in job.warnings:
            self._complain(warning, "WARNING")
        if not job.images:
            _show_colors(context, self._space)
        elif not bpy.app.background:
            show_in_editor(context, job.images[0])
        self._conclude(f"{text}, {duration(1e3 * (time.perf_counter() - self._started))}")
        return {"FINISHED"}


class BakeJob:
    """The bake that the panel describes. Raises ValueError for settings that cannot be baked, OSError and ImportError.

    images: that were written; none if values are attributes.
    """

    where, built_share = "", None

    def __init__(self, context: bpy.types.Context) -> None:
        from ..baking import Baker, BakeSettings

        scene, settings = context.scene, context.scene.perfect_bvh.bake
        objects = [obj for obj in context.selected_objects if obj.type == "MESH"]
        choices: dict[str, Any] = {name: getattr(settings, name) for name in ("kind", "domain", *options_of(settings))}
        choices |= {"uv_map": settings.uv_map or None, "image_size": (settings.width, settings.height)}
        self._table: DirectionTable | None = None
        if settings.kind == "SUN_HOURS":
            table = self._table = table_of(scene)
            bits = len(table.weights) * sum(len(obj.data.polygons) for obj in objects)
            keeps = settings.domain == "FACE" and not table.has_cosine and bits <= 8 * MOST_BYTES
            choices |= {"directions": table, "keep_visible": keeps}
        if settings.kind == "EXPOSURE" and settings.use_frames:
            choices["frames"] = range(scene.frame_start, scene.frame_end + 1)
        is_light = self._table is not None and self._table.has_cosine
        self._name = IRRADIATION if is_light else None
        self._label = IRRADIATION.title() if is_light else KINDS[settings.kind].label
        self._path, self._margin = _table_path(settings.table.strip()), settings.margin
        self.images: list[bpy.types.Image] = []
        how = {"previous": last_bake.found, "threads": threads_of(scene)}
        self.baker = Baker(objects, BakeSettings(**choices), **how)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Returns what is not as expected."""
        return (() if self._table is None else self._table.warnings) + self.baker.result().warnings

    def steps(self) -> Generator[float, None, None]:
        """Yields the share done, 0 to 1."""
        return self.baker.steps()

    def release(self) -> None:
        """Does nothing: the baker releases its data."""

    def stopped(self) -> str:
        """Returns the message to a user who has stopped it."""
        return "Bake canceled: nothing was written"

    def write(self) -> str:
        """Writes the table and the values; returns a sentence. Nothing is written if the values have no place.

        Raises ValueError, ImportError and OSError.
        """
        bake, is_image = self.baker.result(), self.baker.settings.domain == "TEXEL"
        by_uid = {obj.session_uid: obj for obj in bpy.data.objects}  # the window may show another scene by now
        if not is_image:
            names = bake.check_attributes(self._name)
            check_colors([by_uid[baked.session_uid] for baked in bake.objects], next(iter(names.values())))
        if self._path is not None:
            (bake.write_parquet if self._path.suffix == ".parquet" else bake.write_csv)(self._path)
        last_bake.show(bake)
        last_sun.hide()
        if is_image:
            self.images = bake.to_image(self._name, margin=self._margin)
            others = len(self.images) - 1
            where = f", in the image {self.images[0].name!r}{f' and {others} more' if others else ''}"
        else:
            self._show(bake, [by_uid[baked.session_uid].data for baked in bake.objects])
            where = ""
        known = np.concatenate([baked.values[np.isfinite(baked.values)] for baked in bake.objects])
        span = f"from {known.min(initial=0.0):.4g} to {known.max(initial=0.0):.4g}"
        text = f"{self._label}: {len(known):,} values {span} {next(iter(bake.units.values()))}".rstrip()
        return f"{text}{where}{'' if self._path is None else f', also in {self._path}'}"

    def _show(self, bake: Bake, meshes: list[bpy.types.Mesh]) -> None:
        """Writes the attributes and the colours."""
        name = bake.write_attributes(self._name)[0]
        color_meshes(meshes, name, self._label, next(iter(bake.units.values())))
        visible = {mesh.session_uid: baked.visible for mesh, baked in zip(meshes, bake.objects, strict=True)}
        if self._table is not None and all(bits is not None for bits in visible.values()):
            last_sun.show(SunTimes(visible, self._table.times, self._table.weights))


def _table_path(text: str) -> Path | None:
    """Returns where the table goes, None for no table. Raises ValueError and ImportError if it cannot be written."""
    if not text:
        return None
    path = Path(bpy.path.abspath(text))
    if not path.parent.is_dir():
        raise ValueError(f"Table: there is no folder {path.parent}")
    if path.suffix == ".parquet":
        data_library("pyarrow", "Parquet files need pyarrow")
    return path


def table_of(scene: bpy.types.Scene) -> DirectionTable:
    """Returns the directions that the panel describes. Raises ValueError for dates, places and files; OSError."""
    from ..baking import sun

    settings, other = scene.perfect_bvh.bake, sun_position_of(scene)
    dates = settings if other is None or settings.period == "RANGE" else other
    first, last = _date(dates.year, dates.month, dates.day), None
    if settings.period == "RANGE":
        last = _date(settings.year, settings.month_end, settings.day_end)
    elif settings.period == "YEAR":
        first, last = date(dates.year, 1, 1), date(dates.year, 12, 31)
    north = math.degrees(settings.north if other is None else other.north_offset)
    if settings.light == "WEATHER":
        weather = sun.read_epw(bpy.path.abspath(settings.weather), north=north)
        return sun.irradiance_table(weather, first, last or first)
    if other is None:
        place = sun.Place(settings.latitude, settings.longitude, settings.zone, north)
    else:
        zone = f"{other.UTC_zone + other.use_daylight_savings:g}"
        place = sun.Place(other.latitude, other.longitude, zone, north)
    return sun.sun_table(place, first, last, step=settings.step or (10 if last is None else 60))


def _date(year: int, month: int, day: int) -> date:
    try:
        return date(year, month, day)
    except ValueError as error:
        raise ValueError(f"There is no day {day} in month {month} of {year}") from error


def _show_colors(context: bpy.types.Context, space_pointer: int | None) -> None:
    """Sets the viewport that the button was pressed in to the colours, without shadows that would change them."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            space: Any = area.spaces.active
            if area.type == "VIEW_3D" and space.as_pointer() == space_pointer:
                space.shading.type, space.shading.color_type, space.shading.light = "SOLID", "VERTEX", "FLAT"
                area.tag_redraw()


CLASSES = (PERFECT_BVH_OT_bake_rays,)


def forget() -> None:
    """Drops the last bake."""
    last_bake.hide()
