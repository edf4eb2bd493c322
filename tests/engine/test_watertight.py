"""No ray passes through an edge or a vertex of a closed mesh."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

RAYS = 300_000


@pytest.fixture(scope="module")
def sphere():
    positions, triangles = meshes.sphere(161, 257)
    assert len(triangles) == 82_240
    return positions.astype(np.float32), triangles


@pytest.fixture(scope="module")
def scene(sphere):
    made = perfect_bvh.Scene()
    made.add_instance(made.add_mesh(*sphere))
    made.commit()
    return made


def inward_rays(targets: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from random points inside the sphere, exactly at the targets up to float's precision."""
    origins = np.random.default_rng(seed).uniform(-0.5, 0.5, targets.shape).astype(np.float32)
    return origins, targets.astype(np.float32) - origins


def test_vertices(scene, sphere):
    targets = sphere[0][np.random.default_rng(1).integers(0, len(sphere[0]), RAYS)]
    assert scene.cast_rays(*inward_rays(targets, 2), fields=("instance_ids",)).is_hit.all()


def test_edges(scene, sphere):
    random = np.random.default_rng(3)
    positions, triangles = sphere
    chosen = triangles[random.integers(0, len(triangles), RAYS)]
    corner = random.integers(0, 3, RAYS)
    first = positions[chosen[np.arange(RAYS), corner]].astype(np.float64)
    second = positions[chosen[np.arange(RAYS), (corner + 1) % 3]].astype(np.float64)
    share = random.uniform(0.0, 1.0, (RAYS, 1))
    assert scene.test_occlusions(*inward_rays(first * share + second * (1.0 - share), 4)).all()


def test_vertices_of_a_sheared_instance(sphere):
    """The transform is applied to the ray, so the mesh stays closed under any matrix."""
    matrix = np.array([[3.0, 0.5, 0.0, 100.0], [0.1, 0.02, 0.3, -7.0], [0.0, 0.4, 1.0, 0.001], [0.0, 0.0, 0.0, 1.0]])
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*sphere), matrix)
    scene.commit()
    targets = sphere[0][np.random.default_rng(5).integers(0, len(sphere[0]), 50_000)].astype(np.float64)
    origins = np.random.default_rng(6).uniform(-0.5, 0.5, targets.shape)
    world = [points @ matrix[:3, :3].T + matrix[:3, 3] for points in (origins, targets)]
    assert scene.test_occlusions(world[0], world[1] - world[0]).all()


@pytest.mark.parametrize("cells", [1, 7])
def test_flat_grid_from_afar(cells):
    """Rays at the vertices and edges of a plane from a distance of 1e4 units."""
    positions, triangles = meshes.grid(cells)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles))
    scene.commit()
    targets = positions.astype(np.float32)
    inner = (np.abs(targets) < 1.0).all(axis=1) if cells > 1 else np.zeros(len(targets), bool)
    targets = np.concatenate([targets[inner], [[0.0, 0.0, 0.0]]]).astype(np.float32)
    for direction in np.random.default_rng(8).normal(size=(200, 3)):
        origins = (targets + direction * 1e4).astype(np.float32)
        assert scene.test_occlusions(origins, targets - origins).all()
