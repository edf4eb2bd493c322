"""Curves over control points: the distance of their chains from the true curves, and chains of moving curves."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from perfect_bvh import EngineError, Scene

KINDS = ("poly", "catmull_rom", "bezier", "b_spline")
CUBICS = KINDS[1:]
FIELDS = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs", "geometric_normals")
# Of a span's four control values, the cubic's coefficients of 1, t, t^2, t^3.
BASES = {
    "catmull_rom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2,
    "bezier": np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]),
    "b_spline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6,
}


def points_of(kind: str, curves: int = 12, seed: int = 5, bend: float = 0.3) -> tuple[np.ndarray, ...]:
    """points, radii, curve_offsets: open curves, each of another number of points."""
    random = np.random.default_rng(seed)
    counts = [4 + 3 * (curve % 3) for curve in range(curves)]
    points = [
        random.uniform(-1.0, 1.0, 3) + np.cumsum(random.normal(scale=bend, size=(count, 3)) + (0.0, 0.0, 0.2), axis=0)
        for count in counts
    ]
    radii = [np.linspace(0.06, 0.02, count) * random.uniform(0.9, 1.1, count) for count in counts]
    return np.concatenate(points), np.concatenate(radii), np.concatenate([[0], np.cumsum(counts)])


def spans_of(kind: str, rows: np.ndarray) -> np.ndarray:
    """(S, 4, ...) control values of the spans of one open curve."""
    if kind == "bezier":
        return np.stack([rows[i : i + 4] for i in range(0, len(rows) - 1, 3)])
    if kind == "catmull_rom":
        rows = np.concatenate([rows[:1], rows, rows[-1:]])
    return np.stack([rows[i : i + 4] for i in range(len(rows) - 3)])


def true_curve(kind: str, rows: np.ndarray, u: np.ndarray) -> np.ndarray:
    """The curve at u, 0 to 1 over all its spans, in double precision."""
    if kind == "poly":
        place = u * (len(rows) - 1)
        first = np.minimum(place.astype(int), len(rows) - 2)
        share = (place - first).reshape(-1, *[1] * (rows.ndim - 1))
        return rows[first] * (1 - share) + rows[first + 1] * share
    spans = spans_of(kind, rows)
    place = u * len(spans)
    span = np.minimum(place.astype(int), len(spans) - 1)
    powers = (place - span)[:, None] ** np.arange(4)
    weights = powers @ BASES[kind]
    return np.einsum("nk,nk...->n...", weights, spans[span])


def rays_at(count: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= 6.0 / np.linalg.norm(origins, axis=1)[:, None]
    return origins, random.uniform((-1, -1, -0.5), (1, 1, 2.5), (count, 3)) - origins


def scene_of(kind: str, shape: tuple[np.ndarray, ...], **options: Any) -> tuple[Scene, int]:
    scene = Scene()
    mesh = scene.add_curves(*shape, kind=kind, **options)
    scene.add_instance(mesh)
    scene.commit()
    return scene, mesh


def segment_count(scene: Scene) -> int:
    return scene.statistics(detailed=True).meshes[0].primitive_count


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tolerance", [0.01, 0.0005])
def test_hits_are_as_near_the_true_curve_as_the_tolerance_says(kind, tolerance):
    points, radii, offsets = points_of(kind)
    scene, _ = scene_of(kind, (points, radii, offsets), tolerance=tolerance)
    origins, directions = rays_at(4000)
    hits = scene.cast_rays(origins, directions, fields=(*FIELDS, "positions"))
    assert hits.is_hit.sum() > 200
    found = set()
    for curve in np.unique(hits.primitive_ids[hits.is_hit]):
        rows = np.flatnonzero(hits.is_hit & (hits.primitive_ids == curve))
        own = slice(offsets[curve], offsets[curve + 1])
        u = np.linspace(0.0, 1.0, 20001)
        centres, sizes = true_curve(kind, points[own], u), np.maximum(true_curve(kind, radii[own], u), 0.0)
        away = np.linalg.norm(hits.positions[rows][:, None] - centres, axis=2) - sizes
        assert np.abs(away.min(axis=1)).max() <= tolerance + 1e-6  # how finely the true curve is looked at comes on top
        # The same place along the curve as along the chain, except for the detail that the chain leaves out.
        at = true_curve(kind, points[own], hits.primitive_uvs[rows, 0].astype(np.float64))
        size = np.abs(true_curve(kind, radii[own], hits.primitive_uvs[rows, 0].astype(np.float64)))
        assert np.abs(np.linalg.norm(hits.positions[rows] - at, axis=1) - size).max() <= 0.02 + 3 * tolerance
        found.add(int(curve))
    assert len(found) > 6


@pytest.mark.parametrize("kind", CUBICS)
def test_a_finer_tolerance_takes_more_pieces(kind):
    shape = points_of(kind)
    counts = [segment_count(scene_of(kind, shape, tolerance=limit)[0]) for limit in (1.0, 0.1, 0.01, 0.001)]
    assert counts[0] < counts[2] < counts[3] and counts == sorted(counts)
    by_default = segment_count(scene_of(kind, shape)[0])
    assert by_default == segment_count(scene_of(kind, shape, tolerance=0.1 * shape[1].mean())[0])


@pytest.mark.parametrize("kind", CUBICS)
def test_chains_are_polys_of_the_same_balls(kind):
    points, radii, offsets = (column.astype(np.float32) for column in points_of(kind))
    offsets = offsets.astype(np.int64)
    scene, _ = scene_of(kind, (points, radii, offsets), segments=3)
    balls, sizes, starts = [], [], [0]
    for first, end in pairwise(offsets):
        count = 3 * len(spans_of(kind, points[first:end])) + 1
        u = np.arange(count) / (count - 1)
        balls.append(true_curve(kind, points[first:end].astype(np.float64), u))
        sizes.append(true_curve(kind, radii[first:end].astype(np.float64), u))
        starts.append(starts[-1] + count)
    chains = np.concatenate(balls).astype(np.float32), np.concatenate(sizes).astype(np.float32), np.array(starts)
    poly, _ = scene_of("poly", chains)
    hits, expected = (one.cast_rays(*rays_at(3000), fields=FIELDS) for one in (scene, poly))
    assert expected.is_hit.sum() > 200 and segment_count(scene) == segment_count(poly)
    # Except for balls whose last digit rounds differently because sums are in another order.
    assert (hits.primitive_ids != expected.primitive_ids).sum() <= 2
    assert (hits.t_hit == expected.t_hit).sum() > 0.99 * len(hits.t_hit)
    both = hits.is_hit & expected.is_hit
    np.testing.assert_allclose(hits.t_hit[both], expected.t_hit[both], rtol=1e-5)
    np.testing.assert_allclose(hits.primitive_uvs[both], expected.primitive_uvs[both], atol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_cyclic_curves_return_to_where_they_begin(kind):
    angles = np.arange(12) / 12 * 2 * np.pi
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(12)], axis=1)
    scene, _ = scene_of(kind, (ring, 0.1, [0, 12]), cyclic=True)
    around = (np.arange(360) + 0.5) / 360 * 2 * np.pi
    directions = np.stack([np.cos(around), np.sin(around), np.zeros(360)], axis=1)
    hits = scene.cast_rays(np.zeros(3), directions, fields=("t_hit", "primitive_uvs"))
    assert hits.is_hit.all()
    open_ring, _ = scene_of(kind, (ring[: 10 if kind == "bezier" else 12], 0.1, [0, 10 if kind == "bezier" else 12]))
    assert not open_ring.cast_rays(np.zeros(3), directions).is_hit.all()
    mixed = Scene()
    mesh = mixed.add_curves(np.concatenate([ring, ring + (0, 0, 1)]), 0.1, [0, 12, 24], cyclic=[True, False])
    mixed.add_instance(mesh)
    mixed.commit()
    assert segment_count(mixed) == 23


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("limit", [{"segments": 4}, {"tolerance": 0.01}, {}])
def test_what_moved_is_within_the_tolerance(kind, limit):
    """By the bits of fresh scenes where each has as many segments, else judged against the true curve."""
    points, radii, offsets = points_of(kind, bend=0.1)
    scene, mesh = scene_of(kind, (points, radii, offsets), usage="deforming", **limit)
    origins, directions = rays_at(2000)
    random = np.random.default_rng(9)
    for step in range(4):
        points = points + random.normal(scale=0.02, size=points.shape)
        radii = radii * 1.1 if step == 2 else radii
        scene.update_curves(mesh, points, radii if step == 2 else None)
        assert not scene.is_current
        report = scene.commit()
        fresh, _ = scene_of(kind, (points, radii, offsets), **limit)
        hits, expected = (one.cast_rays(origins, directions, fields=FIELDS) for one in (scene, fresh))
        if "segments" in limit or kind == "poly":
            assert report.meshes[0].action != "built"
            for field in FIELDS:
                assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field
        elif limit:
            assert segment_count(scene) >= segment_count(fresh)
            both = hits.is_hit & expected.is_hit & (hits.primitive_ids == expected.primitive_ids)
            assert both.sum() > 0.95 * expected.is_hit.sum()


@pytest.mark.parametrize("kind", CUBICS)
def test_curves_that_bend_more_get_more_pieces(kind):
    points, radii, offsets = points_of(kind, bend=0.02)
    scene, mesh = scene_of(kind, (points, radii, offsets), tolerance=0.002, usage="deforming")
    before = segment_count(scene)
    bent, _, _ = points_of(kind, bend=0.5)
    scene.update_curves(mesh, bent)
    report = scene.commit()
    assert report.meshes[0].action == "rebuilt"
    after = segment_count(scene)
    fresh, _ = scene_of(kind, (bent, radii, offsets), tolerance=0.002)
    assert after == segment_count(fresh) > before
    scene.update_curves(mesh, points)  # straight again: the number of segments stays
    scene.commit()
    assert segment_count(scene) == after


@pytest.mark.parametrize("kind", ["curves", "points"])
def test_others_in_their_place(kind):
    scene = Scene()
    points, radii, offsets = points_of("catmull_rom")
    others, sizes, starts = points_of("b_spline", curves=5, seed=8)
    if kind == "points":
        mesh = scene.add_points(points, radii)
    else:
        mesh = scene.add_curves(points, radii, offsets, kind="catmull_rom")
    scene.add_instance(mesh)
    scene.commit()
    fresh = Scene()
    if kind == "points":
        scene.replace_points(mesh, others, sizes)
        fresh.add_instance(fresh.add_points(others, sizes))
    else:
        scene.replace_curves(mesh, others, sizes, starts, kind="b_spline", segments=3)
        fresh.add_instance(fresh.add_curves(others, sizes, starts, kind="b_spline", segments=3))
    scene.commit(), fresh.commit()
    hits, expected = (one.cast_rays(*rays_at(2000), fields=FIELDS) for one in (scene, fresh))
    assert expected.is_hit.sum() > 20
    for field in FIELDS:
        assert getattr(hits, field).tobytes() == getattr(expected, field).tobytes(), field


def test_the_former_name_of_segments_works_and_is_deprecated() -> None:
    scene, curve = Scene(), (np.eye(4, 3), 0.1, [0, 4])
    for call in (scene.add_curves, lambda *rest, **named: scene.replace_curves(0, *rest, **named)):
        with pytest.warns(DeprecationWarning, match="curves: pieces is now called segments"):
            call(*curve, kind="b_spline", pieces=5)
        with pytest.raises(ValueError, match="segments and pieces are the same"):
            call(*curve, kind="b_spline", pieces=5, segments=5)
    scene.add_instance(0)
    scene.commit()
    assert segment_count(scene) == 5


def test_a_poly_in_a_cubic_s_place_moves_as_one():
    """Nothing is left of how the curves were divided before."""
    scene, mesh = scene_of("catmull_rom", points_of("catmull_rom"))
    scene.replace_curves(mesh, [[0, 0, 0], [1, 0, 0]], 0.1, [0, 2])
    scene.update_curves(mesh, [[0, 0, 1], [1, 0, 1]])
    scene.commit()
    assert segment_count(scene) == 1
    assert scene.cast_rays([0.5, 0, 5], [0, 0, -1]).t_hit == np.float32(3.9)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], kind="nurbs"), "add_curves: kind must be one of poly,"),
        (lambda s: s.add_curves(np.zeros((5, 3)), 1.0, [0, 5], kind="bezier"), "curve 0 must have 3 n + 1 points"),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 1, 4], kind="catmull_rom"), "curve 0 must have 2 points"),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 3], kind="catmull_rom"), "must go from 0 to the number"),
        (lambda s: s.add_curves(np.full((4, 3), np.nan), 1.0, [0, 4], kind="b_spline"), "points[0] must be finite"),
        (lambda s: s.add_curves(np.zeros((4, 3)), -1.0, [0, 4], kind="b_spline"), "radii[0] must be at least 0"),
        (
            lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], tolerance=0.0),
            "tolerance must be a number above 0",
        ),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], tolerance=np.nan), "tolerance must be a number"),
        (
            lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], segments=0),
            "segments must be an integer from 1",
        ),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], segments=2.5), "segments must be an integer"),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], segments=2, tolerance=1.0), "exclude each other"),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], cyclic=[True, False]), "cyclic must have shape (1,)"),
        (lambda s: s.add_curves(np.zeros((4, 3)), 1.0, [0, 4], cyclic=2), "cyclic must be True, False"),
        (lambda s: s.update_curves(0, np.zeros((3, 3))), "update_curves: points must have 5 rows, as many as before"),
        (lambda s: s.update_curves(0, np.full((5, 3), np.inf)), "update_curves: points[0] must be finite"),
        (lambda s: s.update_curves(0, np.zeros((5, 3)), [1.0, 2.0]), "update_curves: radii must have shape (5,)"),
        (lambda s: s.replace_curves(1, np.zeros((2, 3)), 1.0, [0, 2]), "mesh 1 must have curves, but has points"),
        (lambda s: s.replace_points(0, np.zeros((2, 3)), 1.0), "mesh 0 must have points, but has curves"),
        (lambda s: s.replace_curves(7, np.zeros((2, 3)), 1.0, [0, 2]), "replace_curves: there is no mesh with id 7"),
    ],
)
def test_bad_input_changes_nothing(call, words):
    scene, _ = scene_of("catmull_rom", (np.arange(15.0).reshape(5, 3) ** 2, 0.1, [0, 5]))
    scene.add_points(np.zeros((2, 3)), 1.0)
    scene.commit()
    with pytest.raises(ValueError, match=re.escape(words)):
        call(scene)
    assert scene.is_current and scene.mesh_count == 2
    before = segment_count(scene)
    scene.update_curves(0, np.arange(15.0).reshape(5, 3) ** 2)
    scene.commit()
    assert segment_count(scene) == before


def test_an_edit_within_a_commit_s_progress_is_refused():
    """And the edit does not wait for the commit, which waits for the edit."""
    scene, mesh = scene_of("catmull_rom", points_of("catmull_rom"))
    scene.update_curves(mesh, points_of("catmull_rom")[0] * 2)
    refused = []

    def edit(_: float) -> None:
        try:
            scene.update_curves(mesh, points_of("catmull_rom")[0])
        except EngineError as error:
            refused.append(str(error))

    scene.commit(progress=edit)
    assert not refused or "progress callable must not use the scene" in refused[0]
