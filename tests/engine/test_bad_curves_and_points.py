"""Invalid curves and points: a ValueError names the fault and its place, and answers stay the same, bit for bit."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from perfect_bvh import Scene

NAN, INF = np.nan, np.inf
FIELDS = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals")
THREE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)], np.float32)
MESH, POINTS, CURVES, BENT = range(4)  # ids of the scene's meshes and instances


def with_value(value: float, row: int = 2) -> np.ndarray:
    """Three points, one of them with that number."""
    points = THREE.astype(np.float64)
    points[row, 1] = value
    return points


@pytest.fixture
def scene() -> Scene:
    made = Scene()
    made.add_instance(made.add_mesh(THREE, [[0, 1, 2]]))
    made.add_instance(made.add_points(THREE + (0, 0, 1), [0.2, 0.1, 0.0]))
    made.add_instance(made.add_curves(THREE + (0, 0, 2), 0.1, [0, 3]))
    made.add_instance(made.add_curves(THREE + (0, 0, 3), 0.1, [0, 3], kind="catmull_rom"))
    made.commit()
    return made


def answers(scene: Scene) -> list[bytes]:
    random = np.random.default_rng(1)
    targets = random.uniform((-0.1, -0.1, -0.1), (1.1, 1.1, 3.1), (600, 3))
    directions = random.normal(size=(600, 3))
    hits = scene.cast_rays(targets - 9.0 * directions, directions, fields=FIELDS)
    assert len(np.unique(hits.mesh_ids[hits.is_hit])) == 4
    return [getattr(hits, field).tobytes() for field in FIELDS]


# Cases that any function with positions and radii refuses: the positions, the radii, and the words after its name. {}
# is the function's own word for positions.
PLACES_AND_RADII: tuple[tuple[Any, Any, str], ...] = (
    (with_value(NAN), 0.1, "{}[2] must be finite"),
    (with_value(INF), 0.1, "{}[2] must be finite"),
    (with_value(-INF, row=0), 0.1, "{}[0] must be finite"),
    (with_value(2e18), 0.1, "{}[2] must be finite and at most 1e18"),
    (THREE[:, :2], 0.1, "{} must have shape (V, 3)"),
    (THREE[None], 0.1, "{} must have shape (V, 3)"),
    ("abc", 0.1, "{} must hold numbers"),
    (THREE.astype(complex), 0.1, "{} must hold numbers"),
    (THREE, NAN, "radii[0] must be at least 0"),
    (THREE, [0.1, 0.1, NAN], "radii[2] must be at least 0"),
    (THREE, [0.1, INF, 0.1], "radii[1] must be at least 0"),
    (THREE, [0.1, -0.1, 0.1], "radii[1] must be at least 0"),
    (THREE, -1e-30, "radii[0] must be at least 0"),
    (THREE, 1e300, "radii[0] must be at least 0"),
    (THREE, [0.1, 0.1], "radii must have shape (3,) or be one number"),
    (THREE, np.full((3, 1), 0.1), "radii must have shape (3,) or be one number"),
    (THREE, "thin", "radii must hold numbers"),
    (THREE, [None] * 3, "radii must hold numbers"),
)
CALLS: dict[str, tuple[str, Callable[[Scene, Any, Any], Any]]] = {
    "add_points": ("centers", lambda s, p, r: s.add_points(p, r)),
    "add_curves": ("points", lambda s, p, r: s.add_curves(p, r, [0, 3])),
    "update_points": ("centers", lambda s, p, r: s.update_points(POINTS, p, r)),
    "update_curves": ("points", lambda s, p, r: s.update_curves(CURVES, p, r)),
    "replace_points": ("centers", lambda s, p, r: s.replace_points(POINTS, p, r)),
    "replace_curves": ("points", lambda s, p, r: s.replace_curves(CURVES, p, r, [0, 3])),
}
BENT_CALLS: dict[str, tuple[str, Callable[[Scene, Any, Any], Any]]] = {
    "add_curves": ("points", lambda s, p, r: s.add_curves(p, r, [0, 3], kind="b_spline")),
    "update_curves": ("points", lambda s, p, r: s.update_curves(BENT, p, r)),
    "replace_curves": ("points", lambda s, p, r: s.replace_curves(BENT, p, r, [0, 3], kind="bezier", cyclic=True)),
}


@pytest.mark.parametrize(("places", "radii", "words"), PLACES_AND_RADII)
@pytest.mark.parametrize(
    ("name", "what", "call"),
    [(name, *rest) for calls in (CALLS, BENT_CALLS) for name, rest in calls.items()],
)
def test_places_and_radii(
    scene: Scene, name: str, what: str, call: Callable[[Scene, Any, Any], Any], places: Any, radii: Any, words: str
) -> None:
    _assert_refused(scene, lambda: call(scene, places, radii), f"{name}: {words.format(what)}")


# Cases for curves only: the offsets and further arguments, and the words.
OFFSETS: tuple[tuple[Any, dict[str, Any], str], ...] = (
    ([], {}, "curve_offsets must begin with 0"),
    ([1, 3], {}, "curve_offsets must begin with 0"),
    ([-1, 3], {}, "curve_offsets must begin with 0"),
    ([0, 2], {}, "curve_offsets must end with the number of points, 3, got 2"),
    ([0, 4], {}, "curve_offsets must end with the number of points, 3, got 4"),
    ([0, 2, 3], {}, "curve_offsets[2] must be at least 2"),  # a curve of one point
    ([0, 3, 3], {}, "curve_offsets[2] must be at least 2"),  # and of none
    ([0, 3, 0, 3], {}, "curve_offsets[2] must be at least 2"),
    ([0, 2, -(2**63), -1, 3], {}, "curve_offsets[2] must be at least 2"),  # whose differences overflow
    ([0.0, 3.0], {}, "curve_offsets must hold integers"),
    ([0, 2**70], {}, "curve_offsets must hold numbers"),
    (["0", "3"], {}, "curve_offsets must hold numbers"),
    ([0, 3], {"kind": "nurbs"}, "kind must be one of poly"),
    ([0, 3], {"kind": None}, "kind must be one of poly"),
    ([0, 3], {"kind": "bezier"}, "curve 0 must have 3 n + 1 points"),
    ([0, 2, 3], {"kind": "catmull_rom"}, "curve 1 must have 2 points or more, got 1"),
    ([0, 3], {"cyclic": "yes"}, "cyclic must"),
    ([0, 3], {"cyclic": [True, False]}, "cyclic must have shape (1,)"),
    ([0, 3], {"kind": "b_spline", "tolerance": 0.0}, "tolerance must be a number above 0"),
    ([0, 3], {"kind": "b_spline", "tolerance": NAN}, "tolerance must"),
    ([0, 3], {"kind": "b_spline", "segments": 0}, "segments must"),
    ([0, 3], {"kind": "b_spline", "segments": 1025}, "segments must"),
    ([0, 3], {"kind": "b_spline", "segments": 2, "tolerance": 0.1}, "tolerance and segments exclude"),
)


@pytest.mark.parametrize(("offsets", "options", "words"), OFFSETS)
@pytest.mark.parametrize("replaced", [None, CURVES, BENT])
def test_offsets_and_kinds(
    scene: Scene, offsets: Any, options: dict[str, Any], words: str, replaced: int | None
) -> None:
    if replaced is None:
        _assert_refused(scene, lambda: scene.add_curves(THREE, 0.1, offsets, **options), f"add_curves: {words}")
    else:
        _assert_refused(
            scene, lambda: scene.replace_curves(replaced, THREE, 0.1, offsets, **options), f"replace_curves: {words}"
        )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.update_points(CURVES, THREE), "update_points: mesh 2 must have points, but has curves"),
        (lambda s: s.update_points(BENT, THREE), "update_points: mesh 3 must have points, but has curves"),
        (lambda s: s.update_points(MESH, THREE), "update_points: mesh 0 must have points, but has triangles"),
        (lambda s: s.update_curves(POINTS, THREE), "update_curves: mesh 1 must have curves, but has points"),
        (lambda s: s.update_curves(MESH, THREE), "update_curves: mesh 0 must have curves, but has triangles"),
        (lambda s: s.update_mesh(POINTS, THREE), "update_mesh: mesh 1 must have triangles, but has points"),
        (lambda s: s.update_mesh(BENT, THREE), "update_mesh: mesh 3 must have triangles, but has curves"),
        (lambda s: s.replace_mesh(CURVES, THREE, [[0, 1, 2]]), "replace_mesh: mesh 2 must have triangles"),
        (lambda s: s.replace_points(MESH, THREE, 0.1), "replace_points: mesh 0 must have points"),
        (lambda s: s.replace_points(CURVES, THREE, 0.1), "replace_points: mesh 2 must have points"),
        (lambda s: s.replace_curves(MESH, THREE, 0.1, [0, 3]), "replace_curves: mesh 0 must have curves"),
        (
            lambda s: s.replace_curves(POINTS, THREE, 0.1, [0, 3], kind="b_spline"),
            "replace_curves: mesh 1 must have curves",
        ),
        (lambda s: s.update_points(9, THREE), "update_points: there is no mesh with id 9"),
        (lambda s: s.replace_curves(-1, THREE, 0.1, [0, 3]), "replace_curves: "),
        (lambda s: s.update_curves(1.5, THREE), "update_curves: mesh must"),
        (lambda s: s.update_points(POINTS, THREE[:2]), "update_points: centers has 2 rows but there are 3"),
        (lambda s: s.update_curves(CURVES, THREE[:2]), "update_curves: points has 2 rows but there are 3"),
        (
            lambda s: s.update_curves(BENT, THREE[:2]),
            "update_curves: points must have 3 rows, as many as before, got 2",
        ),
        (lambda s: s.remove_mesh(BENT), "remove_mesh: mesh 3 is still used by 1 instances"),
        (lambda s: s.add_points(THREE, 0.1, usage="often"), "add_points: usage must be"),
        (lambda s: s.add_curves(THREE, 0.1, [0, 3], build="best"), "add_curves: build must be"),
    ],
)
def test_meshes_of_another_kind(scene: Scene, call: Callable[[Scene], Any], words: str) -> None:
    _assert_refused(scene, lambda: call(scene), words)


def _assert_refused(scene: Scene, call: Callable[[], Any], words: str) -> None:
    before, counts = answers(scene), (scene.mesh_count, scene.instance_count)
    with pytest.raises(ValueError, match=re.escape(words)):
        call()
    assert scene.is_current and (scene.mesh_count, scene.instance_count) == counts
    scene.commit()  # nothing is kept for later either
    assert answers(scene) == before
    bent = THREE + (0.5, 0, 3)
    scene.update_curves(BENT, bent)  # the curve's own numbers are unchanged
    scene.commit()
    fresh = Scene()
    fresh.add_instance(fresh.add_curves(bent, 0.1, [0, 3], kind="catmull_rom"))
    fresh.commit()
    rays = np.random.default_rng(2).uniform((0, -0.2, 8), (2, 1.2, 8), (200, 3)), (0, 0, -1)
    hits, expected = (one.cast_rays(*rays, t_max=5.5).t_hit for one in (scene, fresh))
    assert hits.tobytes() == expected.tobytes() and np.isfinite(expected).any()
