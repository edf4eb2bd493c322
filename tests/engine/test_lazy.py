"""Trees that are built when the first ray reaches them, as scripts see them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import perfect_bvh
import pytest
from engine.long_work import large_mesh
from oracles import meshes

SEPARATE = 10.0  # between meshes, along x


def tower(lazy: bool, builder: str = "binned") -> perfect_bvh.Scene:
    """Four meshes of half the distance's size in a row, turned and squeezed."""
    scene = perfect_bvh.Scene()
    random = np.random.default_rng(3)
    for place in range(4):
        positions, triangles = meshes.soup(300, place)
        build = perfect_bvh.BuildConfig(builder=builder)
        mesh = scene.add_mesh(positions.astype(np.float32), triangles, build=build, lazy=lazy)
        transform = np.eye(4)
        transform[:3, :3] += 0.3 * random.normal(size=(3, 3))
        transform[0, 3] = SEPARATE * place
        scene.add_instance(mesh, transform)
    scene.commit()
    return scene


def built(scene: perfect_bvh.Scene | perfect_bvh.Snapshot) -> list[bool]:
    return [mesh.is_built for mesh in scene.statistics().meshes]


def rays_at(place: int, count: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    origins, directions = meshes.random_rays(count, place)
    return origins + [SEPARATE * place, 0.0, 0.0], directions


def rays_down_at(place: int) -> tuple[np.ndarray, np.ndarray]:
    """That come near no other mesh."""
    flat = np.random.default_rng(5).uniform(-0.5, 0.5, size=(500, 2))
    return np.c_[flat + [SEPARATE * place, 0.0], np.full(500, 9.0)], np.tile([0.0, 0.0, -1.0], (500, 1))


@pytest.mark.parametrize("builder", ["binned", "spatial", "fast"])
@pytest.mark.parametrize("threads", [1, 2])
def test_every_query_answers_as_in_a_built_scene(builder, threads):
    rays = rays_at(1)
    fields = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions")

    def answers(scene, query):
        if query == "cast_rays":
            hits = scene.cast_rays(*rays, fields=fields, threads=threads)
            return [getattr(hits, name) for name in fields]
        if query == "list_intersections":
            hits, splits = scene.list_intersections(*rays, threads=threads)
            return [hits.t_hit, hits.instance_ids, hits.primitive_ids, splits]
        if query == "compute_closest_points":
            found = scene.compute_closest_points(rays[0], threads=threads)
            return [found.points, found.distances, found.instance_ids, found.primitive_ids]
        return [getattr(scene, query)(*rays, threads=threads)]

    eager = tower(False, builder)
    names = ("cast_rays", "test_occlusions", "count_intersections", "list_intersections", "compute_closest_points")
    for name in names:
        expected = answers(eager, name)
        for lazy, should in zip(answers(tower(True, builder), name), expected, strict=True):
            assert lazy.tobytes() == should.tobytes(), name
    assert answers(eager, "test_occlusions")[0].sum() > 100


@pytest.mark.parametrize("mode", ["clay", "preview", "depth"])
def test_images_are_those_of_a_built_scene(mode):
    matrix = np.eye(4)
    matrix[:3, 3] = 5.0, 0.0, 14.0
    camera = perfect_bvh.Camera(matrix)
    lazy, eager = (
        perfect_bvh.render(tower(lazy), camera, mode=mode, size=(96, 64), samples=2) for lazy in (True, False)
    )
    assert np.array_equal(lazy, eager) and np.ptp(eager) > 0


def test_reports_and_statistics_tell_what_is_built():
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.soup(300, 1)
    seen, unseen = (scene.add_mesh(positions, triangles, lazy=True) for _ in range(2))
    scene.add_instance(seen)
    scene.add_instance(unseen, [[1, 0, 0, SEPARATE], [0, 1, 0, 0], [0, 0, 1, 0]])
    report = scene.commit()
    assert report.count("deferred") == 2 and report.count("built") == 0
    assert all("when a ray reaches it" in mesh.reason and mesh.builder == "binned" for mesh in report.meshes)
    before = scene.statistics(detailed=True)
    assert built(scene) == [False, False] and before.meshes[0].wide_byte_count == before.meshes[0].node_count == 0
    assert before.meshes[0].epo is None and before.triangle_count == 600
    scene.cast_rays(*rays_down_at(0))
    after = scene.statistics()
    assert built(scene) == [True, False] and after.meshes[0].wide_byte_count > 0 and after.meshes[0].sah > 0
    assert after.byte_count - before.byte_count == after.meshes[0].byte_count - before.meshes[0].byte_count
    scene.set_masks([0], 1)
    assert scene.commit().kept_count == 2 and built(scene) == [True, False]


def test_by_default_nothing_waits():
    scene = perfect_bvh.Scene()
    scene.add_mesh(*meshes.soup(30, 1))
    assert scene.commit().count("built") == 1 and built(scene) == [True]


def test_edits_before_a_ray_came():
    scene = tower(True)
    positions, triangles = meshes.soup(300, 9)
    scene.update_mesh(0, positions)
    scene.replace_mesh(1, positions, triangles[:100])
    scene.remove_instances([3])
    scene.remove_mesh(3)
    report = scene.commit()
    assert [(mesh.mesh_id, mesh.action) for mesh in report.meshes] == [(0, "deferred"), (1, "deferred")]
    assert "positions changed" in report.meshes[0].reason and "replaced" in report.meshes[1].reason
    assert scene.cast_rays(*rays_down_at(0)).is_hit.any() and built(scene) == [True, False, False]
    scene.update_mesh(0, positions * 1.01)
    scene.update_mesh(2, positions)
    assert [mesh.action for mesh in scene.commit().meshes] == ["refitted", "deferred"]


def test_a_snapshot_is_traced_by_many_threads_while_the_scene_moves_on():
    scene, eager = tower(True), tower(False)
    snapshot = scene.snapshot()
    rays = [rays_at(place % 4, 500) for place in range(16)]

    def trace(pair):
        return snapshot.cast_rays(*pair).t_hit

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(trace, rays[:8]))
        for step in range(4):
            scene.set_transforms([0], np.eye(4)[None] * [1, 1, 1 + step, 1])
            scene.commit()
        answers += list(pool.map(trace, rays[8:]))
    for pair, answer in zip(rays, answers, strict=True):
        assert np.array_equal(answer, eager.cast_rays(*pair).t_hit)


@pytest.mark.usefixtures("one_thread")
def test_a_query_that_is_stopped_leaves_the_tree_to_the_next():
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*large_mesh(), lazy=True))
    scene.commit()
    ray = [[0.01, 0.02, -3.0]], [[0.0, 0.0, 1.0]]
    with pytest.raises(perfect_bvh.Cancelled):
        scene.cast_rays(*ray, progress=lambda _: False)
    assert built(scene) == [False]

    class StopError(Exception):
        pass

    def fail(_: float) -> bool:
        raise StopError

    with pytest.raises(StopError):
        scene.count_intersections(*ray, progress=fail)
    assert built(scene) == [False]
    assert scene.cast_rays(*ray).is_hit.all() and built(scene) == [True]
