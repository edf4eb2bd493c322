"""Rays with individual times: each meets the scene frozen at its time."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.moving import positions_at, transform_at
from oracles.moving_scene import MovingScene, matrix, still_copy
from perfect_bvh.build_config import BUILDERS

RANGES = [(0.0, 1.0), (0.25, 0.75), (-1.0, 2.0)]
IDENTITY = np.eye(4)


@pytest.fixture(autouse=True)
def default_isa():
    yield
    perfect_bvh.set_active_isa(None)


def assert_alike(hits: perfect_bvh.Hits, expected: perfect_bvh.Hits, tolerance: float) -> None:
    """Rays that graze an edge may be answered either way, by both alike or not: there are next to none of those."""
    same = (hits.instance_ids == expected.instance_ids) & (hits.primitive_ids == expected.primitive_ids)
    assert (~same).mean() < 2e-3
    both = same & hits.is_hit
    np.testing.assert_allclose(hits.t_hit[both], expected.t_hit[both], rtol=tolerance, atol=tolerance)
    assert np.array_equal(hits.front_face[both], expected.front_face[both])
    np.testing.assert_allclose(hits.geometric_normals[both], expected.geometric_normals[both], atol=2e-3)
    np.testing.assert_allclose(hits.positions[both], expected.positions[both], atol=1e-4)


FIELDS = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs", "front_face", "geometric_normals", "positions")


@pytest.mark.parametrize(("steps", "time_range"), [(2, RANGES[0]), (3, RANGES[1]), (5, RANGES[2]), (9, RANGES[0])])
def test_a_ray_meets_the_scene_frozen_at_its_time(steps, time_range):
    """250 times of each motion, 1,000 in all, each compared with a frozen scene."""
    moving = MovingScene(steps, time_range)
    still = still_copy(moving, steps, 0)
    random = np.random.default_rng(7)
    found = 0
    for i in range(250):
        time = (0.0, 1.0, 0.25, 0.5, 0.75, *random.uniform(0, 1, 245))[i]
        origins, directions = meshes.random_rays(200, i)
        moving.frozen(still, time)
        hits = moving.scene.cast_rays(origins, directions, times=time, fields=FIELDS)
        assert_alike(hits, still.cast_rays(origins, directions, fields=FIELDS), 2e-5)
        found += hits.is_hit.sum()
    assert found > 10_000


@pytest.mark.parametrize("count", [1, 4, 9])
def test_a_tree_of_a_single_leaf_moves_like_any_other(count):
    """It has no inner node that could hold the next step's boxes. 9: two leaves."""
    random = np.random.default_rng(count)
    triangles = np.arange(3 * count).reshape(-1, 3)
    shapes = random.uniform(-1.0, 1.0, (3, 3 * count, 3)).astype(np.float32)
    moving, still = perfect_bvh.Scene(), perfect_bvh.Scene()
    for scene in (moving, still):
        mesh = scene.add_mesh(shapes[0], triangles)
        scene.add_instance(mesh)
    moving.set_mesh_motion(0, shapes)
    moving.commit()
    origins, directions = meshes.random_rays(2_000, count)
    for time in (0.1, 0.5, 0.8):
        still.update_mesh(0, positions_at(shapes, time, RANGES[0]))
        still.commit()
        hits = moving.cast_rays(origins, directions, times=time, fields=FIELDS)
        assert hits.is_hit.sum() > 20
        assert_alike(hits, still.cast_rays(origins, directions, fields=FIELDS), 2e-5)
        counts = moving.count_intersections(origins, directions, times=time)
        assert (counts != still.count_intersections(origins, directions)).mean() < 2e-3
        closest, other = (each.compute_closest_points(origins, times=time) for each in (moving, still))
        np.testing.assert_allclose(closest.distances, other.distances, atol=1e-5)
        for row in np.flatnonzero(hits.is_hit)[:5]:
            walk = moving.walk_ray(origins[row], directions[row], time=time)
            assert walk.nearest_t[-1] == pytest.approx(hits.t_hit[row], rel=1e-5)


def test_no_answer_is_wrong_in_double_precision():
    moving = MovingScene(4, seed=3)
    origins, directions = meshes.random_rays(30_000, 5)
    times = np.random.default_rng(6).uniform(0, 1, 30_000)
    hits = moving.scene.cast_rays(origins, directions, times=times, audit=1.0)
    assert hits.is_hit.sum() > 5_000
    assert hits.audit.wrong_rows.size == 0
    shifted = moving.scene.cast_rays(origins, directions, times=(times + 0.5) % 1, audit=1.0)
    assert (hits.primitive_ids != shifted.primitive_ids).mean() > 0.05  # they do move


def answers(scene, origins, directions, times) -> list[bytes]:
    hits = scene.cast_rays(origins, directions, times=times, fields=FIELDS)
    listed, splits = scene.list_intersections(origins[:500], directions[:500], times=times[:500])
    closest = scene.compute_closest_points(origins[:500], times=times[:500])
    return [
        *(hits.columns[name].tobytes() for name in FIELDS),
        scene.test_occlusions(origins, directions, times=times).tobytes(),
        scene.count_intersections(origins, directions, times=times).tobytes(),
        listed.t_hit.tobytes(),
        listed.primitive_ids.tobytes(),
        splits.tobytes(),
        closest.points.tobytes(),
        closest.distances.tobytes(),
    ]


def test_same_bits_on_every_instruction_set_builder_and_thread_count():
    origins, directions = meshes.random_rays(4_000, 2)
    times = np.random.default_rng(8).uniform(0, 1, 4_000).astype(np.float32)
    expected = None
    builders = [name for name in BUILDERS if name != "spatial"]  # whose trees cannot follow
    assert len(builders) > 4
    for builder in builders:
        moving = MovingScene(3, seed=4, build=perfect_bvh.BuildConfig(builder=builder))
        for isa in perfect_bvh.available_isas() if builder == "auto" else perfect_bvh.available_isas()[-1:]:
            perfect_bvh.set_active_isa(isa)
            found = answers(moving.scene, origins, directions, times)
            expected = expected or found
            assert found == expected, (builder, isa)
    alone = moving.scene.cast_rays(origins, directions, times=times, threads=1, fields=FIELDS)
    assert [alone.columns[name].tobytes() for name in FIELDS] == expected[: len(FIELDS)]


@pytest.mark.parametrize("time_range", [(0.0, 1.0), (0.25, 0.75)])
def test_a_lone_mesh_that_deforms_is_met_as_if_it_were_not_alone(time_range):
    """Most rays enter it directly; rays from far away or along an axis, and larger scenes, use the top level."""
    random = np.random.default_rng(27)
    positions, triangles = meshes.sphere(24, 32)
    steps = positions + random.normal(0, 0.1, (3, 1, 3)) + random.normal(0, 0.02, (3, *positions.shape))
    lone, beside = perfect_bvh.Scene(), perfect_bvh.Scene()
    for scene in (lone, beside):
        scene.set_mesh_motion(mesh := scene.add_mesh(positions, triangles), steps, time_range)
        scene.add_instance(mesh)
    beside.add_instance(beside.add_mesh(positions[triangles[0]] + 50.0, [[0, 1, 2]]))
    origins, times = random.normal(0, 3, (4_000, 3)), random.random(4_000, dtype=np.float32)
    directions = random.normal(0, 0.5, (4_000, 3)) - origins
    times[:4] = [-0.5, 1.5, 0.0, 1.0]
    directions[8:40, :2], origins[8:40, :2] = 0.0, steps[0, :32, :2] / 2
    origins[-8:] *= 1e6
    directions[-8:] = -origins[-8:]
    found = []
    for scene in (lone, beside):
        scene.commit()
        hits = scene.cast_rays(origins, directions, times=times, audit=1.0, fields=FIELDS)
        assert len(hits.audit.wrong_rows) == 0
        assert hits.is_hit.sum() > 1_000
        assert not hits.is_hit[:2].any()
        assert hits.is_hit[8:40].any()
        assert hits.is_hit[-8:].any()
        found.append(hits)
    assert_alike(found[0], found[1], 1e-5)
    expected = answers(lone, origins, directions, times)
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        assert answers(lone, origins, directions, times) == expected


def test_every_query_agrees_with_the_frozen_scene():
    moving = MovingScene(3, seed=9)
    still = still_copy(moving, 3, 9)
    origins, directions = meshes.random_rays(1_000, 3)
    for time in (0.0, 0.3, 0.5, 0.9, 1.0):
        moving.frozen(still, time)
        scene, rays = moving.scene, (origins, directions)
        occluded = scene.test_occlusions(*rays, times=time)
        assert (occluded == scene.cast_rays(*rays, times=time).is_hit).all()
        counts, expected = scene.count_intersections(*rays, times=time), still.count_intersections(*rays)
        assert (counts != expected).mean() < 5e-3
        listed = scene.list_intersections(*rays, times=time)
        assert np.array_equal(np.diff(listed.ray_splits), counts)
        closest, other = scene.compute_closest_points(origins, times=time), still.compute_closest_points(origins)
        np.testing.assert_allclose(closest.distances, other.distances, rtol=1e-5, atol=1e-6)
        walk = scene.walk_ray(origins[0], directions[0], time=time)
        assert walk.nearest_t[-1] == pytest.approx(scene.cast_rays(origins[0], directions[0], times=time).t_hit)


def test_times_that_are_none_are_misses_and_counted():
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.sphere(8, 12, 1.0))
    instance = scene.add_instance(mesh)
    scene.set_instance_motion([instance], np.stack([IDENTITY, IDENTITY])[:, None])
    still = perfect_bvh.Scene()
    still.add_instance(still.add_mesh(*meshes.sphere(8, 12, 1.0)))
    times = np.array([0.0, 1.0, -1e-6, 1.000001, np.nan, np.inf, -np.inf, 0.5])
    bad = ~((times >= 0) & (times <= 1))
    for each in (scene, still):
        each.commit()
        hits = each.cast_rays((0, 0, 5), np.tile((0.1, 0.05, -5.0), (8, 1)), times=times, audit=1.0)
        assert np.array_equal(hits.is_hit, ~bad)
        assert hits.invalid_count == bad.sum()
        assert hits.audit.wrong_rows.size == 0
        assert np.array_equal(each.test_occlusions((0, 0, 5), np.tile((0, 0, -5.0), (8, 1)), times=times), ~bad)
        closest = each.compute_closest_points(np.zeros((8, 3)), times=times)
        assert np.array_equal(np.isfinite(closest.distances), ~bad)
        assert closest.invalid_count == bad.sum()


def test_a_wheel_stays_round():
    """A quarter of a turn in one step: a matrix that is interpolated would shrink to .71 of its size half-way."""
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.sphere(64, 128, 1.0))
    instance = scene.add_instance(mesh)
    quarter = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    scene.set_instance_motion([instance], np.stack([IDENTITY, quarter])[:, None])
    scene.commit()
    times = np.linspace(0, 1, 101)
    hits = scene.cast_rays((3, 0.01, 0.02), np.tile((-1.0, 0, 0), (101, 1)), times=times)
    np.testing.assert_allclose(hits.t_hit, 2.0, atol=3e-3)


def test_a_scale_through_zero_vanishes_for_a_moment_only():
    scene = perfect_bvh.Scene()
    instance = scene.add_instance(scene.add_mesh(*meshes.sphere(8, 12, 1.0)))
    inside_out = np.diag([-1.0, 1.0, 1.0, 1.0])
    scene.set_instance_motion([instance], np.stack([IDENTITY, inside_out])[:, None])
    scene.commit()
    times = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    hits = scene.cast_rays((0.01, 0.02, 5), np.tile((0, 0, -1.0), (5, 1)), times=times, fields=FIELDS)
    assert hits.is_hit.tolist() == [True, True, False, True, True]
    assert hits.front_face.tolist() == [True, True, False, False, False]  # it is turned inside out
    front = scene.cast_rays((0.01, 0.02, 5), np.tile((0, 0, -1.0), (5, 1)), times=times, cull="back", fields=FIELDS)
    assert front.is_hit.tolist() == [True, True, False, True, True]
    assert front.front_face[front.is_hit].all()
    assert (front.t_hit == hits.t_hit)[:2].all()
    assert (front.t_hit > hits.t_hit)[3:].all()


def test_motion_ends_where_things_are_placed():
    moving = MovingScene(3, seed=2)
    rays = meshes.random_rays(500, 1)
    still = still_copy(moving, 3, 2)
    moving.frozen(moving.scene, 0.6)
    moving.frozen(still, 0.6)
    for time in (0.0, 0.7):
        hits, expected = moving.scene.cast_rays(*rays, times=time), still.cast_rays(*rays)
        for name in ("t_hit", "instance_ids", "primitive_ids"):
            assert hits.columns[name].tobytes() == expected.columns[name].tobytes()


def test_a_mesh_that_only_another_instance_moves_is_kept():
    scene = perfect_bvh.Scene()
    large = scene.add_mesh(*meshes.sphere(100, 100, 1.0))
    small = scene.add_mesh(*meshes.sphere(4, 4, 0.1))
    scene.add_instance(large)
    instance = scene.add_instance(small)
    scene.commit()
    path = np.stack([IDENTITY, IDENTITY])
    path[1, 0, 3] = 3.0
    scene.set_instance_motion([instance], path[:, None])
    report = scene.commit()
    assert report.kept_count == 2
    assert not report.meshes


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((2, 3, 2))), r"set_mesh_motion: positions must have shape"),
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((2, 5, 3))), r"positions has 5 rows but the mesh has 8"),
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((0, 8, 3))), r"set_mesh_motion: positions must have 1 to 255"),
        (lambda s, m, i: s.set_mesh_motion(m, np.full((2, 8, 3), np.nan)), r"positions\[0\] is not finite"),
        (lambda s, m, i: s.set_mesh_motion(99, np.zeros((2, 8, 3))), r"there is no mesh with id 99"),
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((2, 8, 3)), (1.0, 0.0)), r"time_range must rise"),
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((2, 8, 3)), 3), r"time_range must be two numbers"),
        (lambda s, m, i: s.set_mesh_motion(m, np.zeros((2, 8, 3)), (0, np.nan)), r"time_range must rise"),
        (lambda s, m, i: s.set_instance_motion([i], np.zeros((2, 1, 4, 5))), r"transforms must have shape"),
        (
            lambda s, m, i: s.set_instance_motion([i, i], np.tile(IDENTITY, (2, 1, 1, 1))),
            r"transforms must have 4 rows",
        ),
        (lambda s, m, i: s.set_instance_motion([99], np.tile(IDENTITY, (2, 1, 1, 1))), r"no instance with id 99"),
        (
            lambda s, m, i: s.set_instance_motion([i], np.stack([IDENTITY, np.diag([1.0, 1, 0, 1])])[:, None]),
            r"transforms\[1, 0\] flattens the instance",
        ),
        (
            lambda s, m, i: s.set_instance_motion([i], np.stack([IDENTITY, np.inf * np.ones((4, 4))])[:, None, :3]),
            r"must be finite",
        ),
        (lambda s, m, i: s.cast_rays(np.zeros((4, 3)), np.ones((4, 3)), times=np.zeros(3)), r"times must be a number"),
    ],
)
def test_bad_motions_change_nothing(call, message):
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.sphere(3, 3, 1.0)
    positions = np.resize(positions, (8, 3))
    mesh = scene.add_mesh(positions, np.minimum(triangles, 7))
    instance = scene.add_instance(mesh)
    scene.commit()
    with pytest.raises(ValueError, match=message):
        call(scene, mesh, instance)
    assert scene.is_current


def test_trees_with_spatial_splits_refuse_to_move():
    scene = perfect_bvh.Scene()
    positions, triangles = meshes.sphere(8, 8, 1.0)
    mesh = scene.add_mesh(positions, triangles, perfect_bvh.BuildConfig(builder="spatial"))
    with pytest.raises(ValueError, match=r"set_mesh_motion: mesh 0 is built with spatial splits.*build='auto'"):
        scene.set_mesh_motion(mesh, np.stack([positions, positions]))


def test_far_from_zero():
    """In float64, recentred around the first step."""
    positions, triangles = meshes.sphere(12, 16, 1.0)
    centre = np.array([1e6, -2e6, 5e5])
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions + centre, triangles)
    scene.add_instance(mesh)
    scene.set_mesh_motion(mesh, np.stack([positions + centre, positions + centre + (4.0, 0, 0)]))
    scene.commit()
    times = np.linspace(0, 1, 9)
    origins = centre + np.stack([4 * times, 0 * times, 0 * times + 5], axis=1)
    hits = scene.cast_rays(origins, (0.003, 0.004, -1.0), times=times, audit=1.0)
    assert hits.is_hit.all()
    np.testing.assert_allclose(hits.t_hit, hits.t_hit[0], atol=1e-5)
    assert hits.audit.wrong_rows.size == 0


def round_scene(kind: str, steps: int, seed: int) -> tuple[perfect_bvh.Scene, int, np.ndarray, np.ndarray]:
    """Points, or curves of one sort: the scene, the mesh's id, and centres and radii at each step."""
    random = np.random.default_rng(seed)
    count = 120
    start = random.uniform(-1, 1, (count, 3)) if kind == "points" else np.cumsum(random.normal(0, 0.15, (count, 3)), 0)
    places = (start + np.cumsum(random.normal(0, 0.1, (steps, count, 3)), 0)).astype(np.float32)
    radii = random.uniform(0.02, 0.08, (steps, count)).astype(np.float32)
    scene, offsets = perfect_bvh.Scene(), np.arange(0, count + 1, 12)
    if kind == "points":
        mesh = scene.add_points(places[0], radii[0])
    else:
        shape = "ribbon" if kind == "ribbon" else "round"
        sort = "catmull_rom" if kind == "catmull_rom" else "poly"
        mesh = scene.add_curves(places[0], radii[0], offsets, kind=sort, shape=shape)
    scene.add_instance(mesh, matrix(random))
    turning = scene.add_instance(mesh, matrix(random))
    scene.set_instance_motion([turning], np.stack([matrix(random) for _ in range(steps)])[:, None])
    return scene, mesh, places, radii


ROUND = ["points", "poly", "ribbon", "catmull_rom"]


@pytest.mark.parametrize("kind", ROUND)
def test_moving_curves_and_points_are_right_in_double_precision_and_the_same_bits_everywhere(kind):
    scene, mesh, places, radii = round_scene(kind, 4, 5)
    move = scene.set_points_motion if kind == "points" else scene.set_curves_motion
    move(mesh, places, radii)
    scene.commit()
    origins, directions = meshes.random_rays(6_000, 3)
    times = np.random.default_rng(4).uniform(0, 1, 6_000).astype(np.float32)
    hits = scene.cast_rays(origins, directions, times=times, audit=0.3)
    assert hits.is_hit.sum() > 500
    assert hits.audit.wrong_rows.size == 0
    expected = None
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        found = answers(scene, origins, directions, times)
        expected = expected or found
        assert found == expected, isa


@pytest.mark.parametrize("kind", ["points", "poly", "ribbon"])
def test_moving_curves_and_points_are_those_frozen_at_the_ray_s_time(kind):
    scene, mesh, places, radii = round_scene(kind, 3, 6)
    (scene.set_points_motion if kind == "points" else scene.set_curves_motion)(mesh, places, radii)
    scene.commit()
    still, other, *_ = round_scene(kind, 3, 6)
    both = np.concatenate([places, radii[..., None]], axis=2)
    turning = 1
    random = np.random.default_rng(6)
    for time in (0.0, 0.2, 0.5, *random.uniform(0, 1, 20), 1.0):
        now = positions_at(both, time)
        (still.update_points if kind == "points" else still.update_curves)(other, now[:, :3], now[:, 3])
        still.set_instance_motion([turning], frozen_turn(kind, time)[None, None])
        still.commit()
        origins, directions = meshes.random_rays(400, int(1000 * time))
        hits = scene.cast_rays(origins, directions, times=time, fields=FIELDS)
        expected = still.cast_rays(origins, directions, fields=FIELDS)
        same = (hits.primitive_ids == expected.primitive_ids) & (hits.instance_ids == expected.instance_ids)
        assert (~same).mean() < 1e-2
        np.testing.assert_allclose(hits.t_hit[same], expected.t_hit[same], rtol=1e-4, atol=1e-4)
        found = same & hits.is_hit
        np.testing.assert_allclose(hits.positions[found], expected.positions[found], atol=2e-3)
        closest, nearest = scene.compute_closest_points(origins, times=time), still.compute_closest_points(origins)
        np.testing.assert_allclose(closest.distances, nearest.distances, rtol=1e-4, atol=1e-5)


def frozen_turn(kind: str, time: float) -> np.ndarray:
    """Where the turning instance of `round_scene(kind, 3, 6)` is then."""
    random = np.random.default_rng(6)
    random.uniform(-1, 1, (120, 3)) if kind == "points" else random.normal(0, 0.15, (120, 3))
    random.normal(0, 0.1, (3, 120, 3))
    random.uniform(0.02, 0.08, (3, 120))
    for _ in range(2):
        matrix(random)
    return transform_at(np.stack([matrix(random) for _ in range(3)]), time)


def test_curves_that_bend_get_the_pieces_of_the_most_bent_step():
    scene = perfect_bvh.Scene()
    straight = np.stack([np.arange(6.0), np.zeros(6), np.zeros(6)], axis=1)
    bent = straight + np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0]])
    offsets = [0, 6, 12]
    first, second = np.concatenate([straight, bent]), np.concatenate([bent, straight + (0, 0, 3)])
    mesh = scene.add_curves(np.concatenate([straight, straight]), 0.05, offsets, kind="catmull_rom")
    scene.add_instance(mesh)
    scene.set_curves_motion(mesh, np.stack([first, second]))
    report = scene.commit()
    other = perfect_bvh.Scene()
    other.add_instance(other.add_curves(np.concatenate([bent, bent]), 0.05, offsets, kind="catmull_rom"))
    assert report.meshes[0].triangle_count == other.commit().meshes[0].triangle_count


def test_bad_motions_of_curves_and_points_change_nothing():
    scene = perfect_bvh.Scene()
    points = scene.add_points(np.zeros((3, 3)), 0.1)
    curves = scene.add_curves(np.arange(9.0).reshape(3, 3), 0.1, [0, 3])
    scene.add_instances([points, curves], np.tile(IDENTITY, (2, 1, 1)))
    scene.commit()
    two = np.zeros((2, 3, 3))
    for call, message in (
        (lambda: scene.set_points_motion(points, np.zeros((2, 4, 3))), "set_points_motion: centers has 4 rows"),
        (lambda: scene.set_points_motion(points, two, [[0.1, 0.1, 0.1], [0.1, 0.0, 0.1]]), "0 at every step"),
        (lambda: scene.set_points_motion(points, two, np.full((3, 3), 0.1)), r"radii must have shape \(2, 3\)"),
        (lambda: scene.set_points_motion(points, two, -0.1), "at least 0"),
        (lambda: scene.set_points_motion(curves, two), "must have points, but has curves"),
        (lambda: scene.set_mesh_motion(curves, two), "must have triangles, but has curves"),
        (lambda: scene.set_curves_motion(curves, np.full((2, 3, 3), np.inf)), "must be finite"),
        (lambda: scene.set_curves_motion(curves, two, time_range=(0.5, 0.5)), "time_range must rise"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
        assert scene.is_current


@pytest.mark.parametrize("time_range", RANGES)
def test_images_show_the_scene_where_the_shutter_opens(time_range):
    """Also where motions began before: tracing and shading use the same time."""
    moving = MovingScene(3, time_range, seed=11)
    still = MovingScene(3, time_range, seed=11).scene
    moving.frozen(still, 0.0)
    place = np.eye(4)
    place[2, 3] = 4.0
    camera = perfect_bvh.Camera(place)
    images = [
        perfect_bvh.render_passes(scene, camera, mode="normal", size=(60, 40), passes=("depth", "normal"))
        for scene in (moving.scene, still)
    ]
    for name in ("depth", "normal"):
        one, other = (np.asarray(image[name]) for image in images)
        both = np.isfinite(one) & np.isfinite(other)
        assert both.mean() > 0.3
        apart = np.abs(np.where(both, one, 0.0) - np.where(both, other, 0.0)) > 1e-3
        assert apart.mean() < 5e-3, name
