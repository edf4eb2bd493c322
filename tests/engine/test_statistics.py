"""`statistics()`: figures that can be counted by hand, and relations that hold for any scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh import BuildConfig, SceneStatistics
from perfect_bvh._tuning import CostedBuild
from perfect_bvh.build_config import BUILDERS

SINGLE = BuildConfig(builder="binned", max_leaf_size=1)

# Two triangles of area 2 in one plane; a quarter of each lies in the other's box.
CROSSING = (
    np.array([(0, 0, 0), (2, 0, 0), (0, 2, 0), (3, 2, 0), (1, 2, 0), (3, 0, 0)], np.float32),
    np.array([(0, 1, 2), (3, 4, 5)], np.int32),
)


def scene_of(mesh: meshes.Mesh, build: BuildConfig, usage: str = "static") -> perfect_bvh.Scene:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh, build=build, usage=usage))
    scene.commit()
    return scene


def half_area(corners: np.ndarray) -> float:
    x, y, z = corners.reshape(-1, 3).max(axis=0) - corners.reshape(-1, 3).min(axis=0)
    return float(x * y + y * z + z * x)


def test_two_triangles_by_hand():
    tree = scene_of(CROSSING, SINGLE).statistics(detailed=True).meshes[0]
    assert (tree.node_count, tree.leaf_count, tree.depth, tree.max_leaf_size) == (3, 2, 1, 1)
    assert (tree.reference_count, tree.duplication, tree.is_refittable) == (2, 1.0, True)
    assert tree.sah == pytest.approx(1.0 + (4.0 + 4.0) / 6.0)
    assert tree.sibling_overlap == pytest.approx(2.0 / 6.0)
    assert tree.epo == pytest.approx((0.5 + 0.5) / 4.0)
    assert (tree.primitive_count, tree.vertex_count, tree.user_count) == (2, 6, 1)
    assert tree.geometry_byte_count == 6 * 12 + 2 * 12


def test_the_heuristics_cost_of_separate_triangles():
    positions, triangles = meshes.soup(2, 1, 0.1)
    positions[3:] += 5.0
    tree = scene_of((positions.astype(np.float32), triangles), SINGLE).statistics().meshes[0]
    corners = positions[triangles]
    expected = 1.0 + (half_area(corners[0]) + half_area(corners[1])) / half_area(corners)
    assert tree.sah == pytest.approx(expected, rel=1e-5)


def test_half_of_the_lines_meet_both_halves():
    # Two flat squares side by side, one leaf each: lines through the whole meet one of them, or both on their border.
    positions, triangles = meshes.grid(1)
    pair = np.concatenate([positions, positions + (2.0, 0.0, 0.0)])
    config = CostedBuild(builder="binned", max_leaf_size=2, traversal_cost=0.5)
    statistics = scene_of((pair, np.concatenate([triangles, triangles + 4])), config).statistics(detailed=True)
    assert statistics.meshes[0].leaf_count == 2
    assert statistics.meshes[0].leaf_count_variability == pytest.approx(0.0, abs=1e-6)
    assert statistics.meshes[0].epo == pytest.approx(0.0, abs=1e-12)


def test_details_only_where_asked_for():
    scene = scene_of(meshes.soup(300, 1), BuildConfig())
    short, long = scene.statistics(), scene.statistics(detailed=True)
    for tree in (*short.meshes, short.top_level):
        assert tree.epo is None
        assert tree.leaf_count_variability is None
    assert long.meshes[0].epo > 0.0
    assert long.meshes[0].leaf_count_variability > 0.0
    assert long.top_level.epo is None
    assert long.top_level.leaf_count_variability == 0.0  # one instance
    rows = [replace(tree, epo=None, leaf_count_variability=None) for tree in long.meshes]
    assert rows == list(short.meshes)


@pytest.mark.parametrize("builder", BUILDERS[1:])
def test_the_same_figures_whatever_the_usage(builder):
    config = BuildConfig(builder=builder, optimize=2, duplication_budget=1.0)
    static, deforming = (
        scene_of(meshes.slivers(400, 1), config, usage).statistics(detailed=True).meshes[0]
        for usage in ("static", "deforming")
    )
    names = ("builder", "is_refittable", "node_count", "leaf_count", "reference_count", "depth", "sah", "epo")
    for name in (*names, "leaf_count_variability", "sibling_overlap", "max_leaf_size", "geometry_byte_count"):
        assert getattr(static, name) == getattr(deforming, name), name
    assert static.is_refittable == (builder != "spatial")
    assert (static.duplication > 1.0) == (builder == "spatial")


def test_a_refitted_trees_figures_are_todays():
    positions, triangles = meshes.sphere(24, 32)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    scene.update_mesh(mesh, positions * 1.01)
    assert scene.commit().meshes[0].action == "refitted"
    before = scene.statistics(detailed=True).meshes[0]
    scene.update_mesh(mesh, positions * (1.0, 1.0, 3.0) + 0.02 * np.sin(40.0 * positions[:, [1, 2, 0]]))
    assert scene.commit().meshes[0].action == "refitted"
    after = scene.statistics(detailed=True).meshes[0]
    assert after.sah != before.sah
    assert after.epo is after.leaf_count_variability is None  # the statistics describe binary trees
    assert (after.node_count, after.depth) == (before.node_count, before.depth)
    assert after.node_count == after.wide_node_count + after.wide_leaf_count


def check_totals(statistics: SceneStatistics) -> None:
    for tree in (*statistics.meshes, statistics.top_level):
        trees = tree.wide_byte_count + tree.plan_byte_count
        assert tree.byte_count == tree.geometry_byte_count + trees + tree.motion_byte_count
    assert statistics.byte_count == statistics.top_level.byte_count + sum(tree.byte_count for tree in statistics.meshes)
    assert statistics.triangle_count == sum(tree.primitive_count for tree in statistics.meshes)
    users = sum(tree.primitive_count * tree.user_count for tree in statistics.meshes)
    assert statistics.instanced_triangle_count == users


def test_what_moves_within_the_shutter_is_counted():
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.sphere(24, 32)
    still, moving = (scene.add_mesh(positions, triangles) for _ in range(2))
    instances = scene.add_instances([still, moving, moving], np.tile(np.eye(4), (3, 1, 1)))
    scene.commit()
    statistics = scene.statistics()
    check_totals(statistics)
    assert [tree.motion_byte_count for tree in (*statistics.meshes, statistics.top_level)] == [0, 0, 0]
    scene.set_mesh_motion(moving, np.stack([positions, 1.1 * positions, 1.2 * positions]))
    scene.commit()
    statistics = scene.statistics()
    check_totals(statistics)
    first, second = statistics.meshes
    later = second.motion_byte_count
    assert first.motion_byte_count == 0
    assert later == 2 * (positions.size * 4 + second.wide_byte_count)
    assert statistics.top_level.motion_byte_count > 0
    scene.set_instance_motion(instances[:1], np.stack([np.eye(4), np.diag([1.1, 1.1, 1.1, 1.0])])[:, None])
    scene.commit()
    turning = scene.statistics()
    check_totals(turning)
    assert turning.top_level.motion_byte_count > statistics.top_level.motion_byte_count
    assert turning.meshes[1].motion_byte_count == later


def test_a_scene_of_several_meshes_adds_up():
    scene = perfect_bvh.Scene()
    first = scene.add_mesh(*meshes.sphere(8, 12))
    second = scene.add_mesh(*meshes.grid(10), build=BuildConfig(builder="sweep"))
    unused = scene.add_mesh(*meshes.soup(50, 2), usage="changing")
    places = np.tile(np.eye(4), (7, 1, 1))
    places[:, 0, 3] = 3.0 * np.arange(7)
    scene.add_instances([first] * 5 + [second] * 2, places)
    report = scene.commit()
    statistics = scene.statistics(detailed=True)
    check_totals(statistics)
    assert statistics.byte_count == report.byte_count
    assert [tree.mesh_id for tree in statistics.meshes] == [first, second, unused]
    assert [tree.user_count for tree in statistics.meshes] == [5, 2, 0]
    assert [tree.builder for tree in statistics.meshes] == ["binned", "sweep", "fast"]
    top = statistics.top_level
    assert (top.mesh_id, top.primitive_count, top.reference_count, top.max_leaf_size) == (-1, 7, 7, 1)
    assert top.leaf_count_variability > 0.0


def test_nothing_has_no_figures():
    scene = perfect_bvh.Scene()
    scene.add_mesh(np.empty((0, 3)), np.empty((0, 3), np.int32))
    scene.commit()
    statistics = scene.statistics(detailed=True)
    check_totals(statistics)
    tree = statistics.meshes[0]
    assert (tree.node_count, tree.sah, tree.epo, tree.leaf_count_variability, tree.duplication) == (0, 0, 0, 0, 1)


@pytest.mark.usefixtures("one_thread")
def test_long_measurements_report_progress_and_can_be_cancelled():
    scene = scene_of(meshes.sphere(160, 200), BuildConfig(builder="binned"))
    heard: list[float] = []
    scene.statistics(detailed=True, progress=heard.append)
    assert heard == sorted(heard)
    assert heard
    assert 0.0 <= heard[0] <= heard[-1] <= 1.0
    with pytest.raises(perfect_bvh.Cancelled):
        scene.statistics(detailed=True, progress=lambda share: False)
    assert scene.statistics().meshes[0].node_count > 0


def test_edits_that_wait_are_not_measured():
    scene = scene_of(CROSSING, SINGLE)
    scene.add_mesh(*CROSSING)
    with pytest.raises(perfect_bvh.StaleSceneError):
        scene.statistics()


def test_a_commit_tells_the_time_of_its_stages():
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.sphere(60, 80)
    deforming = scene.add_mesh(positions, triangles, build=BuildConfig(optimize=3), usage="deforming")
    scene.add_instances([deforming] * 4, np.tile(np.eye(4), (4, 1, 1)))
    built = scene.commit()
    assert all(built.mesh_stages[name] > 0.0 for name in ("build", "optimize", "collapse"))
    assert built.mesh_stages["refit"] == 0.0
    assert sum(built.mesh_stages.values()) <= sum(mesh.milliseconds for mesh in built.meshes)
    assert built.top_level.stages["placing"] > 0.0
    assert sum(built.top_level.stages.values()) <= built.top_level_milliseconds
    assert built.mesh_milliseconds + built.top_level_milliseconds == pytest.approx(built.milliseconds)
    scene.update_mesh(deforming, positions * 1.01)
    refitted = scene.commit()
    assert refitted.mesh_stages["refit"] > 0.0
    assert refitted.mesh_stages["build"] == 0.0
    kept = scene.commit()
    assert (sum(kept.mesh_stages.values()), sum(kept.top_level.stages.values())) == (0.0, 0.0)
