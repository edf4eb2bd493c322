"""An update in two halves: Blender is read at once, trees are built in the background, no answer comes too early."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.long_builds import HALF, PATIENCE, Gate  # noqa: E402
from blender.syncing import assert_stale, depsgraph, height, move  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.live.sync_cache import drop_missing, sync_of  # noqa: E402
from perfect_bvh_addon.sync.records import AttributeRequest  # noqa: E402


def test_what_was_read_is_there_at_once_and_answers_come_with_the_trees(box, sync: SceneSync, gate: Gate) -> None:
    building = sync.begin_update(depsgraph())
    assert [mesh.name for mesh in sync.record.meshes] == ["Cube"]
    assert_stale(sync, "the last update did not succeed: call update")
    while building.share != HALF:
        building.wait(0.01)
    assert sync.building is building
    assert_stale(sync, "the last update did not succeed: call update")
    gate.open()
    report = building.result()
    assert (report.added_count, report.commit.generation) == (1, 1)
    assert sync.building is None
    assert height(sync) == 1.0
    assert (sync.revision, sync.last_change) == (1, report)
    assert report.read_milliseconds > 0.0 and report.commit_milliseconds > 0.0


def test_a_sync_that_watches_is_updated_in_one_go_only(box) -> None:
    made = SceneSync()
    with pytest.raises(RuntimeError, match="begin_update: the sync watches Blender; create it with watch=False"):
        made.begin_update(depsgraph())
    made.close()


def test_who_asks_for_the_same_waits_for_the_same(box, sync: SceneSync, gate: Gate) -> None:
    building = sync.begin_update(depsgraph())
    assert sync.begin_update(depsgraph()) is building
    gate.wait_until_held()
    assert gate.held == 1
    gate.open()
    building.settle()
    assert sync.begin_update(depsgraph()) is not building, "it has ended"


def test_a_build_that_ends_while_somebody_joins_it_is_handed_on(
    box, sync: SceneSync, gate: Gate, monkeypatch: pytest.MonkeyPatch
) -> None:
    building = sync.begin_update(depsgraph())
    look = SceneSync.building.fget

    def look_and_let_it_end(asked: SceneSync):
        found = look(asked)
        gate.open()
        assert building.wait(PATIENCE)
        return found

    monkeypatch.setattr(SceneSync, "building", property(look_and_let_it_end))
    joined = sync.begin_update(depsgraph())
    assert joined is building
    assert joined.result().added_count == 1
    assert not sync.begin_update(depsgraph()).result().has_changes
    assert sync.revision == 1


@pytest.mark.parametrize("asked", [{"size": (5, 4)}, {"attributes": True}, {"moved": True}, {"frame": 3}])
def test_who_asks_for_something_else_stops_it(box, sync: SceneSync, gate: Gate, asked: dict[str, object]) -> None:
    bpy.ops.object.shade_smooth()
    building = sync.begin_update(depsgraph())
    if "attributes" in asked:
        sync.request(AttributeRequest(corner_normals=True))
    if "moved" in asked:
        move(box, 2.0)
    if "frame" in asked:
        bpy.context.scene.frame_set(3)
    other = sync.begin_update(depsgraph(), size=asked.get("size"))
    assert other is not building
    assert not building.is_running
    with pytest.raises(perfect_bvh.Cancelled):
        building.result()
    gate.open()
    report = other.result()
    assert report.finishes_earlier_update and report.has_changes
    assert height(sync) == (3.0 if "moved" in asked else 1.0)
    assert (sync.revision, sync.last_change) == (1, report)


def test_an_update_in_one_go_stops_it_and_is_right(box, sync: SceneSync, gate: Gate) -> None:
    building = sync.begin_update(depsgraph())
    move(box, 4.0)
    report = sync.update(depsgraph())
    assert report.finishes_earlier_update
    with pytest.raises(perfect_bvh.Cancelled):
        building.result()
    assert height(sync) == 5.0


def test_one_that_ended_unseen_is_not_forgotten(box, sync: SceneSync) -> None:
    """Its result was never requested: the next update must know that the scene changed, or show an old image."""
    sync.begin_update(depsgraph()).settle()
    assert sync.revision == 1
    move(box, 3.0)
    assert sync.begin_update(depsgraph()).wait(PATIENCE)
    report = sync.begin_update(depsgraph()).result()
    assert not report.has_changes
    assert sync.revision == 2
    assert height(sync) == 4.0


def test_a_stopped_build_leaves_its_edits_to_the_next(box, sync: SceneSync, gate: Gate) -> None:
    sync.update(depsgraph())
    move(box, 2.0)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(5.0, 0.0, 7.0))
    sync.begin_update(depsgraph())
    sync.stop_building()
    assert_stale(sync, "the last update did not succeed: call update")
    gate.open()
    report = sync.begin_update(depsgraph()).result()
    assert report.finishes_earlier_update
    assert (report.added_count, report.moved_count) == (0, 0), "the edits were made before"
    assert (height(sync), height(sync, 5.2)) == (3.0, 8.0)
    expected = SceneSync(watch=False)
    expected.update(depsgraph())
    random = np.random.default_rng(1)
    rays = random.normal(scale=4.0, size=(500, 3)), random.normal(size=(500, 3))
    hits, wanted = sync.scene.cast_rays(*rays), expected.scene.cast_rays(*rays)
    for name in ("t_hit", "primitive_ids", "primitive_uvs"):
        np.testing.assert_array_equal(getattr(hits, name), getattr(wanted, name))
    assert sync.describe(hits.instance_ids).names.tolist() == expected.describe(wanted.instance_ids).names.tolist()
    np.testing.assert_array_equal(sync.polygon_ids(hits), expected.polygon_ids(wanted))


def test_hits_from_before_are_not_looked_up_in_what_was_only_read(box, sync: SceneSync, gate: Gate) -> None:
    sync.update(depsgraph())
    hits = sync.scene.cast_rays([(0.2, 0.2, 10.0)], [(0.0, 0.0, -1.0)])
    box.data.clear_geometry()
    box.data.from_pydata([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], [], [(0, 1, 2)])
    bpy.context.view_layer.update()
    sync.begin_update(depsgraph())
    with pytest.raises(ValueError, match="polygon_ids: hits must be from after"):
        sync.polygon_ids(hits)


def test_a_reading_that_fails_stops_what_is_built(box, sync: SceneSync, gate: Gate, monkeypatch) -> None:
    """The stopped build must not become an answer: the present state of Blender is unknown."""
    building = sync.begin_update(depsgraph())

    def fail(*_: object, **__: object) -> None:
        raise MemoryError("too large")

    monkeypatch.setattr("perfect_bvh_addon.live.scene_sync.read_scene", fail)
    with pytest.raises(MemoryError, match="too large"):
        sync.begin_update(depsgraph())
    assert not building.is_running
    assert_stale(sync, "the last update did not succeed: call update")


def test_closing_and_losing_the_scene_stop_it(box, gate: Gate) -> None:
    made = SceneSync(watch=False)
    building = made.begin_update(depsgraph())
    made.close()
    assert not building.is_running
    assert_stale(made, "the sync was closed")

    building = sync_of(depsgraph()).begin_update(depsgraph())
    drop_missing([])
    assert building.wait(PATIENCE)
    with pytest.raises(perfect_bvh.Cancelled):
        building.result()
