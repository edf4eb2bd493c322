"""A ray's walk without a screen: the drawing and the text of each step."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.walked_rays import heap, walk_down  # noqa: E402
from perfect_bvh import WalkEvent  # noqa: E402
from perfect_bvh_addon.view3d import drawing  # noqa: E402
from perfect_bvh_addon.view3d.walk import walk_legend  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_legend import rows_of, wrap  # noqa: E402
from perfect_bvh_addon.view3d.walk.walk_picture import (  # noqa: E402
    ENTERED,
    HIT,
    MISSED,
    PRUNED,
    THICK,
    WAITING,
    WIDE,
    picture_of,
    span_in_box,
)

pytestmark = pytest.mark.usefixtures("scene", "registered")


@pytest.fixture
def crowd() -> perfect_bvh.Snapshot:
    return heap()


def colors_of(lines: Any, least_opacity: float = 0.5) -> set[tuple[float, ...]]:
    rows = np.unique(lines.colors[lines.colors[:, 3] >= least_opacity][:, :3], axis=0)
    return {tuple(round(float(value), 3) for value in row) for row in rows}


def test_each_step_shows_its_boxes_in_the_color_of_what_becomes_of_them(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    walk, seen = ray.walk, set()
    colors = {
        WalkEvent.ENTER_NODE: ENTERED,
        WalkEvent.BOX_HIT: WAITING,
        WalkEvent.BOX_MISSED: MISSED,
        WalkEvent.BOX_PRUNED: PRUNED,
    }
    for step in steps[:-1]:
        picture = picture_of(ray, step)
        events = {WalkEvent(event) for event in walk.events[step.rows.start : step.rows.stop]}
        bright = set().union(*(colors_of(lines) for lines in picture.lines if lines.width > 1.0))
        for event in events & colors.keys():
            assert tuple(round(value, 3) for value in colors[event]) in bright
            seen.add(event)
        for lines in picture.lines:
            assert lines.positions.dtype == np.float32 and np.isfinite(lines.positions).all()
            assert len(lines.positions) == len(lines.colors)
    assert seen == colors.keys()


def test_the_hit_is_filled_and_marked_from_when_it_is_found(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    row = ray.walk.hit_row
    assert row is not None
    place = ray.origin + ray.walk.t[row] * ray.direction
    is_found = False
    for step in steps:
        picture = picture_of(ray, step)
        is_found = is_found or row in step.rows
        is_marked = picture.hit is not None and np.allclose(picture.hit, place)
        assert is_marked == is_found
    assert picture.triangles.shape == (3, 3)
    np.testing.assert_allclose(picture.triangles, ray.walk.triangles[row], rtol=1e-6)
    np.testing.assert_allclose(picture.triangle_colors[0, :3], HIT, rtol=1e-6)


def test_the_bright_part_of_the_ray_is_in_the_box(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    for step in steps[:-1]:
        first, last = span_in_box(ray, step.rows.start)
        assert 0.0 <= first <= last <= ray.exit
        corners = ray.corners[step.rows.start]
        if step.sentence.startswith("Enters"):
            for t in (first, last):
                place = ray.at(t)
                assert (corners.min(axis=0) - 1e-5 <= place).all() and (place <= corners.max(axis=0) + 1e-5).all()
        np.testing.assert_allclose(picture_of(ray, step).tip, ray.at(last))
        (thick,) = (lines for lines in picture_of(ray, step).lines if lines.width == THICK)
        np.testing.assert_allclose(thick.positions, [ray.at(first), ray.at(last)], rtol=1e-6)


def test_one_box_of_a_step_is_bright(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd)
    kinds = {WalkEvent.BOX_HIT: WAITING, WalkEvent.BOX_MISSED: MISSED, WalkEvent.BOX_PRUNED: PRUNED}
    left = set(kinds)
    for step in steps[:-1]:
        for row in step.rows:
            event = WalkEvent(ray.walk.events[row])
            picture = picture_of(ray, step, row)
            if event not in left:
                continue
            (bright,) = (lines for lines in picture.lines if lines.width == WIDE)
            np.testing.assert_allclose(bright.colors[0, :3], kinds[event], rtol=1e-6)
            assert len(bright.positions) == 24 and len(np.unique(bright.colors, axis=0)) == 1
            wanted = row if event is WalkEvent.BOX_HIT else step.rows.start
            np.testing.assert_allclose(picture.tip, ray.at(span_in_box(ray, wanted)[1]))
            left.remove(event)
    assert not left


def test_a_long_sentence_is_broken_where_there_is_little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    # "W" is wider than other characters: lines of equal length differ in width.
    width = lambda text, *_: (sum(9.0 if letter == "W" else 6.0 for letter in text), 12.0)  # noqa: E731
    monkeypatch.setattr("perfect_bvh_addon.view3d.drawing.text_size", width)
    sentence = "Step 2 of 3: Enters a box of WWWWW WWWWW WWWW and tests 8 inside: 8 missed"
    assert wrap(sentence, 1000.0) == [sentence]
    lines = wrap(sentence, 150.0)
    assert " ".join(lines) == sentence and len(lines) > 2
    assert max(width(line)[0] for line in lines) <= 150.0


@pytest.mark.parametrize(
    ("width", "height", "count"), [(900.0, 700.0, 11), (900.0, 300.0, 5), (900.0, 60.0, 0), (200.0, 700.0, 0)]
)
def test_counters_leave_room_for_the_ray(
    crowd: perfect_bvh.Snapshot, monkeypatch: pytest.MonkeyPatch, width: float, height: float, count: int
) -> None:
    _, steps = walk_down(crowd)
    drawn: list[Any] = []
    monkeypatch.setattr(drawing, "free_rect", lambda *_: drawing.Rect(0.0, 0.0, width, height))
    monkeypatch.setattr(drawing, "pixels", lambda points: points)  # without a window the interface has no size
    monkeypatch.setattr(drawing, "text_size", lambda text, *_: (6.0 * len(text), 16.0))
    monkeypatch.setattr(drawing, "draw_text_panel", lambda *_: None)
    monkeypatch.setattr(walk_legend, "hud_top", lambda *_: 0.0)
    monkeypatch.setattr(walk_legend, "_draw_rows", lambda left, bottom, size, rows: drawn.extend(rows))
    walk_legend.draw_legend(
        SimpleNamespace(area=None, region=None), "Tells", rows_of(steps[-1].counters, steps[-1].counters)
    )
    assert len(drawn) == count
    assert count == 11 or not any(row.is_part for row in drawn)
