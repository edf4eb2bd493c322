"""Meshes of every kind in one scene, and the smallest ones: their answers with every builder, and their bytes."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge
from oracles.closest_point import distances_to_triangles
from perfect_bvh import BuildConfig
from perfect_bvh.build_config import BUILDERS

FLAT = np.diag([1.0, 0.0, 1.0, 1.0])
SHEAR = np.array([[1.0, 0.7, 0.0, 0.3], [0.0, 0.4, 0.2, -0.2], [0.1, 0.0, 1.9, 0.1], [0.0, 0.0, 0.0, 1.0]])


@pytest.fixture(params=perfect_bvh.available_isas())
def isa(request):
    perfect_bvh.set_active_isa(request.param)
    yield request.param
    perfect_bvh.set_active_isa(None)


def camera_rays(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    x, z = np.meshgrid(np.linspace(-0.4, 0.4, width), np.linspace(0.3, -0.3, height))
    return np.float32((0.3, -4.0, 0.5)), np.stack([x, np.ones_like(x), z], axis=-1).reshape(-1, 3).astype(np.float32)


def crowd(builder: str) -> perfect_bvh.Scene:
    """Meshes of every kind, turned, sheared, flattened and far from zero."""
    scene = perfect_bvh.Scene()
    far = meshes.sphere(11, 15, 0.4)[0].astype(np.float64) + 1e6
    parts = [
        (meshes.soup(400, 1), SHEAR),
        (meshes.slivers(300, 2), np.eye(4)),
        (meshes.sphere(19, 23, 0.6), np.diag([1.0, -1.0, 1.0, 1.0])),
        (meshes.sphere(9, 13, 0.5), FLAT),
        ((far, meshes.sphere(11, 15)[1]), np.eye(4) + np.outer([-1e6, -1e6, -1e6, 0.0], [0, 0, 0, 1.0])),
        ((meshes.soup(60, 3)[0] * 1e-12, meshes.soup(60, 3)[1]), np.diag([1e12, 1e12, 1e12, 1.0])),
        (meshes.soup(3, 5), np.eye(4)),
    ]
    for (positions, triangles), place in parts:
        mesh = scene.add_mesh(positions, triangles, build=BuildConfig(builder=builder))
        scene.add_instances([mesh, mesh], np.stack([place, place @ np.diag([0.5, 0.5, 0.5, 1.0])]), masks=[1, 2])
    scene.commit()
    return scene


def answers(scene: perfect_bvh.Scene) -> dict[str, bytes]:
    found = {}
    sets = {"camera": camera_rays(67, 41), "scattered": meshes.random_rays(1500, 6)}
    for name, (origins, directions) in sets.items():
        hits = scene.cast_rays(origins, directions)
        assert hits.is_hit.any() and not hits.is_hit.all()
        for column in hits.columns:
            found[f"{name} {column}"] = getattr(hits, column).tobytes()
        found[f"{name} occluded"] = scene.test_occlusions(origins, directions).tobytes()
        listed, splits = scene.list_intersections(origins, directions)
        found[f"{name} splits"] = splits.tobytes()
        for column in listed.columns:
            found[f"{name} listed {column}"] = getattr(listed, column).tobytes()
    points = np.random.default_rng(7).normal(size=(300, 3))
    nearest = scene.compute_closest_points(points)
    for column in ("distances", "points", "instance_ids", "primitive_ids", "primitive_uvs"):
        found[f"nearest {column}"] = getattr(nearest, column).tobytes()
    return found


def assert_same(left: dict[str, bytes], right: dict[str, bytes]) -> None:
    assert left.keys() == right.keys()
    assert [name for name in left if left[name] != right[name]] == []


@pytest.mark.parametrize("builder", BUILDERS[1:])
def test_every_builder_gives_the_same_answers(isa, builder):
    assert_same(answers(crowd(builder)), answers(crowd("auto")))


@pytest.mark.parametrize("count", range(1, 18))
def test_meshes_of_few_triangles(isa, count):
    """A tree that is one leaf, two leaves, one node; the last vertex is the last thing in its array."""
    positions, triangles = meshes.soup(count, count, 0.8)
    positions = positions.astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    origin, directions = camera_rays(40, 30)
    origins = np.broadcast_to(origin, directions.shape)
    hits = scene.cast_rays(origins, directions)
    world = WorldTriangles.of([(0, positions, triangles, np.eye(4), 0xFFFFFFFF)])
    verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert verdict.hit.any() and not verdict.wrong.any(), str(verdict)
    points = meshes.random_rays(50, 1)[0]
    expected = distances_to_triangles(points, positions[triangles]).min(axis=1)
    np.testing.assert_allclose(scene.compute_closest_points(points).distances, expected, rtol=1e-12)


@pytest.mark.parametrize("size", [(120, 160), (20, 1500)])
@pytest.mark.parametrize("builder", [name for name in BUILDERS if name != "spatial"])
@pytest.mark.parametrize("usage", ["static", "changing"])
def test_bytes_a_triangle_of_a_closed_mesh(size, builder, usage):
    """Positions and indices included, ready to trace. Of long slivers the median's leaves are least full."""
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.sphere(*size), build=BuildConfig(builder=builder), usage=usage)
    scene.add_instance(mesh)
    report = scene.commit()
    row = scene.statistics().meshes[0]
    assert row.byte_count == report.meshes[0].byte_count <= (99 if builder == "median" else 71) * row.primitive_count
