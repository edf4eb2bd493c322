"""Scans whose trees take long: Blender stays responsive, Esc ends them, and none of that changes an answer."""

from __future__ import annotations

import _thread
import threading
from collections.abc import Iterator

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
import perfect_bvh_addon  # noqa: E402
from blender.long_builds import (  # noqa: E402
    ESCAPE,
    HALF,
    MOUSE,
    TIMER,
    FakeOperator,
    FakeWindow,
    Gate,
    building_threads,
    tick_until_half,
)
from blender.scanned_room import LIDAR  # noqa: E402
from perfect_bvh_addon import CameraGrid, PointCloud, scan  # noqa: E402
from perfect_bvh_addon.operators.scan_button import PERFECT_BVH_OT_scan  # noqa: E402
from perfect_bvh_addon.scanning import Scanner  # noqa: E402

COLUMNS = ("positions", "distances", "normals", "object_ids", "instance_ids", "times", "ray_ids", "intensities")


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    perfect_bvh_addon.register()
    yield
    perfect_bvh_addon.unregister()
    assert not building_threads()


@pytest.fixture
def room(scene: bpy.types.Scene) -> bpy.types.Scene:
    """A ground and a cube, a camera that sees both and an empty between them."""
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    bpy.ops.mesh.primitive_cube_add(location=(4.0, 0.0, 1.0))
    bpy.context.object.name = "Box"
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (-6.0, 0.0, 4.0), (1.1, 0.0, -1.57)
    head = bpy.data.objects.new("Head", None)
    head.location.z = 1.5
    for obj in (camera, head):
        scene.collection.objects.link(obj)
    scene.camera = camera
    scene.frame_end = 3
    bpy.context.view_layer.update()
    return scene


def assert_same(cloud: PointCloud, expected: PointCloud) -> None:
    assert len(cloud) == len(expected) > 20
    assert (cloud.object_names, cloud.ray_count) == (expected.object_names, expected.ray_count)
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(cloud, name), getattr(expected, name), err_msg=name)


def undisturbed(gate: Gate, **options: object) -> PointCloud:
    gate.open()
    made = scan(LIDAR, bpy.data.objects["Head"], **options)
    gate.close()
    return made


def begin(gate: Gate, **options: object) -> tuple[Scanner, Iterator[float]]:
    """Start a scan that is building its first trees."""
    scanner = Scanner(LIDAR, bpy.data.objects["Head"], **options)
    steps = scanner.steps()
    while scanner.built_share != HALF:
        assert next(steps) <= HALF / 2
    return scanner, steps


# In steps ------------------------------------------------------------------------------------------------------------


def test_steps_go_on_while_trees_are_built_and_the_share_only_grows(room, gate: Gate) -> None:
    expected = undisturbed(gate)
    scanner, steps = begin(gate)
    seen = [next(steps) for _ in range(3)]
    assert seen == [HALF / 2] * 3
    gate.open()
    seen += list(steps)
    assert scanner.built_share is None
    assert seen == sorted(seen) and seen[-1] == 1.0
    assert_same(scanner.result(), expected)


def test_closing_stops_the_build_and_sets_the_frame_back(room, gate: Gate) -> None:
    expected = undisturbed(gate, frames=(1, 3))
    room.frame_set(2)
    scanner, steps = begin(gate, frames=(3, 5))
    assert room.frame_current == 4  # the end of the current interval
    steps.close()
    assert (room.frame_current, scanner.built_share, building_threads()) == (2, None, 0)
    assert_same(undisturbed(gate, frames=(1, 3)), expected)


def test_a_build_of_a_later_frame_can_be_stopped_as_well(room, gate: Gate) -> None:
    box = bpy.data.objects["Box"]
    for frame, x in ((1, 4.0), (3, 7.0)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)
    room.frame_set(3)
    gate.open()
    scanner = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3))
    steps = scanner.steps()
    while next(steps) < 0.33:
        pass
    gate.close()
    while scanner.built_share != HALF:
        assert next(steps) < 0.6
    steps.close()
    assert (room.frame_current, building_threads()) == (3, 0)


def move_everything() -> None:
    for name in ("Box", "Head", "Plane"):
        bpy.data.objects[name].location.z += 0.7
    bpy.context.view_layer.update()


def delete_the_sensor() -> None:
    bpy.data.objects.remove(bpy.data.objects["Head"])


def delete_the_box() -> None:
    bpy.data.objects.remove(bpy.data.objects["Box"])


def change_the_frame() -> None:
    bpy.context.scene.frame_set(7)


def load_a_file() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def undo() -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.data.objects["Head"].location.z += 5.0
    bpy.data.objects["Box"].location.z += 5.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()
    assert bpy.data.objects["Box"].location.z == 1.0


DISTURBANCES = (move_everything, delete_the_sensor, delete_the_box, change_the_frame, load_a_file, undo)


@pytest.mark.parametrize("disturb", DISTURBANCES)
def test_a_scan_is_about_what_was_read_whatever_happens_during_the_build(room, gate: Gate, disturb) -> None:
    expected = undisturbed(gate)
    scanner, steps = begin(gate)
    disturb()
    next(steps)
    gate.open()
    list(steps)
    assert_same(scanner.result(), expected)


@pytest.mark.parametrize(
    ("disturb", "message"),
    [
        (delete_the_sensor, "the sensor 'Head' was deleted during the scan"),
        (load_a_file, "the scene was removed during the scan"),
    ],
)
def test_the_next_frame_finds_out_what_is_missing(room, gate: Gate, disturb, message: str) -> None:
    _, steps = begin(gate, frames=(1, 3))
    disturb()
    gate.open()
    with pytest.raises(ValueError, match=message):
        list(steps)


def test_the_next_frame_shows_what_was_edited_during_the_build_of_the_last(room, gate: Gate) -> None:
    scanner, steps = begin(gate, frames=(1, 2))
    bpy.data.objects.remove(bpy.data.objects["Box"])
    gate.open()
    list(steps)
    cloud = scanner.result()
    on_box = cloud.object_ids == cloud.object_names.index("Box")
    assert on_box.any() and cloud.times[on_box].max() < 1 / 24 < cloud.times.max()


# In scripts ----------------------------------------------------------------------------------------------------------


def test_scripts_hear_of_the_build_and_can_stop_it(room, gate: Gate) -> None:
    seen: list[float] = []

    def stop(done: float) -> bool:
        seen.append(done)
        return seen.count(HALF / 2 / 3) < 3

    room.frame_set(2)
    with pytest.raises(perfect_bvh.Cancelled, match="the scan was cancelled"):
        scan(LIDAR, bpy.data.objects["Head"], frames=(1, 3), progress=stop)
    assert seen == sorted(seen) and seen[-1] == HALF / 2 / 3
    assert (room.frame_current, building_threads()) == (2, 0)


@pytest.mark.usefixtures("hears_ctrl_c")
def test_ctrl_c_ends_a_build(room, gate: Gate) -> None:
    def press_soon(done: float) -> None:
        if done == HALF / 2 / 3:  # the commit is held, and the scan waits for it until the signal comes
            threading.Timer(0.01, _thread.interrupt_main).start()

    with pytest.raises(KeyboardInterrupt):
        scan(LIDAR, bpy.data.objects["Head"], frames=(1, 3), progress=press_soon)
    assert (gate.held, building_threads()) == (1, 0)


def test_what_the_engine_raises_in_a_build_ends_the_scan(room, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self: object, *_: object, **__: object) -> None:
        raise MemoryError("no room for trees")

    monkeypatch.setattr(perfect_bvh.Scene, "commit", fail)
    room.frame_set(3)
    with pytest.raises(MemoryError, match="no room for trees"):
        scan(LIDAR, bpy.data.objects["Head"], frames=(1, 2))
    assert room.frame_current == 3


# The button ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def pressed(room) -> tuple[FakeOperator, FakeWindow]:
    """The pressed button, in a window."""
    operator, window = FakeOperator(PERFECT_BVH_OT_scan), FakeWindow()
    room.perfect_bvh.scan.width, room.perfect_bvh.scan.height = 32, 18
    assert operator.invoke(window, MOUSE) == {"RUNNING_MODAL"}
    return operator, window


def test_escape_stops_a_build_and_makes_nothing(gate: Gate, room, pressed) -> None:
    operator, window = pressed
    tick_until_half(operator, window)
    assert operator.modal(window, MOUSE) == {"PASS_THROUGH"}
    count = len(bpy.data.objects)
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert operator.reports == [("INFO", "Scan canceled: nothing was written")]
    assert (len(bpy.data.objects), window.status, window.timers, building_threads()) == (count, None, 0, 0)


def test_the_button_scans_when_the_trees_are_built(gate: Gate, room, pressed) -> None:
    operator, window = pressed
    tick_until_half(operator, window)
    gate.open()
    while (answer := operator.modal(window, TIMER)) == {"RUNNING_MODAL"}:
        pass
    assert answer == {"FINISHED"}
    assert window.progress == sorted(window.progress)
    assert (window.status, window.timers) == (None, 0)
    points = bpy.data.objects["Scan"].data.attributes["position"].data
    places = np.empty(3 * len(points), np.float32)
    points.foreach_get("vector", places)
    np.testing.assert_array_equal(places.reshape(-1, 3), scan(CameraGrid(32, 18)).positions.astype(np.float32))


def test_blender_ends_or_opens_a_file_while_the_button_builds(gate: Gate, room, pressed) -> None:
    operator, window = pressed
    tick_until_half(operator, window)
    operator.cancel(window)
    assert (window.status, window.timers, building_threads()) == (None, 0, 0)
