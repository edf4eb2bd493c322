"""Cyclic curves, and points that are given twice: surfaces inside of the joints are not hit."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.round_judge import judge, judge_lists, judge_occlusions
from oracles.round_world import RoundPart, RoundWorld
from perfect_bvh import Scene

SHAPES = ("round", "ribbon")
SQUARE = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], np.float32)


def ring(count: int, seed: int, bend: float = 0.2) -> np.ndarray:
    """(count, 3) float32: points around the origin, at a distance near 1."""
    random = np.random.default_rng(seed)
    angle = np.arange(count) * 2.0 * np.pi / count
    flat = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    return (flat + random.normal(scale=bend, size=(count, 3))).astype(np.float32)


def of_each_kind(seed: int = 1) -> dict[str, np.ndarray]:
    """Rings by the name of their peculiarity, each a cyclic curve."""
    five = ring(5, seed)
    return {
        "ring": ring(9, seed),
        "triangle": ring(3, seed),
        "there and back": ring(2, seed),
        "first point again": np.concatenate([five, five[:1]]),
        "first point three times": np.concatenate([five, five[:1], five[:1]]),
        "points twice": np.repeat(five, 2, axis=0),
        "one place": np.repeat(five[:1], 4, axis=0),
        "on a line": np.float32([[-1, 0, 0], [0, 0, 0], [1, 0, 0]]),
    }


def rays_at(points: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Half of them through places near points of the curve, the others between them."""
    random = np.random.default_rng(seed)
    first = points[random.integers(0, len(points), count)]
    share = random.uniform(0.0, 1.0, (count, 1)) * (np.arange(count)[:, None] % 2)
    second = points[random.integers(0, len(points), count)]
    targets = first + share * (second - first) + random.normal(scale=0.1, size=(count, 3))
    origins = random.normal(size=(count, 3)) * 4.0
    return origins, targets - origins


def world_of(points: np.ndarray, radii: np.ndarray, shape: str, is_cyclic: bool = True) -> RoundWorld:
    if is_cyclic:
        points, radii = np.concatenate([points, points[:1]]), np.concatenate([radii, radii[:1]])
    part = RoundPart(0, points, radii, [0, len(points)], np.eye(4), 0xFFFFFFFF, [is_cyclic])
    return RoundWorld.of([part], shape)


def assert_right(scene: Scene, world: RoundWorld, origins, directions, times=0.0) -> int:
    """Checks the nearest, any and all hits; returns how many rays hit."""
    hits = scene.cast_rays(origins, directions, times=times)
    assert not judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids).wrong.any()
    occluded = scene.test_occlusions(origins, directions, times=times)
    assert not judge_occlusions(world, origins, directions, occluded).wrong.any()
    found = scene.list_intersections(origins, directions, times=times)
    rays = np.repeat(np.arange(len(origins)), np.diff(found.ray_splits))
    columns = (found.hits.t_hit, found.hits.instance_ids, found.hits.primitive_ids)
    assert not judge_lists(world, origins, directions, rays, *columns).wrong.any()
    counts = scene.count_intersections(origins, directions, times=times)
    assert (counts == np.diff(found.ray_splits)).all()
    return int(hits.is_hit.sum())


def scene_of(points, radii, **options) -> tuple[Scene, int]:
    scene = Scene()
    mesh = scene.add_curves(points, radii, [0, len(points)], **options)
    scene.add_instance(mesh)
    scene.commit()
    return scene, mesh


@pytest.mark.parametrize("corner", SQUARE, ids=str)
def test_every_corner_of_a_square_is_alike(corner):
    scene, _ = scene_of(SQUARE, 0.5, cyclic=True)
    inward = np.sign(2.0 - corner) * (1.0, 1.0, 0.0)
    target = corner + inward * (0.1, 0.05, 0.0)
    for slope in ((0.2, 0.15, -1.0), (-0.2, 0.15, -1.0), (0.0, 0.0, -1.0)):
        direction = inward * slope + (0.0, 0.0, slope[2])
        found = scene.list_intersections(target - 5.0 * direction, direction)
        assert len(found.hits.t_hit) == scene.count_intersections(target - 5.0 * direction, direction) == 2


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", of_each_kind())
def test_against_the_reference(kind, shape):
    for seed in range(3):
        points = of_each_kind(seed)[kind]
        radii = np.random.default_rng(seed).uniform(0.05, 0.4, len(points)).astype(np.float32)
        for i in range(1, len(points)):  # a point given twice has one radius
            same = np.flatnonzero((points[:i] == points[i]).all(axis=1))
            radii[i] = radii[same[0]] if len(same) else radii[i]
        scene, _ = scene_of(points, radii, cyclic=True, shape=shape)
        rays = rays_at(points, 1000, seed)
        assert assert_right(scene, world_of(points, radii, shape), *rays) > 300


@pytest.mark.parametrize("shape", SHAPES)
def test_points_given_twice_hide_nothing_between_open_segments(shape):
    once, times = ring(6, 4), [1, 2, 3, 2, 2, 1]
    points = np.repeat(once, times, axis=0)
    radii = np.full(len(points), 0.2, np.float32)
    scene, _ = scene_of(points, radii, shape=shape)
    rays = rays_at(points, 3000, 5)
    assert assert_right(scene, world_of(points, radii, shape, is_cyclic=False), *rays) > 1000
    plain, _ = scene_of(once, 0.2, shape=shape)
    np.testing.assert_array_equal(scene.count_intersections(*rays), plain.count_intersections(*rays))


def test_a_ribbon_is_filled_where_it_returns():
    scene, _ = scene_of(SQUARE, 0.5, cyclic=True, shape="ribbon")
    outward = np.sign(SQUARE - (2.0, 2.0, 0.0)) * 0.3
    assert (scene.count_intersections(SQUARE + outward + (0.0, 0.0, 5.0), (0.0, 0.0, -1.0)) == 1).all()
    normals = scene.cast_rays(SQUARE + (0.0, 0.0, 5.0), (0.0, 0.0, -1.0), fields=("geometric_normals",))
    np.testing.assert_allclose(normals.geometric_normals, np.tile((0.0, 0.0, 1.0), (4, 1)), atol=1e-6)


@pytest.mark.parametrize("kind", ["poly", "catmull_rom", "bezier", "b_spline"])
def test_where_a_curve_begins_changes_no_count(kind):
    points = ring(12, 7, bend=0.05)
    rays = rays_at(points, 4000, 8)
    counts = []
    for shift in (0, 3, 6):
        scene, _ = scene_of(np.roll(points, shift, axis=0), 0.08, cyclic=True, kind=kind, segments=3)
        counts.append(scene.count_intersections(*rays))
    assert counts[0].any() and (counts[0] % 2 == 0).all()
    assert (counts[0] == counts[1]).mean() > 0.999 and (counts[0] == counts[2]).mean() > 0.999


@pytest.mark.parametrize("shape", SHAPES)
def test_in_motion(shape):
    first, last = ring(6, 11), ring(6, 12) + np.float32([0.5, 0.0, 0.25])
    last[2:4] = last[2]
    radii = np.full(6, 0.25, np.float32)
    scene, mesh = scene_of(first, radii, cyclic=True, shape=shape)
    scene.set_curves_motion(mesh, [first, last])
    scene.commit()
    for time, points in ((0.0, first), (0.5, (first + last) / 2), (1.0, last)):
        rays = rays_at(points, 2000, 13)
        assert assert_right(scene, world_of(points, radii, shape), *rays, times=time) > 500


def test_edits_keep_what_is_cyclic():
    points, radii = ring(6, 21), np.full(6, 0.25, np.float32)
    scene, mesh = scene_of(ring(6, 20), radii, cyclic=True, usage="deforming")

    def assert_current() -> None:
        scene.commit()
        assert assert_right(scene, world_of(points, radii, "round"), *rays_at(points, 2000, 22)) > 500

    scene.update_curves(mesh, points)
    assert_current()
    for row in (0, 5, 3):  # the closing segment is left out, and is there again
        radii = np.full(6, 0.25, np.float32)
        radii[[row, (row + 1) % 6]] = 0.0
        scene.update_curves(mesh, points, radii)
        assert_current()
    radii = np.full(6, 0.25, np.float32)
    scene.update_curves(mesh, points, radii)
    assert_current()
    scene.replace_curves(mesh, points, radii, [0, 6], cyclic=False)
    scene.commit()
    open_world = world_of(points, radii, "round", is_cyclic=False)
    assert assert_right(scene, open_world, *rays_at(points, 2000, 23)) > 500
    scene.replace_curves(mesh, points, radii, [0, 6], cyclic=True)
    assert_current()


def test_curves_of_more_pieces_than_before_stay_cyclic():
    points = ring(6, 31, bend=0.0)
    scene, mesh = scene_of(points * 0.1, 0.05, cyclic=True, kind="catmull_rom", tolerance=0.01)
    scene.update_curves(mesh, points)
    assert scene.commit().meshes[0].action == "rebuilt"
    fresh, _ = scene_of(points, 0.05, cyclic=True, kind="catmull_rom", tolerance=0.01)
    rays = rays_at(points, 3000, 32)
    expected = fresh.count_intersections(*rays)
    np.testing.assert_array_equal(scene.count_intersections(*rays), expected)
    scene.set_curves_motion(mesh, [points * 0.5, points * 2.0])
    scene.commit()
    many = scene.count_intersections(*rays_at(points * 0.5, 3000, 33))
    assert expected.any() and many.any() and (many % 2 == 0).all()


def test_several_curves_of_which_some_are_cyclic():
    parts = [ring(4 + k, 40 + k) + np.float32([3.0 * k, 0.0, 0.0]) for k in range(7)]
    cyclic = np.arange(7) % 2 == 0
    scene = Scene()
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    scene.add_instance(scene.add_curves(np.concatenate(parts), 0.2, offsets, cyclic=cyclic))
    scene.commit()
    balls = [
        np.concatenate([part, part[:1]]) if is_closed else part for part, is_closed in zip(parts, cyclic, strict=True)
    ]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in balls])])
    radii = np.full(starts[-1], 0.2, np.float32)
    world = RoundWorld.of([RoundPart(0, np.concatenate(balls), radii, starts, np.eye(4), 0xFFFFFFFF, cyclic)])
    for k, part in enumerate(parts):
        assert assert_right(scene, world, *rays_at(part, 1000, k)) > 300
