"""Loops over instances and triangles for code that keeps a scene in step with another program.

They say nothing about rays: in Python they would cost more than the edits that they find.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core

Float32Array = npt.NDArray[np.float32]
Int32Array = npt.NDArray[np.int32]


def place_instances(
    parent: Float32Array | None, local: Float32Array, placed: Float32Array, largest: float
) -> Int32Array:
    """Writes parent times each local matrix into `placed`; returns its rows that hold more than `largest`, or NaN.

    Args:
        parent: (4, 4), None for the identity.
        local: (N, 4, 4) float32, each matrix transposed, as Blender stores it.
        placed: (N, 3, 4) float32, C-contiguous. The products are bit by bit those of Blender's own list of instances.
    """
    matrix = None if parent is None else np.ascontiguousarray(parent, np.float32)
    return _core.place_instances(matrix, local, placed, largest)


def find_moved(old: Float32Array, new: Float32Array, rows: Int32Array | None = None) -> npt.NDArray[np.bool_]:
    """(I,) bool: whether new[i] differs from old[rows[i]] in any bit.

    Args:
        old: (H, 3, 4), new: (I, 3, 4) float32.
        rows: (I,) int32, -1 where there is no old one, which is no difference; None for old[i].
    """
    return _core.find_moved(np.ascontiguousarray(old), np.ascontiguousarray(new), rows)


def are_equal(first: npt.NDArray[Any], second: npt.NDArray[Any]) -> bool:
    """Whether two arrays have one dtype, one shape and the same bits: zeros of both signs differ."""
    return _core.are_equal(np.ascontiguousarray(first), np.ascontiguousarray(second))


def copy_within(source: Float32Array, target: Float32Array, largest: float) -> bool:
    """Copies one array to another of as many values, both C-contiguous; whether none is beyond `largest`, as NaN is."""
    return _core.copy_within(source, target, largest)


def are_triangles(corner_verts: Int32Array, corner_triangles: Int32Array, triangles: Int32Array) -> bool:
    """Whether corner_verts[corner_triangles], (T, 3), equals `triangles`, without making the array."""
    return _core.are_triangles(corner_verts, corner_triangles, triangles)
