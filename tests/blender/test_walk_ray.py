"""A ray's walk without a screen: the pixel's ray, the steps and what they count, what is drawn, the button and keys."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.long_builds import TIMER, FakeOperator, FakeWindow  # noqa: E402
from mathutils import Euler, Matrix  # noqa: E402
from perfect_bvh import WalkEvent  # noqa: E402
from perfect_bvh_addon.operators import walk_ray as operators  # noqa: E402
from perfect_bvh_addon.statistics.messages import messages_of  # noqa: E402
from perfect_bvh_addon.sync.appearance import as_camera  # noqa: E402
from perfect_bvh_addon.sync.records import CameraRecord  # noqa: E402
from perfect_bvh_addon.view3d import awaited_view, walk_reading, walk_view  # noqa: E402
from perfect_bvh_addon.view3d.pixel_ray import pixel_ray  # noqa: E402
from perfect_bvh_addon.view3d.walk_legend import heading, rows_of, wrap  # noqa: E402
from perfect_bvh_addon.view3d.walk_picture import (  # noqa: E402
    ENTERED,
    HIT,
    MISSED,
    PRUNED,
    THICK,
    WAITING,
    WalkedRay,
    picture_of,
    span_in_box,
)
from perfect_bvh_addon.view3d.walk_reading import written_length  # noqa: E402
from perfect_bvh_addon.view3d.walk_steps import steps_of  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")

DOWN = np.array([0.0, 0.0, -1.0])
SIZE = (12, 8)


@pytest.fixture
def crowd() -> perfect_bvh.Snapshot:
    """Balls in a heap, seen from above in `WALKED`."""
    from oracles import meshes

    engine = perfect_bvh.Scene()
    mesh = engine.add_mesh(*meshes.sphere(12, 16, 1.0))
    places = np.tile(np.eye(4), (60, 1, 1))
    places[:, :3, 3] = np.random.default_rng(2).uniform(-2.0, 2.0, (60, 3))
    engine.add_instances(np.full(60, mesh), places)
    engine.commit()
    return engine.snapshot()


def walk_down(snapshot: perfect_bvh.Snapshot, x: float = 0.3, y: float = 0.2) -> tuple[WalkedRay, list[Any]]:
    origin = np.array([x, y, 9.0])
    walk = snapshot.walk_ray(origin, DOWN)
    names = {int(ident): f"Ball.{ident:03}" for ident in walk.instance_ids if ident >= 0}
    return WalkedRay.of(walk, origin, DOWN, 0.0), steps_of(walk, names)


# The ray of a pixel --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", ["perspective", "orthographic", "equirectangular"])
def test_a_pixels_ray_is_the_one_that_is_traced(crowd: perfect_bvh.Snapshot, projection: Any) -> None:
    matrix = np.array(Euler((0.3, 0.25, 0.2)).to_matrix().to_4x4())
    matrix[:3, 3] = (0.5, -1.0, 6.0)
    window = (-2.0, 2.5, -1.5, 1.0) if projection == "orthographic" else (-0.4, 0.5, -0.3, 0.2)
    record = CameraRecord(matrix, window, projection, 0.7, 50.0)
    names = ("distance", "instance", "primitive", "nodes_visited", "primitives_tested")
    shown = perfect_bvh.render_passes(crowd, as_camera(record), size=SIZE, samples=1, passes=names)
    found = 0
    for row in range(SIZE[1]):
        for column in range(SIZE[0]):
            ray = pixel_ray(record, (column + 0.5) / SIZE[0], 1.0 - (row + 0.5) / SIZE[1])
            assert ray is not None and np.linalg.norm(ray.direction) == pytest.approx(1.0)
            walk = crowd.walk_ray(ray.origin, ray.direction, ray.t_min, ray.t_max)
            assert walk.hit_row is None or walk.t[walk.hit_row] == pytest.approx(shown["distance"][row, column], 1e-5)
            hit = -1 if walk.hit_row is None else int(walk.primitive_ids[walk.hit_row])
            cost = shown["nodes_visited"][row, column] + shown["primitives_tested"][row, column]
            found += (hit, walk.cost) == (shown["primitive"][row, column], cost)
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
    assert any(sentence.startswith("Enters the tree of Ball.") for sentence in sentences)
    assert any("triangles of a leaf at level" in sentence and ": hit at " in sentence for sentence in sentences)
    assert any(sentence.startswith("Drops ") and "behind the hit" in sentence for sentence in sentences)
    row = ray.walk.hit_row
    assert row is not None
    end = f"The nearest hit is Ball.{ray.walk.instance_ids[row]:03} at {ray.walk.t[row]:.4g}"
    assert sentences[-1] == end
    assert steps_of(ray.walk, {int(ray.walk.instance_ids[row]): "A"}, None)[-1].sentence == "The nearest hit is A"
    assert heading(steps, 0) == f"Step 1 of {len(steps)}: {sentences[0]}"
    for step in steps[:-1]:
        if ": of " in step.sentence or "inside: " in step.sentence:
            numbers = [int(word) for word in step.sentence.partition("inside: ")[2].split() if word.isdigit()]
            assert sum(numbers) == len(step.rows) - 1


def test_a_ray_without_a_hit_and_one_without_anything(crowd: perfect_bvh.Snapshot) -> None:
    ray, steps = walk_down(crowd, 2.9, 2.9)
    assert ray.walk.hit_row is None and steps[-1].sentence == "Nothing is hit"
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


# Pictures ------------------------------------------------------------------------------------------------------------


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


# The button ----------------------------------------------------------------------------------------------------------


class Viewport:
    """A window with a 3D viewport that looks down at the scene, and a panel over its right end."""

    def __init__(self) -> None:
        data = SimpleNamespace(
            as_pointer=lambda: 8,
            view_perspective="ORTHO",
            view_matrix=Matrix.Translation((0.0, 0.0, -9.0)),
            window_matrix=Matrix.Diagonal((0.5, 0.5, -0.01, 1.0)),
        )
        space = SimpleNamespace(
            camera=None,
            use_render_border=False,
            local_view=None,
            use_local_collections=False,
            region_3d=data,
            as_pointer=lambda: 7,
        )
        for name in awaited_view.TYPE_FILTERS:
            setattr(space, name, True)
        main = SimpleNamespace(type="WINDOW", x=100, y=50, width=200, height=200, data=data)
        panel = SimpleNamespace(type="UI", x=260, y=50, width=40, height=200)
        self.area = SimpleNamespace(
            type="VIEW_3D",
            x=100,
            y=50,
            width=200,
            height=200,
            regions=[main, panel],
            spaces=SimpleNamespace(active=space),
        )
        self.cursor = "DEFAULT"
        self.context = FakeWindow()
        screen = SimpleNamespace(areas=[self.area])
        window = SimpleNamespace(screen=screen, cursor_modal_set=self._set, cursor_modal_restore=lambda: self._set(""))
        self.context._known["window"] = window
        self.operator = FakeOperator(operators.PERFECT_BVH_OT_walk_ray)

    def _set(self, cursor: str) -> None:
        self.cursor = cursor or "DEFAULT"

    def start(self) -> None:
        assert self.operator.invoke(self.context, None) == {"RUNNING_MODAL"}

    def send(self, kind: str, x: int = 200, y: int = 150, value: str = "PRESS") -> set[str]:
        event = SimpleNamespace(type=kind, value=value, mouse_x=x, mouse_y=y)
        return self.operator.modal(self.context, event)

    def click(self, x: int = 200, y: int = 150) -> None:
        assert self.send("LEFTMOUSE", x, y) == {"RUNNING_MODAL"}
        assert self.send("LEFTMOUSE", x, y, "RELEASE") == {"RUNNING_MODAL"}
        for _ in range(2000):
            if self.operator._reading is None:
                return
            self.operator.modal(self.context, TIMER)
        raise AssertionError("the trees do not come")

    @property
    def is_idle(self) -> bool:
        return self.cursor == "DEFAULT" and self.context.status is None and self.context.timers == 0


@pytest.fixture
def viewport(box: Any) -> Any:
    """Over a cube from -1 to 1."""
    found = Viewport()
    found.start()
    yield found
    walk_view.hide()


def test_a_click_walks_the_pixels_ray(viewport: Viewport) -> None:
    assert viewport.cursor == "CROSSHAIR" and "click a pixel" in viewport.context.status
    assert viewport.send("LEFTMOUSE", 270, 100) == {"PASS_THROUGH"}  # a panel's
    assert viewport.send("RIGHT_ARROW") == {"PASS_THROUGH"}
    assert walk_view.shown() is None
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and walk.steps[-1].sentence == "The nearest hit is Cube"
    assert viewport.cursor == "DEFAULT" and "Esc ends" in viewport.context.status
    assert walk.ray.at(walk.ray.end(-1))[2] == pytest.approx(1.0)
    viewport.click(101, 51)  # beside the cube
    other = walk_view.shown()
    assert other is not None and other is not walk and other.steps[-1].sentence == "Nothing is hit"
    assert viewport.send("ESC") == {"FINISHED"}
    assert walk_view.shown() is None and viewport.is_idle


def test_what_cannot_be_walked_is_said_until_the_next_click(
    viewport: Viewport, scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> Any:
        raise ValueError("the view has no usable matrix")

    with monkeypatch.context() as patch:
        patch.setattr(walk_reading, "read_pixel", fail)
        viewport.click()
    said = "The view has no usable matrix"
    assert viewport.operator.reports == [("WARNING", said)]
    assert [message.text for message in messages_of(scene) if message.source == "Walk a Ray"] == [said]
    assert viewport.cursor == "CROSSHAIR", "another pixel can be clicked"
    viewport.click()
    assert walk_view.shown() is not None
    assert not [message for message in messages_of(scene) if message.source == "Walk a Ray"]


def test_keys_and_buttons_step(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and walk.index == 0 and len(walk.steps) > 3
    for key, index in (("RIGHT_ARROW", 1), ("RIGHT_ARROW", 2), ("LEFT_ARROW", 1), ("HOME", 0), ("LEFT_ARROW", 0)):
        assert viewport.send(key) == {"RUNNING_MODAL"}
        assert walk.index == index
    assert viewport.send("RIGHT_ARROW", 20, 20) == {"PASS_THROUGH"}  # elsewhere keys are others'
    viewport.send("END")
    assert walk.index == len(walk.steps) - 1
    for to, index in (("FIRST", 0), ("NEXT", 1), ("LAST", len(walk.steps) - 1), ("PREVIOUS", len(walk.steps) - 2)):
        assert bpy.ops.perfect_bvh.walk_step(to=to) == {"FINISHED"}
        assert walk.index == index
    assert bpy.ops.perfect_bvh.walk_step(to="OFF") == {"FINISHED"}
    assert not bpy.ops.perfect_bvh.walk_step.poll()
    assert viewport.send("TIMER") == {"FINISHED"} and viewport.is_idle


def test_it_plays_to_the_end_and_pauses(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None
    ticks = round(walk_view.PLAY_SECONDS / operators.TIMER_SECONDS)
    viewport.send("SPACE")
    for _ in range(ticks):
        assert viewport.operator.modal(viewport.context, TIMER) == {"PASS_THROUGH"}
    assert walk.index == 1 and walk.is_playing
    viewport.send("SPACE")
    for _ in range(ticks):
        viewport.operator.modal(viewport.context, TIMER)
    assert walk.index == 1 and not walk.is_playing
    viewport.send("SPACE")
    for _ in range(ticks * len(walk.steps)):
        viewport.operator.modal(viewport.context, TIMER)
    assert walk.index == len(walk.steps) - 1 and not walk.is_playing
    viewport.send("SPACE")
    assert walk.index == 0 and walk.is_playing  # from the beginning


def test_the_newest_alone_goes_on(viewport: Viewport) -> None:
    viewport.click()
    later = Viewport()
    later.start()
    assert walk_view.shown() is None
    assert viewport.send("TIMER") == {"CANCELLED"} and viewport.context.timers == 0
    later.click()
    assert walk_view.shown() is not None and later.context.status is not None
    assert later.send("ESC") == {"FINISHED"}


def test_it_ends_with_its_viewport_its_file_and_an_undo(viewport: Viewport) -> None:
    viewport.click()
    viewport.context.window.screen.areas.clear()
    assert viewport.send("TIMER") == {"FINISHED"} and viewport.is_idle and walk_view.shown() is None
    again = Viewport()
    again.start()
    again.click()
    walk_view._watcher.on_change("an object was edited")
    assert walk_view.shown() is not None
    walk_view._watcher.on_change("a step was undone")
    assert walk_view.shown() is None and again.send("TIMER") == {"FINISHED"}
    again.start()
    again.click()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert walk_view.shown() is None and not walk_view._handles


def test_trees_are_waited_for_no_longer_where_their_viewport_is_closed(
    viewport: Viewport, monkeypatch: pytest.MonkeyPatch
) -> None:
    reading = SimpleNamespace(address=7, state="Building trees", walk=lambda context: None, stop=lambda: None)
    monkeypatch.setattr(walk_reading, "read_pixel", lambda *_: reading)
    assert viewport.send("LEFTMOUSE") == {"RUNNING_MODAL"}
    assert viewport.send("TIMER") == {"PASS_THROUGH"}
    viewport.context.window.screen.areas.clear()
    assert viewport.send("TIMER") == {"CANCELLED"} and viewport.is_idle


def test_a_walk_changes_nothing_and_knows_when_it_is_old(viewport: Viewport, scene: Any) -> None:
    before = sorted(block.name for block in (*bpy.data.objects, *bpy.data.meshes, *bpy.data.scenes))
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None and not walk.is_old(scene)
    assert before == sorted(block.name for block in (*bpy.data.objects, *bpy.data.meshes, *bpy.data.scenes))
    bpy.data.objects["Cube"].location.z = 3.0
    bpy.context.view_layer.update()
    assert walk.is_old(scene)
    viewport.click()
    newer = walk_view.shown()
    assert newer is not None and not newer.is_old(scene)
    assert newer.ray.at(newer.ray.end(-1))[2] == pytest.approx(4.0)
    scene.frame_set(scene.frame_current + 1)
    assert newer.is_old(scene)


def test_a_step_is_told_of_once_in_a_quad_view(viewport: Viewport) -> None:
    viewport.click()
    walk = walk_view.shown()
    assert walk is not None

    def told_in(space: int, views: tuple[int, ...], view: int) -> bool:
        pointers = [SimpleNamespace(as_pointer=lambda number=number: number) for number in views]
        area = SimpleNamespace(as_pointer=lambda: space, region_quadviews=pointers)
        context = SimpleNamespace(space_data=area, region_data=SimpleNamespace(as_pointer=lambda: view))
        return walk_view.tells(context, walk)

    assert told_in(7, (), 8) and not told_in(6, (), 8)
    assert [told_in(7, (1, 8, 2, 3), view) for view in (1, 8, 2, 3)] == [False, True, False, False]
    assert [told_in(7, (1, 2, 3, 4), view) for view in (1, 2, 3, 4)] == [False, False, False, True]


def test_scripts_are_told_that_it_needs_a_click(box: Any) -> None:
    assert not bpy.ops.perfect_bvh.walk_ray.poll()  # no window
    operator = FakeOperator(operators.PERFECT_BVH_OT_walk_ray)
    assert operator.execute(FakeWindow()) == {"CANCELLED"}
    assert "needs a click" in operator.reports[0][1]


def test_a_long_sentence_is_broken_where_there_is_little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    # "W" is wider than others: lines of as many characters are not of the same width.
    width = lambda text, *_: (sum(9.0 if letter == "W" else 6.0 for letter in text), 12.0)  # noqa: E731
    monkeypatch.setattr("perfect_bvh_addon.view3d.drawing.text_size", width)
    sentence = "Step 2 of 3: Enters a box of WWWWW WWWWW WWWW and tests 8 inside: 8 missed"
    assert wrap(sentence, 1000.0) == [sentence]
    lines = wrap(sentence, 150.0)
    assert " ".join(lines) == sentence and len(lines) > 2
    assert max(width(line)[0] for line in lines) <= 150.0
