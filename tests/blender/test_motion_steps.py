"""Stepping through the moments of a shutter and back: the scene's frame afterwards, the readings, and bad arguments."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import camera_object, evaluated, mesh_object
from blender.moving_scenes import FRAME, SHUTTER, Told, frozen, keyed, make
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract.geometry import mesh_table


def place() -> tuple[int, float]:
    scene = bpy.context.scene
    return scene.frame_current, scene.frame_subframe


@pytest.fixture
def visited() -> Iterator[list[float]]:
    """Collect the frames that Blender evaluates from now on."""
    frames: list[float] = []

    def note(scene: Any, depsgraph: Any) -> None:
        frames.append(scene.frame_current_final)

    bpy.app.handlers.frame_change_post.append(note)
    yield frames
    bpy.app.handlers.frame_change_post.remove(note)


# Where the scene is left ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "at", [(10, 0.0), (10, 0.3), (0, 0.7), (-1, 0.75), (-7, 0.1), (-1000, 0.9), (250_000, 0.015625)]
)
def test_the_scene_is_left_where_it_was(scene: Any, at: tuple[int, float]) -> None:
    make("a_keyed_cube")
    scene.frame_set(at[0], subframe=at[1])
    before, location = place(), bpy.data.objects["Cube"].location.copy()
    SceneSync().update(evaluated(), shutter=(-0.4, 0.3))
    assert place() == before
    assert bpy.data.objects["Cube"].location == location


def test_nothing_is_pending_afterwards(scene: Any) -> None:
    make("an_armature")
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    evaluated()
    assert sync.scene.is_current
    assert Told(sync, sync.scene, 0.5).is_hit.any()


def test_a_handler_that_fails_leaves_it_there_too(scene: Any, capfd: Any) -> None:
    make("a_keyed_cube")

    def fail(*_: Any) -> None:
        if bpy.context.scene.frame_subframe:
            raise RuntimeError("out of order")

    bpy.app.handlers.frame_change_post.append(fail)
    try:
        sync = SceneSync()
        assert sync.update(evaluated(), shutter=SHUTTER).motion_count == 1  # Blender reports the error and goes on
    finally:
        bpy.app.handlers.frame_change_post.remove(fail)
    assert "out of order" in capfd.readouterr().err
    assert place() == (FRAME, 0.0)


def test_a_handler_that_changes_the_frame_is_told_of(scene: Any) -> None:
    make("a_keyed_cube")
    is_nested = False

    def elsewhere(*_: Any) -> None:
        nonlocal is_nested
        if not is_nested and bpy.context.scene.frame_subframe:
            is_nested = True
            bpy.context.scene.frame_set(3)
            is_nested = False

    bpy.app.handlers.frame_change_post.append(elsewhere)
    try:
        with pytest.raises(ValueError, match=r"at frame 9.75, got frame 3: .* no handler may change the frame"):
            SceneSync().update(evaluated(), shutter=SHUTTER)
    finally:
        bpy.app.handlers.frame_change_post.remove(elsewhere)
    assert place() == (FRAME, 0.0)


class StopError(Exception):
    """The error of a caller's function."""


@pytest.mark.parametrize("error", [StopError, KeyboardInterrupt, MemoryError])
def test_a_function_that_fails_half_way_leaves_it_there_too(scene: Any, error: type[BaseException]) -> None:
    make("a_keyed_cube")
    sync = SceneSync()
    sync.update(evaluated())
    calls: list[float] = []

    def go(frame: int, subframe: float) -> None:
        calls.append(frame + subframe)
        scene.frame_set(frame, subframe=subframe)
        if len(calls) == 2:
            raise error("half-way")

    with pytest.raises(error):
        sync.update(evaluated(), shutter=SHUTTER, frame_set=go)
    assert calls == [9.75, 10.25, 10.0] and place() == (FRAME, 0.0)
    with pytest.raises(perfect_bvh.StaleSceneError, match="call update"):
        sync.scene.cast_rays([(0, 0, 9)], [(0, 0, -1)])
    sync.update(evaluated(), shutter=SHUTTER, frame_set=lambda frame, part: scene.frame_set(frame, subframe=part))
    assert not Told(sync, sync.scene.snapshot(), 1.0).is_not_at_moment(frozen(0.25)).any()


def test_a_second_ctrl_c_on_the_way_back_does_not_leave_it_half_way(scene: Any) -> None:
    make("a_keyed_cube")
    calls: list[float] = []

    def go(frame: int, subframe: float) -> None:
        calls.append(frame + subframe)
        if len(calls) == 3:
            raise KeyboardInterrupt
        scene.frame_set(frame, subframe=subframe)

    with pytest.raises(KeyboardInterrupt):
        SceneSync().update(evaluated(), shutter=SHUTTER, frame_set=go)
    assert calls == [9.75, 10.25, 10.0, 10.0] and place() == (FRAME, 0.0)


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5])
def test_progress_cancels_between_moments(scene: Any, at: float) -> None:
    make("a_keyed_cube")
    told: list[float] = []

    def progress(share: float) -> bool:
        told.append(share)
        return share < at

    sync = SceneSync()
    with pytest.raises(perfect_bvh.Cancelled):
        sync.update(evaluated(), shutter=SHUTTER, progress=progress)
    assert place() == (FRAME, 0.0)
    told.clear()
    sync.update(evaluated(), shutter=SHUTTER, progress=lambda share: told.append(share))
    assert told[:2] == [0.25, 0.5] and told == sorted(told) and told[-1] <= 1.0


def test_markers_that_choose_cameras_leave_the_one_that_was_chosen(scene: Any) -> None:
    make("a_keyed_cube")
    first, second = camera_object("first"), camera_object("second")
    marker = scene.timeline_markers.new("cut", frame=FRAME + 1)
    marker.camera = first
    scene.timeline_markers.new("begin", frame=1).camera = first
    scene.camera = second
    sync = SceneSync()
    sync.update(evaluated(), shutter=(-0.5, 1.5))
    assert scene.camera == second
    assert sync.scene.is_current and sync.camera_motion == ()


def test_what_was_moved_by_hand_is_where_its_keys_have_it(scene: Any) -> None:
    """As after any change of the frame, the keys win; and the sync agrees with Blender."""
    make("a_keyed_cube")
    cube = bpy.data.objects["Cube"]
    keyed_place = cube.location.copy()
    cube.location.z = 50.0
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    assert cube.location == keyed_place
    assert not Told(sync, sync.scene.snapshot(), 0.5).is_not_at_moment(frozen(0.0)).any()


# Evaluations and readings ---------------------------------------------------------------------------------------------


def test_each_moment_is_evaluated_once(scene: Any, visited: list[float]) -> None:
    make("a_keyed_cube")
    bpy.data.objects["Cube"].cycles.motion_steps = 2
    visited.clear()
    SceneSync().update(evaluated(), shutter=SHUTTER)
    assert visited == [9.75, 9.875, 10.125, 10.25, 10.0]


def test_without_anything_to_follow_nothing_is_evaluated(scene: Any, visited: list[float]) -> None:
    make("a_keyed_cube")
    for obj in bpy.data.objects:
        obj.cycles.use_motion_blur = False
    visited.clear()
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    assert visited == [] and sync.record.motion.count == 0


@pytest.mark.parametrize("watch", [True, False])
def test_a_mesh_that_rests_is_read_once(scene: Any, watch: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scene also has a cube that moves, and one that deforms."""
    reads: list[str] = []
    read_mesh = mesh_table.read_mesh

    def count(mesh: Any, key: Any, name: str, *rest: Any) -> Any:
        reads.append(name)
        return read_mesh(mesh, key, name, *rest)

    monkeypatch.setattr(mesh_table, "read_mesh", count)
    make("a_keyed_cube")
    sync = SceneSync(watch=watch)
    sync.update(evaluated(), shutter=SHUTTER)
    assert sorted(reads) == ["Cube", "Icosphere"], "places alone have changed"
    held = next(mesh.positions for mesh in sync.record.meshes if mesh.name == "Icosphere")
    reads.clear()
    key = bpy.data.objects["Cube"].shape_key_add(name="Basis")
    key = bpy.data.objects["Cube"].shape_key_add(name="Far")
    key.data[0].co.x += 2.0
    keyed(key, "value", [0.0, 1.0])
    scene.frame_set(FRAME)
    sync.update(evaluated(), shutter=SHUTTER)
    assert reads.count("Cube") == 4
    assert reads.count("Icosphere") <= (0 if watch else 1)  # without watching, a second reading is allowed
    assert next(mesh.positions for mesh in sync.record.meshes if mesh.name == "Icosphere") is held
    reads.clear()
    sync.update(evaluated())
    assert not watch or reads == [], "the frame was read last"
    assert sync.record.motion.count == 0


def test_a_render_reads_what_its_own_moments_have_changed(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from blender.builders import _ProbeEngine, in_render

    make("a_keyed_cube")
    make("a_keyed_shape")
    reads: list[str] = []
    read_mesh = mesh_table.read_mesh

    def count(mesh: Any, key: Any, name: str, *rest: Any) -> Any:
        reads.append(name)
        return read_mesh(mesh, key, name, *rest)

    def render(engine: Any, depsgraph: Any) -> None:
        SceneSync(watch=False).update(depsgraph, shutter=SHUTTER, frame_set=engine.frame_set)

    monkeypatch.setattr(mesh_table, "read_mesh", count)
    monkeypatch.setattr(_ProbeEngine, "render", render)
    in_render(lambda _: None)
    assert {name: reads.count(name) for name in reads} == {"Cube": 1, "Icosphere": 1, "Icosphere.001": 4}


def test_what_rests_gets_no_motion(scene: Any) -> None:
    make("a_keyed_cube")
    for x in range(5):
        mesh_object(f"still {x}", location=(x, 5, 0))
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    moving = [row for motions in sync.record.motion.instances for row in motions.rows]
    names = {sync.record.objects[sync.record.instances.object_indices[row]].name for row in moving}
    assert names == {"Cube"} and sync.record.motion.meshes == ()


# Refused arguments ---------------------------------------------------------------------------------------------------

REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"shutter": (0.5, 0.5)}, r"update: shutter must be two finite numbers .* begin < end, got \(0.5, 0.5\)"),
    ({"shutter": (0.5, -0.5)}, r"update: shutter must be two finite numbers"),
    ({"shutter": (0.0, np.nan)}, r"update: shutter must be two finite numbers"),
    ({"shutter": (-np.inf, 0.0)}, r"update: shutter must be two finite numbers"),
    ({"shutter": 0.5}, r"update: shutter must be two finite numbers .*, got 0.5"),
    ({"shutter": (0, 1, 2)}, r"update: shutter must be two finite numbers"),
    ({"shutter": "ab"}, r"update: shutter must be two finite numbers .*, got 'ab'"),
    ({"shutter": (0.0, 1e9)}, r"update: shutter must lie within 1,048,574 frames"),
    ({"shutter": SHUTTER, "steps": 1}, r"update: steps must be an integer from 2 to 255, got 1"),
    ({"shutter": SHUTTER, "steps": 256}, r"update: steps must be an integer from 2 to 255, got 256"),
    ({"shutter": SHUTTER, "steps": 3.0}, r"update: steps must be an integer from 2 to 255, got 3.0"),
    ({"shutter": SHUTTER, "steps": True}, r"update: steps must be an integer from 2 to 255, got True"),
    ({"shutter": SHUTTER, "frame_set": 3}, r"update: frame_set must be a function of a frame and a subframe, got 3"),
    ({"steps": 3}, r"update: steps needs a shutter, got 3 without one"),
    ({"frame_set": print}, r"update: frame_set needs a shutter"),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_arguments_are_refused_before_anything_is_done(scene: Any, arguments: dict[str, Any], message: str) -> None:
    make("a_keyed_cube")
    sync = SceneSync()
    sync.update(evaluated())
    with pytest.raises(ValueError, match=message):
        sync.update(evaluated(), **arguments)
    assert sync.scene.is_current, "what was synced is still there"
