"""Where a sensor says that echoes are: with its noise, bias and dropout, which belong to each ray. Knows no Blender."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..patterns import Float64Array
from .beam_rays import unit
from .model import Noise
from .ray_noise import RayNoise

IntArray = npt.NDArray[Any]

# Channels of a ray's random numbers; distances have one for each return, from the last of these on.
DROPOUT, ACROSS, UP, DISTANCE = 0, 1, 2, 3
LINE = 1 << 32  # of lines, which are no rays


def are_lost(noise: Noise, random: RayNoise, ray_ids: IntArray) -> npt.NDArray[np.bool_]:
    """(N,) whether each ray returns nothing, whatever it met."""
    if noise.dropout <= 0.0:
        return np.zeros(len(ray_ids), np.bool_)
    return random.uniform(ray_ids, DROPOUT) < noise.dropout


def measured_distances(
    noise: Noise, random: RayNoise, distances: Float64Array, ray_ids: IntArray, return_ids: IntArray, ring_ids: IntArray
) -> Float64Array:
    """(N,) what is measured of distances, at least 0."""
    found = distances + noise.bias
    if noise.range or noise.range_square:
        sigma = noise.range + noise.range_square * distances * distances
        found = found + sigma * random.normal(ray_ids, DISTANCE + return_ids.astype(np.uint64))
    if noise.line_bias:
        found = found + noise.line_bias * random.normal(ring_ids, LINE)
    return np.maximum(found, 0.0)


def measured_directions(
    noise: Noise, random: RayNoise, directions: Float64Array, across: Float64Array, ray_ids: IntArray
) -> Float64Array:
    """(N, 3) unit vectors: where the sensor says that rays went. across: (N, 3) unit, at right angles to them."""
    ahead = unit(directions)
    if noise.angle <= 0.0:
        return ahead
    sigma = noise.angle * 1e-3
    aside, up = (sigma * random.normal(ray_ids, channel)[:, None] for channel in (ACROSS, UP))
    return unit(ahead + aside * across + up * np.cross(ahead, across))
