"""`walk_ray()`: step by step the way to the hit that `cast_rays` answers, at the cost that it counts."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from engine.long_work import stack
from oracles import meshes
from perfect_bvh import BuildConfig, RayWalk, WalkEvent
from perfect_bvh.build_config import BUILDERS
from perfect_bvh.calibration import current_calibration
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS

COUNTED = ("t_hit", "instance_ids", "primitive_ids", "nodes_visited", "primitives_tested")
SPATIAL = BuildConfig(builder="spatial", duplication_budget=4.0)
FLAT = np.diag([1.0, 1.0, 0.0, 1.0])
FAR = np.array([1e7, -2e7, 3e7])


@pytest.fixture(params=perfect_bvh.available_isas())
def isa(request):
    perfect_bvh.set_active_isa(request.param)
    yield request.param
    perfect_bvh.set_active_isa(None)


def crowd(build: Any = "auto") -> perfect_bvh.Scene:
    """Overlapping instances of unconnected triangles, slivers, a closed surface and one that is squashed flat."""
    scene, random = perfect_bvh.Scene(), np.random.default_rng(4)
    squashed = meshes.sphere(9, 13, 0.0)
    for number, make in enumerate((meshes.soup(300, 1), meshes.slivers(300, 2), meshes.sphere(9, 13, 0.5), squashed)):
        mesh = scene.add_mesh(make[0].astype(np.float32), make[1], build=build)
        scene.add_instances([mesh] * 6, random.normal(size=(6, 3, 4)) * 0.6, masks=[1 << number] * 6)
        scene.add_instance(mesh, FLAT, 1 << number)
    scene.commit()
    return scene


def check(scene: perfect_bvh.Scene, origins: Any, directions: Any, cull: Any = "none", **limits: Any) -> list[RayWalk]:
    """Each ray's walk is that of `cast_rays`: the same hit, the same counts."""
    hits = scene.cast_rays(origins, directions, cull=cull, fields=COUNTED, **limits)
    walks = []
    for i, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        own = {name: values[i] for name, values in limits.items()}
        walk = scene.walk_ray(origin, direction, cull=cull, **own)
        row = walk.hit_row
        found = (np.inf, -1, -1) if row is None else (walk.t[row], walk.instance_ids[row], walk.primitive_ids[row])
        assert np.float32(found[0]) == hits.t_hit[i]
        assert found[1:] == (hits.instance_ids[i], hits.primitive_ids[i])
        assert (walk.nodes_visited, walk.primitives_tested) == (hits.nodes_visited[i], hits.primitives_tested[i])
        assert walk.cost == walk.nodes_visited + walk.primitives_tested
        walks.append(walk)
    return walks


def count(walk: RayWalk, *events: WalkEvent) -> int:
    return int(np.isin(walk.events, events).sum())


def check_order(walk: RayWalk) -> None:
    """Exactly the boxes that are hit are visited or pruned; a hit is nearer than those before it."""
    event = WalkEvent
    visits = (event.ENTER_NODE, event.ENTER_LEAF, event.ENTER_INSTANCE, event.SKIP_INSTANCE)
    roots = (1 if len(walk) else 0) + count(walk, event.ENTER_INSTANCE)
    assert count(walk, event.BOX_HIT) + roots == count(walk, *visits, event.WAITING_PRUNED)
    assert (np.diff(walk.nearest_t[np.isfinite(walk.nearest_t)]) <= 0.0).all()
    assert (walk.t[walk.events == event.BOX_PRUNED] >= walk.nearest_t[walk.events == event.BOX_PRUNED]).all()
    hits = walk.events == event.TRIANGLE_HIT
    assert np.array_equal(walk.t[hits], walk.nearest_t[hits])
    assert np.isinf(walk.t[walk.events == event.BOX_MISSED]).all()
    is_triangle = np.isin(walk.events, TRIANGLE_TESTS)
    assert np.array_equal(walk.primitive_ids >= 0, is_triangle)
    assert np.array_equal(np.isfinite(walk.triangles).all(axis=(1, 2)), is_triangle)


@pytest.mark.parametrize("cull", ["none", "back"])
def test_it_ends_where_cast_rays_does(isa: str, cull: str) -> None:
    scene, random = crowd(), np.random.default_rng(5)
    origins, directions = meshes.random_rays(150, 6)
    t_min = random.uniform(0.0, 0.5, 150).astype(np.float32)
    t_max = (t_min + random.uniform(0.0, 6.0, 150)).astype(np.float32)
    walks = check(scene, origins, directions, cull)
    walks += check(scene, origins, directions, cull, t_min=t_min, t_max=t_max, mask=random.integers(0, 16, 150))
    for walk in walks:
        check_order(walk)
    seen = set(np.concatenate([walk.events for walk in walks]).tolist())
    assert seen == {int(event) for event in WalkEvent}


@pytest.mark.parametrize("builder", BUILDERS)
def test_every_builder(builder: Any) -> None:
    budget = {"duplication_budget": 4.0} if builder == "spatial" else {}
    scene = crowd(BuildConfig(builder=builder, **budget))
    for walk in check(scene, *meshes.random_rays(60, 7)):
        check_order(walk)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e17])
def test_any_size_and_degenerate_triangles(size: float) -> None:
    scene = perfect_bvh.Scene()
    for number, (positions, triangles) in enumerate((meshes.sphere(9, 13, 1.0), meshes.soup(100, 3))):
        needles = np.concatenate([triangles, triangles[:, [0, 1, 1]], triangles[:, [2, 2, 2]]])
        mesh = scene.add_mesh(positions.astype(np.float32) * np.float32(size), needles)
        scene.add_instance(mesh, np.diag([1.0, 1.0 + number, 1.0, 1.0]))
    scene.commit()
    origins, directions = meshes.random_rays(100, 9)
    walks = check(scene, origins * size, directions * size)
    assert any(walk.hit_row is not None for walk in walks)


def test_costs_are_the_calibrations_and_shared_out_among_tests() -> None:
    origins, directions = np.array([[0.1, 0.2, -5.0], [9.0, 9.0, 9.0]]), np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    costs = replace(current_calibration(), node_nanoseconds=80.0, leaf_nanoseconds=840.0)
    for walk in check(crowd(), origins, directions):
        spent = walk.nanoseconds(costs)
        reached = count(walk, WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
        visits = 80.0 * (count(walk, WalkEvent.ENTER_NODE) + reached) + 840.0 * count(walk, WalkEvent.ENTER_LEAF)
        assert spent.shape == walk.t.shape and spent.sum() == pytest.approx(visits)
        for row in np.flatnonzero(np.isin(walk.events, (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF))):
            tests = np.isin(walk.events[row + 1 :], BOX_TESTS + TRIANGLE_TESTS)
            end = row + 1 + int(np.argmin(np.append(tests, False)))
            whole = 80.0 if walk.events[row] == WalkEvent.ENTER_NODE else 840.0
            np.testing.assert_allclose(spent[row:end], [0.0] + [whole / (end - row - 1)] * (end - row - 1))
        assert not spent[walk.events == WalkEvent.WAITING_PRUNED].any()
        assert walk.nanoseconds().sum() == pytest.approx(walk.nanoseconds(current_calibration()).sum())


def test_places_are_those_of_the_world() -> None:
    """Of a mesh far away in double, seen through a transform: boxes around triangles, triangles at their places."""
    positions, triangles = meshes.sphere(20, 30, 1.0)
    turn = np.array([[0.0, -2.0, 0.0, 5.0], [1.0, 0.0, 0.3, 0.0], [0.0, 0.0, 1.5, 7.0], [0.0, 0.0, 0.0, 1.0]])
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions + FAR, triangles)
    scene.add_instances([mesh] * 2, [turn, np.eye(4)])
    scene.commit()
    corners = (positions + FAR) @ turn[:3, :3].T + turn[:3, 3]
    middle = corners.mean(axis=0)
    walk = scene.walk_ray(middle + (9.0, 0.1, 0.2), (-1.0, 0.0, 0.0))
    row = walk.hit_row
    assert row is not None and walk.instance_ids[row] == 0 and walk.mesh_ids[row] == mesh
    np.testing.assert_allclose(walk.triangles[row], corners[triangles[walk.primitive_ids[row]]], atol=1e-6)
    place = middle + (9.0 - walk.t[row], 0.1, 0.2)
    boxes, own = walk.world_boxes(), walk.instance_ids == 0
    is_entered = own & np.isin(walk.events, (WalkEvent.ENTER_NODE, WalkEvent.ENTER_LEAF))
    last = np.flatnonzero(is_entered[:row])[-1]
    inside = (boxes[last].min(axis=0) - 1e-6 <= place) & (place <= boxes[last].max(axis=0) + 1e-6)
    assert inside.all()
    root = np.flatnonzero(is_entered)[0]
    assert walk.levels[root] == 0
    np.testing.assert_allclose(walk.bounds[root], [(positions + FAR).min(axis=0), (positions + FAR).max(axis=0)])
    of_top_level = walk.instance_ids < 0
    np.testing.assert_array_equal(walk.transforms[of_top_level], np.eye(4)[None, :3].repeat(of_top_level.sum(), axis=0))


def test_boxes_are_those_that_the_tree_lists() -> None:
    scene = crowd(SPATIAL)
    snapshot = scene.snapshot()
    listed = {mesh: snapshot.tree_boxes(None if mesh < 0 else mesh) for mesh in (-1, 0, 1, 2)}
    keys = {
        (mesh, int(level), *box.ravel().tolist())
        for mesh, boxes in listed.items()
        for level, box in zip(boxes.levels, boxes.boxes, strict=True)
    }
    origin, direction = (vectors[3] for vectors in meshes.random_rays(4, 6))
    walk = snapshot.walk_ray(origin, direction, mask=7)
    baked = snapshot.walk_ray(origin, direction, mask=0).instance_ids  # reached, none is entered
    assert (baked != -1).sum() == count(snapshot.walk_ray(origin, direction, mask=0), WalkEvent.SKIP_INSTANCE)
    is_flat = walk.instance_ids % 7 == 6  # baked: with separate trees
    of_top_level = (walk.instance_ids < 0) | np.isin(walk.events, (WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE))
    checked = 0
    for row in np.flatnonzero(of_top_level | ~is_flat):
        mesh = -1 if of_top_level[row] else int(walk.mesh_ids[row])
        assert (mesh, int(walk.levels[row]), *walk.bounds[row].ravel().tolist()) in keys
        checked += not of_top_level[row]
    assert checked > 10


def test_one_instance_and_nothing() -> None:
    scene = perfect_bvh.Scene()
    assert scene.commit() is not None and len(scene.walk_ray((0, 0, 0), (0, 0, 1))) == 0
    instance = scene.add_instance(scene.add_mesh([(0, 0, 1), (1, 0, 1), (0, 1, 1)], [(0, 1, 2)]))
    scene.commit()
    walk = scene.walk_ray((0.2, 0.2, 0.0), (0, 0, 1))
    expected = [WalkEvent.ENTER_INSTANCE, WalkEvent.ENTER_LEAF, WalkEvent.TRIANGLE_HIT]
    assert walk.events.tolist() == expected and (walk.instance_ids == instance).all()
    assert walk.nearest_t.tolist() == [np.inf, np.inf, 1.0] and walk.cost == 2
    for direction in ((0, 0, 0), (np.nan, 0, 1)):  # the first looks at the instance: cast_rays counts it
        (nothing,) = check(scene, [(0.2, 0.2, 0.0)], [direction])
        assert nothing.hit_row is None and set(nothing.events.tolist()) <= {WalkEvent.SKIP_INSTANCE}
    empty = scene.walk_ray((0, 0, 0), (0, 0, 1), t_min=2.0, t_max=1.0)
    assert len(empty) == empty.cost == 0 and empty.world_boxes().shape == (0, 8, 3)


def test_edits_that_wait_are_refused_and_snapshots_stay() -> None:
    scene = crowd()
    snapshot = scene.snapshot()
    before = snapshot.walk_ray((9.0, 0.0, 0.0), (-1.0, 0.01, 0.0))
    scene.add_instance(0)
    with pytest.raises(perfect_bvh.StaleSceneError):
        scene.walk_ray((9.0, 0.0, 0.0), (-1.0, 0.01, 0.0))
    after = snapshot.walk_ray((9.0, 0.0, 0.0), (-1.0, 0.01, 0.0))
    assert len(before) > 0 and np.array_equal(before.events, after.events)


def test_it_can_be_stopped() -> None:
    flag = perfect_bvh.make_stop_flag()
    flag.set()
    with pytest.raises(perfect_bvh.Cancelled):
        crowd().walk_ray((9.0, 0.0, 0.0), (-1.0, 0.01, 0.0), progress=flag)
    scene = stack(500_000)  # takes a quarter of a second, and is asked for the first time in the middle
    with pytest.raises(perfect_bvh.Cancelled):
        scene.walk_ray((0, 0, 1), (0, 0, -1), progress=lambda _share: False)


def test_wrong_arguments_are_named() -> None:
    scene = crowd()
    with pytest.raises(ValueError, match=r"walk_ray: origin and direction must have shape \(3,\), got rays of shape"):
        scene.walk_ray(np.zeros((2, 3)), (0, 0, 1))
    with pytest.raises(ValueError, match="walk_ray: cull must be"):
        scene.walk_ray((0, 0, 0), (0, 0, 1), cull="both")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="walk_ray: origins"):
        scene.walk_ray((0, 0), (0, 0, 1))
