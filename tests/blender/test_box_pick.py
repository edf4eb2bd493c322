"""Picking the box under the mouse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

pytest.importorskip("bpy")

from perfect_bvh_addon.view3d.tree_overlay.tree_lines import BoxPicker, rows_of_cut

ALONG_X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def boxes() -> perfect_bvh.TreeBoxes:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.soup(2000, 1, 0.1)), np.eye(4))
    scene.commit()
    return scene.snapshot().tree_boxes(0)


def with_boxes(boxes: perfect_bvh.TreeBoxes, *bounds: tuple[object, object]) -> BoxPicker:
    return BoxPicker(replace(boxes, boxes=np.array(bounds, np.float64)), np.arange(len(bounds)))


def entered_first(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> int | None:
    """One box after the other; for rays that begin outside."""
    best, found = np.inf, None
    for row, (lower, upper) in enumerate(corners):
        near, far = np.sort([(lower - origin) / direction, (upper - origin) / direction], axis=0)
        if near.max() <= far.min() and 0.0 < near.max() < best:
            best, found = near.max(), row
    return found


def test_the_box_that_is_entered_first_is_found(boxes: perfect_bvh.TreeBoxes) -> None:
    rows = rows_of_cut(boxes, 3)
    picker = BoxPicker(boxes, rows)
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(200):
        origin = rng.normal(size=3)
        origin *= 5.0 / np.linalg.norm(origin)
        direction = rng.normal(size=3) * 0.5 - origin
        expected = entered_first(boxes.boxes[rows], origin, direction)
        assert picker.nearest(origin, direction) == (None if expected is None else rows[expected])
        found += expected is not None
    assert found > 100


def test_boxes_around_the_eye_come_last(boxes: perfect_bvh.TreeBoxes) -> None:
    around, within, before = ((-9.0,) * 3, (9.0,) * 3), ((-1.0,) * 3, (1.0,) * 3), ((4.0, -1.0, -1.0), (5.0, 1.0, 1.0))
    behind = ((-5.0, -1.0, -1.0), (-4.0, 1.0, 1.0))
    eye = np.zeros(3)
    assert with_boxes(boxes, around, within, before).nearest(eye, ALONG_X) == 2
    assert with_boxes(boxes, around, within).nearest(eye, ALONG_X) == 1
    assert with_boxes(boxes, around).nearest(eye, ALONG_X) == 0
    assert with_boxes(boxes, behind).nearest(eye, ALONG_X) is None


def test_flat_boxes_and_rays_along_faces_are_met(boxes: perfect_bvh.TreeBoxes) -> None:
    flat = with_boxes(boxes, ((2.0, -1.0, 0.0), (3.0, 1.0, 0.0)))
    assert flat.nearest(np.zeros(3), ALONG_X) == 0
    assert flat.nearest(np.array([2.5, 0.0, 4.0]), np.array([0.0, 0.0, -1.0])) == 0
    assert flat.nearest(np.array([0.0, 0.0, 0.1]), ALONG_X) is None
    assert with_boxes(boxes, ((2.0, 0.0, 0.0), (3.0, 1.0, 1.0))).nearest(np.zeros(3), ALONG_X) == 0


def test_what_is_picked_of_all_levels_holds_no_other(boxes: perfect_bvh.TreeBoxes) -> None:
    part = replace(
        boxes, **{name: getattr(boxes, name)[boxes.levels <= 2] for name in ("boxes", "levels", "leaf_sizes", "ranges")}
    )
    ranges = part.ranges[rows_of_cut(part, 2)]
    np.testing.assert_array_equal(np.sort(ranges, axis=0)[1:, 0], np.sort(ranges, axis=0)[:-1, 1])
    assert ranges.min() == 0 and ranges.max() == len(boxes.primitives)
