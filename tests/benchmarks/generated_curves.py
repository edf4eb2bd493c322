"""Curves and points that are like those of real scenes, or hard on trees and tests; made from seeds. Their up is y."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
WIND_FRAMES = 4
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


@dataclass(frozen=True)
class BenchBalls:
    """points: (P, 3) float32. radii: (P,) float32. offsets: (C + 1,) int64, each curve's first point; None: points.

    is_inside: the camera is inside, as in a lawn.
    """

    name: str
    points: npt.NDArray[np.float32]
    radii: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64] | None
    is_inside: bool = False

    @property
    def primitive_count(self) -> int:
        """The number of segments or points."""
        return len(self.points) if self.offsets is None else len(self.points) - (len(self.offsets) - 1)

    def write(self, path: Path) -> None:
        """Writes the file that native/benchmarks/round_scene.h reads, with some frames in the wind."""
        firsts = np.empty(0, np.uint32) if self.offsets is None else self.offsets[:-1].astype(np.uint32)
        with path.open("wb") as file:
            file.write(np.array([len(self.points), len(firsts), WIND_FRAMES], np.uint32).tobytes())
            file.write(np.column_stack([self.points, self.radii]).astype(np.float32).tobytes())
            file.write(firsts.tobytes())
            for frame in range(WIND_FRAMES):
                file.write(blown(self, frame).points.tobytes())


def make_all(detail: float) -> list[BenchBalls]:
    """The measured shapes: a lawn, fur, long hair and a scan; their numbers grow with `detail`."""
    return [lawn(detail), fur(detail), long_hair(detail), scan(detail)]


def make_hard() -> list[BenchBalls]:
    """Small shapes to judge; each is hard in a different way."""
    return [zigzag(), slanted_sticks(1000), nested_spheres(), one_place(1000), tips(), far_away()]


def lawn(detail: float) -> BenchBalls:
    """200,000 blades of 4 segments that lean over, up to a tip, on 20 by 20 metres, seen from among them."""
    count = max(50, round(200_000 * detail))
    random = np.random.default_rng(41)
    reach = 10.0 * min(1.0, detail**0.5)
    roots = np.column_stack(
        [random.uniform(-reach, reach, count), np.zeros(count), random.uniform(-reach, reach, count)]
    )
    turn, height = random.uniform(0.0, 2.0 * np.pi, count), random.uniform(0.04, 0.12, count)
    lean = height * random.uniform(0.1, 0.8, count)
    step = np.linspace(0.0, 1.0, 5)
    bend = np.outer(lean, step**2)
    points = roots[:, None] + np.stack(
        [bend * np.cos(turn)[:, None], np.outer(height, step), bend * np.sin(turn)[:, None]], axis=-1
    )
    radii = np.outer(random.uniform(0.001, 0.002, count), np.sqrt(1.0 - step))
    return _curves("lawn", points, radii, is_inside=True)


def fur(detail: float) -> BenchBalls:
    """100,000 strands of 8 segments on a ball, combed one way and curled, up to a tip."""
    count = max(50, round(100_000 * detail))
    random = np.random.default_rng(42)
    roots = _spread(count)
    along = roots + [0.5, -0.6, 0.2] + random.normal(0.0, 0.15, (count, 3))
    along *= random.uniform(0.08, 0.14, (count, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    step = np.linspace(0.0, 1.0, 9)
    phase = random.uniform(0.0, 2.0 * np.pi, (count, 1)) + 7.0 * step
    across, beside = _frame(along)
    curl = 0.006 * step
    points = roots[:, None] + along[:, None] * step[:, None] - [0.0, 0.03, 0.0] * (step**2)[:, None]
    points = (
        points
        + across[:, None] * (curl * np.cos(phase))[..., None]
        + beside[:, None] * (curl * np.sin(phase))[..., None]
    )
    return _curves("fur", points, np.outer(random.uniform(4e-4, 8e-4, count), 1.0 - step))


def long_hair(detail: float) -> BenchBalls:
    """20,000 strands of 64 segments that fall from the crown of a head, in waves, as thin as hair."""
    count = max(20, round(20_000 * detail))
    random = np.random.default_rng(43)
    turn, tilt = random.uniform(0.0, 2.0 * np.pi, count), np.arccos(random.uniform(0.1, 1.0, count))
    way = np.stack([np.sin(tilt) * np.cos(turn), np.cos(tilt), np.sin(tilt) * np.sin(turn)], axis=1)
    step = np.linspace(0.0, 1.0, 65)
    out = way * [1.0, 0.0, 1.0] / np.sin(tilt)[:, None]
    fall = random.uniform(3.0, 5.0, (count, 1))
    outward = 0.25 * np.outer(np.maximum(1.05 - np.sin(tilt), 0.05), 1.0 - np.exp(-4.0 * step))
    down = fall * (step**2 / (0.15 + step))
    wave = random.uniform(0.02, 0.06, (count, 1)) * step
    phase = random.uniform(0.0, 2.0 * np.pi, (count, 1)) + random.uniform(15.0, 25.0, (count, 1)) * step
    sideways = np.stack([-out[:, 2], np.zeros(count), out[:, 0]], axis=1)
    points = way[:, None] + out[:, None] * (outward + wave * np.cos(phase))[..., None]
    points = points + sideways[:, None] * (wave * np.sin(phase))[..., None] - [0.0, 1.0, 0.0] * down[..., None]
    return _curves("long hair", points, np.full((count, 65), 0.0015))


def scan(detail: float) -> BenchBalls:
    """A million points where a scanner hit a hall of pillars: on floor, walls and pillars, with a little noise."""
    count = max(100, round(1_000_000 * detail))
    random = np.random.default_rng(44)
    kinds = random.integers(0, 10, count)
    places = random.uniform([-12.0, 0.0, -8.0], [12.0, 6.0, 8.0], (count, 3))
    places[kinds < 4, 1] = 0.0
    for axis, sign, kind in ((0, -1.0, 4), (0, 1.0, 5), (2, -1.0, 6), (2, 1.0, 7)):
        places[kinds == kind, axis] = sign * (12.0 if axis == 0 else 8.0)
    pillars = kinds >= 8
    turn = random.uniform(0.0, 2.0 * np.pi, pillars.sum())
    places[pillars, 0] = random.integers(-3, 4, pillars.sum()) * 3.0 + 0.4 * np.cos(turn)
    places[pillars, 2] = random.choice([-4.0, 4.0], pillars.sum()) + 0.4 * np.sin(turn)
    places += random.normal(0.0, 0.004, (count, 3))
    size = 0.006 / min(1.0, max(detail, 1e-4)) ** 0.5
    return BenchBalls("scan", places.astype(np.float32), np.full(count, size, np.float32), None, is_inside=True)


def zigzag() -> BenchBalls:
    """Curves that turn by up to 180 degrees at each joint, with segments as short as they are thick, and far longer."""
    random = np.random.default_rng(45)
    count, points = 200, 12
    turns = np.pi * (1.0 - random.choice([0.0, 1e-6, 0.01, 0.1, 0.5], (count, points - 2)))
    angles = np.cumsum(np.column_stack([random.uniform(0.0, 6.0, count), turns]), axis=1)
    radius = 10.0 ** random.uniform(-4.0, -1.0, count)
    length = np.maximum(radius[:, None], 0.3 * random.uniform(0.0, 1.0, (count, points - 1)))
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * length[..., None]
    across, beside = _frame(random.normal(size=(count, 3)))
    steps = flat[..., :1] * across[:, None] + flat[..., 1:] * beside[:, None]
    start = random.uniform(-1.0, 1.0, (count, 1, 3))
    return _curves(
        "zigzag", start + np.cumsum(np.pad(steps, ((0, 0), (1, 0), (0, 0))), axis=1), _as_wide(radius, points)
    )


def slanted_sticks(count: int) -> BenchBalls:
    """Straight sticks through a ball, none along an axis: their boxes are mostly air, and all overlap."""
    random = np.random.default_rng(46)
    ways = _spread(count) + 0.3 * random.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    middles = random.normal(0.0, 0.2, (count, 3))
    points = np.stack([middles - ways, middles + ways], axis=1)
    return _curves("slanted sticks", points, np.full((count, 2), 0.002))


def nested_spheres() -> BenchBalls:
    """A hundred balls around one middle, one in the other down to a millionth, and as many that touch them inside."""
    radii = 10.0 ** -np.linspace(0.0, 6.0, 100)
    inside = np.column_stack([radii * 0.5, np.zeros(100), np.zeros(100)])
    points = np.concatenate([np.zeros((100, 3)), inside])
    both = np.concatenate([radii, radii * 0.5])
    return BenchBalls("nested spheres", points.astype(np.float32), both.astype(np.float32), None)


def one_place(count: int) -> BenchBalls:
    """Points that are all at one place, and of one radius: a ray hits each of them or none."""
    return BenchBalls("one place", np.full((count, 3), 0.25, np.float32), np.full(count, 0.5, np.float32), None)


def tips() -> BenchBalls:
    """Curves with radii of zero at ends and between, balls that hold their neighbours, points that are doubled."""
    random = np.random.default_rng(47)
    count, points = 300, 6
    places = np.cumsum(random.normal(0.0, 0.2, (count, points, 3)), axis=1) + random.uniform(-1.0, 1.0, (count, 1, 3))
    is_double = random.random((count, points)) < 0.2
    is_double[:, 0] = False
    for k in range(1, points):
        places[is_double[:, k], k] = places[is_double[:, k], k - 1]
    radii = random.choice([0.0, 0.01, 0.05, 0.5], (count, points), p=[0.35, 0.3, 0.3, 0.05])
    return _curves("tips", places, radii)


def far_away() -> BenchBalls:
    """Fur at a distance from zero of a thousand times its size."""
    near = fur(0.005)
    return replace(near, name="far away", points=(near.points + np.float32(1024.0)).astype(np.float32))


def blown(balls: BenchBalls, frame: int) -> BenchBalls:
    """Returns the shapes in the wind: curves sway, more towards their tips; points sway along y."""
    places = balls.points.astype(np.float64)
    size = 0.1 * float(np.ptp(places, axis=0).max()) if balls.offsets is None else 1.0
    phase = places @ [1.3, 0.7, 1.9] + 0.4 * frame
    if balls.offsets is None:
        move = np.column_stack([np.zeros(len(places)), 0.05 * size * np.sin(phase), np.zeros(len(places))])
    else:
        counts = np.diff(balls.offsets)
        step = (np.arange(len(places)) - np.repeat(balls.offsets[:-1], counts)) / np.repeat(counts - 1, counts)
        first = np.repeat(balls.offsets[:-1], counts)
        move = np.outer(np.linalg.norm(places - places[first], axis=1) * step, [0.3, 0.0, 0.2]) * np.sin(phase)[:, None]
    return replace(balls, points=(places + move).astype(np.float32))


def _curves(name: str, points: F64, radii: F64, *, is_inside: bool = False) -> BenchBalls:
    """points: (C, K, 3), radii: (C, K)."""
    curves, each = radii.shape
    offsets = each * np.arange(curves + 1, dtype=np.int64)
    return BenchBalls(
        name, points.reshape(-1, 3).astype(np.float32), radii.reshape(-1).astype(np.float32), offsets, is_inside
    )


def _as_wide(radius: F64, count: int) -> F64:
    return np.repeat(radius[:, None], count, axis=1)


def _spread(count: int) -> F64:
    """Points that are evenly spread over the unit ball's surface."""
    height = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    turn = _GOLDEN_ANGLE * np.arange(count)
    ring = np.sqrt(1.0 - height**2)
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)


def _frame(along: F64) -> tuple[F64, F64]:
    """Two unit vectors at right angles to each row of `along` and to each other."""
    least = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    across = np.cross(along, least)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    beside = np.cross(along, across)
    return across, beside / np.linalg.norm(beside, axis=1, keepdims=True)
