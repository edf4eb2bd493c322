"""Packets of rays that are culled together: by the frustum of four of them, from the first one's origin."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SIZE = 16
CORNERS = (0, 3, 15, 12)  # of four by four rays

Float64Array = npt.NDArray[np.float64]


def culled(boxes: Float64Array, origins: Float64Array, directions: Float64Array) -> npt.NDArray[np.bool_]:
    """(R,) whether the packet of each ray misses the box (R, 2, 3) of the triangle that the ray hits."""
    found = np.zeros(len(origins), np.bool_)
    for start in range(0, len(origins) - SIZE + 1, SIZE):
        part = slice(start, start + SIZE)
        found[part] = _outside(boxes[part], origins[start], directions[part])
    return found


def _outside(boxes: Float64Array, origin: Float64Array, directions: Float64Array) -> npt.NDArray[np.bool_]:
    middle = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).mean(axis=0)
    outside = np.zeros(len(boxes), np.bool_)
    for first, second in zip(CORNERS, (*CORNERS[1:], CORNERS[0]), strict=True):
        normal = np.cross(directions[first], directions[second])
        normal *= np.sign(normal @ middle)
        farthest = np.where(normal > 0.0, boxes[:, 1], boxes[:, 0])  # the box's corner that is farthest inside
        outside |= (farthest - origin) @ normal < 0.0
    return outside
