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


# What users have reported of trimesh's intersectors: their inputs, and the right answers.


def test_points_in_voxels_are_inside() -> None:
    cells = np.random.default_rng(0).random((9, 9, 9)) < 0.4
    blocks = [trimesh.creation.box(bounds=[place, place + 1]) for place in np.argwhere(cells)]
    voxels = with_rays(trimesh.util.concatenate(blocks))
    points = np.random.default_rng(1).uniform(0.0, 9.0, (5000, 3))
    points = np.concatenate([points, np.argwhere(cells) + 0.5])
    assert (voxels.ray.contains_points(points) == cells[tuple(points.astype(int).T)]).all()


def test_rays_at_the_edges_of_a_cube_hit_it() -> None:
    cube = with_rays(trimesh.creation.box())
    shares = np.linspace(0.0, 1.0, 101)[:, None, None]
    one, other = np.moveaxis(cube.vertices[cube.edges_unique], 1, 0)
    aims = ((1.0 - shares) * one + shares * other).reshape(-1, 3)
    origins = 3.0 * aims
    assert cube.ray.intersects_any(origins, -aims).all() and (cube.ray.intersects_first(origins, -aims) >= 0).all()
    assert (np.bincount(cube.ray.intersects_location(origins, -aims)[1]) == 2).all()


def test_rays_that_begin_next_to_a_face_meet_it_if_it_is_ahead() -> None:
    torus = with_rays(trimesh.creation.torus(1.0, 0.3))
    points, faces = trimesh.sample.sample_surface(torus, 3000, seed=1)
    normals = torus.face_normals[faces]
    for off, is_ahead in ((-1e-6, True), (1e-6, False)):
        triangles, rays = torus.ray.intersects_id(points + off * normals, normals)
        assert len(set(rays[triangles == faces[rays]])) == (len(points) if is_ahead else 0)


def test_each_triangle_that_rays_aim_at_is_found() -> None:
    sphere = with_rays(trimesh.creation.icosphere(subdivisions=4))
    aims = sphere.triangles_center
    triangles, rays = sphere.ray.intersects_id(3.0 * aims, -aims, multiple_hits=False)
    assert (triangles == np.arange(len(aims))).all() and (rays == triangles).all()


@pytest.mark.parametrize("width", [256, 257])
def test_a_panorama_from_inside_has_a_hit_for_each_ray(width: int) -> None:
    turns, rises = np.meshgrid(np.linspace(-np.pi, np.pi, width), np.linspace(-np.pi / 2, np.pi / 2, width // 2))
    directions = np.stack([np.cos(rises) * np.cos(turns), np.cos(rises) * np.sin(turns), np.sin(rises)], -1)
    directions = directions.reshape(-1, 3)
    for room in (trimesh.creation.box(extents=[4.0, 6.0, 3.0]), trimesh.creation.icosphere()):
        rays = with_rays(room).ray.intersects_location(0.0 * directions, directions, multiple_hits=False)[1]
        assert (rays == np.arange(len(directions))).all()


def test_all_methods_agree_on_rays_through_vertices_and_edges() -> None:
    small, big = (trimesh.creation.box(extents=[size] * 3).subdivide_to_size(20) for size in (40.0, 60.0))
    origins, everyone = np.zeros_like(big.vertices), np.arange(len(big.vertices))
    rays = with_rays(small).ray
    assert rays.intersects_any(origins, big.vertices).all()
    for is_all in (False, True):
        assert (rays.intersects_id(origins, big.vertices, multiple_hits=is_all)[1] == everyone).all()


def test_a_vertex_and_an_edge_are_hit_once() -> None:
    sphere = with_rays(trimesh.creation.icosphere(subdivisions=2))
    for aims in (sphere.vertices, sphere.vertices[sphere.edges_unique].mean(axis=1), sphere.triangles_center):
        for rays in (
            sphere.ray.intersects_id(3.0 * aims, -aims)[1],
            sphere.ray.intersects_location(3.0 * aims, -aims)[1],
        ):
            assert (np.bincount(rays) == 2).all()  # on the way in and out


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
