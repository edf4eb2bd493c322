"""A colour for each point from a column of numbers, vectors or ids. Knows no Blender."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..settings.point_color_items import find_color
from .point_cloud import PointCloud

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]

# From low to high, in sRGB: yellow, green, blue, violet, of falling lightness.
RAMP = np.array(
    [
        (253, 231, 37),
        (122, 209, 81),
        (34, 168, 132),
        (42, 120, 142),
        (65, 68, 135),
        (68, 1, 84),
    ]
)
# The lowest and the highest hundredth get the ends, so that a single far point does not take all of the ramp.
RAMP_SHARES = (1.0, 99.0)
GOLDEN = 0.6180339887498949
SATURATIONS, VALUES = (0.55, 0.4, 0.65), (0.9, 0.75, 0.6)
NOTHING = 0.2  # the grey, linear, of what has no value: no material, no label
# Columns of a cloud by the names that they have on points.
COLUMNS = {
    "position": "positions",
    "distance": "distances",
    "normal": "normals",
    "object_id": "object_ids",
    "instance_id": "instance_ids",
    "material_id": "material_ids",
    "time": "times",
    "ring": "ring_ids",
    "incidence": "incidences",
    "intensity": "intensities",
    "return_id": "return_ids",
    "return_count": "return_counts",
}


def colors_of(cloud: PointCloud, color_by: str) -> Float32Array:
    """(N, 4) float32 scene-linear RGBA. color_by: the identifier of one of `POINT_COLORS`, such as "DISTANCE"."""
    color = find_color(color_by)
    values = getattr(cloud, COLUMNS[color.column])
    # In the precision that attributes of points have: colours are the same whichever they are made from.
    kept = np.int32 if np.issubdtype(values.dtype, np.integer) else np.float32
    return colors_of_column(values.astype(kept), color.scale)


def colors_of_column(values: npt.NDArray[Any], scale: str) -> Float32Array:
    """(N, 4) float32 scene-linear RGBA of (N,) or (N, 3) values. scale: as `PointColor` has it.

    What has no value, NaN or an id below 0, is grey.
    """
    if scale == "ids":
        return _id_colors(values)
    if scale == "normal":
        return _opaque(_to_linear(np.clip(0.5 + 0.5 * values.astype(np.float64), 0.0, 1.0)))
    if scale == "grey":
        brightest = max(float(np.nanmax(values, initial=0.0)), 1e-6)
        return _opaque(np.repeat(values[:, None] / brightest, 3, axis=1))
    numbers = values.astype(np.float64)
    if scale == "height":
        numbers = numbers[:, 2]
    return _ramp_colors(np.log(np.maximum(numbers, 1e-9)) if scale == "near" else numbers)


def scale_of_column(values: npt.NDArray[Any]) -> str:
    """How a column is shown of which nothing is known but its numbers."""
    if values.ndim > 1:
        return "normal"
    return "ids" if np.issubdtype(values.dtype, np.integer) else "ramp"


def _ramp_colors(numbers: Float64Array) -> Float32Array:
    """Even steps of the ramp for even steps of the numbers."""
    has_value = np.isfinite(numbers)
    colors = np.full((len(numbers), 3), NOTHING)
    if has_value.any():
        first, last = np.percentile(numbers[has_value], RAMP_SHARES)
        places = (numbers[has_value] - first) / max(float(last - first), 1e-9)
        stops, ramp = np.linspace(0.0, 1.0, len(RAMP)), _to_linear(RAMP / 255.0)
        colors[has_value] = np.stack([np.interp(places, stops, ramp[:, channel]) for channel in range(3)], axis=1)
    return _opaque(colors)


def _id_colors(ids: npt.NDArray[np.integer[Any]]) -> Float32Array:
    """Hues by the golden ratio, so that those of any run of ids are far apart; brightness tells the others."""
    known, rows = np.unique(ids, return_inverse=True)
    hue = np.where(known < 0, 0, known) * GOLDEN % 1.0
    saturation, value = np.array(SATURATIONS)[known % 3], np.array(VALUES)[known // 3 % 3]
    offsets = np.array((0.0, 2.0 / 3.0, 1.0 / 3.0))
    wheel = np.clip(np.abs((hue[:, None] + offsets) % 1.0 * 6.0 - 3.0) - 1.0, 0.0, 1.0)
    colors = _to_linear(value[:, None] * (1.0 - saturation[:, None] * (1.0 - wheel)))
    colors[known < 0] = NOTHING
    return _opaque(colors)[rows]


def _to_linear(srgb: Float64Array) -> Float64Array:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _opaque(colors: npt.NDArray[np.floating[Any]]) -> Float32Array:
    found = np.ones((len(colors), 4), np.float32)
    found[:, :3] = colors
    return found
