"""The lines and the range of the scan's sensor, drawn over 3D viewports while the object that carries it is selected.

A camera is drawn by Blender itself, as its frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

from ..scanning.patterns import SpinningLidar
from ..scanning.scan import FROM_SENSOR_TO_OBJECT
from ..scanning.sensor_settings import absolute, sensor_of
from .legend import DrawHandler

if TYPE_CHECKING:
    import gpu

# Limits of the drawing: shots in a turn, ends of rays, whole rays.
TURN, MOST_ENDS, MOST_RAYS = 120, 8192, 32
UNLIMITED = 100.0  # how far a sensor without a range is drawn
COLOR = (0.25, 0.85, 0.75, 0.9)
FAINT = (*COLOR[:3], 0.25)
END_SIZE = 2.0  # in pixels


@dataclass(frozen=True, slots=True)
class Outline:
    """The drawing, in the space of the object. ends: (E, 3) float32, rays: (2 * R, 3) float32, pairs of ends."""

    ends: npt.NDArray[np.float32]
    rays: npt.NDArray[np.float32]


def outline_of(settings: bpy.types.PropertyGroup) -> Outline:
    """Returns the ends of rays of a whole turn, and some whole rays. Raises ValueError as `sensor_of` does."""
    pattern = sensor_of(settings).pattern
    is_spinning = isinstance(pattern, SpinningLidar)
    if is_spinning:
        pattern = replace(pattern, columns=min(pattern.columns, TURN))
    rays = pattern.cast(0.0, pattern.duration, None)
    reach = rays.t_max if math.isfinite(rays.t_max) else UNLIMITED
    starts = rays.origins @ FROM_SENSOR_TO_OBJECT.T
    ends = starts + rays.directions @ FROM_SENSOR_TO_OBJECT.T * reach
    # For a spinning head the vertical lines straight ahead; for others some of all rays.
    ahead = len(rays) // 2 // (lines := int(rays.ring_ids.max()) + 1) * lines if is_spinning else 0
    column = slice(ahead, ahead + lines) if is_spinning else slice(None)
    whole = _some(np.arange(len(rays))[column], MOST_RAYS)
    shown = _some(np.arange(len(rays)), MOST_ENDS)
    pairs = np.stack([starts[whole], ends[whole]], axis=1).reshape(-1, 3)
    return Outline(ends[shown].astype(np.float32), pairs.astype(np.float32))


def _some(rows: npt.NDArray[np.intp], most: int) -> npt.NDArray[np.intp]:
    """Return at most `most` of the rows, spread evenly, with the first and the last."""
    if len(rows) <= most:
        return rows
    return rows[np.linspace(0, len(rows) - 1, most).round().astype(np.intp)]


def shown_sensor(context: bpy.types.Context) -> bpy.types.Object | None:
    """The object whose sensor this viewport shows."""
    settings, space = context.scene.perfect_bvh.scan, context.space_data
    obj = settings.sensor
    if obj is None or settings.pattern == "CAMERA" or not space.overlay.show_overlays:
        return None
    layer = context.view_layer
    is_shown = obj.select_get(view_layer=layer) and obj.visible_get(view_layer=layer, viewport=space)
    return obj if is_shown else None


class _Drawn:
    """The batches of the last sensor that was drawn, and the settings that it had."""

    asked: tuple[Any, ...] = ()
    batches: tuple[gpu.types.GPUBatch, gpu.types.GPUBatch] | None = None


def _batches_of(settings: bpy.types.PropertyGroup) -> tuple[gpu.types.GPUBatch, gpu.types.GPUBatch] | None:
    """Return batches; None for an invalid sensor, whose error the button shows."""
    asked = (*(getattr(settings, name) for name in ("pattern", "elevations", "columns", "rate", "max_distance")),)
    if settings.pattern == "FILE":
        asked += (settings.sensor_file, _changed_at(settings.sensor_file))
    if asked != _Drawn.asked:
        from gpu_extras.batch import batch_for_shader

        _Drawn.asked, _Drawn.batches = asked, None
        try:
            outline = outline_of(settings)
        except ValueError:
            return None
        shader = _shader()
        ends = batch_for_shader(shader, "POINTS", {"pos": outline.ends})
        _Drawn.batches = ends, batch_for_shader(shader, "LINES", {"pos": outline.rays})
    return _Drawn.batches


def _changed_at(path: str) -> float:
    """When a file was written last; 0 where there is none."""
    try:
        return absolute(path).stat().st_mtime
    except OSError:
        return 0.0


def _shader() -> Any:
    import gpu

    return gpu.shader.from_builtin("UNIFORM_COLOR")


def _draw() -> None:
    context = bpy.context
    obj = shown_sensor(context)
    batches = None if obj is None else _batches_of(context.scene.perfect_bvh.scan)
    if obj is None or batches is None:
        return
    import gpu

    shader = _shader()
    place, turn, _ = obj.matrix_world.decompose()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.point_size_set(END_SIZE)
    with gpu.matrix.push_pop():
        gpu.matrix.translate(place)
        gpu.matrix.multiply_matrix(turn.to_matrix().to_4x4())
        for batch, color in zip(batches, (COLOR, FAINT), strict=True):
            shader.uniform_float("color", color)
            batch.draw(shader)
    gpu.state.point_size_set(1.0)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


_handler = DrawHandler(_draw, "POST_VIEW")


def register() -> None:
    """Draw the sensor over every 3D viewport from now on."""
    _handler.add()


def unregister() -> None:
    """Draw no more."""
    _handler.remove()
    _Drawn.asked, _Drawn.batches = (), None
