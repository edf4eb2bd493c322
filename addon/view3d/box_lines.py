"""Boxes as lines with colors, in arrays as a graphics card takes them. Knows no Blender.

A box is eight vertices and twelve lines; its colour says how deep in the tree it is, how much of it its siblings cover
as well, or what it costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import TreeBoxes

Float32Array = npt.NDArray[np.float32]

# Corner i takes the upper bound on axis a where bit a of i is set; lines join corners that differ in one bit.
CORNERS = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
EDGES = np.array([(a, a | bit) for bit in (1, 2, 4) for a in range(8) if not a & bit], np.int32)

# From least to most: blue, cyan, green, yellow, red.
RAMP = np.array([(0.1, 0.2, 1.0), (0.0, 0.75, 0.95), (0.1, 0.8, 0.2), (1.0, 0.85, 0.1), (1.0, 0.1, 0.05)])
OPACITY = 0.85
# What costs less than the dearest box by more than this has the first colour.
COST_DECADES = 4.0
# More can no longer be told apart, and every viewport that is drawn would wait for them.
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
    """(N,) where each box stands on the ramp, 0 to 1."""
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
