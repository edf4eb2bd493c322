"""Nearest points against brute force in double precision, in world space, through every kind of transform."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.closest_point import distances_to_triangles
from perfect_bvh.build_config import BUILDERS

SHEAR = np.array([[1.0, 0.7, 0.0, 0.3], [0.0, 0.4, 0.2, -0.2], [0.1, 0.0, 1.9, 0.1], [0.0, 0.0, 0.0, 1.0]])
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
SQUASH = np.array([[0.6, -0.8, 0.0, 1.0], [0.8, 0.6, 0.0, 0.0], [0.0, 0.0, 1e-3, 0.0], [0.0, 0.0, 0.0, 1.0]])
FLAT = np.diag([1.0, 1.0, 0.0, 1.0])
TURNED_SCALE = np.array([[3.0, -0.2, 0.0, 0.0], [4.0, 0.15, 0.0, 2.0], [0.0, 0.0, 7.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
ALL = 0xFFFFFFFF


def make_scene(parts, build="auto"):
    """A scene of (mesh, transform, mask) parts, and per triangle its corners, instance, primitive and mask."""
    scene, corners, instances, primitives, masks = perfect_bvh.Scene(), [], [], [], []
    for (positions, triangles), transform, mask in parts:
        ident = scene.add_instance(scene.add_mesh(positions, triangles, build=build), transform, mask)
        world = positions.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
        corners.append(world[triangles])
        instances.append(np.full(len(triangles), ident))
        primitives.append(np.arange(len(triangles)))
        masks.append(np.full(len(triangles), mask, np.uint32))
    scene.commit()
    return scene, tuple(np.concatenate(columns) for columns in (corners, instances, primitives, masks))


def check(scene, world, points, max_distance=np.inf, mask=ALL, tolerance=1e-12):
    """Right distances, and a point of the named triangle at that distance, for every point."""
    corners, instances, primitives, masks = world
    found = scene.compute_closest_points(points, max_distance=max_distance, mask=mask)
    every = distances_to_triangles(points, corners)
    visible = (masks[None, :] & np.broadcast_to(np.asarray(mask, np.uint32), len(points))[:, None]) != 0
    every = np.where(visible, every, np.inf)
    expected = every.min(axis=1, initial=np.inf)
    size = tolerance * (np.abs(corners).max() + np.abs(points).max())
    near = expected <= np.asarray(max_distance) - size
    far = expected > np.asarray(max_distance) + size
    if np.isinf(np.asarray(max_distance)).all():
        near, far = np.isfinite(expected), ~np.isfinite(expected)
    assert found.is_found[near].all() and not found.is_found[far].any()
    hit = found.is_found
    assert np.isinf(found.distances[~hit]).all() and (found.points[~hit] == 0.0).all()
    error = np.abs(found.distances[hit] - expected[hit])
    assert error.max(initial=0.0) <= size
    row_of = {key: i for i, key in enumerate(zip(instances.tolist(), primitives.tolist(), strict=True))}
    keys = zip(found.instance_ids[hit].tolist(), found.primitive_ids[hit].tolist(), strict=True)
    rows = np.array([row_of[key] for key in keys], np.int64)
    assert (np.abs(every[hit, rows] - expected[hit]) <= size).all()
    measured = np.linalg.norm(found.points[hit] - points[hit], axis=1)
    assert (np.abs(measured - found.distances[hit]) <= size).all()
    u, v = found.primitive_uvs[hit].T
    assert (u >= 0).all() and (v >= 0).all() and (u + v <= 1 + 1e-6).all()
    named = corners[rows]
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    assert (
        np.abs(np.einsum("tc,tck->tk", weights, named) - found.points[hit]).max(initial=0.0)
        <= size + 1e-6 * np.abs(corners).max()
    )
    return found


def some_points(count, seed, reach=2.5):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 3))


@pytest.mark.parametrize("isa", perfect_bvh.available_isas())
@pytest.mark.parametrize("make", [meshes.soup, meshes.slivers])
def test_random_triangles(make, isa):
    positions, triangles = make(400, 1)
    perfect_bvh.set_active_isa(isa)
    try:
        scene, world = make_scene([((positions.astype(np.float32), triangles), np.eye(4), 1)])
        assert check(scene, world, some_points(1500, 2)).is_found.all()
    finally:
        perfect_bvh.set_active_isa("")


def parts_of_all_kinds():
    mesh = meshes.soup(100, 1)[0].astype(np.float32), meshes.soup(100, 1)[1]
    ball = meshes.sphere(10, 14, 0.6)[0].astype(np.float32), meshes.sphere(10, 14, 0.6)[1]
    return [
        (mesh, SHEAR, 1),
        (mesh, MIRROR, 2),
        (ball, SQUASH, 4),
        (ball, FLAT, 8),
        (ball, TURNED_SCALE, 16),
        (mesh, np.eye(4), 32),
    ]


def test_transforms_masks_and_limits():
    """A flattened instance is baked to float32 in world space, whose precision is 1e-7."""
    scene, world = make_scene(parts_of_all_kinds())
    points = some_points(1500, 3, 6.0)
    check(scene, world, points, tolerance=1e-7)
    random = np.random.default_rng(4)
    found = check(scene, world, points, random.uniform(0.0, 5.0, 1500), random.integers(0, 64, 1500), tolerance=1e-7)
    assert 100 < found.is_found.sum() < 1400


@pytest.mark.parametrize("transform", [SHEAR, MIRROR, SQUASH, TURNED_SCALE])
def test_each_transform_is_exact(transform):
    mesh = meshes.soup(200, 5)
    scene, world = make_scene([((mesh[0].astype(np.float32), mesh[1]), transform, 1)])
    check(scene, world, some_points(800, 6, 4.0), tolerance=1e-13)


@pytest.mark.parametrize("scale", [1e-20, 1e-6, 1e3, 1e8, 1e15])
def test_scales(scale):
    positions, triangles = meshes.soup(200, 7)
    scene, world = make_scene([(((positions * scale).astype(np.float32), triangles), SHEAR, 1)])
    check(scene, world, some_points(500, 8) * scale)


@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9])
def test_far_points(distance):
    positions, triangles = meshes.soup(200, 9)
    scene, world = make_scene([((positions.astype(np.float32), triangles), SHEAR, 1)])
    directions = np.random.default_rng(10).normal(size=(300, 3))
    check(scene, world, directions * distance, tolerance=1e-15)


def test_same_for_builders_isas_threads_and_pieces(monkeypatch):
    parts, points, answers = parts_of_all_kinds(), some_points(5000, 11, 5.0), []
    for builder in BUILDERS[1:]:
        scene, _ = make_scene(parts, perfect_bvh.BuildConfig(builder=builder))
        for isa in perfect_bvh.available_isas():
            perfect_bvh.set_active_isa(isa)
            answers += [scene.compute_closest_points(points, threads=threads) for threads in (1, 2)]
        perfect_bvh.set_active_isa("")
    monkeypatch.setattr("perfect_bvh._arrays.PIECE_ROWS", 700)
    answers.append(scene.compute_closest_points(np.asfortranarray(points)))
    for answer in answers[1:]:
        for name in ("points", "distances", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs"):
            assert getattr(answer, name).tobytes() == getattr(answers[0], name).tobytes(), name


def test_ties_go_by_order_id_and_primitive():
    positions, triangles = meshes.grid(4)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions.astype(np.float32), np.concatenate([triangles, triangles]))
    ids = [scene.add_instance(mesh, order=order) for order in (5, 3, 3, 4)]
    scene.commit()
    points = some_points(500, 12, 1.5)
    found = scene.compute_closest_points(points)
    assert (found.instance_ids == ids[1]).all()
    assert (found.primitive_ids < len(triangles)).all()
    corner = scene.compute_closest_points([(0.0, 0.0, 1.0)])  # above a vertex of six triangles
    around = np.flatnonzero((np.abs(positions[triangles]).max(axis=2) == 0.0).any(axis=1))
    assert corner.primitive_ids[0] == around.min() and corner.distances[0] == 1.0


def test_on_the_surface_and_at_the_limit():
    scene, _ = make_scene([((*meshes.grid(4),), np.eye(4), 1)])
    on = np.concatenate([some_points(50, 13, 0.9)[:, :2], np.zeros((50, 1))], axis=1)
    found = scene.compute_closest_points(on)
    assert found.distances.max() <= 1e-16 and np.abs(found.points - on).max() <= 1e-15
    above = on + (0.0, 0.0, 0.75)
    assert scene.compute_closest_points(above, max_distance=0.75).is_found.all()
    assert not scene.compute_closest_points(above, max_distance=np.nextafter(0.75, 0.0)).is_found.any()
    assert scene.compute_closest_points(on, max_distance=0.0).is_found.sum() > 0


def test_given_in_float64_far_from_zero():
    """A million units away distances are as exact as at zero, up to float64's own precision there."""
    positions, triangles = meshes.sphere(30, 40)
    points = some_points(500, 14)
    near, _ = make_scene([((positions, triangles), np.eye(4), 1)])
    expected = near.compute_closest_points(points).distances
    for offset in (1e6, 1e9):
        far, _ = make_scene([((positions + offset, triangles), np.eye(4), 1)])
        answer = far.compute_closest_points(points + offset)
        assert np.abs(answer.distances - expected).max() <= 2e-7 + 4e-16 * offset


def test_shapes_and_nothing_to_find():
    scene, _ = make_scene([((*meshes.grid(2),), np.eye(4), 1)])
    found = scene.compute_closest_points(np.zeros((2, 5, 3)) + (0, 0, 2))
    assert (
        found.points.shape == (2, 5, 3) and found.distances.shape == (2, 5) and found.primitive_uvs.shape == (2, 5, 2)
    )
    assert (found.distances == 2.0).all() and found.generation == 1
    assert scene.compute_closest_points((0, 0, 3)).distances.shape == ()
    assert scene.compute_closest_points(np.zeros((0, 3))).points.shape == (0, 3)
    bad = [(np.nan, 0, 0), (0, np.inf, 0), (0, 0, -np.inf), (1e300, 0, 0)]
    answer = scene.compute_closest_points(bad)
    assert not answer.is_found.any() and answer.invalid_count == 3
    limits = scene.compute_closest_points(np.zeros((3, 3)), max_distance=[np.nan, -1.0, 0.5])
    assert limits.is_found.tolist() == [False, False, True] and limits.invalid_count == 2
    assert not scene.compute_closest_points((0, 0, 1), mask=0).is_found
    empty = perfect_bvh.Scene()
    empty.commit()
    assert not empty.compute_closest_points((0, 0, 1)).is_found
    empty.add_instance(empty.add_mesh(np.zeros((0, 3)), np.zeros((0, 3), int)))
    empty.commit()
    assert not empty.compute_closest_points((0, 0, 1)).is_found


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.zeros((2, 4))}, r"points must have shape \(\.\.\., 3\), got \(2, 4\)"),
        ({"points": [["a", "b", "c"]]}, "points must hold numbers"),
        ({"max_distance": np.zeros(3)}, r"max_distance must be .* got shape \(3,\)"),
        ({"mask": -1}, "mask has values outside"),
        ({"mask": 0.5}, "mask must hold integers"),
        ({"threads": -1}, "threads must be"),
    ],
)
def test_wrong_arguments(arguments, message):
    scene, _ = make_scene([((*meshes.grid(2),), np.eye(4), 1)])
    with pytest.raises(ValueError, match=f"compute_closest_points: {message}"):
        scene.compute_closest_points(**{"points": np.zeros((2, 3)), **arguments})


def test_uncommitted_edits_are_refused():
    scene, _ = make_scene([((*meshes.grid(2),), np.eye(4), 1)])
    scene.add_instance(0)
    with pytest.raises(perfect_bvh.StaleSceneError):
        scene.compute_closest_points(np.zeros((1, 3)))
