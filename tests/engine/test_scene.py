"""Editing, committing and asking a scene: the contract, call by call."""

from __future__ import annotations

import inspect
import threading

import numpy as np
import perfect_bvh
import pytest
from engine.long_work import large_mesh, rays_through_it, stack
from oracles import meshes

TRIANGLE = (np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32), np.array([(0, 1, 2)], np.int32))
DOWN = ([(0.2, 0.3, 1.0)], [(0.0, 0.0, -1.0)])


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


@pytest.fixture
def scene():
    return perfect_bvh.Scene()


@pytest.fixture
def placed(scene):
    mesh = scene.add_mesh(*TRIANGLE)
    instance = scene.add_instance(mesh)
    scene.commit()
    return scene, mesh, instance


def test_every_field(placed):
    scene, mesh, instance = placed
    fields = tuple(perfect_bvh.hits.FIELD_TYPES)
    hits = scene.cast_rays(*DOWN, fields=fields)
    assert hits.t_hit[0] == 1.0 and hits.t_hit.dtype == np.float32
    assert (hits.instance_ids[0], hits.mesh_ids[0], hits.primitive_ids[0]) == (instance, mesh, 0)
    np.testing.assert_allclose(hits.primitive_uvs[0], (0.2, 0.3), atol=1e-7)
    assert np.array_equal(hits.geometric_normals[0], (0.0, 0.0, 1.0))
    np.testing.assert_allclose(hits.positions[0], (0.2, 0.3, 0.0), atol=1e-7)
    assert hits.distances[0] == 1.0 and hits.front_face[0]
    assert hits.nodes_visited[0] >= 1 and hits.primitives_tested[0] == 1
    assert hits.invalid_count == 0


def test_a_miss_in_every_field(placed):
    scene = placed[0]
    hits = scene.cast_rays([(5.0, 5.0, 1.0)], [(0.0, 0.0, -1.0)], fields=tuple(perfect_bvh.hits.FIELD_TYPES))
    assert np.isinf(hits.t_hit[0]) and np.isinf(hits.distances[0]) and not hits.is_hit[0] and not hits.front_face[0]
    assert (hits.instance_ids[0], hits.mesh_ids[0], hits.primitive_ids[0]) == (-1, -1, -1)
    assert not hits.primitive_uvs.any() and not hits.geometric_normals.any() and not hits.positions.any()


def test_shape_follows_the_rays(placed):
    scene = placed[0]
    hits = scene.cast_rays(np.zeros((4, 5, 3)), (0.0, 0.0, 1.0))
    assert hits.t_hit.shape == (4, 5) and hits.primitive_uvs.shape == (4, 5, 2)
    assert scene.cast_rays((0.2, 0.3, 1.0), (0.0, 0.0, -1.0)).t_hit.shape == ()
    assert scene.cast_rays(np.empty((0, 3)), np.empty((0, 3))).t_hit.shape == (0,)


def test_fields_not_asked_for_say_how_to_get_them(placed):
    hits = placed[0].cast_rays(*DOWN, fields=("t_hit",))
    with pytest.raises(AttributeError, match="fields="):
        _ = hits.positions


def test_out_is_written_in_place(placed):
    t_hit = np.zeros(1, np.float32)
    hits = placed[0].cast_rays(*DOWN, fields=("t_hit",), out={"t_hit": t_hit})
    assert hits.t_hit is t_hit and t_hit[0] == 1.0
    with pytest.raises(ValueError, match="out"):
        placed[0].cast_rays(*DOWN, fields=("t_hit",), out={"t_hit": np.zeros(1, np.float64)})


def test_queries_refuse_while_edits_wait(placed):
    scene, mesh, instance = placed
    edits = [
        lambda: scene.add_mesh(*TRIANGLE),
        lambda: scene.add_instance(mesh),
        lambda: scene.set_transforms([instance], [moved(1)]),
        lambda: scene.set_masks([instance], [1]),
        lambda: scene.update_mesh(mesh, TRIANGLE[0] * 2),
        lambda: scene.replace_mesh(mesh, *TRIANGLE),
        lambda: scene.remove_instances([instance]),
    ]
    for edit in edits:
        edit()
        assert not scene.is_current
        for query in (scene.cast_rays, scene.test_occlusions):
            with pytest.raises(perfect_bvh.StaleSceneError, match="commit"):
                query(*DOWN)
        with pytest.raises(perfect_bvh.StaleSceneError):
            scene.statistics()
        scene.commit()
        assert scene.is_current


def test_a_scene_never_committed_refuses(scene):
    with pytest.raises(perfect_bvh.StaleSceneError, match="commit"):
        scene.cast_rays(*DOWN)


def test_a_scene_asks_before_each_query_that_it_would_answer(placed):
    """Once a query, but not for a refused query or a snapshot's query."""
    scene, _, _ = placed
    scene.commit()
    asked = []
    scene.before_query = lambda: asked.append(1)
    for query in (
        lambda: scene.cast_rays(*DOWN, audit=1.0),
        lambda: scene.test_occlusions(*DOWN),
        lambda: scene.count_intersections(*DOWN),
        lambda: scene.list_intersections(*DOWN),
        lambda: scene.compute_closest_points(DOWN[0]),
        scene.statistics,
        scene.snapshot,
        lambda: scene.is_current,
    ):
        asked.clear()
        query()
        assert len(asked) == 1
    snapshot = scene.snapshot()
    asked.clear()
    snapshot.cast_rays(*DOWN)
    assert asked == []
    scene.before_query = lambda: scene.mark_stale("the source has changed")
    assert not scene.is_current
    asked.clear()
    scene.before_query = lambda: asked.append(1)
    with pytest.raises(perfect_bvh.StaleSceneError, match="the source has changed"):
        scene.cast_rays(*DOWN)
    assert asked == []


def test_mark_stale_until_the_next_commit(placed):
    scene = placed[0]
    scene.mark_stale("the source changed; call update()")
    with pytest.raises(perfect_bvh.StaleSceneError, match="call update"):
        scene.cast_rays(*DOWN)
    scene.commit()
    assert scene.cast_rays(*DOWN).is_hit.all()


def test_a_commit_without_edits_keeps_everything(placed):
    scene = placed[0]
    before = scene.snapshot().generation
    scene.mark_stale("in doubt")
    report = scene.commit()
    assert (report.meshes, report.kept_count, report.generation) == ((), 1, before)
    assert scene.cast_rays(*DOWN).is_hit.all()


def test_actions_and_reasons(placed):
    scene, mesh, instance = placed
    scene.update_mesh(mesh, TRIANGLE[0] + 1)
    report = scene.commit()
    assert [(row.mesh_id, row.action) for row in report.meshes] == [(mesh, "refitted")]
    scene.replace_mesh(mesh, *TRIANGLE)
    assert scene.commit().meshes[0].action == "rebuilt"
    scene.set_transforms([instance], [moved(3)])
    report = scene.commit()
    assert report.meshes == () and report.kept_count == 1


def test_no_binary_tree_is_kept_for_refits(scene):
    sphere = meshes.sphere(20, 30)
    rows = {usage: scene.add_mesh(*sphere, usage=usage) for usage in ("static", "deforming")}
    report = {row.mesh_id: row for row in scene.commit().meshes}
    static, deforming = report[rows["static"]], report[rows["deforming"]]
    assert static.byte_count == deforming.byte_count
    for mesh in rows.values():
        scene.update_mesh(mesh, sphere[0] * 1.1)
    report = scene.commit()
    (plan,) = {tree.plan_byte_count for tree in scene.statistics().meshes}
    assert 0 < plan < 9 * static.triangle_count
    assert [(row.action, row.byte_count) for row in report.meshes] == [("refitted", static.byte_count + plan)] * 2


def test_a_tree_with_spatial_splits_is_not_refitted(scene):
    positions, triangles = meshes.slivers(200, 1)
    mesh = scene.add_mesh(positions, triangles, build=perfect_bvh.BuildConfig(builder="spatial"), usage="deforming")
    scene.commit()
    scene.update_mesh(mesh, positions * 1.1)
    row = scene.commit().meshes[0]
    assert row.action == "rebuilt" and "spatial splits" in row.reason


def test_the_stages_of_a_mesh_are_timed(scene):
    positions, triangles = meshes.sphere(60, 90)
    config = perfect_bvh.BuildConfig(optimize=1)
    mesh = scene.add_mesh(positions, triangles, build=config, usage="deforming")
    built = scene.commit().meshes[0]
    assert min(built.build_milliseconds, built.optimize_milliseconds, built.collapse_milliseconds) > 0
    assert built.refit_milliseconds == 0
    scene.update_mesh(mesh, positions * 1.1)
    refitted = scene.commit().meshes[0]
    assert refitted.action == "refitted" and refitted.refit_milliseconds > 0
    assert refitted.build_milliseconds == refitted.optimize_milliseconds == refitted.collapse_milliseconds == 0
    for row in (built, refitted):
        stages = (
            row.build_milliseconds + row.optimize_milliseconds + row.refit_milliseconds + row.restructure_milliseconds
        )
        assert row.milliseconds >= stages + row.collapse_milliseconds


def test_update_before_the_first_commit(scene):
    mesh = scene.add_mesh(*TRIANGLE)
    scene.add_instance(mesh)
    scene.update_mesh(mesh, TRIANGLE[0] + (0, 0, 0.5))
    assert scene.commit().meshes[0].action == "built"
    assert scene.cast_rays(*DOWN).t_hit[0] == 0.5


def test_refit_equals_a_fresh_build():
    positions, triangles = meshes.sphere(20, 30)
    scene, fresh = perfect_bvh.Scene(), perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    bent = positions + 0.2 * np.sin(3.0 * positions[:, [1, 2, 0]])
    scene.update_mesh(mesh, bent)
    assert scene.commit().meshes[0].action in {"refitted", "rotated", "partly_rebuilt"}
    fresh.add_instance(fresh.add_mesh(bent, triangles))
    fresh.commit()
    rays = meshes.random_rays(5000, 1)
    first, second = scene.cast_rays(*rays), fresh.cast_rays(*rays)
    for name in perfect_bvh.hits.DEFAULT_FIELDS:
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


def test_a_scattered_mesh_is_rebuilt_not_refitted():
    positions, triangles = meshes.sphere(20, 30)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    scene.update_mesh(mesh, np.random.default_rng(0).uniform(-1, 1, positions.shape))
    row = scene.commit().meshes[0]
    assert row.action == "rebuilt" and "refit" in row.reason


def test_a_tree_built_without_extent_recovers():
    positions, triangles = meshes.sphere(20, 30)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(np.zeros_like(positions), triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    scene.update_mesh(mesh, positions)
    assert scene.commit().meshes[0].action == "rebuilt"
    assert scene.cast_rays([(0, 0, 0)], [(0, 0.1, 1)]).is_hit.all()


def test_snapshots_outlive_edits(placed):
    scene, mesh, instance = placed
    before = scene.snapshot()
    scene.update_mesh(mesh, TRIANGLE[0] + (0, 0, 0.5))
    scene.commit()
    after = scene.snapshot()
    scene.remove_instances([instance])
    scene.remove_mesh(mesh)
    scene.commit()
    assert (before.cast_rays(*DOWN).t_hit[0], after.cast_rays(*DOWN).t_hit[0]) == (1.0, 0.5)
    assert not scene.cast_rays(*DOWN).is_hit.any()
    assert (before.generation, after.generation, scene.snapshot().generation) == (1, 2, 3)


def test_snapshots_are_traced_while_the_scene_is_edited():
    positions, triangles = meshes.sphere(40, 60)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles)
    scene.add_instance(mesh)
    scene.commit()
    snapshot = scene.snapshot()
    rays = meshes.random_rays(20_000, 1)
    expected = snapshot.cast_rays(*rays).t_hit
    failures: list[str] = []

    def trace() -> None:
        for _ in range(5):
            if not np.array_equal(snapshot.cast_rays(*rays).t_hit, expected):
                failures.append("a snapshot changed")

    workers = [threading.Thread(target=trace) for _ in range(3)]
    for worker in workers:
        worker.start()
    for step in range(10):
        scene.update_mesh(mesh, positions * (1.0 + 0.05 * step))
        scene.commit()
    for worker in workers:
        worker.join()
    assert not failures


def test_ids_are_never_reused(scene):
    mesh = scene.add_mesh(*TRIANGLE)
    first = scene.add_instances([mesh] * 3, np.broadcast_to(np.eye(4), (3, 4, 4)))
    scene.remove_instances(first)
    second = scene.add_instances([mesh] * 2, np.broadcast_to(np.eye(4), (2, 4, 4)))
    assert second.min() > first.max()
    scene.remove_instances(second)
    scene.remove_mesh(mesh)
    assert scene.add_mesh(*TRIANGLE) > mesh


def test_ties_go_to_the_smaller_order(scene):
    mesh = scene.add_mesh(*TRIANGLE)
    first, second = scene.add_instances([mesh, mesh], np.broadcast_to(np.eye(4), (2, 4, 4)), orders=[9, 4])
    scene.commit()
    assert first < second
    assert scene.cast_rays(*DOWN).instance_ids[0] == second


def test_coincident_triangles_answer_the_smallest(scene):
    positions, triangles = meshes.soup(50, 3)
    scene.add_instance(scene.add_mesh(positions, np.concatenate([triangles, triangles])))
    scene.commit()
    hits = scene.cast_rays(*meshes.random_rays(2000, 1))
    assert hits.is_hit.any() and hits.primitive_ids.max() < 50


@pytest.mark.parametrize("transform", [np.eye(4), np.diag([-1.0, 1.0, 1.0, 1.0])])
def test_culling_follows_the_world_winding(scene, transform):
    """A mirrored instance shows its other side: its corners run the other way round in the world."""
    scene.add_instance(scene.add_mesh(*TRIANGLE), transform)
    scene.commit()
    x = 0.2 * transform[0, 0]
    above, below = ([(x, 0.3, 1.0)], [(0.0, 0.0, -1.0)]), ([(x, 0.3, -1.0)], [(0.0, 0.0, 1.0)])
    faces_up = bool(transform[0, 0] > 0)
    for rays, is_front in ((above, faces_up), (below, not faces_up)):
        hits = scene.cast_rays(*rays, fields=("front_face", "geometric_normals", "instance_ids"))
        assert hits.is_hit[0] and hits.front_face[0] == is_front
        assert hits.geometric_normals[0, 2] == (1.0 if faces_up else -1.0)
        assert scene.test_occlusions(*rays, cull="back")[0] == is_front


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_flattened_instance_is_still_seen(scene, axis):
    positions, triangles = meshes.sphere(16, 24)
    scale = np.ones(4)
    scale[axis] = 0.0
    mesh = scene.add_mesh(positions, triangles)
    instance = scene.add_instance(mesh, moved(3, 2, 1) @ np.diag(scale))
    report = scene.commit()
    assert report.baked_count == 1
    direction = np.zeros(3)
    direction[axis] = -1.0
    target = np.array([3.0, 2.0, 1.0]) + np.roll([0.0, 0.3, 0.2], axis)
    hits = scene.cast_rays([target - 2.0 * direction], [direction])
    assert (hits.instance_ids[0], hits.mesh_ids[0]) == (instance, mesh) and abs(hits.t_hit[0] - 2.0) < 1e-6
    scene.set_transforms([instance], [moved(3, 2, 1)])
    assert scene.commit().baked_count == 0


def test_statistics(placed):
    scene, mesh, _ = placed
    scene.add_instance(mesh, moved(4))
    scene.add_mesh(*meshes.sphere(10, 12))
    scene.commit()
    statistics = scene.statistics()
    assert statistics.instance_count == 2 and statistics.instanced_triangle_count == 2
    assert [row.user_count for row in statistics.meshes] == [2, 0]
    assert statistics.meshes[1].primitive_count == 2 * 12 * 9
    assert statistics.meshes[1].sah > 1.0 and statistics.byte_count > 0


def test_empty_scenes_and_empty_meshes(scene):
    scene.commit()
    assert not scene.cast_rays(*DOWN).is_hit.any()
    scene.add_instance(scene.add_mesh(np.empty((0, 3)), np.empty((0, 3), np.int32)))
    scene.commit()
    assert not scene.cast_rays(*DOWN).is_hit.any()


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads_do_not_change_answers(threads):
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.soup(2000, 1)))
    scene.commit()
    rays = meshes.random_rays(30_000, 2)
    alone, several = scene.cast_rays(*rays, threads=1), scene.cast_rays(*rays, threads=threads)
    for name in perfect_bvh.hits.DEFAULT_FIELDS:
        assert np.array_equal(getattr(alone, name), getattr(several, name)), name


def test_progress_and_cancel():
    scene, rays = stack(), rays_through_it()
    seen: list[float] = []

    def progress(fraction: float) -> bool:
        seen.append(fraction)
        return len(seen) < 3

    with pytest.raises(perfect_bvh.Cancelled):
        scene.cast_rays(**rays, progress=progress)
    assert len(seen) == 3 and seen == sorted(seen) and seen[-1] < 1.0
    with pytest.raises(ZeroDivisionError):
        scene.cast_rays(**rays, progress=lambda fraction: 1 / 0)
    assert scene.cast_rays(*DOWN, progress=lambda fraction: True).t_hit.shape == (1,)


@pytest.mark.usefixtures("one_thread")
def test_a_cancelled_commit_changes_nothing():
    positions, triangles = large_mesh()
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*TRIANGLE)
    scene.add_instance(mesh)
    scene.commit()
    snapshot = scene.snapshot()
    scene.replace_mesh(mesh, positions, triangles)
    with pytest.raises(perfect_bvh.Cancelled):
        scene.commit(progress=lambda fraction: False)
    assert snapshot.cast_rays(*DOWN).t_hit[0] == 1.0
    with pytest.raises(perfect_bvh.StaleSceneError):
        scene.cast_rays(*DOWN)
    scene.commit()
    assert scene.statistics().triangle_count == len(triangles)


@pytest.mark.usefixtures("one_thread")
@pytest.mark.parametrize("use", [lambda scene: scene.mesh_count, lambda scene: scene.remove_mesh(0)])
def test_a_commit_refuses_its_own_progress_callable(use):
    """A commit within it would wait for itself for ever."""
    scene = perfect_bvh.Scene()
    scene.add_mesh(*large_mesh())
    with pytest.raises(perfect_bvh.EngineError, match="a commit of this scene is under way"):
        scene.commit(progress=lambda fraction: use(scene))
    assert scene.mesh_count == 1
    scene.commit()


def test_the_number_of_threads_is_checked():
    before = perfect_bvh.thread_count()
    for count in (-1, 1025):
        with pytest.raises(ValueError, match=f"set_thread_count: count must be an integer from 0 .* got {count}"):
            perfect_bvh.set_thread_count(count)
    assert perfect_bvh.thread_count() == before


def test_queries_take_all_but_the_rays_by_keyword_and_in_one_order() -> None:
    order = ["t_min", "t_max", "max_distance", "mask", "cull", "times", "time", "fields", "max_hits", "out"]
    order += ["audit", "threads", "progress"]
    queries = {"cast_rays": 2, "test_occlusions": 2, "count_intersections": 2, "list_intersections": 2, "walk_ray": 2}
    for name, rays in (queries | {"compute_closest_points": 1}).items():
        _, *parameters = inspect.signature(getattr(perfect_bvh.Scene, name)).parameters.values()
        by_keyword = [one.name for one in parameters if one.kind is one.KEYWORD_ONLY]
        assert len(parameters) - len(by_keyword) == rays, name
        assert by_keyword == [one for one in order if one in by_keyword], name
    with pytest.raises(TypeError, match="positional"):
        perfect_bvh.Scene().cast_rays(*DOWN, 0.0)
