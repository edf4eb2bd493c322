"""`Snapshot.tree_boxes()`: the boxes contain their primitives, nest level by level, and add up to the tree's cost."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from oracles import meshes
from perfect_bvh import BuildConfig, TreeBoxes
from perfect_bvh._tuning import with_policy
from perfect_bvh.build_config import BUILDERS

COLUMNS = ("boxes", "levels", "leaf_sizes", "costs", "subtree_costs", "overlaps", "ranges")
FAR = np.array([1e6, -2e6, 3e6])


def snapshot_of(
    mesh: meshes.Mesh, usage: str = "static", build: Literal["auto"] | BuildConfig = "auto"
) -> perfect_bvh.Snapshot:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*mesh, usage=usage, build=build))
    scene.commit()
    return scene.snapshot()


def half_areas(boxes: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    x, y, z = (boxes[:, 1] - boxes[:, 0]).T
    return x * y + y * z + z * x


def find_parents(boxes: TreeBoxes) -> list[int]:
    """For each box below the root, how many nodes of the level above hold it."""
    found = []
    for level in range(1, int(boxes.levels.max()) + 1):
        nodes = boxes.boxes[(boxes.levels == level - 1) & (boxes.leaf_sizes == 0)]
        for lower, upper in boxes.boxes[boxes.levels == level]:
            found.append(int(((nodes[:, 0] <= lower) & (nodes[:, 1] >= upper)).all(axis=1).sum()))
    return found


@pytest.mark.parametrize("build", [name for name in BUILDERS if name != "spatial"])  # which cuts triangles
def test_boxes_nest_and_hold_every_triangle(build: str) -> None:
    positions, triangles = meshes.soup(700, 3, 0.1)
    positions = positions.astype(np.float32)
    boxes = snapshot_of((positions, triangles), build=BuildConfig(builder=build)).tree_boxes(0)
    np.testing.assert_array_equal(boxes.boxes[0], [positions.min(axis=0), positions.max(axis=0)])
    assert (np.diff(boxes.levels) >= 0).all() and boxes.levels[0] == 0
    assert min(find_parents(boxes)) >= 1
    assert boxes.leaf_sizes.sum() == len(triangles)
    leaves = boxes.boxes[boxes.leaf_sizes > 0]
    corners = positions[triangles]
    for lower, upper in zip(corners.min(axis=1), corners.max(axis=1), strict=True):
        assert ((leaves[:, 0] <= lower) & (leaves[:, 1] >= upper)).all(axis=1).any()


def test_costs_are_shares_of_area_and_add_up_to_the_heuristic() -> None:
    snapshot = snapshot_of(meshes.soup(500, 1, 0.1), "changing")  # statistics() measures the same, wide tree of these
    boxes = snapshot.tree_boxes(0)
    areas = half_areas(boxes.boxes)
    np.testing.assert_allclose(boxes.costs, areas / areas[0] * np.maximum(boxes.leaf_sizes, 1), rtol=1e-6)
    assert boxes.costs.sum(dtype=np.float64) == pytest.approx(snapshot.statistics().meshes[0].sah, rel=1e-5)


def test_chances_of_being_hit_are_shares_of_area() -> None:
    boxes = snapshot_of(meshes.soup(500, 1, 0.1)).tree_boxes(0)
    areas = half_areas(boxes.boxes)
    np.testing.assert_allclose(boxes.hit_chances, areas / areas[0], rtol=1e-6)


@pytest.mark.parametrize("build", BUILDERS)
def test_a_level_with_the_leaves_above_is_a_cut(build: str) -> None:
    positions, triangles = meshes.soup(700, 3, 0.1)
    snapshot = snapshot_of((positions, triangles), build=BuildConfig(builder=build))
    whole = snapshot.tree_boxes(0)
    had_leaves_above = 0
    for level in range(whole.depth + 1):
        cut = snapshot.tree_boxes(0, first_level=level, last_level=level, with_leaves_above=True)
        assert cut.levels.max() == level and (np.diff(cut.levels) >= 0).all()
        above = cut.levels < level
        had_leaves_above += above.sum()
        assert (cut.leaf_sizes[above] > 0).all()
        held = [cut.primitives_of(row) for row in range(len(cut))]
        assert sum(map(len, held)) == len(whole.primitives)  # each reference once
        np.testing.assert_array_equal(np.unique(np.concatenate(held)), np.arange(len(triangles)))
        rows = (whole.levels == level) | ((whole.levels < level) & (whole.leaf_sizes > 0))
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name)[rows])
    assert had_leaves_above > 0 or build == "median"  # whose leaves are all on one level here
    np.testing.assert_array_equal(np.sort(whole.levels[whole.leaf_sizes > 0]), np.sort(cut.levels))


def test_boxes_tell_what_they_hold() -> None:
    positions, triangles = meshes.soup(700, 3, 0.1)
    positions = positions.astype(np.float32)
    boxes = snapshot_of((positions, triangles)).tree_boxes(0)
    corners = positions[triangles]
    for row in range(0, len(boxes), 7):
        held = corners[boxes.primitives_of(row)].reshape(-1, 3)
        lower, upper = boxes.boxes[row]
        np.testing.assert_array_equal((lower, upper), (held.min(axis=0), held.max(axis=0)))
    sizes = boxes.ranges[:, 1] - boxes.ranges[:, 0]
    is_leaf = boxes.leaf_sizes > 0
    np.testing.assert_array_equal(sizes[is_leaf], boxes.leaf_sizes[is_leaf])
    assert sizes[0] == len(triangles)


def test_costs_below_add_up() -> None:
    boxes = snapshot_of(meshes.soup(900, 4, 0.1)).tree_boxes(0)
    assert boxes.sah == pytest.approx(boxes.costs.sum(dtype=np.float64), rel=1e-6)
    assert boxes.built_sah == boxes.sah == pytest.approx(float(boxes.subtree_costs[0]), rel=1e-6)
    begins, ends = boxes.ranges.T
    for row in range(len(boxes)):
        is_below = (begins >= begins[row]) & (ends <= ends[row]) & (boxes.levels >= boxes.levels[row])
        assert boxes.subtree_costs[row] == pytest.approx(boxes.costs[is_below].sum(dtype=np.float64), rel=1e-5)


@pytest.mark.parametrize("usage", ["static", "deforming", "changing"])
@pytest.mark.parametrize("count", [1, 9, 900])
def test_the_heuristic_alone_is_that_of_the_boxes(usage: str, count: int) -> None:
    snapshot = snapshot_of(meshes.soup(count, 4, 0.1), usage)
    assert snapshot.tree_sah(0) == pytest.approx(snapshot.tree_boxes(0).sah, rel=1e-12)


def test_the_heuristic_alone_of_trees_without_surface_or_that_are_not_there() -> None:
    line = np.stack([np.arange(60.0), np.zeros(60), np.zeros(60)], axis=1), np.arange(60).reshape(-1, 3)
    assert snapshot_of(line).tree_sah(0) == 20.0  # the number of triangles replaces it
    with pytest.raises(ValueError, match="tree_sah: mesh_id 1 is not in this snapshot"):
        snapshot_of(line).tree_sah(1)


def test_what_refitting_costs_is_told_until_the_tree_is_built_again() -> None:
    positions, triangles = meshes.soup(2000, 6, 0.05)
    scene = with_policy(perfect_bvh.Scene(), "refit")
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit()
    fresh = scene.snapshot().tree_boxes(mesh)
    assert fresh.sah == fresh.built_sah
    scattered = np.random.default_rng(2).permuted(positions.reshape(-1, 3, 3), axis=0).reshape(-1, 3)
    for share in (0.2, 0.4):
        scene.update_mesh(mesh, positions + share * (scattered - positions))
        scene.commit()
        moved = scene.snapshot().tree_boxes(mesh)
        assert moved.built_sah == pytest.approx(fresh.sah, rel=1e-6) and moved.sah > 1.2 * fresh.sah
        assert scene.snapshot().tree_sah(mesh) == pytest.approx(moved.sah, rel=1e-12)
        assert moved.sah == pytest.approx(scene.statistics().meshes[0].sah, rel=1e-5)


def test_a_tree_that_was_built_again_is_as_it_was_built() -> None:
    positions, triangles = meshes.soup(2000, 6, 0.05)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(positions, triangles, usage="deforming")
    scene.add_instance(mesh)
    scene.commit(10**9)
    scattered = np.random.default_rng(2).permuted(positions.reshape(-1, 3, 3), axis=0).reshape(-1, 3)
    scene.update_mesh(mesh, scattered)
    (report,) = scene.commit(10**9).meshes
    assert report.action == "rebuilt" and report.refitted_cost > 0.0  # a refit was tried first
    boxes = scene.snapshot().tree_boxes(mesh)
    assert boxes.built_sah == boxes.sah


def test_the_top_level_tells_what_it_cost_when_it_was_built() -> None:
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.soup(20, 1, 0.1))
    places = meshes.scattered(200, 50.0, 3)
    instances = scene.add_instances(np.full(200, mesh), places)
    scene.commit()
    built = scene.snapshot().tree_boxes()
    assert built.built_sah == pytest.approx(built.sah, rel=1e-6)
    np.testing.assert_array_equal(np.sort(built.primitives), np.sort(instances))
    places[:20, :3, 3] += 3.0
    scene.set_transforms(instances, places)
    report = scene.commit(expected_rays=1)  # too few to pay for another tree
    assert report.top_level.is_refitted
    moved = scene.snapshot().tree_boxes()
    assert moved.built_sah == pytest.approx(built.sah, rel=1e-6)
    assert moved.sah > 1.001 * built.sah


def test_overlaps_are_those_of_siblings() -> None:
    boxes = snapshot_of(meshes.soup(400, 4, 0.3)).tree_boxes(0, first_level=1, last_level=1)
    assert 2 <= len(boxes) <= 8  # the root's children: all of them siblings
    lower, upper = boxes.boxes[:, 0], boxes.boxes[:, 1]
    sizes = np.clip(np.minimum(upper[:, None], upper[None]) - np.maximum(lower[:, None], lower[None]), 0.0, None)
    x, y, z = np.moveaxis(sizes, -1, 0)
    shared = np.where((sizes > 0.0).all(axis=-1), x * y + y * z + z * x, 0.0)
    own = np.diagonal(shared)
    np.testing.assert_allclose(boxes.overlaps, (shared.sum(axis=1) - own) / own, rtol=1e-5)
    assert boxes.overlaps.max() > 0.1


def test_levels_are_slices_of_the_whole() -> None:
    snapshot = snapshot_of(meshes.soup(2000, 5, 0.1))
    whole = snapshot.tree_boxes(0)
    deepest = int(whole.levels.max())
    assert whole.depth == deepest == snapshot.statistics().meshes[0].wide_depth
    for first, last in ((0, 0), (1, 1), (1, 2), (deepest, None), (0, deepest + 5)):
        part = snapshot.tree_boxes(0, first_level=first, last_level=last)
        rows = (whole.levels >= first) & (whole.levels <= (deepest if last is None else last))
        assert part.depth == deepest
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])
    assert len(snapshot.tree_boxes(0, first_level=deepest + 1)) == 0
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(whole.head(3), name), getattr(whole, name)[:3])


def test_meshes_far_away_keep_their_detail() -> None:
    positions, triangles = meshes.soup(300, 7, 0.1)
    near, far = (snapshot_of((place, triangles)).tree_boxes(0) for place in (positions, positions + FAR))
    np.testing.assert_array_equal(far.levels[0], near.levels[0])
    np.testing.assert_allclose(far.boxes[0] - FAR, near.boxes[0], atol=1e-6)


@pytest.mark.parametrize("size", [1e-20, 1e17])
def test_extreme_sizes_come_back_unscaled(size: float) -> None:
    positions, triangles = meshes.soup(100, 2, 0.1)
    positions = positions.astype(np.float32) * np.float32(size)
    snapshot = snapshot_of((positions, triangles))
    for boxes in (snapshot.tree_boxes(0), snapshot.tree_boxes()):
        np.testing.assert_allclose(boxes.boxes[0], [positions.min(axis=0), positions.max(axis=0)], rtol=1e-4)
        assert np.isfinite(boxes.costs).all()


def test_the_top_level_holds_the_instances() -> None:
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(*meshes.soup(20, 1, 0.1))
    places = meshes.scattered(100, 50.0, 3)
    scene.add_instances(np.full(100, mesh), places)
    scene.commit()
    boxes = scene.snapshot().tree_boxes()
    assert boxes.leaf_sizes.sum() == 100
    assert min(find_parents(boxes)) >= 1
    local = scene.snapshot().tree_boxes(mesh, last_level=0).boxes[0]
    expected = local[None] + places[:, None, :3, 3]
    found = boxes.boxes[boxes.leaf_sizes == 1]
    order, other = np.argsort(found[:, 0, 0]), np.argsort(expected[:, 0, 0])
    np.testing.assert_allclose(found[order], expected[other], atol=1e-4)


def test_one_instance_and_nothing() -> None:
    single = snapshot_of(meshes.soup(3, 1, 0.1))
    assert list(single.tree_boxes().leaf_sizes) == [1]
    np.testing.assert_allclose(single.tree_boxes().boxes[0], single.tree_boxes(0).boxes[0], atol=1e-4)
    empty = snapshot_of((np.empty((0, 3)), np.empty((0, 3), int)))
    assert len(empty.tree_boxes()) == len(empty.tree_boxes(0)) == 0
    assert empty.tree_boxes().boxes.shape == (0, 2, 3)


def test_wrong_arguments_are_named() -> None:
    snapshot = snapshot_of(meshes.soup(3, 1, 0.1))
    with pytest.raises(ValueError, match="tree_boxes: mesh_id 7 is not in this snapshot"):
        snapshot.tree_boxes(7)
    with pytest.raises(ValueError, match="0 <= first_level <= last_level, got 3 and 2"):
        snapshot.tree_boxes(0, first_level=3, last_level=2)
    with pytest.raises(ValueError, match="tree_boxes: first_level must be an integer from 0 to 4294967295, got -1"):
        snapshot.tree_boxes(0, first_level=-1)
