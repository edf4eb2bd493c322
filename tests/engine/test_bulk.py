"""The long loops of `perfect_bvh.bulk`, compared with numpy's results."""

from __future__ import annotations

import numpy as np
import pytest
from perfect_bvh import bulk


@pytest.mark.parametrize("count", [0, 1, 1000, 500_000])
def test_equal_arrays(rng: np.random.Generator, count: int) -> None:
    values = rng.normal(size=(count, 3)).astype(np.float32)
    assert bulk.are_equal(values, values)
    assert bulk.are_equal(values, values.copy())
    assert bulk.are_equal(np.asfortranarray(values), values)
    assert not bulk.are_equal(values, values.astype(np.float64)) or count == 0
    assert not bulk.are_equal(values, values[:, :2])
    for row in {0, count // 2, count - 1} if count else ():
        other = values.copy()
        other[row, 2] = np.nextafter(other[row, 2], np.float32(9))
        assert not bulk.are_equal(values, other)


def test_bits_decide() -> None:
    assert not bulk.are_equal(np.float32([0.0]), np.float32([-0.0]))
    assert bulk.are_equal(np.float32([np.nan]), np.float32([np.nan]))
    assert not bulk.are_equal(np.int32([1]), np.uint32([1]))


@pytest.mark.parametrize("parent", [None, "some"])
def test_placed_instances(rng: np.random.Generator, parent: str | None) -> None:
    count = 40_000
    matrix = None if parent is None else rng.normal(size=(4, 4)).astype(np.float32)
    local = rng.normal(size=(count, 4, 4)).astype(np.float32)
    local[:, :, 3] = (0, 0, 0, 1)  # transposed: this is the last row
    local[[7, 39_999], 0, 0] = (np.nan, 1e20)
    placed = np.empty((count, 3, 4), np.float32)
    bad = bulk.place_instances(matrix, local, placed, 1e18)
    expected = (np.eye(4) if matrix is None else matrix.astype(np.float64)) @ local.transpose(0, 2, 1).astype(
        np.float64
    )
    assert bad.tolist() == [7, 39_999]
    good = np.delete(np.arange(count), bad)
    np.testing.assert_allclose(placed[good], expected[good, :3], rtol=1e-4, atol=1e-5)


def test_moved_instances(rng: np.random.Generator) -> None:
    old = rng.normal(size=(50_000, 3, 4)).astype(np.float32)
    rows = rng.permutation(len(old)).astype(np.int32)
    new = old[rows]
    rows[::7] = -1
    new[5::11, 2, 3] += 1
    expected = np.zeros(len(old), np.bool_)
    expected[5::11] = True
    expected[::7] = False
    np.testing.assert_array_equal(bulk.find_moved(old, new, rows), expected)
    assert not bulk.find_moved(old, old).any()
    with pytest.raises(ValueError, match="rows of the old transforms"):
        bulk.find_moved(old[:10], new, rows)


@pytest.mark.parametrize("count", [0, 1, 1000, 500_000])
def test_copies_of_what_is_within_a_limit(rng: np.random.Generator, count: int) -> None:
    values = rng.normal(size=(count, 3)).astype(np.float32)
    copy = np.empty_like(values)
    limit = float(np.abs(values).max(initial=0.0))
    assert bulk.copy_within(values, copy, limit)
    np.testing.assert_array_equal(copy, values)
    for row in {0, count // 2, count - 1} if count else ():
        for wrong in (np.nan, np.inf, -np.inf, np.nextafter(np.float32(-limit), np.float32(-np.inf))):
            other = values.copy()
            other[row, 1] = wrong
            assert not bulk.copy_within(other, copy, limit)
            np.testing.assert_array_equal(copy, other)
    with pytest.raises(ValueError, match="as large as"):
        bulk.copy_within(values, np.empty((count + 1, 3), np.float32), limit)


def test_triangles_by_their_corners(rng: np.random.Generator) -> None:
    corner_verts = rng.integers(0, 9000, 30_000).astype(np.int32)
    corners = rng.integers(0, 30_000, (200_000, 3)).astype(np.int32)
    triangles = corner_verts[corners]
    assert bulk.are_triangles(corner_verts, corners, triangles)
    assert not bulk.are_triangles(corner_verts, corners, triangles[1:])
    for row in (0, 341, 100_000, 199_999):
        other = triangles.copy()
        other[row, 1] += 1
        assert not bulk.are_triangles(corner_verts, corners, other)
    for row, nothing in ((3, 30_000), (100_000, -1), (199_999, -(2**31))):
        outside = corners.copy()
        outside[row, 0] = nothing
        assert not bulk.are_triangles(corner_verts, outside, triangles)
