"""Failure cases as Blender scenes: meshes, their animation from state to state, a camera, a sun, and what to look at.

A body whose vertices move gets shape keys. One whose triangles change, or whose size by far, is one object with a
modifier for each further form, on at its frames only: its evaluated mesh changes as with any modifier that switches.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from mathutils import Matrix, Vector

from .failure_cases import Body, FailureCase, State
from .failure_cases.case import finite, world_corners

FRAMES_A_STATE = 8
VIEW_DIRECTION = Vector((0.55, -0.75, 0.4))
LENS = 35.0
FORMS_COLLECTION = "Forms"


def frame_of(state_index: int) -> int:
    """The frame on which a state is reached."""
    return 1 + FRAMES_A_STATE * state_index


def add_failure_scene(case: FailureCase) -> bpy.types.Scene:
    """A new scene of the case."""
    scene = bpy.data.scenes.new(case.title)
    fill_scene(scene, case)
    return scene


def fill_scene(scene: bpy.types.Scene, case: FailureCase) -> None:
    """Put a case into a scene: its objects in a collection of its name, its camera, a sun, a text that explains it."""
    states = case.states()
    collection = bpy.data.collections.new(case.title)
    scene.collection.children.link(collection)
    for name in dict.fromkeys(part.name for state in states for part in state):
        _add_body(collection, [_find(state, name) for state in states])
    scene.frame_start, scene.frame_end = 1, frame_of(len(states) - 1)
    _add_camera(scene, case, states)
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = 3.0
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = (0.6, 0.3, 0.4)
    scene.collection.objects.link(lamp)
    _write_text(case)


def _find(state: State, name: str) -> Body | None:
    return next((part for part in state if part.name == name), None)


def _add_body(collection: bpy.types.Collection, poses: Sequence[Body | None]) -> None:
    """Objects for each instance of a body; poses: what it is in each state, None where it is not there."""
    first = next(pose for pose in poses if pose is not None)
    present = [pose for pose in poses if pose is not None]
    changes_form = any(not np.array_equal(pose.triangles, first.triangles) for pose in present)
    changes_form |= any(_is_lost_in_mixing(first, pose) for pose in present)
    deforms = any(not np.array_equal(pose.positions, first.positions) for pose in present)
    mesh, forms = _new_mesh(first.name, first), _list_forms(poses)
    for index in range(len(first.transforms)):
        suffix = f".{index:03}" if len(first.transforms) > 1 else ""
        item = bpy.data.objects.new(f"{first.name}{suffix}", mesh)
        collection.objects.link(item)
        _place(item, [None if pose is None else pose.transforms[index] for pose in poses])
        _show(item, poses)
        if changes_form:
            _switch_forms(item, forms, poses)
        elif index == 0 and deforms:
            _add_shape_keys(item, poses)


def _is_lost_in_mixing(basis: Body, pose: Body) -> bool:
    """Shape keys add up to basis + (pose - basis), in float32."""
    return bool(np.abs(basis.positions).max(initial=0.0) > 1e3 * np.abs(pose.positions).max(initial=0.0))


def _new_mesh(name: str, part: Body) -> bpy.types.Mesh:
    """Positions as they are: from_pydata and validate() would mend those that are no numbers."""
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
    """A geometry-nodes group that shows an object's mesh whatever it is given."""
    group = bpy.data.node_groups.new(source.name, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    info = group.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = source
    group.links.new(info.outputs["Geometry"], group.nodes.new("NodeGroupOutput").inputs[0])
    return group


def _add_camera(scene: bpy.types.Scene, case: FailureCase, states: Sequence[State]) -> None:
    """From the case's own view if it has one, else from where all of it is seen."""
    corners = np.concatenate([world_corners(finite(state)) for state in states])
    lower, upper = (corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) if len(corners) else (-np.ones(3), np.ones(3))
    size = float(np.linalg.norm(upper - lower))
    target = Vector(((lower + upper) / 2).tolist())
    eye = target + VIEW_DIRECTION.normalized() * (1.2 * size)
    if case.view is not None:
        eye, target = (Vector(point) for point in case.view)
    data = bpy.data.cameras.new("Camera")
    data.lens = LENS
    data.clip_start, data.clip_end = max(1e-6, 1e-3 * (target - eye).length), max(100.0, 4.0 * size)
    camera = bpy.data.objects.new("Camera", data)
    camera.location = eye
    camera.rotation_euler = (target - eye).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera


def _write_text(case: FailureCase) -> None:
    """What the case is about, in Blender's text editor."""
    text: Any = bpy.data.texts.new(case.title)
    parts = (case.title, f"What breaks: {case.breaks}", f"Seen in: {case.source}", f"How it is held: {case.held}")
    text.write("\n\n".join(textwrap.fill(part, 80) for part in parts) + "\n")
