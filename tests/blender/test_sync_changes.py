"""After each kind of change a synced scene equals a fresh reading, and rays through both agree."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import (
    evaluated,
)
from blender.village import CHANGES, build_village, thing
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.sync.keys import instance_keys

ALL_ATTRIBUTES = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True)


@pytest.fixture
def village(scene: Any) -> Any:
    return build_village(scene)


@pytest.mark.parametrize("name", CHANGES)
def test_a_change(village: Any, name: str) -> None:
    change = CHANGES[name]
    sync = SceneSync(ALL_ATTRIBUTES)
    sync.update(evaluated())
    change.act()
    depsgraph = evaluated()
    if change.stale:
        with pytest.raises(perfect_bvh.StaleSceneError, match=r"call update\(\)"):
            sync.scene.snapshot()
    report = sync.update(depsgraph, verify=True)
    assert report.mismatches == ()
    assert {item.name: item.action for item in report.objects}.items() >= change.actions.items()
    assert_equal_to_a_fresh_one(sync, depsgraph)


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_and_back(village: Any, name: str) -> None:
    """Sync the scene, change it, sync again, scale all objects and leave the change's mode, and sync a third time."""
    sync = SceneSync()
    sync.update(evaluated())
    CHANGES[name].act()
    sync.update(evaluated())
    if bpy.context.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    for obj in bpy.data.objects:
        obj.scale = (obj.scale.x * 0.5, obj.scale.y, obj.scale.z)
    report = sync.update(evaluated())
    assert report.moved_count > 0
    assert_equal_to_a_fresh_one(sync, evaluated())


def test_all_changes_one_after_the_other(village: Any, rng: np.random.Generator) -> None:
    sync = SceneSync()
    sync.update(evaluated())
    done = 0
    for name in rng.permutation(list(CHANGES)):
        try:
            CHANGES[name].act()
        except (KeyError, RuntimeError):
            continue  # the object it changes was removed or renamed by an earlier change
        done += 1
        if bpy.context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        depsgraph = evaluated()
        sync.update(depsgraph)
        assert_equal_to_a_fresh_one(sync, depsgraph)
    assert done > 15


def assert_equal_to_a_fresh_one(sync: SceneSync, depsgraph: Any) -> None:
    """Compare the synced scene with one that has never seen anything else."""
    fresh = SceneSync(sync._attributes, watch=False)
    fresh.update(depsgraph)
    assert_equal_records(sync, fresh)
    assert_equal_answers(sync, fresh)


def assert_equal_records(sync: SceneSync, fresh: SceneSync) -> None:
    one, other = sync.record, fresh.record
    np.testing.assert_array_equal(instance_keys(one), instance_keys(other))
    np.testing.assert_array_equal(one.instances.transforms, other.instances.transforms)
    np.testing.assert_array_equal(one.instances.masks, other.instances.masks)
    assert [mesh.key for mesh in one.meshes] == [mesh.key for mesh in other.meshes]
    for first, second in zip(one.meshes, other.meshes, strict=True):
        np.testing.assert_array_equal(first.positions, second.positions)
        np.testing.assert_array_equal(first.triangles, second.triangles)
    assert (one.objects, one.materials) == (other.objects, other.materials)
    np.testing.assert_array_equal(sync.appearance.materials.colors, fresh.appearance.materials.colors)
    np.testing.assert_array_equal(sync.appearance.instances.slot_materials, fresh.appearance.instances.slot_materials)


def rays() -> tuple[np.ndarray, np.ndarray]:
    """Return rays through the whole village: from above on a grid, and random ones in all directions."""
    x, y = np.meshgrid(np.linspace(-20, 20, 120), np.linspace(-10, 24, 100))
    above = np.stack([x.ravel(), y.ravel(), np.full(x.size, 15.0)], axis=1)
    rng = np.random.default_rng(3)
    around = rng.uniform((-20, -10, -1), (20, 24, 4), (6000, 3))
    directions = np.concatenate([np.broadcast_to([0.0, 0.0, -1.0], above.shape), rng.normal(size=(6000, 3))])
    return np.concatenate([above, around]), directions


def assert_equal_answers(sync: SceneSync, fresh: SceneSync) -> None:
    """Check every ray: the same t, triangle, object, instance, polygon and material."""
    origins, directions = rays()
    fields = ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions")
    one, other = (item.scene.cast_rays(origins, directions, fields=fields) for item in (sync, fresh))
    for field in ("t_hit", "primitive_ids", "primitive_uvs", "geometric_normals", "positions"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field), err_msg=field)
    for mine, theirs in zip(sync.describe(one.instance_ids), fresh.describe(other.instance_ids), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_array_equal(sync.polygon_ids(one), fresh.polygon_ids(other))
    np.testing.assert_array_equal(sync.material_ids(one), fresh.material_ids(other))
    assert one.is_hit.mean() > 0.2
    camera_rays = {"mask": 1}
    seen, seen_fresh = (item.scene.cast_rays(origins, directions, **camera_rays) for item in (sync, fresh))
    np.testing.assert_array_equal(seen.t_hit, seen_fresh.t_hit)


def test_only_the_difference_reaches_the_engine(village: Any) -> None:
    """Moving builds no tree, deforming refits one, other triangles rebuild one."""
    sync = SceneSync()
    first = sync.update(evaluated()).commit
    assert first.count("built") == len(first.meshes) == len(sync.record.meshes)
    refits = {"refitted", "rotated", "partly_rebuilt", "rebuilt"}
    for name, actions, count in (
        ("moved", {"built"}, 0),
        ("nodes moved their instances", {"built"}, 0),
        ("armature posed", refits, 1),
        ("topology changed at equal counts", {"rebuilt"}, 1),
        ("object added", {"built"}, 1),
        ("hidden from the camera", {"built"}, 0),
    ):
        CHANGES[name].act()
        commit = sync.update(evaluated()).commit
        assert len(commit.meshes) == count, name
        assert all(item.action in actions for item in commit.meshes), name
        assert commit.kept_count == len(sync.record.meshes) - count


@pytest.mark.parametrize("frames", [range(1, 26, 3), [20, 1, 15, 15, 2]])
def test_an_animation(village: Any, frames: Any) -> None:
    box = thing("box")
    for frame, x in ((1, 0.0), (20, 4.0)):
        box.location.x = x
        box.keyframe_insert("location", frame=frame)
    sync = SceneSync()
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        depsgraph = evaluated()
        report = sync.update(depsgraph)
        assert report.frame == frame
        assert_equal_to_a_fresh_one(sync, depsgraph)


def test_a_modifier_that_changes_topology_on_some_frames_only(village: Any) -> None:
    modifier = thing("posed").modifiers.new("subsurf", "SUBSURF")
    for frame, shown in ((1, False), (5, True), (7, False)):
        modifier.show_viewport = shown
        modifier.keyframe_insert("show_viewport", frame=frame)
    sync = SceneSync()
    actions = []
    for frame in range(1, 9):
        bpy.context.scene.frame_set(frame)
        if frame in (3, 6):
            pose_by(frame)
        depsgraph = evaluated()
        report = sync.update(depsgraph)
        actions.append(next(item.action for item in report.objects if item.name == "posed"))
        assert_equal_to_a_fresh_one(sync, depsgraph)
    assert actions == ["added", "kept", "deformed", "kept", "replaced", "deformed", "replaced", "kept"]


def pose_by(amount: float) -> None:
    thing("bones").pose.bones["bone"].location.x = amount * 0.1
