"""A plain binary tree over boxes: built by one of the usual splits, refitted, and traversed by rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

LEAF_SIZE = 4

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]
Split = Callable[[Float64Array, Int64Array], tuple[Int64Array, Int64Array]]


@dataclass
class Node:
    """lower, upper: (3,). rows: the primitives of a leaf; children: two of an inner node."""

    rows: Int64Array
    children: tuple[Node, ...]
    lower: Float64Array
    upper: Float64Array
    depth: int  # of the subtree


def boxes_of(corners: Float64Array) -> Float64Array:
    """(T, 2, 3): lower and upper corners of the boxes of triangles (T, 3, 3)."""
    return np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)


def by_area(boxes: Float64Array, rows: Int64Array) -> tuple[Int64Array, Int64Array]:
    """The cheapest of all planes between centroids (MacDonald and Booth 1990)."""
    best, parts = np.inf, (rows[: len(rows) // 2], rows[len(rows) // 2 :])
    for axis in range(3):
        order = rows[np.argsort(boxes[rows, :, axis].sum(axis=1), kind="stable")]
        sorted_ = boxes[order]
        left = _areas(np.minimum.accumulate(sorted_[:, 0]), np.maximum.accumulate(sorted_[:, 1]))[:-1]
        back = sorted_[::-1]
        right = _areas(np.minimum.accumulate(back[:, 0]), np.maximum.accumulate(back[:, 1]))[::-1][1:]
        counts = np.arange(1, len(rows))
        costs = left * counts + right * (len(rows) - counts)
        at = int(np.argmin(costs))
        if costs[at] < min(best, costs.max()):  # where all planes are equal, halves are best
            best, parts = costs[at], (order[: at + 1], order[at + 1 :])
    return parts


def at_the_middle(boxes: Float64Array, rows: Int64Array) -> tuple[Int64Array, Int64Array]:
    """The middle of the centroids' longest axis: halves of equal width. One of them may be empty."""
    centres = boxes[rows].mean(axis=1)
    lower, upper = centres.min(axis=0), centres.max(axis=0)
    axis = int(np.argmax(upper - lower))
    is_left = centres[:, axis] < (lower[axis] + upper[axis]) / 2
    return rows[is_left], rows[~is_left]


def _areas(lower: Float64Array, upper: Float64Array) -> Float64Array:
    x, y, z = (upper - lower).T
    return x * y + y * z + z * x


def build(boxes: Float64Array, split: Split, rows: Int64Array | None = None, leaf_size: int = LEAF_SIZE) -> Node:
    """A tree over boxes (N, 2, 3), or over some rows of them."""
    rows = np.arange(len(boxes)) if rows is None else rows
    lower, upper = boxes[rows, 0].min(axis=0), boxes[rows, 1].max(axis=0)
    if len(rows) <= leaf_size:
        return Node(rows, (), lower, upper, 0)
    children = tuple(build(boxes, split, part, leaf_size) for part in split(boxes, rows))
    return Node(rows[:0], children, lower, upper, 1 + max(child.depth for child in children))


def refit(node: Node, boxes: Float64Array) -> None:
    """Fits all boxes to primitives that have moved; who is whose neighbour stays."""
    for child in node.children:
        refit(child, boxes)
    if node.children:
        node.lower = np.minimum(node.children[0].lower, node.children[1].lower)
        node.upper = np.maximum(node.children[0].upper, node.children[1].upper)
    else:
        node.lower, node.upper = boxes[node.rows, 0].min(axis=0), boxes[node.rows, 1].max(axis=0)


def count_work(node: Node, origins: Float64Array, directions: Float64Array, t_hit: Float64Array) -> int:
    """Boxes and triangles that the rays must test, the nearest hit of each being known."""
    with np.errstate(divide="ignore"):
        inverse = 1.0 / directions
    return _work(node, origins, inverse, t_hit)


def _work(node: Node, origins: Float64Array, inverse: Float64Array, t_hit: Float64Array) -> int:
    with np.errstate(invalid="ignore"):
        first, second = (node.lower - origins) * inverse, (node.upper - origins) * inverse
    near = np.fmax.reduce(np.fmin(first, second), axis=1)
    far = np.fmin.reduce(np.fmax(first, second), axis=1)
    met = (near <= far) & (far >= 0.0) & (near <= t_hit)
    total = len(origins)
    if not met.any():
        return total
    if not node.children:
        return total + int(met.sum()) * len(node.rows)
    return total + sum(_work(child, origins[met], inverse[met], t_hit[met]) for child in node.children)
