"""Exactness far from zero and at extreme sizes: no ray lost, and no error larger than at home."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh._tuning import Traced

RAYS = 3000


def rays_at_sphere(seed):
    """Rays from outside a unit sphere at points well inside it: every one of them hits it."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(RAYS, 3))
    origins *= random.uniform(1.5, 6.0, (RAYS, 1)) / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = random.normal(size=(RAYS, 3))
    targets *= random.uniform(0.0, 0.9, (RAYS, 1)) / np.linalg.norm(targets, axis=1, keepdims=True)
    return origins, targets - origins


def error_of(hits, positions, triangles, origins, directions, centre):
    """Largest distance of an answered position from where the ray meets the answered triangle, reckoned at zero."""
    corners = positions[triangles[hits.primitive_ids]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    t = np.einsum("rk,rk->r", normals, corners[:, 0] - origins) / np.einsum("rk,rk->r", normals, directions)
    return np.linalg.norm(hits.positions - centre - (origins + t[:, None] * directions), axis=1).max()


def cast(positions, triangles, transform, origins, directions):
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles), transform)
    scene.commit()
    return scene.cast_rays(origins, directions, fields=("t_hit", "instance_ids", "primitive_ids", "positions"))


@pytest.mark.parametrize("where", ["mesh", "transform", "both"])
@pytest.mark.parametrize("offset", [1e3, 1e6, 1e9])
def test_a_sphere_far_from_zero_is_as_exact_as_at_zero(offset, where):
    positions, triangles = meshes.sphere(40, 60)
    origins, directions = rays_at_sphere(1)
    home = cast(positions, triangles, np.eye(4), origins, directions)
    centre = offset * np.array([1.0, -0.75, 0.5])
    share = {"mesh": 1.0, "transform": 0.0, "both": 0.5}[where]
    transform = np.eye(4)
    transform[:3, 3] = centre * (1.0 - share)
    far = cast(positions + centre * share, triangles, transform, origins + centre, directions)
    assert home.is_hit.all() and far.is_hit.all(), f"{RAYS - int(far.is_hit.sum())} of {RAYS} missed"
    near_error = error_of(home, positions, triangles, origins, directions, 0.0)
    far_error = error_of(far, positions, triangles, origins, directions, centre)
    unit = np.spacing(offset)  # float64's own precision there, in vertices, origins and answers
    assert far_error <= near_error + 8.0 * unit
    assert near_error < 1e-5


@pytest.mark.parametrize("isa", perfect_bvh.available_isas())
@pytest.mark.parametrize("strategy", ["stream", "packets"])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_t_beyond_float32_is_no_hit(side, strategy, isa):
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh([(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)], [(0, 1, 2)]))
    scene.commit()
    perfect_bvh.set_active_isa(isa)
    try:
        for length, is_met in ((1e-37, True), (1e-39, False)):
            rays = np.full((200, 3), (0.0, 0.0, 1.0)), np.full((200, 3), (0.0, 0.0, side * length))
            hits = Traced(scene, strategy).cast_rays(*rays, t_min=-np.inf)
            assert (hits.is_hit == is_met).all()
            assert np.array_equal(hits.t_hit, np.full(200, np.float32(-side / length if is_met else np.inf)))
            assert (Traced(scene, strategy).test_occlusions(*rays, t_min=-np.inf) == is_met).all()
            assert (scene.count_intersections(*rays, t_min=-np.inf) == is_met).all()
    finally:
        perfect_bvh.set_active_isa(None)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6, 1e8])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("where", ["mesh", "transform"])
def test_a_sphere_of_any_size_loses_no_ray(scale, dtype, where):
    positions, triangles = meshes.sphere(40, 60)
    origins, directions = ((rays * scale).astype(dtype) for rays in rays_at_sphere(2))
    if where == "mesh":
        hits = cast((positions * scale).astype(dtype), triangles, np.eye(4), origins, directions)
    else:
        transform = np.diag([scale, scale, scale, 1.0])
        hits = cast(positions.astype(dtype), triangles, transform, origins, directions)
    assert hits.is_hit.all(), f"{RAYS - int(hits.is_hit.sum())} of {RAYS} missed"
    radii = np.linalg.norm(hits.positions, axis=1) / scale
    assert radii.min() > 0.99 and radii.max() < 1.0 + 1e-6


def test_extents_of_1e11():
    """A sphere as wide, with small ones inside: nothing is lost and nothing is seen that is not there."""
    positions, triangles = meshes.sphere(40, 60)
    scene = perfect_bvh.Scene()
    hall = scene.add_instance(scene.add_mesh(positions * 1e11, triangles))
    small = scene.add_mesh(positions, triangles)
    places = meshes.scattered(20, 3e10, 3)
    centres = places[:, :3, 3]
    ids = scene.add_instances(np.full(20, small), places)
    scene.commit()
    origins, directions = rays_at_sphere(4)
    outside = scene.cast_rays(origins * 1e11, directions)
    assert (outside.instance_ids == hall).all()
    which = np.arange(RAYS) % 20
    inside = scene.cast_rays(origins + centres[which], directions, fields=("instance_ids", "t_hit", "positions"))
    assert (inside.instance_ids == ids[which]).all(), f"{int((inside.instance_ids != ids[which]).sum())} missed"
    radii = np.linalg.norm(inside.positions - centres[which], axis=1)
    assert radii.min() > 0.99 and radii.max() < 1.0 + 1e-4
    away = scene.cast_rays(origins + centres[which], origins)  # away from the small one, to the hall
    assert (away.instance_ids == hall).all()
