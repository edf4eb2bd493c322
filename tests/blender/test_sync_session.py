"""`SceneSync` as a script uses it: its answers compared with Blender's own, and its requests."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import perfect_bvh
import pytest
from blender.builders import (
    SQUARE,
    camera_object,
    collection,
    collection_instance,
    evaluated,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
)
from blender.syncing import DOWN, cast_down
from perfect_bvh_addon import AttributeRequest, SceneSync


def test_hits_are_those_of_blenders_own_ray_cast(scene: Any, rng: np.random.Generator) -> None:
    bpy.ops.mesh.primitive_monkey_add(rotation=(0.4, 0.3, 0.2))
    bpy.ops.mesh.primitive_torus_add(location=(2.5, 0, 0))
    bpy.context.object.scale = (1, -1.5, 0.7)
    inner = collection("inner", linked=False)
    mesh_object("leaf", collection=inner)
    collection_instance("tree", inner, location=(-2.5, 0, 0)).rotation_euler.x = 1.0
    instances_on_grid("field", made_cube, 3).location.y = 8.0
    depsgraph = evaluated()
    sync = SceneSync()
    sync.update(depsgraph)
    origins = rng.uniform((-5, -3, 4), (5, 13, 6), (1000, 3))
    directions = rng.uniform((-0.3, -0.3, -1), (0.3, 0.3, -0.9), (1000, 3))
    hits = sync.scene.cast_rays(origins, directions, fields=("instance_ids", "mesh_ids", "primitive_ids", "positions"))
    names = sync.describe(hits.instance_ids).names
    polygons = sync.polygon_ids(hits)
    for row, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
        found, location, _, polygon, obj, _ = scene.ray_cast(depsgraph, origin, direction)
        assert bool(hits.is_hit[row]) == found
        if found:
            np.testing.assert_allclose(hits.positions[row], location, atol=1e-4)
            assert (names[row], polygons[row]) == (obj.name, polygon)
    assert hits.is_hit.sum() > 60


def test_materials_of_hits(scene: Any) -> None:
    data = mesh_data("two halves", [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)],
                     [(0, 1, 4, 3), (1, 2, 5, 4)])  # fmt: skip
    for name in ("red", "green"):
        data.materials.append(bpy.data.materials.new(name))
    data.polygons[1].material_index = 1
    mesh_object("halves", data)
    sync = SceneSync()
    sync.update(evaluated())
    hits = sync.scene.cast_rays([(-0.5, 0, 5), (0.5, 0, 5), (3, 0, 5)], [DOWN])
    rows = sync.material_ids(hits)
    assert rows[2] == -1
    assert sync.material_names[rows[:2]].tolist() == ["red", "green"]
    assert sync.polygon_ids(hits).tolist() == [0, 1, -1]


def test_other_slots_and_polygons_of_the_same_triangles_are_read(scene: Any) -> None:
    """Nothing moves: neither the slots nor the polygons of the last reading may be used again."""
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    data = mesh_data("square", corners, [(0, 1, 2), (0, 2, 3)])
    for name in ("red", "green"):
        data.materials.append(bpy.data.materials.new(name))
    mesh_object("square", data)
    sync = SceneSync()
    sync.update(evaluated())
    rays = [(0.5, -0.5, 5), (-0.5, 0.5, 5)], [DOWN]
    for slots in ((0, 1), (1, 1), (1, 0), (0, 0)):
        data.polygons.foreach_set("material_index", slots)
        data.update()
        report = sync.update(evaluated(), verify=True)
        assert (report.mismatches, report.attributes_changed) == ((), True)
        assert sync.material_ids(sync.scene.cast_rays(*rays)).tolist() == list(slots)
    for faces, polygons in (([(0, 1, 2, 3)], [0, 0]), ([(0, 1, 2), (0, 2, 3)], [0, 1])):
        data.clear_geometry()
        data.from_pydata(corners, [], faces)
        report = sync.update(evaluated(), verify=True)
        assert (report.mismatches, report.attributes_changed, report.count_meshes("kept")) == ((), True, 1)
        assert sync.polygon_ids(sync.scene.cast_rays(*rays)).tolist() == polygons
    sync.close()


def test_dropped_triangles_leave_the_others_their_ids(scene: Any) -> None:
    mesh_object(
        "broken", mesh_data("broken", [(0, 0, np.nan), (0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (1, 2, 3)])
    )
    sync = SceneSync()
    report = sync.update(evaluated())
    hits = cast_down(sync)
    assert hits.primitive_ids.tolist() == [0]
    assert sync.polygon_ids(hits).tolist() == sync.triangle_ids(hits).tolist() == [1]
    assert (
        report.warnings
        == sync.warnings
        == ("broken: left out 1 triangle with a vertex that is not finite or beyond 1e18",)
    )


def test_a_mesh_with_nothing_left_is_synced(scene: Any) -> None:
    mesh_object("lost", mesh_data("lost", [(0, 0, np.nan), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    sync = SceneSync()
    sync.update(evaluated())
    assert not cast_down(sync).is_hit.any()


def test_an_empty_scene_answers_with_misses(scene: Any) -> None:
    sync = SceneSync()
    report = sync.update(evaluated())
    hits = cast_down(sync)
    assert not hits.is_hit.any()
    assert sync.describe(hits.instance_ids).names.tolist() == [""]
    assert sync.camera is None
    assert sync.size == (32, 18)
    assert report.objects == ()


def test_equal_distances_are_settled_alike_whatever_the_history(scene: Any) -> None:
    """Two objects are in one place: the hit one must not depend on the order of syncing."""
    for name in ("one", "two", "three"):
        mesh_object(name, mesh_data(name, *SQUARE))
    sync = SceneSync()
    sync.update(evaluated())
    for hidden in ("one", "three", "two", "one"):
        bpy.data.objects[hidden].hide_viewport = True
        sync.update(evaluated())
        bpy.data.objects[hidden].hide_viewport = False
        sync.update(evaluated())
        fresh = SceneSync()
        fresh.update(evaluated())
        answers = [item.describe(cast_down(item).instance_ids).names[0] for item in (sync, fresh)]
        assert answers == ["one", "one"]


def test_the_camera_is_the_engines(scene: Any) -> None:
    camera_object(shift_x=0.1).location.z = 4.0
    sync = SceneSync()
    sync.update(evaluated())
    assert isinstance(sync.camera, perfect_bvh.Camera)
    assert sync.camera.matrix[2, 3] == 4.0
    assert sync.camera.window == sync.record.camera.window


def test_more_attributes_can_be_requested(scene: Any) -> None:
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.object.shade_smooth()
    sync = SceneSync(AttributeRequest(material_slots=False))
    sync.update(evaluated())
    (before,) = sync.appearance.meshes.values()
    assert (before.corner_normals, before.material_slots) == (None, None)
    sync.request(AttributeRequest(corner_normals=True))
    report = sync.update(evaluated())
    (after,) = sync.appearance.meshes.values()
    assert after.corner_normals is not None
    assert after.material_slots is not None
    assert report.attributes_changed
    assert report.count_meshes("kept") == 1
    sync.request(AttributeRequest(material_slots=False), only=True)
    sync.update(evaluated())
    (last,) = sync.appearance.meshes.values()
    assert (last.corner_normals, last.material_slots) == (None, None)


def test_render_visibility_can_be_asked_for(scene: Any) -> None:
    mesh_object("a").hide_render = True
    viewport, render = SceneSync(), SceneSync(for_viewport=False)
    for sync in (viewport, render):
        sync.update(evaluated())
    assert cast_down(viewport).is_hit.all()
    assert not cast_down(render).is_hit.any()


def test_verification_finds_what_was_read_wrongly(scene: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from perfect_bvh_addon.live import scene_sync

    mesh_object("a")
    sync = SceneSync()
    assert sync.update(evaluated(), verify=True).mismatches == ()

    right = scene_sync.read_scene

    def wrong(*arguments: Any, **options: Any) -> Any:
        made = right(*arguments, **options)
        if "reader" not in options:
            made.meshes[0].positions[0] += 1.0
        return made

    monkeypatch.setattr(scene_sync, "read_scene", wrong)
    assert sync.update(evaluated(), verify=True).mismatches == ("mesh a: positions differ",)
