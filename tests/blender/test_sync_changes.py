"""After each kind of change a synced scene equals one that is read afresh, and rays through both agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bmesh
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
    object_info,
)
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.sync.keys import instance_keys

ALL_ATTRIBUTES = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True)


@pytest.fixture
def village(scene: Any) -> Any:
    """A scene with one of everything, in rows along x."""
    ground = mesh_object("ground", mesh_data("ground", *SQUARE), location=(0, 0, -2))
    ground.scale = (40, 40, 1)
    painted = mesh_data("painted")
    painted.materials.append(bpy.data.materials.new("red"))
    mesh_object("box", painted)
    shared = mesh_data("shared")
    mesh_object("left", shared, location=(3, 0, 0))
    mesh_object("right", shared, location=(5, 0, 0))
    add_posed(8.0)
    add_shaped(11.0)
    instances_on_grid("field", made_cube, 3).location = (-10, 0, 0)
    copies = instances_on_grid("copies", object_info(bpy.data.objects["box"]), 2)
    copies.location = (-10, 14, 0)
    inner = collection("inner", linked=False)
    mesh_object("leaf", collection=inner)
    mesh_object("twig", collection=inner, location=(1.5, 0, 0))
    collection_instance("tree", inner, location=(0, 6, 0))
    bpy.ops.object.text_add(location=(3, 6, 0))
    bpy.context.object.name = "text"
    bpy.ops.object.metaball_add(location=(8, 6, 0))
    bpy.context.object.name = "blob"
    camera_object("camera").location.z = 20.0
    return scene


def add_posed(x: float) -> None:
    armature = bpy.data.objects.new("bones", bpy.data.armatures.new("bones"))
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.data.edit_bones.new("bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    posed = mesh_object("posed", location=(x, 0, 0))
    posed.vertex_groups.new(name="bone").add([1, 3], 1.0, "REPLACE")
    posed.modifiers.new("armature", "ARMATURE").object = armature


def add_shaped(x: float) -> None:
    shaped = mesh_object("shaped", location=(x, 0, 0))
    shaped.shape_key_add(name="Basis")
    key = shaped.shape_key_add(name="tall")
    key.data[3].co.z = 3.0
    key.value = 0.0
    for frame, value in ((10, 0.0), (20, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    key.value = 0.0


@dataclass(frozen=True)
class Change:
    """act: what is done. actions: what the report says of some objects. stale: whether Blender lets us know."""

    act: Callable[[], Any]
    actions: dict[str, str]
    stale: bool = True


def thing(name: str) -> Any:
    return bpy.data.objects[name]


def setting(name: str, path: str, value: Any) -> Callable[[], None]:
    def act() -> None:
        *owners, last = path.split(".")
        target = thing(name)
        for owner in owners:
            target = getattr(target, owner)
        setattr(target, last, value)

    return act


def edit_mesh(name: str, *, update: bool) -> Callable[[], None]:
    def act() -> None:
        data = thing(name).data
        points = np.empty(len(data.vertices) * 3, np.float32)
        data.vertices.foreach_get("co", points)
        data.vertices.foreach_set("co", points * 1.5)
        if update:
            data.update()

    return act


def change_topology() -> None:
    """The same counts of vertices and triangles, but other triangles."""
    data = thing("box").data
    data.clear_geometry()
    data.from_pydata(*(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), [], ((0, 1, 2), (0, 3, 1), (1, 3, 2), (0, 2, 3))))
    data.update()


def pose() -> None:
    thing("bones").pose.bones["bone"].location = (0.5, 0.2, 0.3)


def move_shape_key() -> None:
    thing("shaped").data.shape_keys.animation_data_clear()
    thing("shaped").data.shape_keys.key_blocks["tall"].value = 0.7


def node_input(name: str, node: str, socket: str, value: Any) -> Callable[[], None]:
    def act() -> None:
        nodes = thing(name).modifiers[0].node_group.nodes
        next(item for item in nodes if item.bl_idname == node).inputs[socket].default_value = value

    return act


def remove(name: str) -> Callable[[], None]:
    return lambda: bpy.data.objects.remove(thing(name))


def unlink() -> None:
    bpy.context.scene.collection.objects.unlink(thing("box"))


def swap_data() -> None:
    thing("left").data = mesh_data("another", *SQUARE)


def duplicate() -> None:
    copy = thing("box").copy()
    copy.name, copy.location = "box copy", (0, 3, 0)
    bpy.context.scene.collection.objects.link(copy)


def edit_in_edit_mode() -> None:
    bpy.context.view_layer.objects.active = thing("box")
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(thing("box").data)
    edited.verts.ensure_lookup_table()
    edited.verts[0].co = (-1, -1, -1)
    bmesh.update_edit_mesh(thing("box").data)


def color_material() -> None:
    bpy.data.materials["red"].diffuse_color = (1, 0, 0, 1)


def exclude_collection() -> None:
    made = collection("made")
    mesh_object("member", collection=made)
    bpy.context.view_layer.layer_collection.children["made"].exclude = True


CHANGES = {
    "nothing": Change(lambda: None, {"box": "kept"}, stale=False),
    "moved": Change(setting("box", "location", (1, 2, 3)), {"box": "moved", "leaf": "kept"}),
    "moved to the same place": Change(setting("box", "location", (0, 0, 0)), {"box": "kept"}),
    "rotated": Change(setting("left", "rotation_euler", (0, 0, 1)), {"left": "moved", "right": "kept"}),
    "mirrored": Change(setting("left", "scale", (-1, 1, 1)), {"left": "moved"}),
    "flattened": Change(setting("left", "scale", (1, 1, 0)), {"left": "moved"}),
    "parented": Change(lambda: setattr(thing("left"), "parent", thing("tree")), {"left": "moved"}),
    "mesh edited": Change(edit_mesh("left", update=True), {"left": "deformed", "right": "deformed", "box": "kept"}),
    "mesh edited without update()": Change(edit_mesh("left", update=False), {}, stale=bpy.app.version >= (5, 0)),
    "topology changed at equal counts": Change(change_topology, {"box": "replaced"}),
    "edited in edit mode": Change(edit_in_edit_mode, {"box": "deformed"}),
    "armature posed": Change(pose, {"posed": "deformed", "box": "kept"}),
    "shape key moved by hand": Change(move_shape_key, {"shaped": "deformed", "box": "kept"}),
    "shape key on a frame change": Change(lambda: bpy.context.scene.frame_set(15), {"shaped": "deformed"}),
    "unchanged on a frame change": Change(lambda: bpy.context.scene.frame_set(2), {"shaped": "kept", "box": "kept"}),
    "nodes moved their instances": Change(
        node_input("field", "GeometryNodeMeshGrid", "Size X", 14.0), {"field": "moved", "leaf": "kept"}
    ),
    "nodes made more instances": Change(
        node_input("field", "GeometryNodeMeshGrid", "Vertices X", 4), {"field": "recounted"}
    ),
    "nodes deformed their mesh": Change(
        node_input("field", "GeometryNodeMeshCube", "Size", (1, 1, 2)), {"field": "deformed"}
    ),
    "nodes changed their mesh's topology": Change(
        node_input("field", "GeometryNodeMeshCube", "Vertices X", 3), {"field": "replaced"}
    ),
    "nodes' object moved": Change(setting("field", "location", (-10, 0, 1)), {"field": "moved"}),
    "collection instance moved": Change(setting("tree", "location", (0, 6, 2)), {"leaf": "moved", "twig": "moved"}),
    "object inside a collection instance moved": Change(
        setting("leaf", "location", (0, 1, 0)), {"leaf": "moved", "twig": "kept"}
    ),
    "object added": Change(lambda: mesh_object("new", location=(0, 3, 0)), {"new": "added", "box": "kept"}),
    "object added to an instanced collection": Change(
        lambda: mesh_object("new", collection=bpy.data.collections["inner"], location=(0, 0, 1)),
        {"new": "added", "leaf": "kept"},
    ),
    "duplicated": Change(duplicate, {"box copy": "added", "box": "kept"}),
    "deleted": Change(remove("left"), {"left": "removed", "right": "kept"}),
    "deleted with its instances": Change(remove("tree"), {"leaf": "removed", "twig": "removed"}),
    "unlinked": Change(unlink, {"box": "recounted"}),  # nodes still show it
    "excluded": Change(exclude_collection, {"box": "kept"}),
    "hide_set": Change(lambda: thing("left").hide_set(True), {"left": "removed", "right": "kept"}),
    "hide_viewport": Change(setting("left", "hide_viewport", True), {"left": "removed", "right": "kept"}),
    "hide_render": Change(setting("left", "hide_render", True), {"left": "kept"}),
    "selected": Change(lambda: thing("box").select_set(True), {"box": "kept"}),
    "hidden from the camera": Change(setting("left", "visible_camera", False), {"left": "masked", "right": "kept"}),
    "renamed": Change(setting("left", "name", "first in the list"), {"first in the list": "kept"}),
    "data swapped": Change(swap_data, {"left": "replaced", "right": "kept"}),
    "modifier added": Change(
        lambda: thing("left").modifiers.new("m", "SUBSURF"), {"left": "replaced", "right": "kept"}
    ),
    "modifiers stacked": Change(
        lambda: thing("posed").modifiers.new("m", "SUBSURF"), {"posed": "replaced", "box": "kept"}
    ),
    "text changed": Change(setting("text", "data.body", "other"), {"text": "replaced"}),
    "metaball moved": Change(setting("blob", "location", (8, 7, 0)), {"blob": "moved"}),
    "material coloured": Change(color_material, {"box": "kept"}),
    "material slot added": Change(
        lambda: thing("left").data.materials.append(bpy.data.materials["red"]), {"left": "kept"}
    ),
}


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
    """Three updates, the last with everything as it was but for what cannot be undone by setting it."""
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
    """The synced scene against one that has never seen anything else."""
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
    """Rays all through the village: from above on a grid, and crosswise at random."""
    x, y = np.meshgrid(np.linspace(-20, 20, 120), np.linspace(-10, 24, 100))
    above = np.stack([x.ravel(), y.ravel(), np.full(x.size, 15.0)], axis=1)
    rng = np.random.default_rng(3)
    around = rng.uniform((-20, -10, -1), (20, 24, 4), (6000, 3))
    directions = np.concatenate([np.broadcast_to([0.0, 0.0, -1.0], above.shape), rng.normal(size=(6000, 3))])
    return np.concatenate([above, around]), directions


def assert_equal_answers(sync: SceneSync, fresh: SceneSync) -> None:
    """Every ray: the same t, triangle, object, instance, polygon and material."""
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
    for name, action, count in (
        ("moved", "built", 0),
        ("nodes moved their instances", "built", 0),
        ("armature posed", "refitted", 1),
        ("topology changed at equal counts", "rebuilt", 1),
        ("object added", "built", 1),
        ("hidden from the camera", "built", 0),
    ):
        CHANGES[name].act()
        commit = sync.update(evaluated()).commit
        assert len(commit.meshes) == count, name
        assert all(item.action in {action, "rebuilt"} for item in commit.meshes), name
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
