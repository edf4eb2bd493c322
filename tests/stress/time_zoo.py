"""Motions within the shutter on which usual methods fail: arcs, several steps, turns, zero scale, bad times.

Each case is one mesh and one instance. The usual methods are in `losses_of_times.py`: boxes between the steps' boxes,
matrices entry by entry, an inverse without a question, a step's number without a check.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import perfect_bvh
from oracles.moving import positions_at, transform_at

from .playing import SHIPPED

F32, F64 = npt.NDArray[np.float32], npt.NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """shapes: (S, V, 3) float32, one for a mesh that keeps its shape. path: (S, 4, 4), one where it does not move."""

    shapes: F32
    triangles: npt.NDArray[np.int32]
    path: F64

    def scene(self) -> perfect_bvh.Scene:
        """Committed."""
        scene = perfect_bvh.Scene(calibration=SHIPPED)
        mesh = scene.add_mesh(self.shapes[0], self.triangles)
        instance = scene.add_instance(mesh, self.path[0])
        if len(self.shapes) > 1:
            scene.set_mesh_motion(mesh, self.shapes)
        if len(self.path) > 1:
            scene.set_instance_motion([instance], self.path[:, None])
        scene.commit()
        return scene

    def corners_at(self, time: float) -> F64:
        """(T, 3, 3) in the world."""
        shape = positions_at(self.shapes, time) if len(self.shapes) > 1 else self.shapes[0]
        place = transform_at(self.path, time) if len(self.path) > 1 else self.path[0]
        corners: F64 = (shape.astype(np.float64) @ place[:3, :3].T + place[:3, 3])[self.triangles]
        return corners


@dataclass(frozen=True, slots=True)
class TimeCase:
    """name: identifier. breaks: the failure elsewhere. source: where it was seen. make: always the same."""

    name: str
    breaks: str
    source: str
    make: Callable[[], Motion]


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> tuple[F32, npt.NDArray[np.int32]]:
    """Eight vertices and twelve triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    positions: F32 = np.float32(low) + corners * (np.float32(high) - np.float32(low))
    return positions, triangles


def boxes(parts: list[tuple[F32, npt.NDArray[np.int32]]]) -> tuple[F32, npt.NDArray[np.int32]]:
    """Joins boxes into one mesh."""
    offsets = np.cumsum([0, *(len(positions) for positions, _ in parts[:-1])])
    triangles = np.concatenate([each + offset for (_, each), offset in zip(parts, offsets, strict=True)])
    return np.concatenate([positions for positions, _ in parts]), triangles.astype(np.int32)


def turned(angle: float, place: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> F64:
    """(4, 4) about z."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = place
    return matrix


def _stick() -> Motion:
    positions, triangles = box((-2.0, -0.05, -0.05), (2.0, 0.05, 0.05))
    return Motion(positions[None], triangles, np.stack([turned(0.0), turned(np.pi / 2)]))


def _slats() -> Motion:
    """Axis-aligned, of no thickness, which rise and are where they were in the end."""
    corner = np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (2.0, 0.2, 0.0), (0.0, 0.2, 0.0)], np.float32)
    slat = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    positions, triangles = boxes([(corner + np.float32([-1.0, 0.4 * row - 1.0, 0.0]), slat) for row in range(5)])
    heights = np.float32([0.0, 1.0, 1.5, 1.0, 0.0])
    shapes = np.stack([positions + np.float32([0.0, 0.0, height]) for height in heights])
    return Motion(shapes, triangles, np.eye(4)[None])


def _wheel() -> Motion:
    """Twelve spokes and a rim of boxes, which turn by nine tenths of a turn; three moments, as in Blender's renders."""
    parts = []
    for number in range(12):
        matrix = turned(2 * np.pi * number / 12)
        for low, high in (((0.1, -0.03, -0.05), (0.9, 0.03, 0.05)), ((0.9, -0.26, -0.1), (1.0, 0.26, 0.1))):
            positions, triangles = box(low, high)
            parts.append(((positions @ matrix[:3, :3].T).astype(np.float32), triangles))
    positions, triangles = boxes(parts)
    path = np.stack([turned(share * 0.9 * 2 * np.pi) for share in (0.0, 0.5, 1.0)])
    return Motion(positions[None], triangles, path)


def _inside_out() -> Motion:
    """A cube that is scaled from 1 to -1: in the middle it is a point."""
    positions, triangles = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    return Motion(positions[None], triangles, np.stack([np.eye(4), np.diag([-1.0, -1.0, -1.0, 1.0])]))


def _late() -> Motion:
    positions, triangles = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    return Motion(positions[None], triangles, np.stack([np.eye(4), turned(0.3, (0.5, 0.0, 0.0))]))


TIME_CASES = (
    TimeCase(
        "sweeping_stick",
        "Between two steps what turns goes along an arc, and leaves the box between the steps' boxes: it vanishes.",
        "embree 349, 352",
        _stick,
    ),
    TimeCase(
        "rising_slats",
        "Flat, axis-aligned boxes with several steps, of which the first and the last alone bound the tree.",
        "embree 352",
        _slats,
    ),
    TimeCase(
        "fast_wheel",
        "Matrices between matrices: a wheel shrinks in the middle of each step, and at half a turn is a point.",
        "pbrt-v4 206",
        _wheel,
    ),
    TimeCase(
        "scale_through_zero",
        "An inverse of what has no volume: infinities and NaN for rays of that time, and nothing that says so.",
        "classic",
        _inside_out,
    ),
    TimeCase(
        "times_out_of_the_shutter",
        "A time below 0, above 1 or not a number chooses a step that is not there: memory is read past the end.",
        "classic",
        _late,
    ),
)


def rays_at(motion: Motion, count: int, seed: int = 1) -> tuple[F64, F64, F32]:
    """Origins and directions, (R, 3), and times (R,): towards the moving mesh at its place at the ray's own time."""
    random = np.random.default_rng(seed)
    times = random.uniform(0.0, 1.0, count).astype(np.float32)
    times[::5] = np.float32(0.5)
    size = max(float(np.abs(motion.corners_at(time)).max()) for time in (0.0, 0.5, 1.0))
    targets = np.empty((count, 3))
    for row, time in enumerate(times.tolist()):
        corners = motion.corners_at(time)
        chosen = corners[random.integers(0, len(corners))]
        weights = random.dirichlet((1.0, 1.0, 1.0))
        targets[row] = weights @ chosen
    origins = targets + 3.0 * size * random.normal(size=(count, 3))
    return origins, targets - origins, times
