"""The rays that stand for a beam: its middle, and others evenly over its disc. Knows no Blender."""

from __future__ import annotations

import math

import numpy as np

from ..patterns import Float64Array

# Vogel 1979: each seed of a sunflower is turned by so much of a turn from the one before.
GOLDEN_TURN = math.pi * (3.0 - math.sqrt(5.0))


def disc_places(count: int) -> Float64Array:
    """(count, 2) places in the unit disc, the first its middle; each stands for the same share of it."""
    numbers = np.arange(count, dtype=np.float64)
    radii, angles = np.sqrt(numbers / max(count - 0.5, 1.0)), numbers * GOLDEN_TURN
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def axis_across(directions: Float64Array) -> Float64Array:
    """(R, 3) unit vectors at right angles to (R, 3) directions: Duff et al. 2017, without a branch."""
    x, y, z = unit(directions).T
    sign = np.where(z < 0.0, -1.0, 1.0)
    share = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * share, sign * x * y * share, -sign * x], axis=1)


def spread_over_disc(
    directions: Float64Array, across: Float64Array, places: Float64Array, divergence: float
) -> Float64Array:
    """(R * K, 3) directions, the K of each beam one after the other, as long as the beam's own.

    across: (R, 3) unit vectors at right angles to the directions. places: (K, 2) of `disc_places`. divergence: the full
    angle, in milliradians. The first of each beam is its own direction, bit for bit.
    """
    if len(places) == 1:
        return directions
    lengths = length_of(directions)[:, None]
    ahead = directions / lengths
    other = np.cross(ahead, across)
    aside = math.tan(divergence * 5e-4) * places
    spread = ahead[:, None] + aside[:, :1] * across[:, None] + aside[:, 1:] * other[:, None]
    spread *= (lengths / np.sqrt(1.0 + (aside * aside).sum(axis=1)))[:, :, None]
    spread[:, 0] = directions
    return spread.reshape(-1, 3)


def dot(first: Float64Array, second: Float64Array) -> Float64Array:
    """(N,) of (N, 3) each, summed in one order, whatever stands beside them."""
    return first[:, 0] * second[:, 0] + first[:, 1] * second[:, 1] + first[:, 2] * second[:, 2]


def length_of(vectors: Float64Array) -> Float64Array:
    """(N,) of (N, 3)."""
    return np.sqrt(dot(vectors, vectors))


def unit(vectors: Float64Array) -> Float64Array:
    """(N, 3), each as long as 1; those without a length, as normals at the tips of curves are, stay so."""
    return vectors / np.maximum(length_of(vectors), 1e-300)[:, None]
