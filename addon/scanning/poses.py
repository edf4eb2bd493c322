"""Where a sensor is while it moves: between two poses in a straight line, turning evenly the shorter way.

Knows no Blender.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .patterns import Float64Array

# How far from a rotation what turns one pose into the next may be: matrices of Blender are float32.
ROUNDING = 1e-4


@dataclass(frozen=True, slots=True)
class Path:
    """From one pose to the next. first, last: (4, 4) from the sensor's space to the world, without scale."""

    first: Float64Array
    last: Float64Array

    def place(
        self, origins: Float64Array, directions: Float64Array, shares: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """(R, 3) origins and directions of the sensor's space in the world, each at its share, 0 to 1, of the way."""
        if np.array_equal(self.first, self.last):
            linear = self.first[:3, :3]
            return _turned(origins, linear) + self.first[:3, 3], _turned(directions, linear)
        way = self.first[:3, 3] + shares[:, None] * (self.last[:3, 3] - self.first[:3, 3])
        return self._turn(origins, shares) + way, self._turn(directions, shares)

    def _turn(self, vectors: Float64Array, shares: Float64Array) -> Float64Array:
        """By a share of what turns the first pose's axes into the last one's (Rodrigues' formula)."""
        start = self.first[:3, :3]
        between = np.linalg.solve(start, self.last[:3, :3])
        if np.abs(between @ between.T - np.eye(3)).max() > ROUNDING or np.linalg.det(between) < 0.0:
            straight = _turned(vectors, start)  # sheared or mirrored on the way: there is no rotation between them
            return straight + shares[:, None] * (_turned(vectors, self.last[:3, :3]) - straight)
        axis = np.array([between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1]])
        sine, cosine = float(np.linalg.norm(axis)) / 2.0, (float(np.trace(between)) - 1.0) / 2.0
        if sine < ROUNDING**2:
            return _turned(vectors, start)
        axis /= 2.0 * sine
        angles = shares * np.arctan2(sine, cosine)
        along = axis * _along(vectors, axis)[:, None]
        across = np.cross(axis, vectors)
        turned = along + np.cos(angles)[:, None] * (vectors - along) + np.sin(angles)[:, None] * across
        return _turned(turned, start)


def _along(vectors: Float64Array, axis: Float64Array) -> Float64Array:
    """(R,) the vectors' components along an axis.

    Not by `@`: that is a library's, which rounds as it likes on each processor, and starts threads of its own.
    """
    return vectors[:, 0] * axis[0] + vectors[:, 1] * axis[1] + vectors[:, 2] * axis[2]


def _turned(vectors: Float64Array, linear: Float64Array) -> Float64Array:
    """(R, 3) vectors through a (3, 3) matrix."""
    return np.stack([_along(vectors, row) for row in linear], axis=1)


def bend(before: Float64Array, here: Float64Array, after: Float64Array, distance: float) -> float:
    """How far points may be off for poses between which the true way is curved: three in a row, (4, 4).

    A curve leaves its chord by an eighth of its second difference; that of the directions counts at this distance.
    """
    second = before - 2.0 * here + after
    turning = float(np.linalg.norm(second[:3, :3], ord=2)) * distance
    # A rotation at an even speed bends, but is followed exactly.
    rate = float(np.linalg.norm(after[:3, :3] - before[:3, :3], ord=2)) / 2.0
    return (float(np.linalg.norm(second[:3, 3])) + max(turning - rate * rate * distance, 0.0)) / 8.0
