"""t is that of the triangle's plane, to the last bits of a float, however large the triangle: judged in fractions."""

from __future__ import annotations

import functools
from fractions import Fraction

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from oracles import meshes
from oracles.exact_rays import lines_meet
from perfect_bvh._tuning import Traced

RAYS = 400
UNITS = 2  # in the last place
SIDES = (10.0, 1_500.0, 100_000.0)
F64 = npt.NDArray[np.float64]


@pytest.fixture(params=perfect_bvh.available_isas(), autouse=True)
def isa(request):
    perfect_bvh.set_active_isa(request.param)
    yield request.param
    perfect_bvh.set_active_isa(None)


def exact_t(corners: F64, origin: F64, direction: F64) -> Fraction:
    """Where the ray meets the plane of three corners (3, 3), without any rounding."""
    return _exact_t((*corners.ravel().tolist(), *origin.tolist(), *direction.tolist()))


@functools.cache  # kernels and strategies are asked alike
def _exact_t(numbers: tuple[float, ...]) -> Fraction:
    a, b, c, o, d = ([Fraction(x) for x in numbers[first : first + 3]] for first in range(0, 15, 3))
    e, f, away = ([x - y for x, y in zip(*two, strict=True)] for two in ((b, a), (c, a), (a, o)))
    normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]]
    return sum(n * x for n, x in zip(normal, away, strict=True)) / sum(n * x for n, x in zip(normal, d, strict=True))


def units_off(t: np.ndarray, corners: F64, origins: F64, directions: F64) -> F64:
    """Returns each t's error against the exact one in units in the last place of a float. corners: (R, 3, 3)."""
    off = []
    for answer, triangle, origin, direction in zip(t, corners, origins, directions, strict=True):
        exact = exact_t(triangle, origin, direction)
        off.append(float(abs(Fraction(float(answer)) - exact)) / float(np.spacing(np.float32(abs(float(exact))))))
    return np.array(off)


def heights_above(positions: npt.NDArray[np.float32], triangles: np.ndarray, points: F64) -> F64:
    """Returns the height of each point above the plane of its triangle (R, 3)."""
    a, b, c = (positions.astype(np.longdouble)[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    return np.abs(((points - a) * normals).sum(axis=1) / np.sqrt((normals**2).sum(axis=1))).astype(np.float64)


def rotation(seed: int) -> F64:
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turn


def ground(side: float, turn: F64, away: npt.ArrayLike = (0.0, 0.0, 0.0)) -> tuple[npt.NDArray[np.float32], np.ndarray]:
    """A square of two triangles, turned, as floats hold it."""
    flat = side * np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)])
    return (flat @ turn.T + np.asarray(away)).astype(np.float32), np.array([(0, 1, 2), (0, 2, 3)])


def rays_above(turn: F64, away: npt.ArrayLike = (0.0, 0.0, 0.0), slope: float = 1.0) -> tuple[F64, F64]:
    """Down to the 10 x 10 about the middle; the steeper the slope, the more they graze it."""
    random = np.random.default_rng(3)
    origins = np.column_stack([random.uniform(-5.0, 5.0, (RAYS, 2)), random.uniform(0.5, 3.0, RAYS)])
    targets = np.column_stack([random.uniform(-5.0, 5.0, (RAYS, 2)), np.zeros(RAYS)])
    directions = (targets - origins) * [slope, slope, 1.0]
    return origins @ turn.T + np.asarray(away), directions @ turn.T


def check(positions, triangles, transform: F64, origins: F64, directions: F64, **how: str) -> perfect_bvh.Hits:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles), transform)
    scene.commit()
    hits = scene.cast_rays(origins, directions, **how)
    found = hits.is_hit
    assert found.mean() > 0.9
    world = positions.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
    corners = world[triangles[hits.primitive_ids[found]]]
    off = units_off(hits.t_hit[found], corners, origins[found], directions[found])
    assert off.max() <= UNITS, f"{off.max():.3g} units in the last place"
    return hits


@pytest.mark.parametrize("strategy", ["stream", "packets"])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("tilt", [None, 1, 2])
def test_on_grounds_of_any_size(side, tilt, strategy):
    turn = np.eye(3) if tilt is None else rotation(tilt)
    scene = perfect_bvh.Scene()
    positions, triangles = ground(side, turn)
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    origins, directions = rays_above(turn)
    hits = Traced(scene, strategy).cast_rays(origins, directions)
    assert hits.is_hit.all()
    corners = positions.astype(np.float64)[triangles[hits.primitive_ids]]
    assert units_off(hits.t_hit, corners, origins, directions).max() <= UNITS
    closest = scene.compute_closest_points(origins)
    assert np.allclose(
        closest.distances, heights_above(positions, triangles[closest.primitive_ids], origins), rtol=2e-7
    )


@pytest.mark.parametrize("slope", [30.0, 1_000.0])
@pytest.mark.parametrize("tilt", [None, 1, 2])
def test_where_rays_graze_a_ground(tilt, slope):
    """At such grazing angles the weighted corners do not determine t; they still decide the edges."""
    turn = np.eye(3) if tilt is None else rotation(tilt)
    check(*ground(15_000.0, turn), np.eye(4), *rays_above(turn, slope=slope))


@pytest.mark.parametrize("side", SIDES)
def test_through_transforms(side):
    """Scaled unevenly, sheared, turned and moved: the plane is the transformed triangle's."""
    random = np.random.default_rng(5)
    transform = np.eye(4)
    transform[:3, :3] = rotation(6) @ np.diag([3.0, 0.2, 1.0]) @ rotation(7) + 0.1 * random.normal(size=(3, 3))
    transform[:3, 3] = (120.0, -30.0, 7.0)
    positions, triangles = ground(side, rotation(8))
    inverse = np.linalg.inv(transform)
    origins, directions = rays_above(rotation(8))
    world = origins @ transform[:3, :3].T + transform[:3, 3]
    assert np.allclose(world @ inverse[:3, :3].T + inverse[:3, 3], origins)
    check(positions, triangles, transform, world, directions @ transform[:3, :3].T)


def test_far_from_zero():
    away = np.array([4096.0, -1024.0, 512.0])
    check(*ground(64.0, np.eye(3), away), np.eye(4), *rays_above(np.eye(3), away))


def test_where_rays_begin_far_away():
    origins, directions = rays_above(np.eye(3))
    for distance in (1e3, 1e6):
        check(*ground(10.0, np.eye(3)), np.eye(4), origins - distance * directions, directions)


@pytest.mark.parametrize("make", [meshes.soup, meshes.slivers])
def test_on_triangles_of_any_shape(make):
    positions, triangles = make(300, 4)
    positions = positions.astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    random = np.random.default_rng(9)
    chosen = positions.astype(np.float64)[triangles[random.integers(0, len(triangles), RAYS)]]
    origins = random.normal(size=(RAYS, 3)) * 3.0
    directions = np.einsum("rk,rki->ri", random.dirichlet((2.0, 2.0, 2.0), RAYS), chosen) - origins
    hits = scene.cast_rays(origins, directions)
    found = np.flatnonzero(hits.is_hit)
    assert len(found) > 0.9 * RAYS
    corners = positions.astype(np.float64)[triangles[hits.primitive_ids[found]]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    along = directions[found] / np.linalg.norm(directions[found], axis=1, keepdims=True)
    seen = np.abs(np.einsum("rk,rk->r", normals, along)) > 1e-3  # edge-on a plane has no t to speak of
    assert (
        units_off(hits.t_hit[found][seen], corners[seen], origins[found][seen], directions[found][seen]).max() <= UNITS
    )


def exact_hits(
    positions: npt.NDArray[np.float32], triangles: np.ndarray, origins: F64, directions: F64
) -> list[list[int]]:
    """Ids of the triangles that each ray meets ahead of its origin, the nearest first: of equal floats the least id."""
    corners = positions.astype(np.float64)[triangles]
    ids = []
    for met, origin, direction in zip(
        lines_meet(positions, triangles, origins, directions), origins, directions, strict=True
    ):
        ahead = [(exact_t(corners[number], origin, direction), int(number)) for number in np.flatnonzero(met)]
        ids.append([number for _, number in sorted((np.float32(float(t)), number) for t, number in ahead if t >= 0)])
    return ids


def beside_edges(positions: npt.NDArray[np.float32], triangles: np.ndarray, eye: F64, away: float) -> tuple[F64, F64]:
    """Rays from about `eye` past random points of random edges, on either side by up to `away` of the edge's length."""
    random = np.random.default_rng(11)
    ends = positions.astype(np.float64)[triangles[random.integers(0, len(triangles), RAYS)]]
    share = random.uniform(0.05, 0.95, (RAYS, 1))
    across = ends[:, 2] - ends[:, 0]
    targets = (1 - share) * ends[:, 0] + share * ends[:, 1] + random.uniform(-away, away, (RAYS, 1)) * across
    origins = eye + random.uniform(-0.01, 0.01, (RAYS, 3)) * np.abs(eye).max()
    return origins, targets - origins


CUBE = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
CUBE_TRIANGLES = np.array(
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4)]
    + [(1, 5, 7), (1, 7, 3)]
)


@functools.cache
def beside_edges_of_a_cube(offset: float, away: float) -> tuple[npt.NDArray[np.float32], F64, F64, list[list[int]]]:
    """Positions, origins, directions and exact hits, the same for each instruction set."""
    positions = (CUBE @ rotation(12).T + offset).astype(np.float32)
    origins, directions = beside_edges(positions, CUBE_TRIANGLES, offset + np.array([4.0, 3.0, 2.0]), away)
    return positions, origins, directions, exact_hits(positions, CUBE_TRIANGLES, origins, directions)


@pytest.mark.parametrize("strategy", ["stream", "packets"])
@pytest.mark.parametrize("away", [1e-6, 1e-8])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_beside_edges(offset, away, strategy):
    """The hit is exact where float could not decide, behind a silhouette too; t is that of the triangle's plane."""
    positions, origins, directions, expected = beside_edges_of_a_cube(offset, away)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, CUBE_TRIANGLES))
    scene.commit()
    assert 0.05 < np.mean([not met for met in expected]) < 0.5  # past a silhouette
    hits = Traced(scene, strategy).cast_rays(origins, directions)
    assert hits.primitive_ids.tolist() == [met[0] if met else -1 for met in expected]
    assert Traced(scene, strategy).test_occlusions(origins, directions).tolist() == [bool(met) for met in expected]
    found = hits.is_hit
    corners = positions.astype(np.float64)[CUBE_TRIANGLES[hits.primitive_ids[found]]]
    assert units_off(hits.t_hit[found], corners, origins[found], directions[found]).max() <= UNITS
    every = scene.list_intersections(origins, directions)
    assert every.hits.primitive_ids.tolist() == [number for met in expected for number in met]


def rays_along(corners: F64, angle: float, farthest: float) -> tuple[F64, F64]:
    """Rays from at most `farthest` away to points of a triangle, at `angle` to its plane."""
    random = np.random.default_rng(16)
    across = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    along = random.normal(size=(RAYS, 2)) @ (corners[1:] - corners[0])
    directions = along / np.linalg.norm(along, axis=1, keepdims=True) + angle * across / np.linalg.norm(across)
    targets = random.dirichlet((2.0, 2.0, 2.0), RAYS) @ corners
    return targets - random.uniform(0.0, farthest, (RAYS, 1)) * directions, directions


def check_exactly(positions: npt.NDArray[np.float32], triangles: np.ndarray, rays: tuple[F64, F64], how: str) -> None:
    """Which triangle each ray meets, and its t, are as fractions have them."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    hits = Traced(scene, how).cast_rays(*rays)
    expected = exact_hits(positions, triangles, *rays)
    assert np.mean([bool(met) for met in expected]) > 0.1
    assert hits.primitive_ids.tolist() == [met[0] if met else -1 for met in expected]
    found = hits.is_hit
    corners = positions.astype(np.float64)[triangles[hits.primitive_ids[found]]]
    assert units_off(hits.t_hit[found], corners, *(vectors[found] for vectors in rays)).max() <= UNITS


@pytest.mark.parametrize("strategy", ["stream", "packets"])
@pytest.mark.parametrize(("exponent", "farthest"), [(-20, 3), (-25, 1000), (-30, 3), (-40, 3), (-50, 3), (-60, 3)])
def test_where_rays_run_nearly_within_the_plane(exponent, farthest, strategy):
    """At 2^-60 rays and triangle are in one plane up to rounding of doubles: they can meet anywhere on it."""
    corners = (np.array([(0.0, 0.0, 0.0), (2.0, 0.3, 0.0), (0.4, 2.0, 0.0)]) @ rotation(15).T + 0.5).astype(np.float32)
    rays = rays_along(corners.astype(np.float64), 2.0**exponent, farthest)
    check_exactly(corners, np.array([(0, 1, 2)]), rays, strategy)


@pytest.mark.parametrize("strategy", ["stream", "packets"])
@pytest.mark.parametrize("angle", [2.0**-38, -(2.0**-41), 2.0**-50, -(2.0**-140)])
def test_where_rays_run_nearly_within_flat_boxes(angle, strategy):
    """Boxes take components of a direction that are smaller than 2^-40 of the longest for so large."""
    positions, triangles = meshes.grid(6)
    rays = rays_along(np.array([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)]), angle, 3.0)
    check_exactly(positions.astype(np.float32), triangles, rays, strategy)


def test_beside_the_edge_that_two_grounds_share():
    """A roof of a hundred kilometres: next to its ridge each side has its own t."""
    turn = rotation(13)
    flat = 1e5 * np.array([(-1.0, 0.0, -0.3), (0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, -0.7)])
    positions, triangles = (flat @ turn.T).astype(np.float32), np.array([(0, 1, 2), (1, 3, 2)])
    random = np.random.default_rng(14)
    targets = np.column_stack([random.uniform(-0.02, 0.02, RAYS), random.uniform(-5.0, 5.0, RAYS), np.zeros(RAYS)])
    origins = np.column_stack([random.uniform(-2.0, 2.0, (RAYS, 2)), random.uniform(3.0, 6.0, RAYS)])
    rays = origins @ turn.T, (targets - origins) @ turn.T
    hits = check(positions, triangles, np.eye(4), *rays)
    expected = [met[0] for met in exact_hits(positions, triangles, *rays)]
    assert hits.primitive_ids.tolist() == expected
    assert 0.3 < np.mean(expected) < 0.7


def test_far_rays_almost_within_a_plane_meet_the_triangle() -> None:
    origin = np.array([52.60573063999155, 13.518174709103304, -35.13571323593284])
    direction = np.array([-52.41005221217611, -13.43765096394648, 34.9400348081174])
    corners = np.array([(0, 0.1821172, -0.39135686), (0, 0, 0), (0.39135686, -0.021069704, 0)], np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(corners, [(0, 1, 2)]))
    scene.commit()
    assert scene.cast_rays(origin, direction).t_hit == 1.0
    assert scene.cast_rays(origin, direction, t_min=0.9, t_max=1.1).is_hit
