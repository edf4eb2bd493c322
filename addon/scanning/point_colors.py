"""A colour for each point: by distance, by object or by intensity. Knows no Blender."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .point_cloud import PointCloud

Float32Array = npt.NDArray[np.float32]

# From near to far, in sRGB: yellow, green, blue, violet, of falling lightness.
DISTANCE_RAMP = np.array(
    [
        (253, 231, 37),
        (122, 209, 81),
        (34, 168, 132),
        (42, 120, 142),
        (65, 68, 135),
        (68, 1, 84),
    ]
)
# The nearest and the farthest hundredth get the ends, so that a single far point does not take all of the ramp.
DISTANCE_SHARES = (1.0, 99.0)
GOLDEN = 0.6180339887498949
SATURATIONS, VALUES = (0.55, 0.4, 0.65), (0.9, 0.75, 0.6)


def colors_of(cloud: PointCloud, color_by: str) -> Float32Array:
    """(N, 4) float32 scene-linear RGBA. color_by: "DISTANCE", "OBJECT" or "INTENSITY"."""
    if color_by == "OBJECT":
        return _object_colors(len(cloud.object_names))[cloud.object_ids]
    if color_by == "INTENSITY":
        brightest = max(float(cloud.intensities.max(initial=0.0)), 1e-6)
        return _opaque(np.repeat(cloud.intensities[:, None] / brightest, 3, axis=1))
    return _distance_colors(cloud.distances)


def _distance_colors(distances: npt.NDArray[np.float64]) -> Float32Array:
    """Even steps of the ramp for even ratios of distance: near the sensor are most of the points."""
    if not len(distances):
        return np.empty((0, 4), np.float32)
    logs = np.log(np.maximum(distances, 1e-9))
    first, last = np.percentile(logs, DISTANCE_SHARES)
    places = (logs - first) / max(float(last - first), 1e-9)
    stops, ramp = np.linspace(0.0, 1.0, len(DISTANCE_RAMP)), _to_linear(DISTANCE_RAMP / 255.0)
    return _opaque(np.stack([np.interp(places, stops, ramp[:, channel]) for channel in range(3)], axis=1))


def _object_colors(count: int) -> Float32Array:
    """Hues by the golden ratio, so that those of any run of objects are far apart; brightness tells the others."""
    rows = np.arange(count)
    hue, saturation = rows * GOLDEN % 1.0, np.array(SATURATIONS)[rows % 3]
    value = np.array(VALUES)[rows // 3 % 3]
    offsets = np.array((0.0, 2.0 / 3.0, 1.0 / 3.0))
    wheel = np.clip(np.abs((hue[:, None] + offsets) % 1.0 * 6.0 - 3.0) - 1.0, 0.0, 1.0)
    return _opaque(_to_linear(value[:, None] * (1.0 - saturation[:, None] * (1.0 - wheel))))


def _to_linear(srgb: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _opaque(colors: npt.NDArray[np.floating]) -> Float32Array:
    found = np.ones((len(colors), 4), np.float32)
    found[:, :3] = colors
    return found
