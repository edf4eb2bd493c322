"""The compact layout: every answer is that of the default one, bit for bit, in at most 36 bytes a triangle."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge
from perfect_bvh import BuildConfig
from perfect_bvh.build_config import BUILDERS, LAYOUTS

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


def crowd(layouts: tuple[str, ...], builder: str = "auto", usage: str = "static") -> perfect_bvh.Scene:
    """Meshes of every kind, turned, sheared, flattened and far from zero; the layouts take turns."""
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
    for number, ((positions, triangles), place) in enumerate(parts):
        build = BuildConfig(builder=builder, layout=layouts[number % len(layouts)])
        mesh = scene.add_mesh(positions, triangles, build=build, usage=usage)
        scene.add_instances([mesh, mesh], np.stack([place, place @ np.diag([0.5, 0.5, 0.5, 1.0])]), masks=[1, 2])
    scene.commit()
    return scene


def answers(scene: perfect_bvh.Scene, **how: object) -> dict[str, bytes]:
    found = {}
    sets = {"camera": camera_rays(67, 41), "scattered": meshes.random_rays(1500, 6)}
    for name, (origins, directions) in sets.items():
        hits = scene.cast_rays(origins, directions, **how)
        assert hits.is_hit.any() and not hits.is_hit.all()
        for column in hits.columns:
            found[f"{name} {column}"] = getattr(hits, column).tobytes()
        found[f"{name} occluded"] = scene.test_occlusions(origins, directions, **how).tobytes()
        if how.get("strategy", "auto") != "auto":
            continue
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


@pytest.mark.parametrize("builder", BUILDERS)
def test_every_answer_is_the_default_layouts(isa, builder):
    usual = answers(crowd(("default",), builder))
    assert_same(answers(crowd(("compact",), builder)), usual)
    assert_same(answers(crowd(("compact", "default"), builder)), usual)


@pytest.mark.parametrize("how", [{"strategy": name} for name in ("packets", "stream", "single")])
@pytest.mark.parametrize("cull", ["none", "back"])
def test_however_rays_are_traced(isa, how, cull):
    usual, compact = (crowd((layout,)) for layout in LAYOUTS)
    assert_same(answers(compact, cull=cull, **how), answers(usual, cull=cull, **how))


@pytest.mark.parametrize("usage", ["deforming", "changing"])
def test_edited_meshes(usage):
    scenes = [crowd((layout,), usage=usage) for layout in LAYOUTS]
    for edit in range(3):
        for scene in scenes:
            report_of = {row.mesh_id: row for row in scene.statistics().meshes}
            mesh = sorted(report_of)[2]
            if edit < 2:
                positions = meshes.sphere(19, 23, 0.6)[0] * (1.0 + 0.05 * (edit + 1))
                positions[:, 0] += 0.1 * np.sin(9.0 * positions[:, 1])
                scene.update_mesh(mesh, positions)
            else:
                scene.replace_mesh(mesh, *meshes.sphere(15, 31, 0.65))
            report = scene.commit()
            assert [row.layout for row in report.meshes] == [report_of[mesh].layout]
            if usage == "deforming" and edit < 2:
                assert report.meshes[0].action in ("refitted", "rotated")  # the governor's choice; never built again
        assert_same(answers(scenes[1]), answers(scenes[0]))


def test_hits_equal_the_oracles(isa):
    positions, triangles = meshes.soup(1200, 3)
    positions = positions.astype(np.float32)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles, build=BuildConfig(layout="compact")))
    scene.commit()
    for rays in (meshes.random_rays(800, 8), camera_rays(40, 20)):
        origins, directions = (np.broadcast_to(part, (len(rays[1]), 3)) for part in rays)
        hits = scene.cast_rays(origins, directions)
        world = WorldTriangles.of([(0, positions, triangles, np.eye(4), 0xFFFFFFFF)])
        verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
        assert not verdict.wrong.any(), str(verdict)
        assert verdict.hit.any()


@pytest.mark.parametrize("count", range(1, 18))
def test_meshes_of_few_triangles(isa, count):
    """A tree that is one leaf, two leaves, one node; the last vertex is the last thing in its array."""
    found = []
    for layout in LAYOUTS:
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(*meshes.soup(count, count, 0.8), build=BuildConfig(layout=layout))
        scene.add_instance(mesh)
        scene.commit()
        rays = camera_rays(40, 30)
        found.append([getattr(scene.cast_rays(*rays), name).tobytes() for name in ("t_hit", "primitive_ids")])
        found[-1].append(scene.compute_closest_points(meshes.random_rays(50, 1)[0]).distances.tobytes())
        assert scene.cast_rays(*rays).is_hit.any()
    assert found[0] == found[1]


@pytest.mark.parametrize("size", [(120, 160), (20, 1500)])
@pytest.mark.parametrize("builder", [name for name in BUILDERS if name != "spatial"])
@pytest.mark.parametrize("usage", ["static", "changing"])
def test_bytes_a_triangle_of_a_closed_mesh(size, builder, usage):
    """Positions and indices included, ready to trace."""
    rows = {}
    for layout in LAYOUTS:
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(*meshes.sphere(*size), build=BuildConfig(builder=builder, layout=layout), usage=usage)
        scene.add_instance(mesh)
        report = scene.commit()
        rows[layout] = scene.statistics().meshes[0]
        assert rows[layout].layout == report.meshes[0].layout == layout
        assert rows[layout].byte_count == report.meshes[0].byte_count
        assert rows[layout].binary_byte_count == 0
    assert rows["compact"].byte_count <= 36 * rows["compact"].primitive_count
    assert rows["compact"].byte_count < 0.75 * rows["default"].byte_count
    assert rows["compact"].wide_leaf_count <= rows["default"].wide_leaf_count
