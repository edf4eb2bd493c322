"""Scene Updates: the objects that are named, their states, and the sentences about them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.builders import (  # noqa: E402
    collection,
    collection_instance,
    evaluated,
    mesh_data,
    mesh_object,
)
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.image.plan import owners_of  # noqa: E402
from perfect_bvh_addon.statistics import updates  # noqa: E402
from perfect_bvh_addon.statistics.last_result import Owners  # noqa: E402
from perfect_bvh_addon.statistics.updates import (  # noqa: E402  # noqa: E402
    UpdateRow,
    Updates,
    facts_of,
    find_instancers,
    find_updates,
    what_to_do,
    what_was_done,
)


def update(sync: SceneSync) -> Updates:
    report = sync.update(evaluated(), expected_rays=100_000)
    return find_updates(report, owners_of(sync))


def told(found: Updates) -> tuple[dict[str, str], dict[str, str]]:
    """Return the states by title: of changed rows, and of unchanged rows."""
    return {row.title: row.state for row in found.changed}, {row.title: row.state for row in found.unchanged}


def row_named(found: Updates, name: str) -> UpdateRow:
    (row,) = [row for row in (*found.changed, *found.unchanged) if row.title == name]
    return row


# Which objects ------------------------------------------------------------------------------------------------------


def test_objects_of_one_mesh_are_one_row_until_something_happens_to_one_of_them(scene: Any) -> None:
    shared = mesh_data("shared")
    for number in range(20):
        mesh_object(f"Chair {number:02}", shared, location=(number, 0, 0))
    mesh_object("Table")
    sync = SceneSync()
    assert told(update(sync)) == ({"Chair 00 and 19 more": "built", "Table": "built"}, {})
    found = update(sync)
    assert told(found) == ({}, {"Chair 00 and 19 more": "kept", "Table": "kept"})
    assert (found.changed_count, found.unchanged_count) == (0, 21)
    bpy.data.objects["Chair 07"].location.z = 1.0
    found = update(sync)
    assert told(found) == ({"Chair 07": "moved"}, {"Chair 00 and 18 more": "kept", "Table": "kept"})
    assert (found.changed_count, found.unchanged_count) == (1, 20)
    shared.vertices[0].co.x = 0.5
    shared.update()
    found = update(sync)
    assert told(found)[0] == {"Chair 00 and 19 more": "refitted"}
    assert sorted(row_named(found, "Chair 00 and 19 more").uids) == sorted(
        obj.session_uid for obj in scene.objects if obj.data == shared
    )
    sync.close()


def test_what_is_gone_hidden_or_new_is_named(scene: Any) -> None:
    for name in ("A", "B", "C"):
        mesh_object(name)
    sync = SceneSync()
    update(sync)
    for switch in ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
        setattr(bpy.data.objects["A"], f"visible_{switch}", False)
    bpy.data.objects.remove(bpy.data.objects["B"])
    mesh_object("D", bpy.data.objects["C"].data)
    found = update(sync)
    changed, unchanged = told(found)
    assert changed == {"D": "added", "A and 1 more": "removed"} or changed == {"D": "added", "B and 1 more": "removed"}
    assert unchanged == {"C": "kept", "A": "unseen"}
    assert "visible to no kind of ray" in what_was_done(row_named(found, "A"))
    assert "show it" in what_to_do(row_named(found, "A"))
    sync.close()


def test_what_took_longest_stands_first_then_what_rays_work_on(scene: Any) -> None:
    for name in ("A", "B", "C"):
        mesh_object(name)
    sync = SceneSync()
    report = sync.update(evaluated())
    owners = owners_of(sync)
    weights = {"A": 0.1, "B": 0.6, "C": 0.2}
    shares = np.array([weights[owners.objects[row].name] for row in owners.object_rows])
    again = sync.update(evaluated())
    plain = Owners(owners.mesh_ids, owners.objects, owners.mesh_rows, owners.object_rows, owners.parent_rows, shares)
    kept = find_updates(again, plain)
    assert [(row.name, row.share) for row in kept.unchanged] == [("B", 0.6), ("C", 0.2), ("A", 0.1)]
    built = find_updates(report, plain)
    times = [row.milliseconds for row in built.changed]
    assert times == sorted(times, reverse=True) and min(times) > 0.0
    by_share = find_updates(report, plain, by_time=False)
    assert [row.name for row in by_share.changed] == ["B", "C", "A"]
    assert "60% of the camera rays' work" in facts_of(row_named(kept, "B"))
    sync.close()


def test_instances_are_of_the_object_that_is_shown(scene: Any) -> None:
    inner = collection("inner", linked=False)
    mesh_object("Leaf", collection=inner)
    collection_instance("Tree", inner)
    collection_instance("Bush", inner, location=(3, 0, 0))
    sync = SceneSync()
    found = update(sync)
    assert told(found)[0] == {"Leaf": "built"}
    instancers = find_instancers(row_named(found, "Leaf"), owners_of(sync))
    assert instancers == {bpy.data.objects[name].session_uid for name in ("Tree", "Bush")}
    sync.close()


def test_a_hundred_thousand_objects_become_few_rows() -> None:
    """Each object has a different mesh, and each tenth has moved: the list is bounded, and the counts are complete."""
    count = 100_000
    numbers = np.arange(count, dtype=np.int32)
    objects = tuple(SimpleNamespace(name=f"Object {number}", session_uid=number) for number in range(count))
    owners = Owners(numbers, objects, numbers, numbers, np.full(count, -1, np.int32), np.full(count, 1.0 / count))
    actions = np.where(numbers % 10 == 0, 2, 0).astype(np.int8)  # of OBJECT_ACTIONS: moved, kept
    columns = SimpleNamespace(session_uids=numbers.astype(np.int64), actions=actions, names=None)
    commit = SimpleNamespace(meshes=(), resting=())
    found = find_updates(SimpleNamespace(commit=commit, meshes=(), object_columns=columns, unseen=()), owners)
    assert (found.changed_count, found.unchanged_count) == (count // 10, count - count // 10)
    assert (len(found.changed), len(found.unchanged)) == (updates.MOST_CHANGED, updates.MOST_UNCHANGED)
    assert found.changed_more == count // 10 - updates.MOST_CHANGED
    assert {row.state for row in found.changed} == {"moved"} and found.changed[0].share == pytest.approx(1.0 / count)


# Sentences ----------------------------------------------------------------------------------------------------------


def cut_object() -> Any:
    """A cube with another cube cut out of it; the latter moves."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    cube = bpy.context.object
    cube.name = "Wall"
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.9, 0.0, 0.0))
    cutter = bpy.context.object
    cutter.hide_render = True
    cutter.hide_set(True)
    made = cube.modifiers.new("Window Cut", "BOOLEAN")
    made.object = cutter
    return cutter


def test_a_modifier_that_makes_other_triangles_is_named_with_what_to_do(scene: Any) -> None:
    cutter = cut_object()
    sync = SceneSync()
    update(sync)
    for step in range(1, 4):
        cutter.location = (0.9, 0.1 * step, 0.1 * step)
        cutter.scale = (1.0, 1.0, 1.0 + step)
        found = update(sync)
        if row_named(found, "Wall").mesh.action == "replaced":
            break
    row = row_named(found, "Wall")
    assert what_was_done(row).startswith("The BVH was rebuilt in ") and what_was_done(row).endswith("replaced")
    expected = "Window Cut changes the mesh in every frame: apply or bake it for faster updates"
    assert what_to_do(row) == expected
    sync.close()


def test_sentences_begin_with_a_capital_and_say_what_to_do(scene: Any, repository: Path) -> None:
    for name in ("tree_in_wind", "ocean", "gears"):
        bpy.ops.wm.open_mainfile(filepath=str(repository / "blend_scenes" / f"{name}.blend"))
        sync = SceneSync()
        for frame in (1, 2, 3):
            bpy.context.scene.frame_set(frame)
            found = update(sync)
            for row in (*found.changed, *found.unchanged):
                done, advice = what_was_done(row), what_to_do(row)
                assert done[0].isupper() and advice[0].isupper(), (done, advice)
                assert "no action is needed" in advice.lower() or "faster updates" in advice
                assert "  " not in done + advice and " 0.0 ms" not in done
        assert found.changed, "something moves in each of them"
        sync.close()
