"""The words and numbers of the tree overlay: for a tree, for a box, and for the meaning of its colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

pytest.importorskip("bpy")

from perfect_bvh_addon.view3d.drawing import ramp_colors, shares
from perfect_bvh_addon.view3d.tree_overlay.tree_lines import (
    Shown,
    describe,
    describe_box,
    format_cost,
    format_share,
    scale_of,
)

SHOWN = Shown(level=3, first_level=3, count=412, total=412, depth=7, sah=38.2, built_sah=31.0)


@pytest.fixture(scope="module")
def boxes() -> perfect_bvh.TreeBoxes:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.soup(900, 1, 0.1)), np.eye(4))
    scene.commit()
    return scene.snapshot().tree_boxes(0)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({}, "Level 3 of 7 - 412 boxes - SAH 38.2 (built: 31.0)"),
        ({"built_sah": 38.21}, "Level 3 of 7 - 412 boxes - SAH 38.2"),
        ({"first_level": 0}, "Levels 0 to 3 of 7 - 412 boxes - SAH 38.2 (built: 31.0)"),
        (
            {"count": 100_000, "total": 262_144, "built_sah": 38.2},
            "Level 3 of 7 - 100,000 of 262,144 boxes - SAH 38.2",
        ),
        ({"level": 0, "first_level": 0, "count": 1, "total": 1}, "Level 0 of 7 - 1 box - SAH 38.2 (built: 31.0)"),
        ({"count": 0, "total": 0}, "No boxes"),
    ],
)
def test_a_tree_is_described(changes: dict[str, float], text: str) -> None:
    assert describe(replace(SHOWN, **changes)) == text


@pytest.mark.parametrize(
    ("cost", "text"),
    [
        (0.0, "0"),
        (0.00123, "0.0012"),
        (0.000069, "0.000069"),
        (0.5, "0.5"),
        (1.0, "1.00"),
        (9.87, "9.87"),
        (38.21, "38.2"),
        (12345.6, "12,346"),
    ],
)
def test_costs_have_three_digits_at_most(cost: float, text: str) -> None:
    assert format_cost(cost) == text


@pytest.mark.parametrize(
    ("share", "text"),
    [(1.0, "100%"), (0.123, "12%"), (0.0123, "1.2%"), (0.00123, "0.12%"), (1e-6, "less than 0.01%"), (0.0, "0%")],
)
def test_shares_are_percentages(share: float, text: str) -> None:
    assert format_share(share) == text


def test_boxes_are_described(boxes: perfect_bvh.TreeBoxes) -> None:
    root = describe_box(boxes, 0, holds="triangle")
    assert root[0] == "Node on level 0: 900 triangles"
    assert root[1] == "Chance of being hit: 100%"
    sah = format_cost(boxes.sah)
    assert root[2] == "Expected nodes and triangles of a ray: 1.00"
    assert root[3] == f"With all below: {sah}, in the whole BVH: {sah} (SAH)"
    row = int(np.flatnonzero(boxes.leaf_sizes > 1)[-1])
    leaf = describe_box(boxes, row, holds="triangle")
    assert leaf[0] == f"Leaf on level {boxes.levels[row]}: {boxes.leaf_sizes[row]} triangles"
    assert leaf[2:] == [f"Expected nodes and triangles of a ray: {format_cost(float(boxes.costs[row]))}"]
    assert describe_box(boxes, row, holds="instance", name="Tree")[0].endswith(": Tree")
    (single,) = np.flatnonzero(boxes.leaf_sizes == 1)[:1]
    assert describe_box(boxes, int(single), holds="instance")[0].endswith(": 1 instance")


def test_the_level_scale_has_a_swatch_for_each_level(boxes: perfect_bvh.TreeBoxes) -> None:
    scale = scale_of(boxes, "LEVEL")
    assert scale.levels == len(scale.labels) == boxes.depth + 1
    places = np.array([place for place, _ in scale.labels])
    drawn = ramp_colors(shares(boxes, "LEVEL"))
    np.testing.assert_array_equal(ramp_colors(places)[boxes.levels], drawn)
    deep = scale_of(replace(boxes, depth=40), "LEVEL")
    assert deep.levels == 0 and deep.labels[-1] == (1.0, "40")


def test_the_cost_scale_tells_the_costs_of_its_colours(boxes: perfect_bvh.TreeBoxes) -> None:
    labels = dict(scale_of(boxes, "COST").labels)
    dearest = float(boxes.costs.max())
    assert labels[1.0] == format_cost(dearest)
    assert labels[0.5] == format_cost(dearest / 100.0)
    assert labels[0.0] == f"\N{LESS-THAN OR EQUAL TO} {format_cost(dearest / 10_000.0)}"
    box = replace(boxes, costs=np.array([dearest, dearest / 100.0, dearest / 1e6], np.float32))
    np.testing.assert_allclose(shares(box, "COST"), (1.0, 0.5, 0.0), atol=1e-6)
    assert scale_of(replace(boxes, costs=np.zeros(3, np.float32)), "COST").labels == ((0.0, "0"),)
    assert scale_of(boxes, "OVERLAP").labels[-1] == (1.0, "100%")
