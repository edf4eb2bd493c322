"""Two trees of one object, compared without a screen: their costs, the written results, and the end of a comparison."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.long_builds import ESCAPE, TIMER, FakeOperator, FakeWindow  # noqa: E402
from perfect_bvh_addon.operators.measure import PERFECT_BVH_OT_compare  # noqa: E402
from perfect_bvh_addon.settings.view_settings import CHOICES, REFITTED, choice_of  # noqa: E402
from perfect_bvh_addon.view3d.compare import compare_view, half_picture  # noqa: E402
from perfect_bvh_addon.view3d.compare.compare_trees import (  # noqa: E402  # noqa: E402
    BRIGHTEST,
    DARKEST,
    Row,
    compare,
    heading_of,
    level_line,
    rows_of,
    shade,
)
from perfect_bvh_addon.view3d.compare.half_picture import FILLS, Framing, cut_of, frame_box  # noqa: E402
from perfect_bvh_addon.view3d.pointer import SIDE, primary_rays  # noqa: E402
from perfect_bvh_addon.view3d.reading import read_object  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


@pytest.fixture
def ball(scene: Any) -> Any:
    """A sphere that is stretched from frame 1 to 4; the scene is at frame 3."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4)
    ball = bpy.context.object
    ball.shape_key_add(name="rest")
    tall = ball.shape_key_add(name="tall")
    for point in tall.data:
        point.co.z *= 5.0 * (1.0 + point.co.x)
    for frame, value in ((1, 0.0), (4, 1.0)):
        tall.value = value
        tall.keyframe_insert("value", frame=frame)
    scene.frame_start, scene.frame_end = 1, 4
    scene.frame_set(3)
    return ball


def compared(obj: Any, left: str, right: str) -> Any:
    first = read_object(bpy.context, obj, 1)
    choices = (choice_of(left), choice_of(right))
    return compare(read_object(bpy.context, obj), 3, choices, first, lambda share: True)


def test_every_builder_of_the_engine_can_be_chosen() -> None:
    from perfect_bvh.build_config import BUILDERS

    assert {choice.builder for choice in CHOICES} == set(BUILDERS)
    assert len({choice.number for choice in CHOICES}) == len(CHOICES)


def test_a_naive_tree_costs_more_in_every_respect(ball: Any) -> None:
    found = compared(ball, "MEDIAN", "SWEEP")
    median, sweep = found.left, found.right
    assert median.sah > 1.2 * sweep.sah and median.epo > sweep.epo
    assert median.primary.triangles > sweep.primary.triangles
    assert median.diffuse.triangles > sweep.diffuse.triangles
    assert median.references == sweep.references == 20 * 4**3


@pytest.mark.parametrize("name", [choice.identifier for choice in CHOICES])
def test_what_is_said_of_a_tree_is_what_the_engine_says(ball: Any, name: str) -> None:
    side = compared(ball, name, "AUTO").left
    statistics = side.snapshot.statistics(detailed=name != REFITTED).meshes[0]
    assert side.sah == pytest.approx(side.snapshot.tree_boxes(side.mesh).costs.sum(), rel=1e-5)
    assert (side.nodes, side.leaves) == (statistics.wide_node_count, statistics.wide_leaf_count)
    assert side.epo == statistics.epo
    assert (side.epo is None) == (name in {REFITTED, "FAST"})  # they have no binary tree
    boxes = side.snapshot.tree_boxes(side.mesh)
    rays = primary_rays(*boxes.boxes[0])
    hits = side.snapshot.cast_rays(*rays, fields=("nodes_visited", "primitives_tested"))
    assert side.primary.nodes == pytest.approx(hits.nodes_visited.mean(), rel=0.01)
    assert side.primary.triangles == pytest.approx(hits.primitives_tested.mean(), rel=0.01)


def test_a_refitted_tree_is_the_one_of_the_first_frame_with_other_boxes(ball: Any) -> None:
    found = compared(ball, REFITTED, "BINNED")
    assert found.left.is_refitted and not found.right.is_refitted
    assert found.left.sah > 1.05 * found.right.sah
    now = read_object(bpy.context, ball)
    box = found.left.snapshot.tree_boxes(found.left.mesh, last_level=0).boxes[0]
    np.testing.assert_allclose(box[0], now.mesh.positions.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(box[1], now.mesh.positions.max(axis=0), atol=1e-5)
    assert bpy.context.scene.frame_current == 3


def test_other_triangles_cannot_be_refitted(ball: Any) -> None:
    now = read_object(bpy.context, ball)
    bpy.ops.mesh.primitive_cube_add()
    first = read_object(bpy.context, bpy.context.object)
    with pytest.raises(ValueError, match="different triangles in the first frame"):
        compare(now, 3, (choice_of(REFITTED), choice_of("AUTO")), first, lambda share: True)


def test_it_stops_when_it_is_told_to(ball: Any) -> None:
    now = read_object(bpy.context, ball)
    with pytest.raises(perfect_bvh.Cancelled):
        compare(now, 3, (choice_of("AUTO"), choice_of("MEDIAN")), None, lambda share: share < 0.9)


def test_rays_go_at_all_of_a_box_from_outside() -> None:
    lower, upper = np.array([-1.0, 2.0, 5.0]), np.array([3.0, 2.5, 11.0])
    origins, directions = primary_rays(lower, upper)
    assert origins.shape == directions.shape == (SIDE * SIDE, 3)
    assert np.linalg.norm(origins - (lower + upper) / 2, axis=1).min() > np.linalg.norm(upper - lower)
    targets = origins + directions
    assert (targets.min(axis=0) < lower).any() and (targets.max(axis=0) > upper).any()


def test_rows_say_how_the_right_side_compares_to_the_left_one(ball: Any) -> None:
    found = compared(ball, "MEDIAN", "SWEEP")
    left, right = rows_of(found.left), rows_of(found.right, found.left)
    assert [row.name for row in left] == [row.name for row in right]
    assert all(row.ratio is None for row in left)
    ratios = {row.name: row for row in right}
    assert ratios["SAH"].ratio == pytest.approx(found.right.sah / found.left.sah)
    assert ratios["SAH"].is_better and not ratios["SAH"].is_worse
    assert rows_of(found.left, found.right)[0].is_worse
    assert rows_of(compared(ball, REFITTED, "AUTO").left)[3].name == "Refit"
    assert heading_of(found) == f"{ball.name}, frame 3: 1,280 triangles"


def test_a_level_is_named_with_its_boxes() -> None:
    assert level_line(9, 4, 1) == "Level 4 of 4: 1 box"


def test_a_level_is_a_cut_through_the_tree(ball: Any) -> None:
    side = compared(ball, "MEDIAN", "SWEEP").right
    whole = side.snapshot.tree_boxes(side.mesh)
    for level in range(whole.depth + 1):
        boxes = side.snapshot.tree_boxes(side.mesh, last_level=level)
        cut = cut_of(side.snapshot, side.mesh, level, use_all=False)
        assert len(cut) <= len(cut_of(side.snapshot, side.mesh, level, use_all=True)) == len(boxes)
        above = cut.levels < level
        assert (cut.leaf_sizes[above] > 0).all() and (cut.levels == level).any()
    assert cut.leaf_sizes.sum() == side.references  # of the deepest level: all leaves


def test_an_object_fits_into_its_half(ball: Any) -> None:
    found = compared(ball, "AUTO", "MEDIAN")
    region, size = (800.0, 600.0), (300.0, 400.0)
    perspective = np.diag([0.1, 0.1 * 4 / 3, 0.01, 1.0])
    perspective[0, 3] = 0.4  # to the right of the middle
    after = frame_box(found, perspective, region, size).matrix(region, size) @ perspective
    corners = np.array([[x, y, z, 1.0] for x, y, z in np.stack(np.meshgrid(*found.bounds.T), -1).reshape(-1, 3)])
    places = (corners @ (after @ found.shown.matrix).T)[:, :2]
    np.testing.assert_allclose(places.max(axis=0) + places.min(axis=0), 0.0, atol=1e-9)
    assert np.abs(places).max() == pytest.approx(FILLS)
    behind = np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, -1.0, 0.5]])
    assert frame_box(found, behind, region, size) == Framing()


def test_an_object_is_shaded_from_above(ball: Any) -> None:
    shaded = shade(read_object(bpy.context, ball).mesh)
    grey, heights = shaded.colors[:, 0], shaded.positions[:, 2]
    assert DARKEST <= grey.min() < grey.max() <= BRIGHTEST
    assert grey[heights.argmax()] > grey[heights.argmin()]


# The button ----------------------------------------------------------------------------------------------------------


def test_the_button_reports_without_a_window(ball: Any) -> None:
    assert bpy.ops.perfect_bvh.compare() == {"FINISHED"}
    assert bpy.context.scene.frame_current == 3


def test_the_button_goes_on_beside_blender_and_shows_what_it_finds(ball: Any, shown: list[Any]) -> None:
    operator, window = begun()
    while operator.modal(window, TIMER) == {"RUNNING_MODAL"}:
        assert window.status is not None and "Esc: Cancel" in window.status
        time.sleep(0.005)
    (comparison,) = shown
    assert window.status is None and window.timers == 0
    assert (comparison.left.label, comparison.right.label) == ("Median Split", "Binned")


def test_escape_ends_it_and_shows_nothing(ball: Any, shown: list[Any]) -> None:
    operator, window = begun()
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert not operator._work.is_running and not shown
    assert window.status is None and window.timers == 0


def begun() -> tuple[FakeOperator, FakeWindow]:
    operator, window = FakeOperator(PERFECT_BVH_OT_compare), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    return operator, window


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The comparisons that a viewport would show."""
    found: list[Any] = []
    monkeypatch.setattr(compare_view, "show", lambda comparison, *_: found.append(comparison))
    monkeypatch.setattr("perfect_bvh_addon.operators.measure.find_space", lambda context: 7)
    return found


def test_a_comparison_ends_with_its_file(ball: Any) -> None:
    show(ball)
    assert compare_view.shown() is not None
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert compare_view.shown() is None


def test_narrow_halves_have_lines_that_fit_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("perfect_bvh_addon.view3d.drawing.text_size", lambda text, size: (len(text) * size, size))
    rows = [Row("SAH", "79.9"), Row("Primary Ray", "7.3 nodes, 28.6 triangles"), Row("Nodes", "66")]
    assert compare_view.fitting_lines(rows, 8.0, 1.0) == ["SAH 79.9", "Nodes 66"]
    assert compare_view.fitting_lines(rows, 37.0, 1.0)[1] == "Primary Ray 7.3 nodes, 28.6 triangles"
    assert compare_view.fitting_lines(rows, 7.0, 1.0) == []


def test_a_comparison_knows_when_it_is_old(ball: Any) -> None:
    found = show(ball)
    scene = bpy.context.scene
    assert not compare_view.is_old(found, scene)
    ball.data.vertices[0].co.x += 1.0
    ball.data.update()
    bpy.context.view_layer.update()
    assert compare_view.is_old(found, scene)
    found = show(ball)
    scene.frame_set(2)
    assert compare_view.is_old(found, scene)
    assert bpy.ops.perfect_bvh.end_comparison() == {"FINISHED"}
    assert compare_view.shown() is None and not bpy.ops.perfect_bvh.end_comparison.poll()


def show(obj: Any) -> Any:
    edits = compare_view.edit_count(bpy.context.scene.session_uid)
    compare_view.show(compared(obj, "AUTO", "MEDIAN"), bpy.context.scene, 7, edits)
    return compare_view.shown()


@pytest.mark.parametrize("is_encoded", [False, True])
def test_halves_have_the_viewports_background(monkeypatch: pytest.MonkeyPatch, is_encoded: bool) -> None:
    """is_encoded: whether Blender encodes drawings into a viewport, as it does before 5.0."""
    from mathutils import Color

    monkeypatch.setattr(half_picture, "IS_ENCODED", is_encoded)
    background = half_picture.background_color()
    cleared = half_picture._as_cleared(background)
    shown = Color(cleared[:3]).from_scene_linear_to_srgb() if is_encoded else cleared[:3]
    assert tuple(shown) == pytest.approx(background[:3], abs=1e-4) and cleared[3] == background[3]
