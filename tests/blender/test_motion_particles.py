"""Particles, and particle hair, within a shutter."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import collection, evaluated
from blender.moving_scenes import FRAME, SHUTTER, Told, at_frame, frozen, keyed
from blender.particle_hair import emitter
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.sync.keys import instance_keys, match_keys


@pytest.fixture
def spray(scene: Any) -> Any:
    """Cubes that are thrown upwards; in every frame some appear and some vanish. They are simulated beyond FRAME."""
    bpy.ops.mesh.primitive_cube_add(size=0.5)
    cube = bpy.context.object
    scene.collection.objects.unlink(cube)
    collection("off", linked=False).objects.link(cube)
    bpy.ops.mesh.primitive_grid_add(size=6.0)
    obj = bpy.context.object
    obj.name = "spray"
    obj.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = obj.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 200, 1, 20, 12
    settings.render_type, settings.instance_object, settings.normal_factor = "OBJECT", cube, 5.0
    for frame in range(1, FRAME + 3):
        scene.frame_set(frame)
    scene.frame_set(FRAME)
    return obj


def test_emitted_particles_go_by_their_numbers(spray: Any) -> None:
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    record, snapshot = sync.record, sync.scene.snapshot()
    [motions] = record.motion.instances
    keys = instance_keys(record)[motions.rows]
    assert len(keys) > 60
    moving = Told(sync, snapshot, 1.0)
    for step, offset in enumerate((-0.25, 0.0, 0.25)):
        there = at_frame(offset).record
        places = match_keys(instance_keys(there), keys)
        assert (places >= 0).all()
        assert motions.transforms[step].tobytes() == there.instances.transforms[places].tobytes()
    bpy.context.scene.frame_set(FRAME)
    both = (moving.names == frozen(0.25).names) & (moving.ids == frozen(0.25).ids).all(axis=1)
    assert both.mean() > 0.9


def test_those_that_are_born_and_gone_meanwhile_are_counted(spray: Any) -> None:
    sync = SceneSync()
    sync.update(evaluated())
    here = instance_keys(sync.record)
    sync.update(evaluated(), shutter=SHUTTER)
    record = sync.record
    ends = [instance_keys(at_frame(offset).record) for offset in SHUTTER]
    missing = sum((~np.isin(here, ends[0]) | ~np.isin(here, ends[1])).tolist())
    more = max(int((~np.isin(end, here)).sum()) for end in ends)
    assert missing > 1 and more > 1
    assert list(sync.warnings) == [
        f"spray: {missing} of its instances are missing at a moment of the shutter; they stand still, as at the frame",
        f"spray: {more} of its instances are missing at the frame, but not at another moment of the shutter; left out",
    ]
    moving = np.concatenate([motions.rows for motions in record.motion.instances])
    assert len(record.instances) == len(here) == len(moving) + missing + 1  # the grid itself


def grown_on(path: str) -> Any:
    obj = emitter("sheep")
    if path == "shape":
        obj.shape_key_add(name="Basis")
        key = obj.shape_key_add(name="Raised")
        for point in key.data:
            point.co.z += point.co.x
        keyed(key, "value", [0.0, 1.0])
    else:
        keyed(obj, "location", [(0.0, 0.0, 0.0), (3.0, 2.0, 1.0)])
        keyed(obj, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.3, 1.0)])
    bpy.context.scene.frame_set(FRAME)
    return obj


def test_hair_goes_with_an_emitter_that_moves_as_a_whole(scene: Any) -> None:
    """Blender stores the strands in world space, with other rounding at each moment; that must not count as motion."""
    grown_on("place")
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    kinds = [mesh.kind for mesh in sync.record.meshes]
    assert sorted(kinds) == ["curves", "triangles"]
    assert sync.record.motion.meshes == () and sync.record.motion.count == 2
    moving, there = Told(sync, sync.scene.snapshot(), 1.0), frozen(0.25)
    assert moving.is_elsewhere(there, 1e-4).mean() < 0.002


def test_hair_goes_with_an_emitter_that_deforms(scene: Any) -> None:
    grown_on("shape")
    sync = SceneSync()
    sync.update(evaluated(), shutter=SHUTTER)
    assert {sync.record.meshes[motion.row].kind for motion in sync.record.motion.meshes} == {"curves", "triangles"}
    moving, there = Told(sync, sync.scene.snapshot(), 1.0), frozen(0.25)
    assert there.is_hit.mean() > 0.05 and not moving.is_not_at_moment(there).any()
    assert moving.differs(frozen(0.0)).any()
