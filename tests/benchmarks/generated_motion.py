"""Scenes that move within the shutter, made from seeds: a crowd, a tree, an explosion, wheels, a car. Their up is y."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks import generated_meshes

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
# A mesh: where its vertices are by the step, (S, V, 3), S being 1 where it keeps its shape; and its triangles.
Shapes = tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]


@dataclass(frozen=True)
class BenchMotion:
    """meshes: as `Shapes`. mesh: (N,) int32, of each instance. places: (S, N, 3, 4) float32. moves: (N,) bool.

    is_inside: the camera is inside the box instead of looking at it from outside.
    """

    name: str
    meshes: list[Shapes]
    mesh: npt.NDArray[np.int32]
    places: npt.NDArray[np.float32]
    moves: npt.NDArray[np.bool_]
    is_inside: bool = False

    @property
    def triangle_count(self) -> int:
        """The number of triangles of all instances."""
        counts = np.array([len(triangles) for _, triangles in self.meshes])
        return int(counts[self.mesh].sum())

    def bounds(self) -> tuple[F64, F64]:
        """Least and largest coordinates of all ways, a part of the instances' vertices alone where there are many."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for number, (shapes, _) in enumerate(self.meshes):
            points = np.concatenate(shapes)[:: max(1, len(self.mesh) // 100)]
            for places in self.places[:, self.mesh == number].reshape(-1, 3, 4):
                placed = points @ places[:, :3].T + places[:, 3]
                low, high = np.minimum(low, placed.min(axis=0)), np.maximum(high, placed.max(axis=0))
        return low, high

    def write(self, path: Path) -> None:
        """Writes the file that native/benchmarks/motion_scene.h reads."""
        with path.open("wb") as file:
            file.write(np.array([len(self.places), len(self.meshes), len(self.mesh)], "<u4").tobytes())
            for shapes, triangles in self.meshes:
                file.write(np.array([len(shapes), shapes.shape[1], len(triangles)], "<u4").tobytes())
                file.write(shapes.astype("<f4").tobytes() + triangles.astype("<u4").tobytes())
            file.write(self.mesh.astype("<u4").tobytes() + self.moves.astype("<u4").tobytes())
            file.write(self.places.astype("<f4").tobytes())

    def scene(self) -> perfect_bvh.Scene:
        """Committed, ids in the order of the arrays."""
        scene = perfect_bvh.Scene()
        for shapes, triangles in self.meshes:
            mesh = scene.add_mesh(shapes[0], triangles)
            if len(shapes) > 1:
                scene.set_mesh_motion(mesh, shapes)
        scene.add_instances(self.mesh, self.places[0])
        scene.set_instance_motion(np.flatnonzero(self.moves).astype(np.int32), self.places[:, self.moves])
        scene.commit()
        return scene


def crowd(detail: float, steps: int) -> BenchMotion:
    """400 walkers of eight kinds on a ground: all go on and turn a little, every other kind swings its limbs."""
    count, kinds = max(8, round(400 * detail)), 8
    random = np.random.default_rng(61)
    times = _times(steps)
    side = int(np.ceil(count**0.5))
    ground = (0.8 * side + 3.0) * np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])
    meshes = [_mesh(ground[None], np.array([[0, 1, 2], [0, 2, 3]]))]
    meshes += [_walker(random, times if kind % 2 else times[:1]) for kind in range(kinds)]
    at = np.stack(np.divmod(np.arange(count), side), axis=-1) * 1.6 - 0.8 * side + random.uniform(-0.4, 0.4, (count, 2))
    heading = random.uniform(0.0, 2.0 * np.pi, count)
    angle = heading + np.outer(times, random.uniform(-0.3, 0.3, count))
    along = np.stack([np.sin(heading), np.zeros(count), np.cos(heading)], axis=-1)
    places = np.zeros((steps, count + 1, 3, 4))
    places[:, 0, :, :3] = np.eye(3)
    places[:, 1:, :, :3] = _rotations(np.broadcast_to([0.0, 1.0, 0.0], (count, 3)), angle)
    places[:, 1:, :, 3] = np.stack([at[:, 0], np.zeros(count), at[:, 1]], axis=-1) + times[:, None, None] * 0.5 * along
    mesh = np.concatenate([[0], 1 + np.arange(count) % kinds])
    return _scene("crowd", meshes, mesh, places, np.arange(count + 1) > 0)


def tree(detail: float, steps: int) -> BenchMotion:
    """A trunk, 200 boughs and 60,000 leaves of two triangles, bent by the wind; leaves flutter as well."""
    leaf_count = max(200, round(60_000 * detail))
    random = np.random.default_rng(62)
    parts = [_ball(24, 32, [0.3, 4.0, 0.3], [0.0, 4.0, 0.0])]
    ends = np.column_stack([_directions(random, 200)[:, :2] * 3.0, random.uniform(-3.0, 3.0, 200)])
    ends[:, 1] = np.abs(ends[:, 1]) + 5.0
    parts += [_stick([0.0, 0.6 * end[1], 0.0], end, 0.06) for end in ends]
    wood, triangles = _join(parts)
    middles = ends[random.integers(0, 200, leaf_count)] + random.normal(0.0, 0.6, (leaf_count, 3))
    along, across = (random.normal(0.0, 0.05, (leaf_count, 3)) for _ in range(2))
    leaves = np.stack([middles - along, middles + across, middles + along, middles - across], axis=1)
    quads = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(leaf_count)[:, None, None] + len(wood)
    still = np.concatenate([wood, leaves.reshape(-1, 3)])
    flutter = np.zeros_like(still)
    flutter[len(wood) :] = np.repeat(random.normal(0.0, 0.04, (leaf_count, 3)), 4, axis=0)
    sway = np.sin(1.5 * _times(steps))[:, None]
    bent = still + sway[..., None] * flutter
    bent[..., 0] += sway * 0.012 * still[:, 1] ** 2
    return _alone("tree", bent, np.concatenate([triangles, quads.reshape(-1, 3)]))


def explosion(detail: float, steps: int) -> BenchMotion:
    """A ball of 65,000 triangles, each of which flies off and turns."""
    rows = max(8, round(180 * detail**0.5))
    random = np.random.default_rng(63)
    positions, triangles = _ball(rows, rows, [1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    corners, count = positions[triangles], len(triangles)
    middles = corners.mean(axis=1)
    times = _times(steps)
    turns = _rotations(_directions(random, count), np.outer(times, random.uniform(0.0, 2.0, count)))
    arms = np.einsum("snij,nkj->snki", turns, corners - middles[:, None])
    gone = times[:, None, None] * (random.uniform(0.1, 1.0, (count, 1)) * middles)
    flown = (middles + gone)[:, :, None] + arms
    return _alone("explosion", flown.reshape(steps, -1, 3), np.arange(3 * count).reshape(-1, 3))


def wheels(detail: float, steps: int) -> BenchMotion:
    """100,000 instances of a stone of 220 triangles on a grid, each turning about a different axis."""
    side = max(4, round((100_000 * detail) ** (1 / 3)))
    random = np.random.default_rng(64)
    count = side**3
    positions, triangles = _ball(11, 11, [0.5, 0.35, 0.25], [0.0, 0.0, 0.0])
    positions = positions * random.uniform(0.85, 1.15, (len(positions), 1))
    at = np.stack(np.unravel_index(np.arange(count), (side, side, side)), axis=-1) * 1.2
    start = _rotations(_directions(random, count), random.uniform(0.0, 6.0, (1, count)))
    turns = _rotations(_directions(random, count), np.outer(_times(steps), random.uniform(0.3, 1.2, count)))
    places = np.concatenate([turns @ start, np.broadcast_to(at[..., None], (steps, count, 3, 1))], axis=-1)
    return _scene("wheels", [_mesh(positions[None], triangles)], np.zeros(count), places, np.ones(count, bool))


def car(detail: float, steps: int) -> BenchMotion:
    """A car of four turning wheels that drives 6 m within the shutter, through streets that do not move."""
    city = generated_meshes.city(detail)
    body, body_triangles = _join(
        [_ball(40, 80, [3.0, 1.0, 1.3], [0.0, 1.4, 0.0]), _ball(30, 60, [1.5, 0.9, 1.1], [0.2, 2.3, 0.0])]
    )
    wheel, wheel_triangles = _ball(24, 48, [0.6, 0.6, 0.25], [0.0, 0.0, 0.0])
    meshes = [
        _mesh(city.positions[None], city.triangles),
        _mesh(body[None], body_triangles),
        _mesh(wheel[None], wheel_triangles),
    ]
    extent = np.ptp(city.positions, axis=0)
    front = np.array([0.25 * np.linalg.norm(extent) - 60.0, 0.0, 0.0])
    axles = np.array([[0.0, 0.0, 0.0], *([x, 0.6, z] for x in (-2.0, 2.0) for z in (-1.2, 1.2))])
    times = _times(steps)
    places = np.zeros((steps, 6, 3, 4))
    places[..., :3] = np.eye(3)
    places[:, 2:, :, :3] = _rotations(np.broadcast_to([0.0, 0.0, 1.0], (4, 3)), np.repeat(10.0 * times[:, None], 4, 1))
    if steps == 2:  # no more than half a turn between two steps
        places[-1, 2:, :, :3] = _rotations(np.broadcast_to([0.0, 0.0, 1.0], (4, 3)), np.full((1, 4), 3.0))[0]
    places[:, 1:, :, 3] = axles + front
    places[:, 1:, 0, 3] -= 6.0 * times[:, None]
    return _scene("car", meshes, [0, 1, 2, 2, 2, 2], places, np.arange(6) > 0, is_inside=True)


def _times(steps: int) -> F64:
    return np.linspace(0.0, 1.0, steps)


def _scene(
    name: str,
    meshes: list[Shapes],
    mesh: npt.ArrayLike,
    places: F64,
    moves: npt.NDArray[np.bool_],
    *,
    is_inside: bool = False,
) -> BenchMotion:
    label = f"{name}, {len(places)} steps"
    return BenchMotion(label, meshes, np.asarray(mesh, np.int32), places.astype(np.float32), moves, is_inside)


def _alone(name: str, shapes: F64, triangles: I64) -> BenchMotion:
    """One mesh, in its own place."""
    places = np.tile(np.eye(3, 4), (len(shapes), 1, 1, 1))
    return _scene(name, [_mesh(shapes, triangles)], [0], places, np.zeros(1, bool))


def _mesh(shapes: npt.NDArray[np.floating], triangles: npt.NDArray[np.integer]) -> Shapes:
    return np.ascontiguousarray(shapes, np.float32), np.ascontiguousarray(triangles, np.int32)


def _walker(random: np.random.Generator, times: F64) -> Shapes:
    """Trunk, head, arms and legs; these swing about hip and shoulder."""
    size = random.uniform(0.85, 1.1)
    parts: list[tuple[list[float], list[float], float]] = [
        ([0.22, 0.35, 0.15], [0.0, 1.2, 0.0], 0.0),
        ([0.12, 0.15, 0.13], [0.0, 1.7, 0.0], 0.0),
    ]
    parts += [([0.09, 0.45, 0.1], [x, 0.45, 0.0], swing) for x, swing in ((-0.12, 0.6), (0.12, -0.6))]
    parts += [([0.06, 0.35, 0.07], [x, 1.2, 0.0], swing) for x, swing in ((-0.3, -0.5), (0.3, 0.5))]
    balls = [_ball(14, 22, half, middle) for half, middle, _ in parts]
    shapes = []
    for time in times:
        swung = []
        for (positions, _), (half, middle, swing) in zip(balls, parts, strict=True):
            hip = np.array(middle) + [0.0, half[1], 0.0]
            turn = _rotations(np.array([[1.0, 0.0, 0.0]]), np.array([[swing * (time - 0.3)]]))[0, 0]
            swung.append((positions - hip) @ turn.T + hip)
        shapes.append(size * np.concatenate(swung))
    return _mesh(np.stack(shapes), _join(balls)[1])


def _rotations(axes: npt.NDArray[np.floating], angles: F64) -> F64:
    """(S, N, 3, 3): about (N, 3) axes of unit length, by (S, N) angles (Rodrigues)."""
    x, y, z = np.asarray(axes, np.float64).T
    none = np.zeros_like(x)
    cross = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1).reshape(-1, 3, 3)
    sine, cosine = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
    return np.asarray(np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross))


def _directions(random: np.random.Generator, count: int) -> F64:
    vectors = random.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _ball(rows: int, columns: int, half: npt.ArrayLike, middle: npt.ArrayLike) -> tuple[F64, I64]:
    """An ellipsoid: its poles are rings of points, so that no triangle is flat but those at them."""
    down, around = np.linspace(0.001, np.pi - 0.001, rows + 1), np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    height, circle = np.cos(down)[:, None], np.sin(down)[:, None]
    ball = np.stack([circle * np.cos(around), height + 0.0 * around, circle * np.sin(around)], axis=-1)
    row, column = np.mgrid[0:rows, 0:columns].reshape(2, -1)
    a, b = row * columns + column, row * columns + (column + 1) % columns
    triangles = np.concatenate([np.stack([a, b, b + columns], 1), np.stack([a, b + columns, a + columns], 1)])
    return ball.reshape(-1, 3) * np.asarray(half) + np.asarray(middle), triangles


def _stick(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> tuple[F64, I64]:
    """An open tube of six sides."""
    along = np.asarray(end, np.float64) - np.asarray(start, np.float64)
    side = np.cross(along, [0.3, 0.1, 1.0])
    side /= np.linalg.norm(side)
    other = np.cross(along, side) / np.linalg.norm(along)
    angles = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False)[:, None]
    ring = radius * (np.cos(angles) * side + np.sin(angles) * other)
    i = np.arange(6)
    j = (i + 1) % 6
    triangles = np.concatenate([np.stack([i, j, j + 6], 1), np.stack([i, j + 6, i + 6], 1)])
    return np.concatenate([ring + np.asarray(start), 0.4 * ring + np.asarray(end)]), triangles


def _join(parts: list[tuple[F64, I64]]) -> tuple[F64, I64]:
    firsts = np.cumsum([0, *(len(positions) for positions, _ in parts[:-1])])
    triangles = [triangles + first for (_, triangles), first in zip(parts, firsts, strict=True)]
    return np.concatenate([positions for positions, _ in parts]), np.concatenate(triangles)


MAKERS: dict[str, Callable[[float, int], BenchMotion]] = {
    "crowd": crowd,
    "tree": tree,
    "explosion": explosion,
    "wheels": wheels,
    "car": car,
}
