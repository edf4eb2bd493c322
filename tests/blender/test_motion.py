"""Scenes that move within a shutter, compared ray by ray with the same scenes at rest at a moment of the shutter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from blender.builders import evaluated
from blender.moving_scenes import EVEN, FRAME, SCENES, SHUTTER, Told, at_frame, frozen, make
from perfect_bvh_addon import SceneSync

# Between two moments, Blender's own values are float32, as those at the moments are.
ROUNDING = 2e-5
# The share of rays that pass an edge more closely than that.
PASSING = 0.002


def offset(time: float, shutter: tuple[float, float] = SHUTTER) -> float:
    return (1.0 - time) * shutter[0] + time * shutter[1]


def read(shutter: tuple[float, float] = SHUTTER, **how: Any) -> SceneSync:
    sync = SceneSync()
    sync.update(evaluated(), shutter=shutter, **how)
    return sync


@pytest.mark.parametrize("name", SCENES)
def test_at_its_moments_a_scene_is_what_it_is_there(scene: Any, name: str) -> None:
    make(name)
    sync = read()
    snapshot = sync.scene.snapshot()
    assert sync.record.motion.count and not sync.warnings
    still = frozen(0.0)
    for time in (0.0, 0.5, 1.0):
        moving, there = Told(sync, snapshot, time), frozen(offset(time))
        assert there.is_hit.mean() > 0.02
        assert not moving.is_not_at_moment(there).any()
        assert time == 0.5 or moving.differs(still).any(), "it moves"


@pytest.mark.parametrize("name", SCENES)
def test_moments_hold_what_blender_has_there_bit_by_bit(scene: Any, name: str) -> None:
    make(name)
    record = read().record
    moving = {row for motions in record.motion.instances for row in motions.rows.tolist()}
    for step, time in enumerate((0.0, 0.5, 1.0)):
        there = at_frame(offset(time)).record
        for motions in record.motion.instances:
            assert motions.transforms[step].tobytes() == there.instances.transforms[motions.rows].tobytes()
        rest = [row for row in range(len(record.instances)) if row not in moving]
        assert record.instances.transforms[rest].tobytes() == there.instances.transforms[rest].tobytes()
        shapes = {motion.row: motion.positions[step] for motion in record.motion.meshes}
        for row, mesh in enumerate(there.meshes):
            assert shapes.get(row, record.meshes[row].positions).tobytes() == mesh.positions.tobytes()


@pytest.mark.parametrize("name", EVEN)
def test_between_moments_what_goes_evenly_is_where_blender_has_it(scene: Any, name: str) -> None:
    make(name)
    sync = read()
    snapshot = sync.scene.snapshot()
    for seed, time in enumerate((0.13, 0.77)):
        moving, there = Told(sync, snapshot, time, seed=seed), frozen(offset(time), seed=seed)
        assert moving.is_elsewhere(there, ROUNDING).mean() < PASSING


@pytest.mark.parametrize("name", SCENES)
def test_without_a_shutter_nothing_moves_any_more(scene: Any, name: str) -> None:
    make(name)
    sync = read()
    report = sync.update(evaluated())
    assert report.motion_changed and report.motion_count == 0 and sync.record.motion.count == 0
    snapshot = sync.scene.snapshot()
    fresh = frozen(0.0)
    for time in (0.0, 0.3, 1.0):
        assert not Told(sync, snapshot, time).differs(fresh).any()
    assert not sync.update(evaluated()).has_changes


@pytest.mark.parametrize("name", SCENES)
def test_the_same_shutter_again_changes_nothing(scene: Any, name: str) -> None:
    make(name)
    sync = read()
    first = Told(sync, sync.scene.snapshot(), 0.9)
    revision = sync.revision
    report = sync.update(evaluated(), shutter=SHUTTER)
    assert not report.has_changes and report.motion_count and sync.revision == revision
    assert not Told(sync, sync.scene.snapshot(), 0.9).differs(first).any()


@pytest.mark.parametrize("name", ["a_keyed_cube", "a_keyed_shape", "hair", "instances_of_nodes"])
def test_another_frame_has_the_motion_of_that_frame(scene: Any, name: str) -> None:
    make(name)
    sync = read()
    scene.frame_set(FRAME + 3)
    sync.update(evaluated(), shutter=SHUTTER)
    snapshot = sync.scene.snapshot()
    for time in (0.0, 1.0):
        assert not Told(sync, snapshot, time).is_not_at_moment(frozen(3.0 + offset(time))).any()


@pytest.mark.parametrize("shutter", [(0.0, 0.5), (-0.5, 0.0), (0.25, 1.0), (-3.0, -2.5)])
def test_a_shutter_may_open_anywhere(scene: Any, shutter: tuple[float, float]) -> None:
    make("a_keyed_shape")
    sync = read(shutter)
    snapshot = sync.scene.snapshot()
    assert sync.record.frame == FRAME
    for time in (0.0, 0.5, 1.0):
        assert not Told(sync, snapshot, time).is_not_at_moment(frozen(offset(time, shutter))).any()


def test_steps_are_asked_of_what_never_said_how_many(scene: Any) -> None:
    make("an_armature")
    sync = read(steps=6)
    snapshot = sync.scene.snapshot()
    for time in np.linspace(0.0, 1.0, 6):
        assert not Told(sync, snapshot, float(np.float32(time))).is_elsewhere(frozen(offset(time)), ROUNDING).any()
    assert len(sync.record.motion.meshes[0].positions) == 6


def test_a_viewport_is_verified_at_its_frame(scene: Any) -> None:
    make("a_keyed_shape")
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True, shutter=SHUTTER).mismatches == ()


def test_halves_take_a_shutter_as_well(scene: Any, sync: SceneSync) -> None:
    make("a_keyed_cube")
    report = sync.begin_update(evaluated(), shutter=SHUTTER).result()
    assert report.motion_count == 1
    again = sync.begin_update(evaluated(), shutter=(0.0, 0.5)).result()
    assert again.motion_changed
    snapshot = sync.scene.snapshot()
    assert not Told(sync, snapshot, 1.0).is_not_at_moment(frozen(0.5)).any()


def test_times_of_rays_go_each_to_its_own(scene: Any) -> None:
    make("a_keyed_cube")
    sync = read()
    snapshot = sync.scene.snapshot()
    times = np.tile(np.float32([0.0, 0.5, 1.0]), 1000)
    moving = Told(sync, snapshot, times)
    for number, time in enumerate((0.0, 0.5, 1.0)):
        assert not moving.is_not_at_moment(frozen(offset(time)))[number::3].any()


def test_a_render_s_own_frames_are_read(scene: Any) -> None:
    """Only the render's engine may evaluate its depsgraph."""
    from blender.builders import _ProbeEngine, in_render

    make("a_keyed_shape")
    engines: list[Any] = []
    render = _ProbeEngine.render

    def keep(engine: Any, depsgraph: Any) -> None:
        engines.append(engine)
        render(engine, depsgraph)

    def visit(depsgraph: Any) -> Any:
        sync = SceneSync(watch=False)
        with pytest.raises(ValueError, match="frame_set must evaluate the depsgraph that is read"):
            sync.update(depsgraph, shutter=SHUTTER)
        sync.update(depsgraph, shutter=SHUTTER, frame_set=engines[0].frame_set)
        assert sync.record.motion.count == 1
        assert (depsgraph.scene.frame_current, depsgraph.scene.frame_subframe) == (FRAME, 0.0)
        return Told(sync, sync.scene.snapshot(), 1.0)

    _ProbeEngine.render = keep
    try:
        moving = in_render(visit)
    finally:
        _ProbeEngine.render = render
    assert (scene.frame_current, scene.frame_subframe) == (FRAME, 0.0)
    assert not moving.is_not_at_moment(frozen(offset(1.0))).any()


def test_the_oracle_sees_a_motion_that_is_off(scene: Any) -> None:
    """The motion is off by a hundredth of a frame."""
    make("a_keyed_cube")
    sync = at_frame(0.01)
    off = Told(sync, sync.scene.snapshot())
    assert off.is_elsewhere(frozen(0.0), ROUNDING).mean() > PASSING
