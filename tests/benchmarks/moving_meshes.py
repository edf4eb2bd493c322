"""Meshes made from seeds that move from frame to frame and keep their triangles, to test trees that follow motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class MovingMesh:
    """positions: (F, V, 3) float32, frame by frame. triangles: (T, 3) int32."""

    name: str
    positions: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]


def exploding(frame_count: int = 48, rows: int = 120, seed: int = 1) -> MovingMesh:
    """A ball of 4 rows^2 triangles that bursts: each piece flies off, tumbles and falls, some far faster."""
    random = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, 2 * rows + 1), indexing="ij")
    ball = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1)
    a, b, c, d = ball[:-1, :-1], ball[:-1, 1:], ball[1:, 1:], ball[1:, :-1]
    corners = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    count = len(corners)
    middles = corners.mean(axis=1)
    speeds = middles * random.lognormal(-3.2, 0.7, (count, 1)) + random.normal(0, 0.012, (count, 3))
    axes = random.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    spins = random.normal(0, 0.3, count)
    frames = []
    for frame in range(frame_count):
        turned = _turned(corners - middles[:, None], axes, spins * frame)
        places = middles + speeds * frame
        places[:, 2] -= 0.0004 * frame**2
        frames.append((turned + places[:, None]).reshape(-1, 3).astype(np.float32))
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return MovingMesh("exploding", np.stack(frames), triangles)


def _turned(
    corners: npt.NDArray[np.float64], axes: npt.NDArray[np.float64], angles: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """(T, 3, 3) corners, each triangle turned about a different axis (Rodrigues)."""
    axis, cos, sin = axes[:, None], np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    along = (corners * axis).sum(axis=2, keepdims=True)
    return np.asarray(corners * cos + np.cross(axis, corners) * sin + axis * along * (1 - cos))
