"""A scene frozen at a time of the shutter: positions of vertices and instances by independent formulas."""

from __future__ import annotations

import numpy as np


def share_at(time: float, steps: int, time_range: tuple[float, float] = (0.0, 1.0)) -> tuple[int, np.float32]:
    """The step at or before a time, and how far it is from there to the next, as float32 has it."""
    begin = np.float32(time_range[0])
    rate = np.float32(steps - 1) / np.float32(np.float32(time_range[1]) - begin)
    at = np.float32(np.float32(np.float32(time) - begin) * rate)
    if not at > 0:
        return 0, np.float32(0)
    if at >= steps - 1:
        return steps - 1, np.float32(0)
    return int(at), np.float32(at - np.float32(int(at)))


def positions_at(steps: np.ndarray, time: float, time_range: tuple[float, float] = (0.0, 1.0)) -> np.ndarray:
    """(V, 3) float32 of (S, V, 3) float32: in straight lines, in the engine's roundings."""
    step, later = share_at(time, len(steps), time_range)
    if later == 0:
        return steps[step]
    earlier = np.float32(1) - later
    from_here = (earlier * steps[step]).astype(np.float64)
    return (from_here + np.float64(later) * steps[step + 1].astype(np.float64)).astype(np.float32)


def rotation_and_stretch(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, 3) each: a rotation, and the remaining factor; by singular values."""
    left, _, right = np.linalg.svd(matrix)
    rotation = left @ right
    if np.linalg.det(rotation) < 0:
        rotation = -rotation
    return rotation, rotation.T @ matrix


def turned_by(rotation: np.ndarray, share: float) -> np.ndarray:
    """(3, 3): a share of the way from no rotation to this one, the shorter way (Rodrigues)."""
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = np.linalg.norm(axis) / 2, (np.trace(rotation) - 1) / 2
    if sine < 1e-12:
        return np.eye(3)
    x, y, z = axis / (2 * sine)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = share * np.arctan2(sine, cosine)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def transform_at(steps: np.ndarray, time: float, time_range: tuple[float, float] = (0.0, 1.0)) -> np.ndarray:
    """(4, 4) of (S, 4, 4): rotations turn evenly, the rest goes in straight lines."""
    step, later = share_at(time, len(steps), time_range)
    if later == 0:
        return steps[step]
    share = float(later)
    (first, stretch), (second, next_stretch) = (rotation_and_stretch(steps[step + i][:3, :3]) for i in (0, 1))
    result = np.eye(4)
    rotation = first @ turned_by(first.T @ second, share)
    result[:3, :3] = rotation @ ((1 - share) * stretch + share * next_stretch)
    result[:3, 3] = (1 - share) * steps[step][:3, 3] + share * steps[step + 1][:3, 3]
    return result
