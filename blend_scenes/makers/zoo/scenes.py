"""Failure cases as Blender scenes: meshes, their animation from state to state, a camera and a sun.

A body whose vertices move gets shape keys. One whose triangles change, or whose size by far, is one object with a
modifier for each further form, on at its frames only: its evaluated mesh changes as with any modifier that switches.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector

from ..stage import animation_curves
from . import Body, FailureCase, State
from .case import finite, world_corners

FRAMES_A_STATE = 8
VIEW_DIRECTION = Vector((0.55, -0.75, 0.4))
LENS = 35.0
FORMS_COLLECTION = "Forms"
FAR_LARGER = 100.0


def frame_of(state_index: int) -> int:
    """The frame on which a state is reached."""
    return 1 + FRAMES_A_STATE * state_index


def fill_scene(scene: bpy.types.Scene, case: FailureCase) -> None:
    """Put a case into a scene: its objects in a collection of its name, its camera, a sun."""
    states = stored_states(case)
    collection = bpy.data.collections.new(case.title)
    scene.collection.children.link(collection)
    for name in dict.fromkeys(part.name for state in states for part in state):
        _add_body(collection, [_find(state, name) for state in states], case)
    scene.frame_start, scene.frame_end = 1, frame_of(len(states) - 1)
    _add_camera(scene, case, states)
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = 3.0
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = (0.6, 0.3, 0.4)
    scene.collection.objects.link(lamp)


def stored_states(case: FailureCase) -> tuple[State, ...]:
    """The states of a case as a file holds them: float32, and on the case's grid if it has one."""
    return tuple(tuple(_stored(part, case.grid) for part in state) for state in case.states())


def _stored(part: Body, grid: float | None) -> Body:
    positions = part.positions if grid is None else np.round(part.positions / grid) * grid
    return Body(part.name, positions.astype(np.float32), part.triangles, part.transforms)


def _find(state: State, name: str) -> Body | None:
    return next((part for part in state if part.name == name), None)


def _add_body(collection: bpy.types.Collection, poses: Sequence[Body | None], case: FailureCase) -> None:
    """Objects for each instance of a body; poses: the body in each state, None where it is absent."""
    first = next(pose for pose in poses if pose is not None)
    present = [pose for pose in poses if pose is not None]
    changes_form = any(not np.array_equal(pose.triangles, first.triangles) for pose in present)
    changes_form |= any(_is_lost_in_mixing(first, pose) for pose in present)
    deforms = any(not np.array_equal(pose.positions, first.positions) for pose in present)
    mesh, forms = _new_mesh(first.name, _largest(first, case)), _list_forms(poses)
    for index in range(len(first.transforms)):
        suffix = f".{index:03}" if len(first.transforms) > 1 else ""
        item = bpy.data.objects.new(f"{first.name}{suffix}", mesh)
        collection.objects.link(item)
        _place(item, [None if pose is None else pose.transforms[index] for pose in poses])
        _show(item, poses)
        if case.halvings:
            _repeat_halved(item, case.halvings)
        if case.is_loose:
            _join_by_threes(item, len(first.triangles))
        if changes_form:
            _switch_forms(item, forms, poses)
        elif index == 0 and deforms:
            _add_shape_keys(item, poses)


def _largest(part: Body, case: FailureCase) -> Body:
    """The input from which modifiers make the whole body: its first part, to repeat at half size; or its vertices."""
    vertex_count = len(part.positions) // (1 + case.halvings)
    triangle_count = 0 if case.is_loose else len(part.triangles) // (1 + case.halvings)
    return Body(part.name, part.positions[:vertex_count], part.triangles[:triangle_count], part.transforms)


def _repeat_halved(item: bpy.types.Object, halvings: int) -> None:
    """An array of copies, each half as large as the one before. Powers of two: exact in float32."""
    half = bpy.data.objects.new("Half", None)
    half.scale = (0.5, 0.5, 0.5)
    item.users_collection[0].objects.link(half)
    modifier = item.modifiers.new("Halves", "ARRAY")
    modifier.count = 1 + halvings
    modifier.use_relative_offset = False
    modifier.use_object_offset, modifier.offset_object = True, half


def _join_by_threes(item: bpy.types.Object, count: int) -> None:
    """Each three vertices become a triangle: one is instanced `count` times, and takes its corners from them."""
    group = bpy.data.node_groups.new("Triangles", "GeometryNodeTree")
    group.is_modifier = True
    for in_out in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=in_out, socket_type="NodeSocketGeometry")
    points, triangle, instances, realize, corner, place = (
        group.nodes.new(f"GeometryNode{kind}")
        for kind in ("Points", "MeshCircle", "InstanceOnPoints", "RealizeInstances", "SampleIndex", "SetPosition")
    )
    points.inputs["Count"].default_value = count
    triangle.fill_type, triangle.inputs["Vertices"].default_value = "NGON", 3
    corner.data_type, corner.domain = "FLOAT_VECTOR", "POINT"
    value = next(socket for socket in corner.inputs if socket.name == "Value" and socket.enabled)
    for start, end in (
        (points.outputs[0], instances.inputs["Points"]),
        (triangle.outputs["Mesh"], instances.inputs["Instance"]),
        (instances.outputs[0], realize.inputs[0]),
        (realize.outputs[0], place.inputs["Geometry"]),
        (group.nodes.new("NodeGroupInput").outputs[0], corner.inputs["Geometry"]),
        (group.nodes.new("GeometryNodeInputPosition").outputs[0], value),
        (group.nodes.new("GeometryNodeInputIndex").outputs[0], corner.inputs["Index"]),
        (next(socket for socket in corner.outputs if socket.enabled), place.inputs["Position"]),
        (place.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0]),
    ):
        group.links.new(start, end)
    item.modifiers.new("Triangles", "NODES").node_group = group


def _is_lost_in_mixing(basis: Body, pose: Body) -> bool:
    """Shape keys add up to basis + (pose - basis), in float32."""
    return bool(np.abs(basis.positions).max(initial=0.0) > 1e3 * np.abs(pose.positions).max(initial=0.0))


def _new_mesh(name: str, part: Body) -> bpy.types.Mesh:
    """Writes positions unchanged: from_pydata and validate() would replace those that are not finite."""
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(part.positions))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(part.positions, np.float32).ravel())
    mesh.loops.add(3 * len(part.triangles))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(part.triangles, np.int32).ravel())
    mesh.polygons.add(len(part.triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(part.triangles), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh


def _place(item: bpy.types.Object, transforms: Sequence[npt.NDArray[np.float64] | None]) -> None:
    """Where the object is; animated if that differs between states. Sheared matrices go into the parent's inverse."""
    known = [transform for transform in transforms if transform is not None]
    if all(np.array_equal(transform, known[0]) for transform in known):
        matrix = Matrix(known[0].tolist())
        item.matrix_basis = matrix
        if not np.allclose(item.matrix_basis, matrix, atol=1e-6):
            item.matrix_basis = Matrix.Identity(4)
            parent = bpy.data.objects.new(f"{item.name} matrix", None)
            item.users_collection[0].objects.link(parent)
            item.parent, item.matrix_parent_inverse = parent, matrix
        return
    item.rotation_mode = "QUATERNION"
    for index, transform in enumerate(transforms):
        if transform is not None:
            item.matrix_basis = Matrix(transform.tolist())
            for path in ("location", "rotation_quaternion", "scale"):
                item.keyframe_insert(path, frame=frame_of(index))


def _show(item: bpy.types.Object, poses: Sequence[Body | None]) -> None:
    if all(pose is not None for pose in poses):
        return
    for index, pose in enumerate(poses):
        item.hide_viewport = item.hide_render = pose is None
        for path in ("hide_viewport", "hide_render"):
            item.keyframe_insert(path, frame=frame_of(index))


def _add_shape_keys(item: bpy.types.Object, poses: Sequence[Body | None]) -> None:
    """One key for each pose, fully on at the frame of its state and off at the states before and after."""
    first = next(pose for pose in poses if pose is not None)
    item.shape_key_add(name="Basis", from_mix=False)
    for index, pose in enumerate(poses):
        if pose is None or np.array_equal(pose.positions, first.positions):
            continue
        key = item.shape_key_add(name=f"State {index + 1}", from_mix=False)
        key.data.foreach_set("co", np.ascontiguousarray(pose.positions, np.float32).ravel())
        for near in {max(index - 1, 0), index, min(index + 1, len(poses) - 1)}:
            key.value = float(near == index)
            key.keyframe_insert("value", frame=frame_of(near))


Form = tuple[Body, list[int]]


def _list_forms(poses: Sequence[Body | None]) -> list[Form]:
    """Each distinct mesh among the poses, with the states that show it."""
    forms: list[Form] = []
    for index, pose in enumerate(poses):
        if pose is None:
            continue
        for known, indices in forms:
            if np.array_equal(known.positions, pose.positions) and np.array_equal(known.triangles, pose.triangles):
                indices.append(index)
                break
        else:
            forms.append((pose, [index]))
    return forms


def _switch_forms(item: bpy.types.Object, forms: Sequence[Form], poses: Sequence[Body | None]) -> None:
    """A modifier for each form but the object's own, on at its states only."""
    for number, (pose, indices) in enumerate(forms[1:], 2):
        source = bpy.data.objects.new(f"{pose.name} form {number}", _new_mesh(f"{pose.name} form {number}", pose))
        _forms_collection(item.users_collection[0]).objects.link(source)
        modifier = item.modifiers.new(f"Form {number}", "NODES")
        modifier.node_group = _show_instead(source)
        for index in range(len(poses)):
            modifier.show_viewport = modifier.show_render = index in indices
            for path in ("show_viewport", "show_render"):
                modifier.keyframe_insert(path, frame=frame_of(index))


def _forms_collection(parent: bpy.types.Collection) -> bpy.types.Collection:
    """Where forms wait, unseen."""
    for child in parent.children:
        if child.name.startswith(FORMS_COLLECTION):
            return child
    made = bpy.data.collections.new(FORMS_COLLECTION)
    made.hide_viewport = made.hide_render = True
    parent.children.link(made)
    return made


def _show_instead(source: bpy.types.Object) -> bpy.types.NodeTree:
    """A geometry-nodes group that shows an object's mesh and ignores its input."""
    group = bpy.data.node_groups.new(source.name, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info = group.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = source
    group.links.new(info.outputs["Geometry"], group.nodes.new("NodeGroupOutput").inputs[0])
    return group


def _add_camera(scene: bpy.types.Scene, case: FailureCase, states: Sequence[State]) -> None:
    """From the case's own view, else from where all of it is seen: in each state, if sizes differ by far."""
    data = bpy.data.cameras.new("Camera")
    data.lens = LENS
    camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    boxes = [_box_of(state) for state in states]
    sizes = [float(np.linalg.norm(upper - lower)) for lower, upper in boxes]
    if max(sizes) < FAR_LARGER * min(size for size in sizes if size > 0.0):
        lower, upper = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
        _aim(camera, case, lower, upper)
        return
    for index, (lower, upper) in enumerate(boxes):
        _aim(camera, case, lower, upper)
        for owner, path in ((camera, "location"), (data, "clip_start"), (data, "clip_end")):
            owner.keyframe_insert(path, frame=frame_of(index))
    for owner in (camera, data):
        for curve in animation_curves(owner):
            for point in curve.keyframe_points:
                point.interpolation = "CONSTANT"  # as the meshes change


def _box_of(state: State) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    corners = world_corners(finite(state))
    if len(corners) == 0:
        return -np.ones(3), np.ones(3)
    return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))


def _aim(
    camera: bpy.types.Object, case: FailureCase, lower: npt.NDArray[np.float64], upper: npt.NDArray[np.float64]
) -> None:
    """Looks at a box, from the case's own view if it has one."""
    size = float(np.linalg.norm(upper - lower))
    target = Vector(((lower + upper) / 2).tolist())
    eye = target + VIEW_DIRECTION.normalized() * (1.2 * size)
    if case.view is not None:
        eye, target = (Vector(point) for point in case.view)
    camera.data.clip_start = max(1e-6, 1e-3 * (target - eye).length)
    camera.data.clip_end = max(100.0, 4.0 * size)
    camera.location = eye
    camera.rotation_euler = (target - eye).to_track_quat("-Z", "Y").to_euler()
