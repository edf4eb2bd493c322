"""Every builder from Python: right hits on ordinary and on hard meshes; which one the engine takes by itself."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.brute_force import WorldTriangles, judge
from perfect_bvh.build_config import BUILDERS

FIELDS = perfect_bvh.hits.DEFAULT_FIELDS


def placed(mesh: meshes.Mesh, builder: str) -> perfect_bvh.Scene:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh, build=perfect_bvh.BuildConfig(builder=builder)))
    scene.commit()
    return scene


def one_mesh() -> meshes.Mesh:
    """A sphere among random triangles, over a floor that is far larger than they are."""
    parts = [meshes.soup(1500, 3), meshes.sphere(24, 32, 0.7), meshes.slivers(300, 4), meshes.grid(1, 200.0)]
    first = np.cumsum([0] + [len(positions) for positions, _ in parts[:-1]])
    positions = np.concatenate([positions for positions, _ in parts]).astype(np.float32)
    return positions, np.concatenate([part[1] + start for part, start in zip(parts, first, strict=True)])


@pytest.mark.parametrize("builder", BUILDERS)
def test_hits_equal_the_oracles_and_the_other_builders(builder):
    mesh, rays = one_mesh(), meshes.random_rays(1000, 8)
    scene, other = placed(mesh, builder), placed(mesh, "auto")
    hits, expected = scene.cast_rays(*rays), other.cast_rays(*rays)
    triangles = WorldTriangles.of([(0, *mesh, np.eye(4), 0xFFFFFFFF)])
    verdict = judge(triangles, *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any(), str(verdict)
    assert verdict.hit.sum() > 400
    for name in FIELDS:
        assert np.array_equal(getattr(hits, name), getattr(expected, name)), name
    assert np.array_equal(scene.test_occlusions(*rays), hits.is_hit)
    assert scene.statistics().meshes[0].builder == ("binned" if builder == "auto" else builder)


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("scale", [1e-6, 1e8])
def test_small_and_large_meshes(builder, scale):
    positions, triangles = meshes.sphere(40, 60)
    scene = placed((positions * scale, triangles), builder)
    rays = meshes.random_rays(500, 2)
    hits = scene.cast_rays(rays[0] * scale, rays[1])
    expected = placed((positions, triangles), builder).cast_rays(*rays)
    # Rays close to an edge or to the outline may go either way: the scaled corners are rounded differently.
    assert np.mean(hits.primitive_ids == expected.primitive_ids) > 0.99
    assert expected.is_hit.any()


@pytest.mark.parametrize("builder", BUILDERS)
def test_equal_triangles(builder):
    positions, triangles = meshes.sphere(2, 3)
    scene = placed((positions, np.repeat(triangles[:1], 20_000, axis=0)), builder)
    centre = positions[triangles[0]].mean(axis=0)
    hits = scene.cast_rays([2.0 * centre], [-centre])
    assert hits.primitive_ids[0] == 0
    assert scene.statistics().meshes[0].reference_count >= 20_000


@pytest.mark.parametrize(
    ("usage", "build", "expected"),
    [
        ("static", "auto", "binned"),
        ("deforming", "auto", "binned"),
        ("changing", "auto", "fast"),
        ("changing", perfect_bvh.BuildConfig(builder="binned"), "binned"),
        ("static", perfect_bvh.BuildConfig(builder="fast"), "fast"),
    ],
)
def test_usage_decides_where_the_choice_is_left_to_the_engine(usage, build, expected):
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.sphere(12, 16)
    mesh = scene.add_mesh(positions, triangles, usage=usage, build=build)
    flat = scene.add_instance(mesh, np.diag([1.0, 1.0, 0.0, 1.0]))  # traced as a copy with a separate tree
    reports = [scene.commit().meshes[0]]
    scene.replace_mesh(mesh, *meshes.sphere(14, 20))
    reports.append(scene.commit().meshes[0])
    scene.update_mesh(mesh, meshes.sphere(14, 20, 1.1)[0])
    reports.append(scene.commit().meshes[0])
    assert [report.action for report in reports] == ["built", "rebuilt", "refitted"]
    assert [report.builder for report in reports] == [expected] * 3
    is_for_speed = expected == "fast" and build == "auto"
    assert ["fast builder" in report.reason for report in reports] == [is_for_speed, is_for_speed, False]
    assert scene.statistics().meshes[0].builder == expected
    assert scene.cast_rays([(0.1, 0.2, 2.0)], [(0.0, 0.0, -1.0)]).instance_ids[0] == flat
