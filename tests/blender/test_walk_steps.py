"""A ray's walk without a screen: the pixel's ray, its steps and boxes, their counts and costs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.walked_rays import heap, names_in, shown, walk_down  # noqa: E402
from mathutils import Euler  # noqa: E402
from perfect_bvh import WalkEvent  # noqa: E402
from perfect_bvh.calibration import current_calibration  # noqa: E402
from perfect_bvh.ray_walk import BOX_TESTS, TRIANGLE_TESTS  # noqa: E402
from perfect_bvh_addon.sync.appearance import as_camera  # noqa: E402
from perfect_bvh_addon.sync.records import CameraRecord  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_legend import rows_of  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_picture import picture_of  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_steps import (  # noqa: E402
    WalkWords,
    pixel_ray,
    steps_of,
)
from perfect_bvh_addon.view3d.walk.walk_view import written_length  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")
SIZE = (12, 8)


@pytest.fixture
def crowd() -> perfect_bvh.Snapshot:
    return heap()


# The ray of a pixel --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", ["perspective", "orthographic", "equirectangular"])
def test_a_pixels_ray_is_the_one_that_is_traced(crowd: perfect_bvh.Snapshot, projection: Any) -> None:
    matrix = np.array(Euler((0.3, 0.25, 0.2)).to_matrix().to_4x4())
    matrix[:3, 3] = (0.5, -1.0, 6.0)
    window = (-2.0, 2.5, -1.5, 1.0) if projection == "orthographic" else (-0.4, 0.5, -0.3, 0.2)
    record = CameraRecord(matrix, window, projection, 0.7, 50.0)
    names = ("distance", "instance", "primitive", "nodes_visited", "primitives_tested")
    traced = perfect_bvh.render_passes(crowd, as_camera(record), size=SIZE, samples=1, passes=names)
    found = 0
    for row in range(SIZE[1]):
        for column in range(SIZE[0]):
            ray = pixel_ray(record, (column + 0.5) / SIZE[0], 1.0 - (row + 0.5) / SIZE[1])
            assert ray is not None and np.linalg.norm(ray.direction) == pytest.approx(1.0)
            walk = crowd.walk_ray(ray.origin, ray.direction, t_min=ray.t_min, t_max=ray.t_max)
            assert walk.hit_row is None or walk.t[walk.hit_row] == pytest.approx(traced["distance"][row, column], 1e-5)
            hit = -1 if walk.hit_row is None else int(walk.primitive_ids[walk.hit_row])
            cost = traced["nodes_visited"][row, column] + traced["primitives_tested"][row, column]
            found += (hit, walk.cost) == (traced["primitive"][row, column], cost)
    assert found >= SIZE[0] * SIZE[1] - 2  # directions differ in their last bits


def test_nothing_is_seen_beside_a_panorama() -> None:
    record = CameraRecord(np.eye(4), (-1.0, 1.0, -1.0, 1.0), "equirectangular", 0.1, 10.0, (0.25, 0.75, 0.0, 1.0))
    assert pixel_ray(record, 0.1, 0.5) is None
    ray = pixel_ray(record, 0.5, 0.5)
    assert ray is not None
    np.testing.assert_allclose(ray.direction, (0.0, 0.0, -1.0))


# Steps ---------------------------------------------------------------------------------------------------------------


def test_steps_cover_the_walk_and_count_it(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    walk = ray.walk
    assert [row for step in steps for row in step.rows] == list(range(len(walk)))
    last = steps[-1].counters
    assert (last.visits, last.triangles_tested, last.cost) == (walk.nodes_visited, walk.primitives_tested, walk.cost)
    assert last.boxes_tested == last.boxes_hit + last.boxes_missed + int((walk.events == WalkEvent.BOX_PRUNED).sum())
    fields = [name for name in dir(last) if name.split("_")[0] in ("boxes", "triangles", "visits", "cost")]
    for earlier, later in pairwise(steps):
        assert all(getattr(earlier.counters, name) <= getattr(later.counters, name) for name in fields)
    assert rows_of(steps[0].counters, last)[-1].count == f"1 of {walk.cost}"


def test_sentences_tell_what_happens(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    sentences = [step.sentence for step in steps]
    assert sentences[0].startswith("Enters the root box of the top level and tests ")
    assert any(sentence.startswith("Enters the BVH of Ball.") for sentence in sentences)
    assert any("triangles of a leaf at level" in sentence and ": hit at " in sentence for sentence in sentences)
    assert any(sentence.startswith("Drops ") and "behind the hit" in sentence for sentence in sentences)
    row = ray.walk.hit_row
    assert row is not None
    end = f"The nearest hit is Ball.{ray.walk.instance_ids[row]:03} at {ray.walk.t[row]:.4g}"
    assert sentences[-1] == end
    nowhere = WalkWords(ray.walk, {int(ray.walk.instance_ids[row]): "A"}, None)
    assert steps_of(nowhere)[-1].sentence == "The nearest hit is A"
    assert shown(ray, steps).heading == f"Step 1 of {len(steps)}: {sentences[0]}"
    for step in steps[:-1]:
        if ": of " in step.sentence or "inside: " in step.sentence:
            numbers = [int(word) for word in step.sentence.partition("inside: ")[2].split() if word.isdigit()]
            assert sum(numbers) == len(step.rows) - 1


def test_costs_are_those_of_the_visits_and_add_up(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    events, costs, total = ray.walk.events, current_calibration(), steps[-1].counters
    count = {event: int((events == event).sum()) for event in WalkEvent}
    nodes = count[WalkEvent.ENTER_NODE] * costs.node_nanoseconds
    leaves = count[WalkEvent.ENTER_LEAF] * costs.leaf_nanoseconds
    instances = (WalkEvent.ENTER_INSTANCE, WalkEvent.SKIP_INSTANCE)
    entered = sum(count[event] for event in instances) * costs.node_nanoseconds
    assert total.time(*BOX_TESTS) == pytest.approx(nodes, abs=2)  # three kinds are rounded
    assert total.time(*TRIANGLE_TESTS) == pytest.approx(leaves, abs=2)
    assert total.time(*instances) == pytest.approx(entered, abs=1)
    assert total.total_time == pytest.approx(ray.walk.nanoseconds().sum(), abs=5)
    for step in steps:
        rows = rows_of(step.counters, total)
        costs_of_parts, costs_of_wholes = (
            [int(row.cost.partition(" ")[0].replace(",", "")) for row in rows if row.cost and row.is_part == is_part]
            for is_part in (True, False)
        )
        boxes, tested, reached, everything = costs_of_wholes
        assert boxes + tested + reached == everything
        assert sum(costs_of_parts[:3]) == boxes and sum(costs_of_parts[3:]) == tested


def test_boxes_are_stepped_through_one_by_one(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    walk = shown(ray, steps)
    assert walk.row is None and walk.counters is steps[0].counters
    walk.go_to_previous_box()
    assert (walk.index, walk.row) == (0, steps[0].rows.stop - 2), "all but the last"
    walk.go(0)
    walk.go_to_next_box()
    seen, sentences = [], []
    while walk.row is not None:
        seen.append(walk.row)
        sentences.append(walk.heading.partition(": ")[2])
        assert walk.counters.total_time == pytest.approx(ray.walk.nanoseconds()[: walk.row + 1].sum(), abs=5)
        walk.go_to_next_box()
    assert seen == list(range(steps[1].rows.start, len(ray.walk))), "each once, in their order"
    assert walk.index == len(steps) - 1
    walk.go_to_next_box()
    assert walk.index == len(steps) - 1 and walk.row is None
    back = []
    while walk.index or walk.part != 0:
        walk.go_to_previous_box()
        back.append(walk.row)
    assert back == list(range(len(ray.walk)))[::-1]
    walk.go_to_previous_box()
    assert (walk.index, walk.part) == (0, 0)
    walk.go_to_next_step()
    assert (walk.index, walk.part) == (0, None), "the whole that it is of"
    for told in (
        ": missed",
        ", visited later",
        "inside, tested at once",
        ", the nearest so far",
        ", behind the nearer hit at ",
        "Waiting box 1 of ",
    ):
        assert any(told in sentence for sentence in sentences), told


def test_what_is_stepped_through_by_boxes_plays_by_boxes(crowd: perfect_bvh.Snapshot) -> None:
    walk = shown(*walk_down(crowd))
    walk.go(0)
    walk.go_to_next_box()
    walk.play_or_pause()
    walk.go_on()
    assert (walk.index, walk.part) == (1, 1) and walk.is_playing


def test_without_distances_sentences_have_none(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    words = WalkWords(ray.walk, names_in(ray.walk), None)
    told = {words.of_event(step.rows, row) for step in steps for row in step.rows}
    assert not any(" at " in sentence.replace(" at level", "").replace(" at once", "") for sentence in told)
    assert any(sentence.endswith(": begins, behind the nearer hit, pruned") for sentence in told)


def test_a_ray_without_a_hit_and_one_without_anything(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd, 2.9, 2.9)
    assert ray.walk.hit_row is None and steps[-1].sentence == "The ray hits nothing"
    assert ray.exit > 9.0 - 3.0
    empty = perfect_bvh.Scene()
    empty.commit()
    ray, steps = walk_down(empty.snapshot())
    assert len(steps) == 1 and picture_of(ray, steps[0]).hit is None


def test_lengths_are_in_the_scenes_units(scene: Any) -> None:
    assert written_length(scene, 7.25) == "7.25 m"
    scene.unit_settings.scale_length = 0.01
    assert written_length(scene, 7.25) == "7.25 cm"
    scene.unit_settings.system = "NONE"
    assert written_length(scene, 7.25) == "7.25"
