"""Every ray's answer against the double-precision oracle."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import Verdict, WorldTriangles, judge

SHEAR = np.array([[1.0, 0.7, 0.0, 0.3], [0.0, 0.4, 0.2, -0.2], [0.1, 0.0, 1.9, 0.1], [0.0, 0.0, 0.0, 1.0]])
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
SQUASH = np.diag([1.0, 1e-3, 1.0, 1.0])


def as_float32(mesh: meshes.Mesh) -> meshes.Mesh:
    return mesh[0].astype(np.float32), mesh[1]


def judge_scene(parts, origins, directions, **limits) -> Verdict:
    """Builds a scene of (mesh, transform, mask) parts, casts the rays, and judges closest and any hits."""
    scene = perfect_bvh.Scene()
    instances = []
    for mesh, transform, mask in parts:
        ident = scene.add_instance(scene.add_mesh(*mesh), transform, mask)
        instances.append((ident, *mesh, transform, mask))
    scene.commit()
    hits = scene.cast_rays(origins, directions, **limits)
    verdict = judge(
        WorldTriangles.of(instances),
        origins,
        directions,
        hits.t_hit,
        hits.instance_ids,
        hits.primitive_ids,
        **limits,
    )
    occluded = scene.test_occlusions(origins, directions, **limits)
    assert np.array_equal(occluded, hits.is_hit)
    return verdict


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", [meshes.soup, meshes.slivers])
def test_random_triangles(make, seed):
    mesh = as_float32(make(800, seed))
    verdict = judge_scene([(mesh, np.eye(4), 1)], *meshes.random_rays(3000, seed + 100))
    assert not verdict.wrong.any(), str(verdict)
    assert verdict.hit.sum() > 100


@pytest.mark.parametrize("seed", range(2))
def test_instances(seed):
    mesh, other = as_float32(meshes.soup(200, seed)), as_float32(meshes.sphere(12, 16, 0.6))
    parts = [(mesh, SHEAR, 1), (mesh, MIRROR, 2), (other, SQUASH, 4), (other, np.eye(4), 8)]
    verdict = judge_scene(parts, *meshes.random_rays(3000, seed))
    assert not verdict.wrong.any(), str(verdict)


def test_ranges_and_masks():
    mesh, other = as_float32(meshes.soup(300, 5)), as_float32(meshes.sphere(12, 16, 0.6))
    origins, directions = meshes.random_rays(3000, 6)
    random = np.random.default_rng(7)
    t_min = random.uniform(0.0, 0.5, 3000).astype(np.float32)
    t_max = (t_min + random.uniform(0.0, 2.0, 3000)).astype(np.float32)
    mask = random.integers(0, 4, 3000, dtype=np.uint32)
    verdict = judge_scene(
        [(mesh, SHEAR, 1), (other, np.eye(4), 2)], origins, directions, t_min=t_min, t_max=t_max, mask=mask
    )
    assert not verdict.wrong.any(), str(verdict)


def test_axis_parallel_rays():
    """Directions with zeros of either sign, from points on the planes of boxes and of triangles."""
    mesh = as_float32(meshes.grid(8))
    line = np.linspace(-1.0, 1.0, 33, dtype=np.float32)
    x, y = np.meshgrid(line, line)
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, 2.0, np.float32)], axis=1)
    for zero in (0.0, -0.0):
        directions = np.broadcast_to(np.array([zero, -zero, -1.0], np.float32), origins.shape)
        verdict = judge_scene([(mesh, np.eye(4), 1)], origins, directions)
        assert not verdict.wrong.any()
        assert verdict.hit.all()


def test_rays_that_start_on_a_surface():
    """T = 0 counts when t_min is 0, in both directions of the ray."""
    mesh = as_float32(meshes.grid(4))
    origins = np.zeros((50, 3), np.float32)
    origins[:, :2] = np.random.default_rng(1).uniform(-0.9, 0.9, (50, 2))
    directions = np.random.default_rng(2).normal(size=(50, 3)).astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh))
    scene.commit()
    hits = scene.cast_rays(origins, directions)
    assert hits.is_hit.all()
    assert np.array_equal(hits.t_hit, np.zeros(50, np.float32))
    assert not scene.test_occlusions(origins, directions, t_min=1e-6).any()


@pytest.mark.parametrize("scale", [1e-20, 1e-12, 1e-6, 1e-3, 1e3, 1e8, 1e15])
def test_scales(scale):
    mesh = meshes.soup(300, 11)
    scaled = ((mesh[0] * scale).astype(np.float32), mesh[1])
    origins, directions = meshes.random_rays(1500, 12)
    verdict = judge_scene([(scaled, np.eye(4), 1)], (origins * scale).astype(np.float32), directions)
    assert not verdict.wrong.any(), str(verdict)
    assert verdict.hit.sum() > 100


@pytest.mark.parametrize("length", [1e-30, 1e-10, 1e10, 1e30])
def test_direction_lengths(length):
    """T scales with the direction's length; nothing else changes."""
    mesh = as_float32(meshes.sphere(24, 32))
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh))
    scene.commit()
    origins, directions = meshes.random_rays(1000, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    usual = scene.cast_rays(origins.astype(np.float64), directions.astype(np.float64))
    scaled = scene.cast_rays(origins.astype(np.float64), directions.astype(np.float64) * length)
    assert np.array_equal(usual.primitive_ids, scaled.primitive_ids)
    hit = usual.is_hit
    np.testing.assert_allclose(scaled.t_hit[hit].astype(np.float64) * length, usual.t_hit[hit], rtol=1e-6)


def test_far_from_the_origin():
    """Given in float64, a sphere a million units away is answered as exactly as at zero."""
    positions, triangles = meshes.sphere(40, 60)
    origins, directions = meshes.random_rays(3000, 4)
    answers = []
    for offset in (0.0, 1e6, 1e9):
        scene = perfect_bvh.Scene()
        scene.add_instance(scene.add_mesh(positions + offset, triangles))
        scene.commit()
        answers.append(scene.cast_rays(origins.astype(np.float64) + offset, directions))
    for far, tolerance in zip(answers[1:], (2e-9, 2e-6), strict=True):  # float64's own precision at 1e6, 1e9
        assert (far.is_hit == answers[0].is_hit).mean() > 1 - 1e-3
        both = far.is_hit & answers[0].is_hit
        length = np.linalg.norm(directions, axis=1)[both]
        difference = np.abs(far.t_hit[both] - answers[0].t_hit[both]) * length
        assert np.quantile(difference, 0.99) < 4e-7 + tolerance


def test_tiny_triangles_far_away_are_ambiguous():
    """Smaller than a double's precision at that distance: they may not be called surely hit."""
    random = np.random.default_rng(9)
    corners = random.normal(size=(20, 3, 3)) * 1e-12
    world = WorldTriangles.of([(0, corners.reshape(-1, 3), np.arange(60).reshape(-1, 3), np.eye(4), 1)])
    origins = random.uniform(-1.0, 1.0, (200, 3))
    verdict = judge(world, origins, -origins, np.full(200, np.inf), np.full(200, -1), np.full(200, -1))
    assert verdict.ambiguous.all()
    assert not verdict.wrong.any()


def one_square() -> tuple[perfect_bvh.Scene, WorldTriangles]:
    """Two triangles over [-1, 1]^2 at z = 0, and one far behind them."""
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [-9, -9, -5], [9, -9, -5], [0, 9, -5]])
    triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6]]
    scene = perfect_bvh.Scene()
    ident = scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    return scene, WorldTriangles.of([(ident, positions, triangles, np.eye(4), 1)])


@pytest.mark.parametrize(
    ("t_hit", "instance_shift", "primitive_id", "is_wrong"),
    [
        (3.0, 0, 0, False),
        (3.0 + 1e-4, 0, 0, True),
        (3.0 - 1e-4, 0, 0, True),
        (3.0, 0, 1, True),
        (8.0, 0, 2, True),
        (3.0, 0, 7, True),
        (3.0, 1, 0, True),
    ],
    ids=["right", "behind", "before", "its neighbour", "what is hidden", "no such triangle", "no such instance"],
)
def test_wrong_hits_are_called_wrong(t_hit, instance_shift, primitive_id, is_wrong):
    scene, world = one_square()
    rays = [[0.5, -0.5, 3.0]], [[0.0, 0.0, -1.0]]
    hits = scene.cast_rays(*rays)
    verdict = judge(world, *rays, [t_hit], hits.instance_ids + instance_shift, [primitive_id])
    assert verdict.wrong.tolist() == [is_wrong]
    assert not verdict.ambiguous.any()
    assert judge(world, *rays, [np.inf], [-1], [-1]).wrong.all()


def test_on_an_edge_either_neighbour_is_right_and_nothing_else():
    """Which one is ambiguous, not whether: another triangle, distance or a miss stay wrong, or are ambiguous."""
    _, world = one_square()
    rays = [[0.5, 0.5, 3.0]], [[0.0, 0.0, -1.0]]
    for primitive_id in (0, 1):
        verdict = judge(world, *rays, [3.0], [world.instance_ids[0]], [primitive_id])
        assert verdict.ambiguous.all() and not verdict.wrong.any()
        assert judge(world, *rays, [3.1], [world.instance_ids[0]], [primitive_id]).wrong.all()
    assert judge(world, *rays, [8.1], [world.instance_ids[0]], [2]).wrong.all()
    assert judge(world, *rays, [np.inf], [-1], [-1]).wrong.all()  # the one behind is hit for sure
