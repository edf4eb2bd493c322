"""The intersector for trimesh: its contract, and errors of trimesh's own two intersectors."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from perfect_bvh.trimesh import RayMeshIntersector


def with_rays(mesh: Any) -> Any:
    mesh.ray = RayMeshIntersector(mesh)
    return mesh


def down_at(places: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Rays from above to places in the plane z = 0."""
    flat = np.asarray(places, np.float64)
    origins = np.column_stack([flat, np.full(len(flat), 10.0)])
    return origins, np.tile([0.0, 0.0, -1.0], (len(flat), 1))


def test_rays_through_vertices_and_edges_meet_the_surface_once() -> None:
    sphere = with_rays(trimesh.creation.icosphere(subdivisions=3))
    aims = np.concatenate([sphere.vertices, sphere.vertices[sphere.edges_unique].mean(axis=1)])
    origins = np.zeros_like(aims)
    assert sphere.ray.intersects_any(origins, aims).all()
    places, rays, triangles = sphere.ray.intersects_location(origins, aims)
    assert (rays == np.arange(len(aims))).all()
    np.testing.assert_allclose(places, aims, atol=2e-7)
    assert (sphere.ray.intersects_first(origins, aims) == triangles).all()


def test_all_of_the_surfaces_on_a_ray_are_found_however_close_they_are() -> None:
    gaps = np.cumsum([0.0, 1e-3, 1e-5, 1e-6, 0.5, 1e-6])
    sheets = [trimesh.Trimesh([[0, 0, z], [4, 0, z], [0, 4, z]], [[0, 1, 2]], process=False) for z in gaps]
    stack = with_rays(trimesh.util.concatenate(sheets))
    places, rays, triangles = stack.ray.intersects_location(*down_at([[1.0, 1.0], [9.0, 9.0]]))
    assert triangles.tolist() == [5, 4, 3, 2, 1, 0] and rays.tolist() == [0] * 6
    np.testing.assert_allclose(places[:, 2], gaps[::-1], atol=1e-7)
    triangles, rays = stack.ray.intersects_id(*down_at([[1.0, 1.0], [2.0, 1.0]]), max_hits=2)
    assert triangles.tolist() == [5, 4, 5, 4] and rays.tolist() == [0, 0, 1, 1]
    triangles, rays = stack.ray.intersects_id(*down_at([[1.0, 1.0], [9.0, 9.0]]), multiple_hits=False)
    assert triangles.tolist() == [5] and rays.tolist() == [0]


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e8])
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_points_are_inside_or_outside_whatever_the_size(scale: float, shift: float) -> None:
    hollow = trimesh.creation.box(extents=[2.0, 2.0, 2.0])
    cavity = trimesh.creation.icosphere(radius=0.5)
    cavity.invert()
    both = trimesh.util.concatenate([hollow, cavity])
    both.apply_scale(scale)
    both.apply_translation([shift * scale] * 3)
    random = np.random.default_rng(5)
    points = random.uniform(-1.5, 1.5, (2000, 3))
    away, beside = np.linalg.norm(points, axis=1), np.abs(points).max(axis=1)
    is_clear = (np.abs(away - 0.5) > 0.02) & (np.abs(beside - 1.0) > 1e-3)
    inside = with_rays(both).ray.contains_points(points * scale + shift * scale)
    assert (inside == ((beside < 1.0) & (away > 0.5)))[is_clear].all()


def test_boxes_that_touch_hold_what_either_holds() -> None:
    boxes = [trimesh.creation.box(bounds=[[x, 0, 0], [x + 1, 1, 1]]) for x in range(3)]
    row = with_rays(trimesh.util.concatenate(boxes))
    points = np.random.default_rng(6).uniform([0.0, 0.0, 0.0], [3.0, 1.0, 1.0], (500, 3))
    assert row.ray.contains_points(points).all()


def test_a_mesh_that_changes_is_read_again() -> None:
    box = with_rays(trimesh.creation.box())
    origins, directions = down_at([[5.0, 0.0]])
    assert not box.ray.intersects_any(origins, directions).any()
    box.apply_translation([5.0, 0.0, 0.0])
    assert box.ray.intersects_any(origins, directions).all()
    for twin in (copy.copy(box.ray), copy.deepcopy(box.ray), pickle.loads(pickle.dumps(box.ray))):
        assert twin.intersects_any(origins, directions).all()


def test_rays_that_begin_on_the_bounds_meet_them() -> None:
    box = with_rays(trimesh.creation.box(extents=[0.1, 0.3, 0.7]))
    origins, directions = np.diag(0.5 * box.extents), -np.eye(3)
    _, rays = box.ray.intersects_id(origins, directions)
    assert rays.tolist() == [0, 0, 1, 1, 2, 2]


def test_odd_input_is_missed_or_refused() -> None:
    nothing = with_rays(trimesh.Trimesh())
    box = with_rays(trimesh.creation.box())
    origins, directions = down_at([[0.1, 0.2]])
    assert nothing.ray.intersects_first(origins, directions).tolist() == [-1]
    assert nothing.ray.intersects_location(origins, directions)[0].shape == (0, 3)
    assert box.ray.intersects_first(np.empty((0, 3)), np.empty((0, 3))).shape == (0,)
    assert box.ray.intersects_any(origins * np.nan, directions).tolist() == [False]
    assert box.ray.intersects_any(origins, 0.0 * directions).tolist() == [False]
    for method in (box.ray.intersects_id, box.ray.intersects_first, box.ray.intersects_any):
        with pytest.raises(ValueError, match=r"must both have shape \(n, 3\), got \(1, 3\) and \(2, 3\)"):
            method(origins, np.ones((2, 3)))
    line = with_rays(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False))
    assert line.ray.intersects_first(*down_at([[0.5, 0.0]])).tolist() == [-1]
