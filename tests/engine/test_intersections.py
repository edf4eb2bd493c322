"""Counting and listing everything that rays meet, against the double-precision oracle and against `cast_rays`."""

from __future__ import annotations

import numpy as np
import perfect_bvh
import pytest
from engine.long_work import rays_through_it, stack
from oracles import meshes
from oracles.brute_force import WorldTriangles, certain_hits
from perfect_bvh.build_config import BUILDERS

SHEAR = np.array([[1.0, 0.7, 0.0, 0.3], [0.0, 0.4, 0.2, -0.2], [0.1, 0.0, 1.9, 0.1], [0.0, 0.0, 0.0, 1.0]])
MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
FLAT = np.diag([1.0, 1.0, 0.0, 1.0])
SPATIAL = perfect_bvh.BuildConfig(builder="spatial", duplication_budget=4.0)


def make_scene(parts, build="auto"):
    """A scene of (mesh, transform, mask) parts, and the same for the oracle."""
    scene, instances = perfect_bvh.Scene(), []
    for (positions, triangles), transform, mask in parts:
        single = positions.astype(np.float32)
        ident = scene.add_instance(scene.add_mesh(single, triangles, build=build), transform, mask)
        instances.append((ident, single, triangles, transform, mask))
    scene.commit()
    return scene, WorldTriangles.of(instances)


def check(scene, world, origins, directions, **limits):
    """Every triangle that is surely met is listed, none that is surely missed is, none twice; sorted; counted."""
    hits, splits = scene.list_intersections(origins, directions, **limits)
    counts = scene.count_intersections(origins, directions, **limits)
    assert splits.dtype == np.int64 and counts.dtype == np.int32
    assert np.array_equal(np.diff(splits), counts) and splits[0] == 0
    rays = np.repeat(np.arange(len(counts)), counts)
    order = np.lexsort((hits.primitive_ids, hits.instance_ids, hits.t_hit, rays))
    assert np.array_equal(hits.t_hit[order], hits.t_hit)
    keys = zip(world.instance_ids.tolist(), world.primitive_ids.tolist(), strict=True)
    row_of = {key: i for i, key in enumerate(keys)}
    rows = [row_of[key] for key in zip(hits.instance_ids.tolist(), hits.primitive_ids.tolist(), strict=True)]
    listed = np.zeros((len(counts), len(world.corners)), np.int32)
    np.add.at(listed, (rays, rows), 1)
    sure, possible, t, bound = certain_hits(world, origins, directions, **limits)
    assert listed.max(initial=0) <= 1, "a triangle was listed twice"
    assert not (sure & (listed == 0)).any(), "a triangle that is surely met was not listed"
    assert not ((listed == 1) & ~possible).any(), "a triangle that is surely missed was listed"
    error = np.abs(hits.t_hit - t[rays, rows])
    assert (error <= np.where(np.isfinite(bound[rays, rows]), bound[rays, rows], np.inf)).all()
    closest = scene.cast_rays(origins, directions, **limits)
    first = splits[:-1][counts > 0]
    assert np.array_equal(closest.is_hit, counts > 0)
    for name in closest.columns:
        assert np.array_equal(closest.columns[name][counts > 0], hits.columns[name][first]), name
    return counts


@pytest.mark.parametrize("build", ["auto", SPATIAL])
@pytest.mark.parametrize("make", [meshes.soup, meshes.slivers])
def test_random_triangles(make, build):
    scene, world = make_scene([(make(500, 1), np.eye(4), 1)], build)
    assert check(scene, world, *meshes.random_rays(1500, 2)).max() > 3


@pytest.mark.parametrize("cull", ["none", "back"])
def test_instances_ranges_masks_and_culling(cull):
    parts = [
        (meshes.soup(150, 1), SHEAR, 1),
        (meshes.soup(150, 1), MIRROR, 2),
        (meshes.sphere(12, 16, 0.6), FLAT, 4),
        (meshes.sphere(12, 16, 0.7), np.eye(4), 8),
    ]
    scene, world = make_scene(parts)
    origins, directions = meshes.random_rays(1500, 3)
    random = np.random.default_rng(4)
    t_min = random.uniform(0.0, 0.5, 1500).astype(np.float32)
    limits = {"t_min": t_min, "t_max": (t_min + random.uniform(0.0, 2.0, 1500)).astype(np.float32)}
    limits |= {"mask": random.integers(0, 16, 1500, dtype=np.uint32)}
    if cull == "none":
        check(scene, world, origins, directions, **limits)
    fronts = scene.count_intersections(origins, directions, **limits, cull="back")
    every, _ = scene.list_intersections(origins, directions, **limits, fields=("front_face",))
    assert fronts.sum() == every.front_face.sum()
    hits, _ = scene.list_intersections(origins, directions, **limits, cull="back", fields=("front_face", "t_hit"))
    assert hits.front_face.all() and len(hits.t_hit) == fronts.sum()


def test_same_for_builders_isas_and_threads():
    mesh = (*meshes.soup(400, 1),)
    origins, directions = meshes.random_rays(4500, 2)
    answers = []
    for builder in BUILDERS[1:]:
        scene, _ = make_scene(
            [(mesh, SHEAR, 1), (mesh, np.eye(4), 1)], perfect_bvh.BuildConfig(builder=builder, duplication_budget=1.0)
        )
        for isa in perfect_bvh.available_isas():
            perfect_bvh.set_active_isa(isa)
            for threads in (1, 2):
                hits, splits = scene.list_intersections(origins, directions, threads=threads)
                counts = scene.count_intersections(origins, directions, threads=threads)
                answers.append([counts, splits, *hits.columns.values()])
        perfect_bvh.set_active_isa("")
    for answer in answers[1:]:
        assert all(first.tobytes() == other.tobytes() for first, other in zip(answers[0], answer, strict=True))


@pytest.mark.parametrize("most", [0, 1, 3, 2**40])
def test_the_nearest_hits(most):
    scene, _ = make_scene([(meshes.soup(500, 1), np.eye(4), 1)])
    rays = meshes.random_rays(2000, 2)
    every, splits = scene.list_intersections(*rays)
    some, some_splits = scene.list_intersections(*rays, max_hits=most)
    counts = np.diff(splits)
    assert np.array_equal(np.diff(some_splits), np.minimum(counts, most))
    place = np.arange(len(every.t_hit)) - np.repeat(splits[:-1], counts)
    for name, column in some.columns.items():
        assert np.array_equal(column, every.columns[name][place < most]), name


def test_shapes():
    scene, _ = make_scene([(meshes.grid(4), np.eye(4), 1)])
    origins = np.zeros((3, 5, 3)) + (0.1, 0.2, 2.0)
    counts = scene.count_intersections(origins, (0.0, 0.0, -1.0))
    assert counts.shape == (3, 5) and (counts == 1).all()
    found = scene.list_intersections(origins, (0.0, 0.0, -1.0))
    assert len(found.ray_splits) == 16 and found.hits.t_hit.shape == (15,)
    assert np.array_equal(found.ray_indices, np.arange(15))
    assert found.hits.geometric_normals.shape == (15, 3)
    single = scene.count_intersections((0.1, 0.2, 2.0), (0.0, 0.0, -1.0))
    assert single.shape == () and single == 1
    hits, splits = scene.list_intersections(np.zeros((0, 3)), (0.0, 0.0, -1.0))
    assert splits.tolist() == [0] and len(hits.t_hit) == 0
    assert scene.count_intersections(np.zeros((0, 3)), (0.0, 0.0, -1.0)).shape == (0,)


def test_batches_in_pieces(monkeypatch):
    """Lists that are copied in pieces equal one copied whole."""
    scene, _ = make_scene([(meshes.soup(300, 1), np.eye(4), 1)])
    origins, directions = (rays.reshape(10, 30, 3) for rays in meshes.random_rays(300, 2))
    whole = scene.list_intersections(origins, directions)
    closest, occluded = scene.cast_rays(origins, directions), scene.test_occlusions(origins, directions)
    for rows in (1, 7, 64):
        monkeypatch.setattr("perfect_bvh._arrays.PIECE_ROWS", rows)
        shares = []
        pieces = scene.list_intersections(
            np.asfortranarray(origins), directions[:, ::-1][:, ::-1], progress=shares.append
        )
        assert np.array_equal(pieces.ray_splits, whole.ray_splits)
        assert all(np.array_equal(pieces.hits.columns[name], whole.hits.columns[name]) for name in whole.hits.columns)
        again = scene.cast_rays(np.asfortranarray(origins), directions)
        assert all(np.array_equal(again.columns[name], closest.columns[name]) for name in closest.columns)
        assert np.array_equal(scene.test_occlusions(np.asfortranarray(origins), directions), occluded)
        assert shares == sorted(shares)
    crossed = scene.cast_rays(origins[:, :1], directions[:1]).t_hit
    monkeypatch.undo()
    assert np.array_equal(crossed, scene.cast_rays(origins[:, :1], directions[:1]).t_hit)


def test_closed_surfaces_are_left_as_often_as_entered():
    """From outside to outside a ray crosses a sphere an even number of times, even through edges and vertices."""
    scene, _ = make_scene([(meshes.sphere(40, 60), np.eye(4), 1)])
    origins, directions = meshes.random_rays(5000, 9)
    outside = np.linalg.norm(origins, axis=1) > 1.0
    hits, splits = scene.list_intersections(origins, directions, fields=("front_face", "t_hit"))
    enters = np.zeros(len(outside), int)
    np.add.at(enters, np.repeat(np.arange(len(outside)), np.diff(splits)), np.where(hits.front_face, 1, -1))
    assert outside.sum() > 1000
    assert (enters[outside] == 0).all()
    assert (enters[np.linalg.norm(origins, axis=1) < 0.99] == -1).all()


def test_wrong_arguments():
    scene, _ = make_scene([(meshes.grid(2), np.eye(4), 1)])
    rays = np.zeros((2, 3)), np.ones((2, 3))
    for wrong in (-1, 1.5, "2"):
        with pytest.raises(ValueError, match=r"list_intersections: max_hits must be .*, got"):
            scene.list_intersections(*rays, max_hits=wrong)
    with pytest.raises(ValueError, match="list_intersections: fields has 'nodes_visited'"):
        scene.list_intersections(*rays, fields=("t_hit", "nodes_visited"))
    with pytest.raises(ValueError, match="list_intersections: unknown field 'depth'"):
        scene.list_intersections(*rays, fields=("depth",))
    scene.add_instance(0)
    for query in (scene.count_intersections, scene.list_intersections):
        with pytest.raises(perfect_bvh.StaleSceneError):
            query(*rays)
    scene.commit()
    for query in (stack().count_intersections, stack().list_intersections):
        with pytest.raises(perfect_bvh.Cancelled):
            query(**rays_through_it(), progress=lambda share: False)


@pytest.mark.parametrize("most", [2**31 - 1, 2**31, 2**40, 2**63 - 1])
def test_a_limit_beyond_any_count_limits_nothing(most: int) -> None:
    scene, _ = make_scene([(meshes.grid(4), np.eye(4), 1)])
    rays = meshes.random_rays(200, 5)
    every, limited = scene.list_intersections(*rays), scene.list_intersections(*rays, max_hits=most)
    assert len(every.hits.t_hit) > 10
    assert np.array_equal(every.ray_splits, limited.ray_splits)
    assert np.array_equal(every.hits.t_hit, limited.hits.t_hit)


@pytest.mark.parametrize("distance", [2.0, 10.0, 100.0])
def test_equal_t_is_ordered_however_far_the_rays_begin(distance: float) -> None:
    quad = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(quad, [(0, 1, 2), (0, 2, 3)])
    first = scene.add_instance(mesh, [[1, 0, 0, 0.3], [0, 1, 0, 0.1], [0, 0, 1, 0]], order=0)
    scene.add_instance(mesh, order=1)
    scene.commit()
    random = np.random.default_rng(0)
    origin = np.array([0.7, 0.4, 1.0]) * distance
    targets = np.concatenate([random.uniform(-0.5, 0.5, (20_000, 2)), np.zeros((20_000, 1))], axis=1)
    directions = (targets - origin) / np.linalg.norm(targets - origin, axis=1, keepdims=True)
    hits, splits = scene.list_intersections(origin, directions, fields=("t_hit", "instance_ids"))
    nearest = hits.t_hit[splits[:-1]]
    is_tie = (np.diff(splits) == 2) & (nearest == hits.t_hit[splits[1:] - 1])
    assert is_tie.sum() > 15_000
    assert (hits.instance_ids[splits[:-1]][is_tie] == first).all()
    assert (scene.cast_rays(origin, directions).instance_ids[is_tie] == first).all()
