"""The double-precision reference of curves and points, compared with calculations by hand and by bisection."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.round_judge import find_surfaces, judge, judge_lists, judge_occlusions, surfaces_at
from oracles.round_segments import Hulls, Real, Reals, distances, intervals, touching
from oracles.round_world import RoundPart, RoundWorld, find_chords

# Around the x axis, 5 long, from radius 5 to 2: sines and cosines of 3/5 and 4/5. Its cone is 14/5 wide at x = 23/5.
CONE = ([0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 2.0])
DOWN = [0.0, 0.0, -1.0]
ZIGZAG = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [8, 4, 0]], np.float32)


def world_of(centres, radii, offsets=None, transform=None, mask=1) -> RoundWorld:
    matrix = np.eye(4) if transform is None else transform
    return RoundWorld.of([RoundPart(0, np.asarray(centres, np.float32), radii, offsets, matrix, mask)])


@pytest.mark.parametrize(
    ("start", "end", "radii", "origin", "direction", "expected"),
    [
        ([0, 0, 0], [0, 0, 0], [1, 1], [0, 0, 3], DOWN, (2, 4)),
        ([-2, 0, 0], [2, 0, 0], [1, 1], [0, 0, 3], DOWN, (2, 4)),
        ([-2, 0, 0], [2, 0, 0], [1, 1], [-5, 0, 0], [1, 0, 0], (2, 8)),
        ([-2, 0, 0], [2, 0, 0], [1, 1], [-5, 0.6, 0], [2, 0, 0], (1.1, 3.9)),
        (*CONE, [23 / 5, 0, 10], DOWN, (36 / 5, 64 / 5)),
        (*CONE, [23 / 5, 0, 10], [0, 0, -4], (9 / 5, 16 / 5)),
        (*CONE, [-10, 0, 0], [1, 0, 0], (5, 17)),
        (*CONE, [-10, 4, 0], [1, 0, 0], (7, 13)),
        ([0, 0, 0], [1, 0, 0], [3, 1], [0, 0, 5], DOWN, (2, 8)),
        ([0, 0, 0], [4, 0, 0], [0, 0], [2, 0, 5], DOWN, (5, 5)),
        ([0, 0, 0], [5, 0, 0], [3, 0], [5 - 1e-9, 0, 0], [1, 0, 0], (-8 + 1e-9, 1e-9)),
        (*CONE, [23 / 5, 2.9, 10], DOWN, None),
        ([0, 0, 0], [4, 0, 0], [1, 1], [5.1, 0, 5], DOWN, None),
        ([0, 0, 0], [0, 0, 0], [1, 1], [0, 0, 1e6], [0, 1e-3, 1], None),
    ],
)
def test_by_hand(start, end, radii, origin, direction, expected):
    rays = np.array([origin], Real), np.array([direction], Real)
    near, far = intervals(Hulls.of([start], [end], [radii]), *rays)
    if expected is None:
        assert np.isnan(near).all() and np.isnan(far).all()
    else:
        np.testing.assert_allclose([float(near[0]), float(far[0])], expected, rtol=0.0, atol=1e-14)


def test_growth_is_that_of_both_balls():
    """The tip that shrinks away lies where the cone's ball has no radius left."""
    rays = np.array([[0.0, 0.0, 5.0], [9.0, 0.0, 0.0]], Real), np.array([DOWN, [-1.0, 0.0, 0.0]], Real)
    hull = Hulls.of([[0, 0, 0]] * 2, [[4, 0, 0]] * 2, [[2, 0]] * 2)
    near, far = intervals(hull, *rays, -1.0)
    np.testing.assert_allclose(near.astype(float), [4.0, 7.0])  # s = 1/2, at x = 2
    assert float(far[1]) == 10.0
    near, _ = intervals(hull, *rays, 1.0)
    np.testing.assert_allclose(float(near[1]), 4.0)


def random_hulls(count: int, seed: int, thickness: float, distance: float) -> tuple[Hulls, Reals, Reals]:
    """Hulls and rays that pass close by, many along the axis or nearly; balls within balls, tips, cylinders."""
    random = np.random.default_rng(seed)
    start = random.normal(size=(count, 3))
    axis = random.normal(size=(count, 3)) * random.choice([1.0, 1e-2, 0.0], size=(count, 1))
    radii = random.uniform(0.0, thickness, (count, 2)) * random.choice([1.0, 0.0], p=[0.9, 0.1], size=(count, 2))
    radii[::5, 1] = radii[::5, 0]
    target = start + random.uniform(size=(count, 1)) * axis
    target += random.normal(size=(count, 3)) * 0.6 * radii.max(axis=1, keepdims=True)
    direction = random.normal(size=(count, 3))
    direction[::3] = axis[::3] + direction[::3] * random.choice([1e-9, 1e-4, 0.1], size=(len(axis[::3]), 1))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = (target - distance * direction).astype(Real)
    return Hulls.of(start, start + axis, radii), origin, direction.astype(Real)


@pytest.mark.parametrize(("thickness", "distance"), [(1.0, 1.0), (1e-6, 1.0), (1.0, 1e6), (1e-3, 1e3)])
def test_bisection_finds_the_same(thickness, distance):
    """The distance from a convex body is convex along a ray: its least place and both zeros are found by halving."""
    hulls, origins, directions = random_hulls(4000, 1, thickness, distance)
    near, far = intervals(hulls, origins, directions)

    def height(t: Reals) -> Reals:
        return touching(hulls, origins + t[:, None] * directions)[2]

    low, high = np.full(len(near), distance - 30.0, Real), np.full(len(near), distance + 30.0, Real)
    first, last = low, high
    golden = (np.sqrt(Real(5)) - 1) / 2
    for _ in range(110):
        left, right = high - golden * (high - low), low + golden * (high - low)
        falls = height(left) < height(right)
        low, high = np.where(falls, low, left), np.where(falls, right, high)
    deepest = (low + high) / 2
    size = np.maximum(np.maximum(hulls.first_radii, hulls.last_radii), Real(1e-300))
    depth = -height(deepest) / size
    blur = 1e4 * float(np.finfo(Real).eps) * (1.0 + distance) / size
    assert not np.isnan(near[depth > blur]).any()
    assert np.isnan(near[depth < -blur]).all()
    inside = depth > np.maximum(blur, 1e-9)
    assert inside.sum() > 1000
    for outer, found in ((first, near), (last, far)):
        out, within = outer, deepest
        for _ in range(80):
            middle = (out + within) / 2
            is_in = height(middle) <= 0.0
            out, within = np.where(is_in, out, middle), np.where(is_in, middle, within)
        # Along the ray the surface is nowhere steeper than a depth that is reached within the interval's length.
        off, length = np.abs(found - within), np.abs(deepest - within)
        assert (off * depth <= blur * length)[inside].all()


def test_what_touches():
    hull = Hulls.of(*([row] for row in CONE))
    s, normal, distance = touching(hull, [[23 / 5, 0.0, 3.8]])
    np.testing.assert_allclose(normal[0].astype(float), [3 / 5, 0.0, 4 / 5], atol=1e-15)
    np.testing.assert_allclose(float(distance[0]), 0.8, atol=1e-15)  # a height of 1 above it, aslant
    np.testing.assert_allclose(float(s[0]), 0.35, atol=1e-15)
    assert float(distances([[0.0, 0.0, 0.0]], hull)[0, 0]) == -5.0
    s, _, distance = touching(Hulls.of([[0, 0, 0]], [[1, 0, 0]], [[3, 1]]), [[10.0, 0.0, 0.0]])
    assert (float(s[0]), float(distance[0])) == (0.0, 7.0)


def test_joints_show_each_surface_once():
    """Along a zigzag's first leg, and across its elbow: in and out, though two or three segments are passed."""
    world = world_of(ZIGZAG, np.full(4, 0.5), [0, 4])
    rays = np.array([[-3.0, 0, 0], [4, 0, 3], [4, -3, 0], [2, 0, 3]]), np.array([[1.0, 0, 0], DOWN, [0, 1, 0], DOWN])
    assert np.bincount(find_chords(world, *rays).rays).tolist() == [2, 2, 3, 1]
    surfaces = find_surfaces(world, *rays)
    own = surfaces.is_own
    assert own[surfaces.rays == 0].sum() == 1 and own[surfaces.rays == 3].sum() == 2
    t = {ray: sorted(surfaces.low[surfaces.rays == ray].tolist()) for ray in range(4)}
    np.testing.assert_allclose(t[0], [2.5, 7.5, 7.5], rtol=1e-6)
    np.testing.assert_allclose(t[1], [2.5, 2.5, 3.5, 3.5], rtol=1e-6)  # either segment's: they cannot be distinguished
    np.testing.assert_allclose([min(t[2]), max(t[2])], [2.5, 7.5], rtol=1e-6)
    verdict = judge_lists(
        world, *rays, np.repeat(range(4), 2), [2.5, 7.5, 2.5, 3.5, 2.5, 7.5, 2.5, 3.5], [0] * 8, [0] * 8
    )
    assert not verdict.wrong.any(), str(verdict)


def test_no_neighbours_are_not_united():
    """Two strands that cross show both; so do points."""
    balls = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]], np.float32)
    rays = np.array([[0.0, 0, 3]]), np.array([DOWN])
    assert find_surfaces(world_of(balls, np.full(4, 0.5), [0, 2, 4]), *rays).is_own.sum() == 4
    assert find_surfaces(world_of(balls * 0.1, np.full(4, 0.5)), *rays).is_own.sum() == 8


@pytest.mark.parametrize(
    ("t_hit", "instance_id", "primitive_id", "is_wrong"),
    [
        (2.5, 0, 0, False),
        (2.5 + 1e-5, 0, 0, True),
        (2.5 - 1e-5, 0, 0, True),
        (3.5, 0, 0, True),
        (2.5, 0, 1, True),
        (2.5, 1, 0, True),
        (np.inf, -1, -1, True),
    ],
    ids=["right", "behind", "before", "its exit", "no such curve", "no such instance", "a miss"],
)
@pytest.mark.parametrize("x", [2.0, 4.0], ids=["leg", "elbow"])
def test_wrong_hits_are_called_wrong(x, t_hit, instance_id, primitive_id, is_wrong):
    world = world_of(ZIGZAG, np.full(4, 0.5), [0, 4])
    rays = np.array([[x, 0.0, 3.0]]), np.array([DOWN])
    assert judge(world, *rays, [t_hit], [instance_id], [primitive_id]).wrong.tolist() == [is_wrong]


def test_ranges_and_masks():
    """From inside the ray hits the exit, on any segment; curves hidden by the mask are not hit."""
    world = world_of(ZIGZAG, np.full(4, 0.5), [0, 4], mask=2)
    rays = np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    assert not judge(world, *rays, [3.5], [0], [0]).wrong.any()
    assert not judge(world, *rays, [3.5], [0], [0], t_min=3.4999).wrong.any()
    for missed, limits in ((True, {"t_min": 3.6}), (True, {"t_max": 3.4}), (True, {"mask": 1}), (False, {"mask": 2})):
        assert judge(world, *rays, [np.inf], [-1], [-1], **limits).wrong.tolist() == [not missed]
        assert judge_occlusions(world, *rays, [False], **limits).wrong.tolist() == [not missed]
        assert judge_occlusions(world, *rays, [True], **limits).wrong.tolist() == [missed]


def test_tangents_are_ambiguous_and_no_more():
    """On the surface's edge the answer is undecided; a millionth of a millionth next to it, it is decided."""
    world = world_of([[0, 0, 0]], [1.0])
    for off, verdict in ((0.0, (True, False)), (1e-12, (False, False)), (-1e-12, (False, True))):
        rays = np.array([[1.0 + off, 0.0, 3.0]]), np.array([DOWN])
        judged = judge(world, *rays, [np.inf], [-1], [-1])
        assert (bool(judged.ambiguous[0]), bool(judged.wrong[0])) == verdict


def test_instances_are_ellipsoids():
    """A ball that its instance makes 3 high, in the world 5 above: u, normal and t are those of the ellipsoid."""
    matrix = np.diag([1.0, 2.0, 3.0, 1.0])
    matrix[2, 3] = 5.0
    world = world_of([[0, 0, 0]], [1.0], transform=matrix)
    rays = np.array([[0.6, 0.0, 20.0]]), np.array([[0.0, 0.0, -2.0]])
    t = (20.0 - 5.0 - 3.0 * 0.8) / 2.0
    assert not judge(world, *rays, [np.float32(t)], [0], [0]).wrong.any()
    assert judge(world, *rays, [t + 1e-4], [0], [0]).wrong.all()
    u, normals, distance = surfaces_at(world, rays[0] + t * rays[1], [0], [0])
    expected = np.array([0.6, 0.0, 0.8 / 3.0])
    np.testing.assert_allclose(normals[0], expected / np.linalg.norm(expected), atol=1e-14)
    assert u[0] == 0.0 and abs(distance[0]) < 1e-14


def test_u_runs_along_the_whole_curve():
    world = world_of(ZIGZAG, np.full(4, 0.5), [0, 4])
    u, normals, _ = surfaces_at(world, [[1.0, 0.0, 0.5], [4.5, 1.0, 0.0], [8.5, 4.0, 0.0]], [0] * 3, [0] * 3)
    np.testing.assert_allclose(u, [1 / 12, 5 / 12, 1.0], atol=1e-15)
    np.testing.assert_allclose(normals, [[0, 0, 1], [1, 0, 0], [1, 0, 0]], atol=1e-15)


def test_a_segment_without_radius_is_not_there():
    world = world_of(ZIGZAG, [0.5, 0.0, 0.0, 0.5], [0, 4])
    assert world.steps.tolist() == [0, 2] and world.counts.tolist() == [3, 3]
    assert not find_chords(world, [[4.0, 2.0, 1.0]], [DOWN]).rays.size
