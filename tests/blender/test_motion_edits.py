"""Random edits between updates with and without a shutter: the synced record equals a fresh reading bit by bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import evaluated
from blender.moving_scenes import FRAME, SCENES, Told, keyed
from perfect_bvh_addon import SceneSync

STEPS = 30
SHUTTERS = (None, (-0.25, 0.25), (0.0, 0.5), (-2.0, 1.0))


def shown(random: np.random.Generator) -> Any:
    objects = [obj for obj in bpy.context.scene.objects if obj.type in {"MESH", "CURVES", "POINTCLOUD", "FONT"}]
    return objects[random.integers(len(objects))]


def another_frame(random: np.random.Generator) -> None:
    bpy.context.scene.frame_set(FRAME + int(random.integers(-3, 4)), subframe=float(random.choice([0.0, 0.5])))


def other_keys(random: np.random.Generator) -> None:
    places = random.uniform(-4.0, 4.0, (2, 3))
    keyed(shown(random), "location", [tuple(place) for place in places])


def no_keys(random: np.random.Generator) -> None:
    shown(random).animation_data_clear()


def another_switch(random: np.random.Generator) -> None:
    settings = shown(random).cycles
    settings.use_motion_blur = bool(random.random() < 0.7)
    settings.use_deform_motion = bool(random.random() < 0.7)
    settings.motion_steps = int(random.integers(1, 3))


def hidden(random: np.random.Generator) -> None:
    obj = shown(random)
    obj.hide_viewport = not obj.hide_viewport


def a_copy(random: np.random.Generator) -> None:
    obj = shown(random).copy()
    obj.location.y += 2.0
    bpy.context.scene.collection.objects.link(obj)


def gone(random: np.random.Generator) -> None:
    if len(bpy.context.scene.objects) > 4:
        bpy.data.objects.remove(shown(random))


def other_triangles(random: np.random.Generator) -> None:
    obj = shown(random)
    if obj.type == "MESH":
        obj.modifiers.new("solid", "SOLIDIFY")


EDITS: tuple[Callable[[np.random.Generator], None], ...] = (
    another_frame,
    other_keys,
    no_keys,
    another_switch,
    hidden,
    a_copy,
    gone,
    other_triangles,
)


@pytest.mark.parametrize("seed", range(4))
def test_a_synced_scene_moves_as_a_fresh_one(scene: Any, seed: int) -> None:
    random = np.random.default_rng(seed)
    for name in random.choice([name for name in SCENES if name != "an_armature"], 4, replace=False):
        SCENES[name]()
    scene.frame_set(FRAME)
    sync = SceneSync()
    moved = 0
    for step in range(STEPS):
        edit = EDITS[random.integers(len(EDITS))]
        edit(random)
        shutter = SHUTTERS[random.integers(len(SHUTTERS))]
        at = scene.frame_current, scene.frame_subframe
        report = sync.update(evaluated(), shutter=shutter, verify=True)
        snapshot = sync.scene.snapshot()
        fresh = SceneSync()
        fresh.update(evaluated(), shutter=shutter)
        told = f"step {step}: {edit.__name__}, {shutter}"
        assert report.mismatches == (), told
        assert (scene.frame_current, scene.frame_subframe) == at, told
        assert sync.warnings == fresh.warnings, told
        for time in (0.0, 0.31, 1.0):
            there = Told(fresh, fresh.scene.snapshot(), time, seed=step)
            assert not Told(sync, snapshot, time, seed=step).differs(there).any(), told
        fresh.close()
        moved += report.motion_count > 0
    assert moved > STEPS // 4
