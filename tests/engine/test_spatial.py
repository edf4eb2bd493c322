"""Trees with spatial splits, seen from Python: the same hits as any other tree, and correct reports."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge

SPATIAL = perfect_bvh.BuildConfig(builder="spatial", duplication_budget=2.0)
FIELDS = (*perfect_bvh.hits.DEFAULT_FIELDS, "positions", "distances", "front_face")


def as_float32(mesh: meshes.Mesh) -> meshes.Mesh:
    return mesh[0].astype(np.float32), mesh[1]


def joined(*parts: meshes.Mesh) -> meshes.Mesh:
    """One mesh of several."""
    firsts = np.cumsum([0, *(len(positions) for positions, _ in parts)])
    triangles = [rows + first for (_, rows), first in zip(parts, firsts, strict=False)]
    return np.concatenate([positions for positions, _ in parts]), np.concatenate(triangles).astype(np.int32)


def hall() -> meshes.Mesh:
    """A floor and walls of large flat triangles, round columns, and beams across: large next to small."""
    floor = meshes.grid(3, 2.0)
    wall = floor[0][:, [2, 0, 1]] + (2.0, 0.0, 0.0), floor[1]
    columns = [meshes.sphere(8, 12, 0.3, (x, y, 0.3)) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 1.0)]
    return joined(floor, wall, *columns, meshes.slivers(150, 3))


MESHES = {
    "soup": meshes.soup(600, 1),
    "slivers": meshes.slivers(600, 2),
    "grid": meshes.grid(16),
    "sphere": meshes.sphere(24, 32),
    "hall": hall(),
}


def scene_of(mesh: meshes.Mesh, build, transform=None) -> perfect_bvh.Scene:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh, build=build), np.eye(4) if transform is None else transform)
    scene.commit()
    return scene


def rays_for(mesh: meshes.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Rays at random, along the axes, and exactly at vertices and edge points."""
    random = np.random.default_rng(7)
    origins, directions = meshes.random_rays(3000, 8)
    axes = np.eye(3, dtype=np.float32)[random.integers(0, 3, 1000)] * random.choice([-1, 1], (1000, 1))
    along = (mesh[0][random.integers(0, len(mesh[0]), 1000)] - 3.0 * axes).astype(np.float32)
    corners = mesh[0][mesh[1][random.integers(0, len(mesh[1]), 3000)]]
    share = random.choice([0.0, 0.5, 1.0, 0.3], (3000, 1))
    targets = corners[:, 0] * share + corners[:, 1] * (1.0 - share)
    starts = random.uniform(-2.5, 2.5, (3000, 3)).astype(np.float32)
    return (
        np.concatenate([origins, along, starts]),
        np.concatenate([directions, axes.astype(np.float32), (targets - starts).astype(np.float32)]),
    )


@pytest.mark.parametrize("name", MESHES)
def test_every_field_of_every_hit_is_as_without_splits(name):
    mesh = as_float32(MESHES[name])
    turned = np.array([[0.6, -0.8, 0.1, 3.0], [0.8, 0.6, 0.0, -1.0], [0.2, 0.0, 1.5, 0.5], [0.0, 0.0, 0.0, 1.0]])
    for transform in (np.eye(4), turned):
        origins, directions = rays_for(mesh)
        origins = origins @ transform[:3, :3].T + transform[:3, 3]
        directions = directions @ transform[:3, :3].T
        plain = scene_of(mesh, perfect_bvh.BuildConfig(builder="binned"), transform)
        split = scene_of(mesh, SPATIAL, transform)
        first = plain.cast_rays(origins, directions, fields=FIELDS)
        second = split.cast_rays(origins, directions, fields=FIELDS)
        assert first.is_hit.sum() > 500
        for field in FIELDS:
            np.testing.assert_array_equal(getattr(first, field), getattr(second, field), err_msg=field)
        assert np.array_equal(plain.test_occlusions(origins, directions), split.test_occlusions(origins, directions))


@pytest.mark.parametrize("name", MESHES)
def test_against_the_oracle(name):
    mesh = as_float32(MESHES[name])
    origins, directions = rays_for(mesh)
    oblique = (directions != 0).all(axis=1)  # the oracle has no t for rays in a triangle's own plane
    origins, directions = origins[oblique][::2], directions[oblique][::2]
    hits = scene_of(mesh, SPATIAL).cast_rays(origins, directions)
    world = WorldTriangles.of([(0, *mesh, np.eye(4), 1)])
    verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any(), str(verdict)


def test_a_closed_sphere_stays_closed():
    sphere = as_float32(meshes.sphere(161, 257))
    scene = scene_of(sphere, SPATIAL)
    random = np.random.default_rng(1)
    corners = sphere[0][sphere[1][random.integers(0, len(sphere[1]), 200_000)]].astype(np.float64)
    share = np.concatenate([np.zeros((100_000, 1)), random.uniform(0.0, 1.0, (100_000, 1))])
    targets = corners[:, 0] * (1.0 - share) + corners[:, 1] * share
    origins = random.uniform(-0.5, 0.5, targets.shape).astype(np.float32)
    assert scene.test_occlusions(origins, targets.astype(np.float32) - origins).all()


def test_new_positions_mean_a_new_tree_and_the_report_says_so():
    positions, triangles = as_float32(meshes.soup(300, 5))
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles, build=SPATIAL, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    moved = (positions + 0.3 * np.sin(3.0 * positions[:, [1, 2, 0]])).astype(np.float32)
    scene.update_mesh(mesh, moved)
    (row,) = scene.commit().meshes
    assert row.action == "rebuilt"
    assert "spatial" in row.reason
    rays = meshes.random_rays(3000, 6)
    first, second = scene.cast_rays(*rays), scene_of((moved, triangles), SPATIAL).cast_rays(*rays)
    assert np.array_equal(first.t_hit, second.t_hit)
    assert np.array_equal(first.primitive_ids, second.primitive_ids)


@pytest.mark.parametrize("budget", [-0.1, 10.5, float("nan")])
def test_the_budget_is_checked(budget):
    with pytest.raises(ValueError, match="duplication_budget"):
        perfect_bvh.BuildConfig(builder="spatial", duplication_budget=budget)
