"""Attributes of curves and points: uvs and materials of a whole one, and between the control points of a curve."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from perfect_bvh import Appearance, Camera, InstanceTable, MaterialTable, MeshAppearance, Scene, render_passes

SIZE = (64, 36)
CAMERA = Camera(window=(-1.0, 1.0, -0.5625, 0.5625))
STRANDS, KEYS = 4, 5
OFFSETS = np.arange(0, STRANDS * KEYS + 1, KEYS, dtype=np.int64)
X = np.linspace(-1.2, 1.2, STRANDS)
Y = np.array([-1.0, -0.4, 0.1, 0.3, 1.0])


def strand_points() -> np.ndarray:
    """Upright, side by side, three units before the camera; the first and the last key of a strand are far apart."""
    points = np.empty((STRANDS, KEYS, 3))
    points[..., 0], points[..., 1], points[..., 2] = X[:, None], Y, -3.0
    return points.reshape(-1, 3)


def scene_of(kind: str) -> Scene:
    scene = Scene()
    if kind == "points":
        radii = np.array([0.3, 0.0, 0.3, 0.3])  # the second is left out and keeps its number
        mesh = scene.add_points(np.stack([X, 0 * X, 0 * X - 3.0], axis=1), radii)
    else:
        segments: dict[str, Any] = {} if kind == "poly" else {"segments": 8}
        mesh = scene.add_curves(strand_points(), 0.2, OFFSETS, kind=kind, **segments)
    scene.add_instance(mesh)
    scene.commit()
    return scene


def seen(scene: Scene, mesh: MeshAppearance, *passes: str, **tables: Any) -> dict[str, np.ndarray]:
    look = Appearance(meshes={0: mesh}, **tables)
    return render_passes(scene, CAMERA, mode="uv", size=SIZE, appearance=look, passes=("combined", *passes))


@pytest.mark.parametrize("kind", ["points", "poly", "catmull_rom"])
def test_a_whole_one_has_one_place(kind: str) -> None:
    uvs = np.random.default_rng(1).random((STRANDS, 2)).astype(np.float32)
    found = seen(scene_of(kind), MeshAppearance(corner_uvs=uvs), "primitive")
    inside = found["combined"][..., 3] > 0.0
    columns = np.broadcast_to(np.arange(SIZE[0]), inside.shape)[inside]
    nearest = np.abs(X[:, None] / 3.0 - ((columns + 0.5) / SIZE[0] * 2.0 - 1.0)).argmin(axis=0)
    np.testing.assert_array_equal(found["combined"][inside][:, :2], uvs[nearest])
    assert len(np.unique(nearest)) == (STRANDS - 1 if kind == "points" else STRANDS)


def test_between_control_points_values_go_straight() -> None:
    uvs = np.stack([strand_points()[:, 1], np.repeat(np.arange(STRANDS), KEYS)], axis=1).astype(np.float32)
    scene = scene_of("poly")
    found = seen(scene, MeshAppearance(corner_uvs=uvs, curve_offsets=OFFSETS), "depth")["combined"]
    rows, columns = np.nonzero(found[..., 3] > 0.0)
    directions = np.stack(
        [(columns + 0.5) / SIZE[0] * 2.0 - 1.0, 0.5625 - (rows + 0.5) / SIZE[1] * 1.125, -np.ones(len(rows))], axis=1
    )
    hits = scene.cast_rays(np.zeros(3), directions, fields=("t_hit", "primitive_uvs", "primitive_ids"))
    spans = hits.primitive_uvs[:, 0] * (KEYS - 1)
    expected = np.interp(spans, np.arange(KEYS), Y)
    np.testing.assert_allclose(found[rows, columns, 0], expected, atol=1e-4)
    np.testing.assert_array_equal(found[rows, columns, 1], hits.primitive_ids)
    assert np.ptp(expected) > 1.0


@pytest.mark.parametrize("kind", ["points", "catmull_rom"])
def test_each_has_its_material(kind: str) -> None:
    table = InstanceTable(
        ids=np.zeros(1, np.int32),
        slot_offsets=np.array([0, 2], np.int32),
        slot_materials=np.array([0, 1], np.int32),
        object_indices=np.zeros(1, np.int32),
        holdout=np.zeros(1, bool),
    )
    materials = MaterialTable(np.ones((2, 4), np.float32), np.array([11, 12], np.int32))
    slots = np.array([0, 1, 1, 5], np.int32)
    mesh = MeshAppearance(material_slots=slots, corner_uvs=np.zeros((STRANDS, 2), np.float32))
    found = seen(scene_of(kind), mesh, "material_index", instances=table, materials=materials)
    middle = found["material_index"][SIZE[1] // 2]
    columns = ((X / 3.0 + 1.0) * 0.5 * SIZE[0]).astype(int)
    assert middle[columns].tolist() == [11, 0 if kind == "points" else 12, 12, 12]


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (MeshAppearance(corner_uvs=np.zeros((3, 2), np.float32)), "corner_uvs has 3 rows but the mesh has 4 curves"),
        (
            MeshAppearance(corner_uvs=np.zeros((7, 2), np.float32), curve_offsets=OFFSETS),
            "has 7 rows but the mesh has 4 curves and 20 control points",
        ),
        (MeshAppearance(corner_uvs=np.zeros((4, 3, 2), np.float32)), "has 12 rows but the mesh has 4 curves"),
        (
            MeshAppearance(corner_uvs=np.zeros((4, 2), np.float32), curve_offsets=OFFSETS[:-1]),
            "curve_offsets has 3 rows but the mesh has 4 curves",
        ),
        (
            MeshAppearance(curve_offsets=np.array([0, 1, 2])),
            "curve_offsets must rise from 0 by 2 or more, got 1 in row 1",
        ),
        (
            MeshAppearance(
                corner_uvs=np.zeros((20, 2), np.float32), curve_offsets=np.array([0, 2**63 - 1, -(2**63) + 1, 20])
            ),
            "curve_offsets must rise from 0 by 2 or more, got -9223372036854775807 in row 2",
        ),
    ],
)
def test_what_does_not_fit_is_refused(mesh: MeshAppearance, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        seen(scene_of("poly"), mesh)
