"""Flat curves that face the ray: their shape in hard places, the attributes of hits, and edits."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from engine.test_curves_and_points import FIELDS, TURNED, fur, rays_at
from oracles.ribbon_world import ribbon_at
from oracles.round_judge import judge, judge_lists, judge_occlusions
from oracles.round_world import RoundPart, RoundWorld
from perfect_bvh import Scene


def ribbons(points, radii, offsets, transform=None) -> tuple[Scene, RoundWorld]:
    """A committed scene of them, and the reference's."""
    scene = Scene()
    matrix = np.eye(4) if transform is None else transform
    mesh = scene.add_curves(points, radii, offsets, shape="ribbon")
    instance = scene.add_instance(mesh, matrix)
    scene.commit()
    every = np.broadcast_to(np.asarray(radii, np.float32), (len(points),))
    part = RoundPart(instance, np.asarray(points, np.float32), every, offsets, matrix, 0xFFFFFFFF)
    return scene, RoundWorld.of([part], "ribbon")


def assert_right(scene: Scene, world: RoundWorld, origins, directions) -> int:
    """Checks the nearest, all and any hits. Returns how many rays hit."""
    hits = scene.cast_rays(origins, directions)
    verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any()
    occluded = scene.test_occlusions(origins, directions)
    assert not judge_occlusions(world, origins, directions, occluded).wrong.any()
    found = scene.list_intersections(origins, directions)
    rays = np.repeat(np.arange(len(origins)), np.diff(found.ray_splits))
    columns = (found.hits.t_hit, found.hits.instance_ids, found.hits.primitive_ids)
    assert not judge_lists(world, origins, directions, rays, *columns).wrong.any()
    assert (scene.count_intersections(origins, directions) == np.diff(found.ray_splits)).all()
    return int(hits.is_hit.sum())


def zigzag(turns: int = 30) -> np.ndarray:
    """Long legs whose bends are sharp, in all directions."""
    random = np.random.default_rng(5)
    legs = random.normal(scale=0.2, size=(turns, 3)) + np.outer((-1.0) ** np.arange(turns), (0.4, 0.0, 0.0))
    return np.cumsum(legs, axis=0).astype(np.float32)


@pytest.mark.parametrize("far", [3.0, 1e3, 1e6])
def test_joints_of_a_zigzag(far):
    points = zigzag()
    scene, world = ribbons(points, 0.05, [0, len(points)])
    random = np.random.default_rng(6)
    targets = points[random.integers(0, len(points), 3000)] + random.normal(scale=0.04, size=(3000, 3))
    origins = random.normal(size=(3000, 3))
    origins *= far / np.linalg.norm(origins, axis=1)[:, None]
    assert assert_right(scene, world, origins, targets - origins) > 1000


def test_no_ray_passes_between_two_segments():
    """Of a chain that winds, from all sides: every ray that passes the axis at less than the least radius hits."""
    steps = np.linspace(0.0, 6.0, 200)
    points = np.stack([np.cos(3 * steps), np.sin(3 * steps), 0.3 * steps], axis=1).astype(np.float32)
    scene, _ = ribbons(points, 0.02, [0, 200])
    random = np.random.default_rng(7)
    targets = points[random.integers(1, 199, 20000)] + random.uniform(-1.0, 1.0, (20000, 3)) * 0.011
    origins = random.normal(size=(20000, 3)) * 5.0
    assert scene.cast_rays(origins, targets - origins).is_hit.all()


def test_a_straight_chain_is_one_ribbon():
    """However it is divided, and however wide it is: one row a ray, at the depth of the axis, seen from askew."""
    points = np.linspace((-1.0, 0.0, 0.0), (1.0, 0.0, 0.5), 41)
    scene, world = ribbons(points, 0.3, [0, 41])
    x, y = np.meshgrid(np.linspace(-0.8, 0.8, 37), np.linspace(-0.29, 0.29, 19))
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)], axis=1)
    down = np.broadcast_to((0.0, 0.0, -1.0), origins.shape)
    hits = scene.cast_rays(origins, down, fields=FIELDS)
    np.testing.assert_allclose(hits.t_hit, 5.0 - 0.25 * (origins[:, 0] + 1.0), rtol=1e-6)
    np.testing.assert_allclose(hits.primitive_uvs[:, 0], (origins[:, 0] + 1.0) / 2.0, atol=1e-5)
    assert (scene.count_intersections(origins, down) == 1).all()
    assert assert_right(scene, world, origins, down) == len(origins)


def test_ends_are_cut_off_straight():
    scene, _ = ribbons([[0, 0, 0], [1, 0, 0], [1, 1, 0]], 0.25, [0, 3])
    down = (0.0, 0.0, -1.0)
    origins = [[-0.01, 0, 5], [0.01, 0.2, 5], [1, 1.01, 5], [0.9, 0.99, 5], [1.15, -0.15, 5], [1.2, -0.2, 5]]
    assert scene.cast_rays(origins, down).is_hit.tolist() == [False, True, False, True, True, False]


def test_along_the_axis_and_from_it():
    points = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]], np.float32)
    scene, world = ribbons(points, 0.5, [0, 4])
    tilted = np.array([[0.0, 0.0, 1.0], [1e-9, 0.0, 1.0], [1e-6, 0.0, 1.0], [1e-3, 0.0, -1.0], [1.0, 0.0, 0.0]])
    directions = np.tile(tilted, (6, 1))
    origins = np.repeat([[0, 0, -5], [0, 0, 1], [0.2, 0.1, 1.5], [0, 0, 8], [0.5, 0, 1.5], [-2, 0.2, 1]], 5, axis=0)
    assert assert_right(scene, world, origins, directions) > 5


def test_tips_have_no_width():
    points, radii, offsets = fur(radius=0.1)
    scene, world = ribbons(points, radii, offsets)
    random = np.random.default_rng(8)
    tips = np.asarray(offsets[1:]) - 1
    targets = points[np.repeat(tips, 50)] + random.normal(scale=0.01, size=(50 * len(tips), 3))
    origins = random.normal(size=targets.shape) * 3.0
    assert_right(scene, world, origins, targets - origins)


@pytest.mark.parametrize("far", [4.0, 1e6])
def test_points_and_rounded_normals(far):
    points, radii, offsets = fur()
    turn = np.array([[0.6, -1.6, 0.0, 0.2], [1.6, 0.6, 0.0, -0.1], [0.0, 0.0, 1.7088, 0.4], [0.0, 0.0, 0.0, 1.0]])
    for matrix in (turn, TURNED):
        scene, world = ribbons(points, radii, offsets, matrix)
        origins, directions = rays_at(2000, far=far)
        hits = scene.cast_rays(origins, directions, fields=(*FIELDS, "front_face"))
        some = np.flatnonzero(hits.is_hit)[:150]
        assert hits.front_face[some].all()
        checked = 0
        for row in some:
            ray = origins[row], directions[row]
            found = ribbon_at(world, ray, int(hits.instance_ids[row]), int(hits.primitive_ids[row]))
            if found is None:  # which of the places it is, the reference does not say
                continue
            u, position, normal = found
            checked += 1
            assert abs(u - hits.primitive_uvs[row, 0]) < 1e-5
            assert np.abs(position - hits.positions[row]).max() < max(1e-12, 1e-14 * far)
            assert np.abs(normal - hits.geometric_normals[row]).max() < 1e-5
            assert normal @ directions[row] <= 1e-9 * far
        assert checked > 80


def test_they_are_fronts():
    scene, _ = ribbons([[-1, 0, 0], [1, 0, 0]], 0.25, [0, 2])
    ray = [0, 0.1, 5], [0, 0, -1]
    assert scene.cast_rays(*ray, cull="back").is_hit
    assert scene.count_intersections(*ray) == 1
    row = scene.list_intersections(*ray).hits
    assert row.t_hit.tolist() == [5.0]


def test_another_shape_takes_the_place():
    points, radii, offsets = fur()
    scene = Scene()
    mesh = scene.add_curves(points, radii, offsets)
    scene.add_instance(mesh)
    scene.commit()
    rays = rays_at(2000)
    answers = {"round": scene.cast_rays(*rays, fields=FIELDS)}
    for shape in ("ribbon", "round", "ribbon"):
        scene.replace_curves(mesh, points, radii, offsets, shape=shape)
        scene.commit()
        hits = scene.cast_rays(*rays, fields=FIELDS)
        expected = answers.setdefault(shape, hits)
        for field in FIELDS:
            assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field
    assert (answers["round"].t_hit != answers["ribbon"].t_hit).any()


def test_curves_that_bend_stay_ribbons():
    points, radii, offsets = fur()
    scene = Scene()
    mesh = scene.add_curves(points, radii, offsets, kind="catmull_rom", shape="ribbon", tolerance=1e-4)
    scene.add_instance(mesh)
    scene.commit()
    points = points + np.random.default_rng(9).normal(scale=0.1, size=points.shape).astype(np.float32)
    scene.update_curves(mesh, points)
    scene.commit()
    counts = scene.count_intersections(*rays_at(2000))
    assert (scene.count_intersections(*rays_at(2000), cull="back") == counts).all() and counts.any()


@pytest.mark.parametrize("mode", ["clay", "normal", "preview"])
def test_images_show_them(mode):
    points, radii, offsets = fur()
    scene, _ = ribbons(points, radii, offsets)
    camera = perfect_bvh.Camera.look_at((0.0, -4.0, 1.0), (0.0, 0.0, 0.4))
    image = perfect_bvh.render(scene, camera, mode=mode, size=(32, 24))
    assert np.isfinite(image).all() and image.std() > 0.0


def test_every_instruction_set_gives_the_same_bits():
    scene, _ = ribbons(*fur(strands=200))
    origins, directions = rays_at(5000)
    answers = []
    try:
        for isa in perfect_bvh.available_isas():
            perfect_bvh.set_active_isa(isa)
            hits = scene.cast_rays(origins, directions, fields=FIELDS)
            found = scene.list_intersections(origins, directions)
            columns = [getattr(hits, field) for field in FIELDS] + [found.ray_splits, found.hits.t_hit]
            columns += [found.hits.primitive_ids, scene.test_occlusions(origins, directions)]
            answers.append([column.tobytes() for column in columns])
    finally:
        perfect_bvh.set_active_isa(None)
    assert hits.is_hit.sum() > 500
    assert all(answer == answers[0] for answer in answers)
