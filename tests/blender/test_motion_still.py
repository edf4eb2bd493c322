"""Objects at rest within a shutter: their switches are off, or their motion cannot be followed, which is reported."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest
from blender.builders import (
    NodeGroup,
    camera_object,
    collection,
    collection_instance,
    evaluated,
    mesh_data,
    mesh_object,
)
from blender.hair_and_points import cloud_object
from blender.moving_scenes import FRAME, SHUTTER, Told, at_frame, frozen, keyed, make
from perfect_bvh_addon import SceneSync

AS_AT_THE_FRAME = "the one at the frame is shown, moved as a whole"


def read(shutter: tuple[float, float] = SHUTTER, **how: Any) -> SceneSync:
    sync = SceneSync()
    sync.update(evaluated(), shutter=shutter, **how)
    return sync


def moving_names(sync: SceneSync) -> set[str]:
    """Return objects of moving instances, and deforming meshes, which are marked with an arrow."""
    record = sync.record
    rows = [row for motions in record.motion.instances for row in motions.rows]
    names = {record.objects[record.instances.object_indices[row]].name for row in rows}
    return names | {f"> {record.meshes[motion.row].name}" for motion in record.motion.meshes}


def told(sync: SceneSync) -> list[str]:
    rows = [row for row in sync.record.not_shown if "shutter" in row.text]
    assert [str(row) for row in rows] == list(sync.warnings)
    assert all(row.advice for row in rows)
    return [str(row) for row in rows]


# By its switches -----------------------------------------------------------------------------------------------------


@pytest.fixture
def pair(scene: Any) -> list[Any]:
    """Two cubes that move and deform alike, each with a separate mesh."""
    cubes = []
    for x in (-3.0, 3.0):
        bpy.ops.mesh.primitive_cube_add(location=(x, 0.0, 0.0))
        cube = bpy.context.object
        cube.name = cube.data.name = f"cube {x:g}"
        keyed(cube, "location", [(x, 0.0, 0.0), (x, 5.0, 0.0)])
        cube.shape_key_add(name="Basis")
        key = cube.shape_key_add(name="Far")
        for point in key.data:
            point.co *= 2.0
        keyed(key, "value", [0.0, 1.0])
        cubes.append(cube)
    scene.frame_set(FRAME)
    return cubes


def test_all_of_it_moves_unless_it_is_switched_off(pair: list[Any]) -> None:
    assert moving_names(read()) == {"cube -3", "cube 3", "> cube -3", "> cube 3"}
    pair[0].cycles.use_deform_motion = False
    assert moving_names(read()) == {"cube -3", "cube 3", "> cube 3"}
    pair[1].cycles.use_motion_blur = False
    sync = read()
    assert moving_names(sync) == {"cube -3"} and told(sync) == [], "who asks for it knows"


def test_what_is_switched_off_is_as_at_the_frame(pair: list[Any]) -> None:
    pair[0].cycles.use_motion_blur = False
    sync = read()
    snapshot, still, there = sync.scene.snapshot(), frozen(0.0), frozen(0.25)
    moving = Told(sync, snapshot, 1.0)
    first = (still.names == "cube -3") & (moving.names == "cube -3")
    second = (there.names == "cube 3") & (moving.names == "cube 3")
    assert first.sum() > 50 and second.sum() > 50
    assert not moving.is_not_at_moment(still)[first].any()
    assert not moving.is_not_at_moment(there)[second].any()


def test_its_own_steps_count(pair: list[Any]) -> None:
    pair[0].cycles.motion_steps = 3
    sync = read()
    steps = {sync.record.meshes[motion.row].name: len(motion.positions) for motion in sync.record.motion.meshes}
    assert steps == {"cube -3": 9, "cube 3": 3}
    assert sorted(len(motions.transforms) for motions in sync.record.motion.instances) == [3, 9]
    steps = {len(motion.positions) for motion in read(steps=4).record.motion.meshes}
    assert steps == {9, 4}, "who has set steps has said something"


def test_an_instancer_s_switches_and_steps_count_as_well(scene: Any) -> None:
    shown = collection("shown", linked=False)
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    scene.collection.objects.unlink(cube)
    shown.objects.link(cube)
    empties = [collection_instance(f"in {x}", shown, location=(x, 0, 0)) for x in (-3, 0, 3)]
    for empty in empties:
        keyed(empty, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
    empties[0].cycles.use_motion_blur = False
    empties[1].cycles.motion_steps = 2
    scene.frame_set(FRAME)
    sync = read()
    parents = sync.record.instances.parent_indices
    found = {
        sync.record.objects[parents[row]].name: len(motions.transforms)
        for motions in sync.record.motion.instances
        for row in motions.rows
    }
    assert found == {"in 0": 5, "in 3": 3}


def test_without_cycles_everything_moves(pair: list[Any]) -> None:
    keyed(camera_object(), "location", [(0.0, 0.0, 5.0), (1.0, 0.0, 5.0)])
    pair[0].cycles.use_motion_blur = False
    addon_utils.disable("cycles")
    try:
        sync, in_steps = read(), read(steps=7)
    finally:
        addon_utils.enable("cycles")
    assert moving_names(sync) == {"cube -3", "cube 3", "> cube -3", "> cube 3"} and len(sync.camera_motion) == 3
    assert {len(motion.positions) for motion in in_steps.record.motion.meshes} == {7}
    assert len(in_steps.camera_motion) == 7


# Because it cannot be followed ---------------------------------------------------------------------------------------


def other_triangles() -> str:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    keyed(cube.modifiers.new("Array", "ARRAY"), "count", [2, 40], (1, 20))
    keyed(cube, "location", [(-9.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    return f"Cube: its shape has different triangles at a moment of the shutter; {AS_AT_THE_FRAME}"


def hidden_at_the_end() -> str:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    keyed(cube, "location", [(-9.0, 0.0, 0.0), (9.0, 0.0, 0.0)])
    keyed(cube, "hide_viewport", [False, True], (FRAME, FRAME + 1))
    return "Cube: it is missing at a moment of the shutter; it stands still, as at the frame"


def there_at_the_end_alone() -> str:
    bpy.ops.mesh.primitive_cube_add()
    keyed(bpy.context.object, "hide_viewport", [True, False], (FRAME, FRAME + 1))
    return "Cube: it is missing at the frame, but not at another moment of the shutter; left out"


def grown_from_nothing() -> str:
    bpy.ops.mesh.primitive_cube_add()
    keyed(bpy.context.object, "scale", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0)], (FRAME, FRAME + 1))
    return "Cube: its scale is zero at a moment of the shutter; it stands still, as at the frame"


def more_instances_of_nodes() -> str:
    group = NodeGroup("line")
    line = group.node("GeometryNodeMeshLine")
    time = group.node("GeometryNodeInputSceneTime")
    group.link(time.outputs["Frame"], line.inputs["Count"])
    on_points = group.node("GeometryNodeInstanceOnPoints")
    group.link(line.outputs[0], on_points.inputs["Points"])
    group.link(group.node("GeometryNodeMeshCube").outputs[0], on_points.inputs["Instance"])
    obj = mesh_object("line")
    group.show(on_points.outputs[0]).apply_to(obj)
    keyed(obj, "location", [(-9.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    return "line: 1 of its instances is missing at the frame, but not at another moment of the shutter; left out"


def points_without_a_radius() -> str:
    obj = cloud_object("cloud", np.random.default_rng(0).normal(size=(9, 3)), 0.2)
    group = NodeGroup("radius")
    time, less = group.node("GeometryNodeInputSceneTime"), group.node("ShaderNodeMath")
    less.operation, less.inputs[1].default_value = "LESS_THAN", FRAME + 0.5
    group.link(time.outputs["Frame"], less.inputs[0])
    radius = group.node("GeometryNodeSetPointRadius")
    group.link(group.input.outputs[0], radius.inputs["Points"])
    group.link(less.outputs[0], radius.inputs["Radius"])
    group.show(radius.outputs[0]).apply_to(obj)
    told_of = "points whose radius is zero at one moment of the shutter and not at another"
    return f"cloud: its shape has {told_of}; {AS_AT_THE_FRAME}"


FALLBACKS: dict[str, tuple[Callable[[], str], tuple[float, float], set[str]]] = {
    "other triangles": (other_triangles, (-1.0, 1.0), {"Cube"}),
    "hidden": (hidden_at_the_end, (0.0, 1.0), set()),
    "shown": (there_at_the_end_alone, (0.0, 1.0), set()),
    "flat": (grown_from_nothing, (0.0, 1.0), set()),
    "more instances": (more_instances_of_nodes, (0.0, 1.0), {"line"}),
    "no radius": (points_without_a_radius, (0.0, 1.0), set()),
}


@pytest.mark.parametrize("name", FALLBACKS)
def test_what_cannot_be_followed_stands_still_and_is_named_once(scene: Any, name: str) -> None:
    build, shutter, moving = FALLBACKS[name]
    words = build()
    mesh_object("bystander", location=(0.0, 5.0, 0.0))
    scene.frame_set(FRAME)
    sync = read(shutter)
    assert told(sync) == [words]
    assert moving_names(sync) == moving
    snapshot, still = sync.scene.snapshot(), frozen(0.0)
    if not moving:
        for time in (0.0, 0.4, 1.0):
            assert not Told(sync, snapshot, time).differs(still).any()
    assert sync.update(evaluated(), shutter=shutter).has_changes is False
    sync.update(evaluated())
    assert told(sync) == [] and not Told(sync, sync.scene.snapshot(), 0.7).differs(still).any()


def test_a_shape_that_cannot_be_followed_goes_with_its_object(scene: Any) -> None:
    other_triangles()
    scene.frame_set(FRAME)
    sync = read((-1.0, 1.0))
    mesh, [motions] = sync.record.meshes[0], sync.record.motion.instances
    assert mesh.positions.tobytes() == at_frame(0.0).record.meshes[0].positions.tobytes()
    assert motions.transforms[2].tobytes() == at_frame(1.0).record.instances.transforms.tobytes()


# One mesh at the frame, several at other moments ----------------------------------------------------------------------


def linked_pair(begins: int) -> list[Any]:
    """Two objects of one mesh, each with a separate armature; the second armature starts to move at a frame."""
    data = mesh_data("shared")
    made = []
    for number in range(2):
        bpy.ops.object.armature_add()
        rig = bpy.context.object
        bone = rig.pose.bones[0]
        bone.rotation_mode = "XYZ"
        if number:
            keyed(bone, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)], (begins, begins + 1))
        obj = mesh_object(f"rigged {number}", data, location=(3.0 * number, 0.0, 0.0))
        group = obj.vertex_groups.new(name=bone.name)
        group.add(range(len(data.vertices)), 1.0, "REPLACE")
        obj.modifiers.new("rig", "ARMATURE").object = rig
        made.append(obj)
    bpy.context.scene.frame_set(FRAME)
    return made


def test_a_shared_mesh_parts_where_only_one_of_its_objects_moves(scene: Any) -> None:
    linked_pair(FRAME)
    sync = SceneSync()
    sync.update(evaluated())
    assert len(sync.record.meshes) == 1
    report = sync.update(evaluated(), shutter=(0.0, 1.0), verify=True)
    assert report.mismatches == () and len(sync.record.meshes) == 2
    assert len(sync.record.motion.meshes) == 1
    snapshot = sync.scene.snapshot()
    for time in (0.0, 0.5, 1.0):
        assert not Told(sync, snapshot, time).is_not_at_moment(frozen(time)).any()
    assert not sync.update(evaluated(), shutter=(0.0, 1.0)).has_changes
    sync.update(evaluated())
    assert len(sync.record.meshes) == 1
    assert not Told(sync, sync.scene.snapshot(), 1.0).differs(frozen(0.0)).any()


def test_a_shared_mesh_parts_where_one_of_its_objects_is_switched_off(scene: Any) -> None:
    make("a_keyed_shape")
    first = bpy.context.object
    second = bpy.data.objects.new("second", first.data)
    second.location.y = 4.0
    scene.collection.objects.link(second)
    second.cycles.use_deform_motion = False
    scene.frame_set(FRAME)
    sync = read()
    assert len(sync.record.meshes) == 2 and len(sync.record.motion.meshes) == 1
    moving, still, there = Told(sync, sync.scene.snapshot(), 1.0), frozen(0.0), frozen(0.25)
    rests = (moving.names == "second") & (still.names == "second")
    goes = (moving.names == first.name) & (there.names == first.name)
    assert rests.sum() > 50 and goes.sum() > 50
    assert not moving.is_not_at_moment(still)[rests].any() and not moving.is_not_at_moment(there)[goes].any()
