"""Curves and points in a scene: rays compared with a separate reference, the attributes of hits, and motion."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from engine.test_audit import audit_natively
from oracles.round_judge import judge, judge_lists, judge_occlusions, surfaces_at
from oracles.round_world import RoundPart, RoundWorld
from perfect_bvh import BuildConfig, Scene
from perfect_bvh.build_config import BUILDERS

FIELDS = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions")
KINDS = ["curves", "ribbons", "points"]
SHAPES = {"curves": "round", "ribbons": "ribbon", "points": "round"}
TURNED = np.array([[0.8, -0.6, 0.1, 0.2], [0.6, 1.1, 0.0, -0.1], [0.2, 0.3, -1.4, 0.4], [0.0, 0.0, 0.0, 1.0]])


def fur(strands: int = 40, segments: int = 6, radius: float = 0.03, seed: int = 1) -> tuple[np.ndarray, ...]:
    """points, radii, curve_offsets: strands that bend, whose tips have no radius."""
    random = np.random.default_rng(seed)
    steps = np.cumsum(random.normal(scale=0.15, size=(strands, segments + 1, 3)) + (0.0, 0.0, 0.15), axis=1)
    points = random.uniform(-1.0, 1.0, (strands, 1, 3)) * (1.0, 1.0, 0.1) + steps
    radii = np.tile(radius * (1.0 - np.arange(segments + 1) / segments), strands)
    offsets = np.arange(strands + 1) * (segments + 1)
    return points.reshape(-1, 3).astype(np.float32), radii.astype(np.float32), offsets


def cloud(count: int = 200, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """centers, radii; every seventh point has none."""
    random = np.random.default_rng(seed)
    radii = random.uniform(0.02, 0.1, count) * (np.arange(count) % 7 > 0)
    return random.uniform(-1.0, 1.0, (count, 3)).astype(np.float32), radii.astype(np.float32)


def rays_at(count: int, seed: int = 3, far: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= far / np.linalg.norm(origins, axis=1)[:, None]
    origins[::5] *= 0.2 / far  # some begin among them
    return origins, random.uniform(-1.0, 1.0, (count, 3)) - origins


def add(scene: Scene, kind: str, transforms: list[np.ndarray], **options: Any) -> tuple[int, RoundWorld]:
    """A mesh of that kind and its instances, and the reference's."""
    if kind == "points":
        places, radii = cloud()
        offsets, mesh = None, scene.add_points(places, radii, **options)
    else:
        places, radii, offsets = fur()
        mesh = scene.add_curves(places, radii, offsets, shape=SHAPES[kind], **options)
    ids = scene.add_instances([mesh] * len(transforms), transforms)
    parts = [RoundPart(int(i), places, radii, offsets, m, 0xFFFFFFFF) for i, m in zip(ids, transforms, strict=True)]
    return mesh, RoundWorld.of(parts, SHAPES[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_against_the_reference(kind):
    scene = Scene()
    _, world = add(scene, kind, [np.eye(4), TURNED])
    scene.commit()
    origins, directions = rays_at(3000)
    hits = scene.cast_rays(origins, directions, fields=FIELDS)
    verdict = judge(world, origins, directions, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not verdict.wrong.any() and verdict.hit.sum() > 300
    occluded = scene.test_occlusions(origins, directions)
    assert not judge_occlusions(world, origins, directions, occluded).wrong.any()
    found = scene.list_intersections(origins[:500], directions[:500])
    counts = scene.count_intersections(origins[:500], directions[:500])
    rays = np.repeat(np.arange(500), counts)
    hits = found.hits
    assert len(rays) == len(hits.t_hit) and (found.ray_splits == np.concatenate([[0], np.cumsum(counts)])).all()
    lists = judge_lists(world, origins[:500], directions[:500], rays, hits.t_hit, hits.instance_ids, hits.primitive_ids)
    assert not lists.wrong.any()


@pytest.mark.parametrize("kind", ["curves", "points"])
@pytest.mark.parametrize("far", [4.0, 1e6])
def test_points_and_normals_of_the_true_surface(kind, far):
    scene = Scene()
    _, world = add(scene, kind, [TURNED])
    scene.commit()
    origins, directions = rays_at(2000, far=far)
    hits = scene.cast_rays(origins, directions, fields=(*FIELDS, "front_face"))
    some = np.flatnonzero(hits.is_hit)[:200]
    assert len(some) > 100
    u, normals, distances = surfaces_at(world, hits.positions[some], hits.instance_ids[some], hits.primitive_ids[some])
    assert np.abs(distances).max() < 1e-12
    assert np.abs(hits.geometric_normals[some] - normals).max() < 1e-6
    assert np.abs(hits.primitive_uvs[some, 0] - u).max() < 1e-5
    assert (hits.primitive_uvs[some, 1] == 0.0).all()
    along = (hits.positions[some] - origins[some]) / directions[some]
    assert np.abs(along - hits.t_hit[some, None]).max() < 1e-3
    facing = (normals * directions[some]).sum(axis=1) < 0.0
    assert (hits.front_face[some] == facing).all()


@pytest.mark.parametrize("kind", KINDS)
def test_ranges(kind):
    scene = Scene()
    _, world = add(scene, kind, [np.eye(4), TURNED])
    scene.commit()
    t_min = np.random.default_rng(8).uniform(0.0, 1.0, 3000).astype(np.float32)
    limits = {"t_min": t_min, "t_max": t_min + np.float32(1.0)}
    hits = scene.cast_rays(*rays_at(3000), **limits)
    assert hits.is_hit.sum() > 300
    verdict = judge(world, *rays_at(3000), hits.t_hit, hits.instance_ids, hits.primitive_ids, **limits)
    assert not verdict.wrong.any() and verdict.ambiguous.sum() < 300
    fronts = scene.cast_rays(*rays_at(3000), **limits, cull="back", fields=("front_face", "t_hit"))
    assert fronts.front_face[fronts.is_hit].all() and fronts.is_hit.sum() <= hits.is_hit.sum()


@pytest.mark.parametrize("kind", KINDS)
def test_audits_say_that_they_do_not_judge_them(kind):
    scene = Scene()
    add(scene, kind, [np.eye(4), TURNED])
    scene.commit()
    audit = scene.cast_rays(*rays_at(3000), audit=1.0).audit
    assert audit.not_judged_count >= scene.cast_rays(*rays_at(3000)).is_hit.sum() > 300
    assert audit.checked_count + audit.not_judged_count == 3000 and len(audit.wrong_rows) == 0
    assert f"{audit.not_judged_count:,} near curves or points not judged" in str(audit)
    assert (audit + audit).not_judged_count == 2 * audit.not_judged_count


def test_audits_judge_triangles_beside_them():
    """A miss of a surely hit triangle is wrong, even near curves; so is a hit of a curve where none can be."""
    scene = Scene()
    add(scene, "curves", [np.eye(4)])
    scene.add_instance(scene.add_mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [(0, 1, 2)]))
    scene.commit()
    origins, directions = np.array([[0.0, 0, 50], [0, 0, 50]]), np.array([[0.0, 0, -1], [1, 0, 0]])
    missed = [np.full(2, np.inf, np.float32), np.full(2, -1, np.int32), np.full(2, -1, np.int32)]
    assert audit_natively(scene, origins, directions, missed)[0].tolist() == [True, False]
    invented = [np.full(2, 1, np.float32), np.zeros(2, np.int32), np.zeros(2, np.int32)]
    assert audit_natively(scene, origins, directions, invented)[0].tolist() == [False, True]


@pytest.mark.parametrize("kind", KINDS)
def test_every_tree_gives_the_same_bits(kind):
    origins, directions = rays_at(2000)
    answers = []
    for build in ("auto", *(BuildConfig(builder=builder) for builder in BUILDERS)):
        for usage in ("static", "changing"):
            scene = Scene()
            add(scene, kind, [np.eye(4), TURNED], build=build, usage=usage)
            scene.commit()
            answers.append(scene.cast_rays(origins, directions, fields=FIELDS))
    for other in answers[1:]:
        for field in FIELDS:
            assert getattr(other, field).tobytes() == getattr(answers[0], field).tobytes(), field


@pytest.mark.parametrize("kind", KINDS)
def test_what_moved_is_a_fresh_scene(kind):
    origins, directions = rays_at(2000)
    random = np.random.default_rng(7)
    scene = Scene()
    mesh, _ = add(scene, kind, [TURNED], usage="deforming")
    scene.commit()
    places, radii, *offsets = cloud() if kind == "points" else fur()
    for changes_radii in (False, False, True, True):
        places = places + random.normal(scale=0.02, size=places.shape).astype(np.float32)
        if changes_radii:  # some get their first radius, some lose it
            radii = np.roll(radii, 1)
        new_radii = radii if changes_radii else None
        if kind == "points":
            scene.update_points(mesh, places, new_radii)
        else:
            scene.update_curves(mesh, places, new_radii)
        report = scene.commit()
        assert report.meshes[0].action == ("rebuilt" if changes_radii and kind == "points" else report.meshes[0].action)
        fresh = Scene()
        if kind == "points":
            other = fresh.add_points(places, radii)
        else:
            other = fresh.add_curves(places, radii, *offsets, shape=SHAPES[kind])
        fresh.add_instance(other, TURNED)
        fresh.commit()
        hits, expected = (s.cast_rays(origins, directions, fields=FIELDS) for s in (scene, fresh))
        for field in FIELDS:
            assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field


@pytest.mark.parametrize("kind", KINDS)
def test_closest_points(kind):
    """As far away as the nearest of all surfaces, in an instance that keeps distances."""
    turn = np.array([[0.6, -0.8, 0.0, 0.2], [0.8, 0.6, 0.0, -0.1], [0.0, 0.0, 1.0, 0.4], [0.0, 0.0, 0.0, 1.0]])
    scene = Scene()
    _, world = add(scene, kind, [turn])
    scene.commit()
    points = np.random.default_rng(9).uniform(-1.5, 1.5, (100, 3))
    nearest = scene.compute_closest_points(points)
    numbers = np.unique(world.primitive_ids)
    all_pairs = np.repeat(points, len(numbers), axis=0), np.zeros(100 * len(numbers), np.int32), np.tile(numbers, 100)
    distances = np.maximum(surfaces_at(world, *all_pairs)[2].reshape(100, -1), 0.0)
    assert np.abs(nearest.distances - distances.min(axis=1)).max() < 1e-7
    named = np.searchsorted(numbers, nearest.primitive_ids)
    assert np.abs(distances[np.arange(100), named] - nearest.distances).max() < 1e-7
    outside = nearest.distances > 0.0
    u, _, off = surfaces_at(
        world, nearest.points[outside], nearest.instance_ids[outside], nearest.primitive_ids[outside]
    )
    assert np.abs(off).max() < 1e-7
    assert np.abs(u - nearest.primitive_uvs[outside, 0]).max() < 1e-4
    assert (nearest.points[~outside] == points[~outside]).all()


def test_walks_name_curves():
    scene = Scene()
    _, world = add(scene, "curves", [TURNED])
    scene.commit()
    origins, directions = rays_at(50)
    hits = scene.cast_rays(origins, directions)
    for row in np.flatnonzero(hits.is_hit)[:5]:
        walk = scene.walk_ray(origins[row], directions[row])
        assert hits.primitive_ids[row] in walk.primitive_ids
        assert walk.primitive_ids.max() <= world.primitive_ids.max()


def test_doubles_keep_their_detail_far_away():
    scene = Scene()
    points, radii, offsets = fur(radius=0.001)
    scene.add_instance(scene.add_curves(points.astype(np.float64) + 1e6, radii, offsets))
    scene.commit()
    origin = points[3].astype(np.float64) + 1e6
    hits = scene.cast_rays(origin + (0.0, 1.0, 0.0), np.array([0.0, -1.0, 0.0]), fields=("t_hit", "positions"))
    assert hits.is_hit.all() and abs(float(hits.t_hit) - 1.0) < 0.01


def test_beside_triangles():
    scene = Scene()
    scene.add_instance(scene.add_mesh([[-5, -5, 0], [5, -5, 0], [0, 5, 0]], [[0, 1, 2]]))
    scene.add_instance(scene.add_points([[0, 0, 0]], 1.0))
    curve = scene.add_curves([[0, 0, 3], [1, 0, 3], [3, 0, 3]], 0.25, [0, 3])
    scene.add_instance(curve)
    scene.commit()
    down = np.array([0.0, 0.0, -1.0])
    hits = scene.cast_rays([[0, 0, 9], [2, 0, 9], [0, -3, 9], [0, 0.5, 9]], down, fields=FIELDS)
    assert hits.mesh_ids.tolist() == [2, 2, 0, 1]
    np.testing.assert_allclose(hits.t_hit, [5.75, 5.75, 9.0, 9.0 - 0.75**0.5], rtol=1e-6)
    np.testing.assert_allclose(hits.primitive_uvs[:2, 0], [0.0, 0.75])
    assert scene.count_intersections([0, 0, 9], down) == 5


def test_a_flattened_instance_shows_nothing():
    scene = Scene()
    scene.add_instance(scene.add_points([[0, 0, 0]], 1.0), np.diag([1.0, 1.0, 0.0, 1.0]))
    report = scene.commit()
    assert report.baked_count == 1
    assert not scene.cast_rays([0, 0, 5], [0, 0, -1]).is_hit


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.add_points([[0, 0]], 1.0), "add_points: centers must have shape (V, 3)"),
        (lambda s: s.add_points([[0, 0, np.nan]], 1.0), "add_points: centers[0] must be finite"),
        (lambda s: s.add_points([[0, 0, 0]], -1.0), "add_points: radii[0] must be at least 0"),
        (lambda s: s.add_points([[0, 0, 0]], np.nan), "add_points: radii[0] must be at least 0"),
        (lambda s: s.add_points([[0, 0, 0]], [1.0, 2.0]), "add_points: radii must have shape (1,) or be one number"),
        (lambda s: s.add_points([[0, 0, 0]], 1.0, usage="often"), "add_points: usage must be"),
        (lambda s: s.add_points([[0, 0, 0]], 1.0, build="best"), "add_points: build must be"),
        (lambda s: s.add_curves(np.zeros((3, 3)), 1.0, [0, 2]), "add_curves: curve_offsets must end with"),
        (lambda s: s.add_curves(np.zeros((3, 3)), 1.0, [1, 3]), "add_curves: curve_offsets must begin with 0"),
        (lambda s: s.add_curves(np.zeros((3, 3)), 1.0, [0, 2, 3]), "add_curves: curve_offsets[2] must be at least 2"),
        (lambda s: s.add_curves(np.zeros((3, 3)), 1.0, []), "add_curves: curve_offsets must begin with 0"),
        (lambda s: s.add_curves(np.zeros((3, 3)), 1.0, [0.0, 3.0]), "add_curves: curve_offsets must hold integers"),
        (lambda s: s.add_curves(np.zeros((2, 3)), 1.0, [0, 2], kind="nurbs"), "add_curves: kind must be one of poly"),
        (
            lambda s: s.add_curves(np.zeros((2, 3)), 1.0, [0, 2], shape="flat"),
            "add_curves: shape must be one of round, ribbon; got 'flat'",
        ),
        (
            lambda s: s.replace_curves(1, np.zeros((2, 3)), 1.0, [0, 2], shape=None),
            "replace_curves: shape must be one of round, ribbon; got None",
        ),
        (lambda s: s.update_points(0, np.zeros((3, 3))), "update_points: centers has 3 rows but there are 2"),
        (lambda s: s.update_points(0, np.zeros((2, 3)), [-1, 1]), "update_points: radii[0]"),
        (lambda s: s.update_points(1, np.zeros((2, 3))), "update_points: mesh 1 must have points, but has curves"),
        (lambda s: s.update_curves(1, np.full((2, 3), np.inf)), "update_curves: points[0] must be finite"),
        (lambda s: s.update_curves(9, np.zeros((2, 3))), "update_curves: there is no mesh with id 9"),
        (lambda s: s.update_mesh(1, np.zeros((2, 3))), "update_mesh: mesh 1 must have triangles, but has curves"),
        (lambda s: s.replace_mesh(0, np.zeros((3, 3)), [[0, 1, 2]]), "replace_mesh: mesh 0 must have triangles"),
    ],
)
def test_bad_input_changes_nothing(call, words):
    scene = Scene()
    scene.add_instance(scene.add_points(np.zeros((2, 3)), 1.0))
    scene.add_curves([[0, 0, 0], [1, 0, 0]], 0.1, [0, 2])
    scene.commit()
    with pytest.raises(ValueError, match=re.escape(words)):
        call(scene)
    assert scene.is_current and scene.mesh_count == 2


def test_statistics_and_images_know_them():
    scene = Scene()
    add(scene, "curves", [np.eye(4)])
    scene.commit()
    scene.add_points(*cloud())
    scene.commit()
    row, points = scene.statistics(detailed=True).meshes
    assert (points.primitive_count, points.left_out_count, row.left_out_count) == (171, 29, 0)
    assert row.primitive_count == 240 and row.epo is None
    camera = perfect_bvh.Camera.look_at((0.0, -4.0, 1.0), (0.0, 0.0, 0.4))
    for mode in ("clay", "normal", "wireframe", "preview"):
        image = perfect_bvh.render(scene, camera, mode=mode, size=(32, 24))
        assert np.isfinite(image).all() and image.std() > 0.0, mode


@pytest.mark.parametrize("kind", ["points", "poly", "catmull_rom"])
@pytest.mark.parametrize("steps", [1, 2])
def test_one_radius_may_be_given_for_all_steps(kind: str, steps: int) -> None:
    scene = Scene()
    places = np.random.default_rng(3).normal(size=(6, 3))
    mesh = scene.add_points(places, 0.2) if kind == "points" else scene.add_curves(places, 0.2, [0, 3, 6], kind=kind)
    move = scene.set_points_motion if kind == "points" else scene.set_curves_motion
    scene.add_instance(mesh)
    towards = np.array([0.0, 0.0, -1.0])
    hits = []
    for radii in (0.1, np.full(6, 0.1), np.full((steps, 6), 0.1)):
        move(mesh, np.stack([places] * steps), radii)
        scene.commit()
        hits.append(scene.cast_rays(places - 50.0 * towards, towards).t_hit)
    np.testing.assert_array_equal(hits[0], hits[1])
    np.testing.assert_array_equal(hits[0], hits[2])
    for wrong in (np.full((6, 1), 0.1), np.full((2, 3), 0.1)):
        with pytest.raises(ValueError, match=rf"set_(points|curves)_motion: radii must have shape \({steps}, 6\)"):
            move(mesh, np.stack([places] * steps), wrong)
    with pytest.raises(ValueError, match="time_range"):
        move(mesh, np.stack([places] * steps), 0.1, (1.0, 0.0))
