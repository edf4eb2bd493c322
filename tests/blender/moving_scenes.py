"""Scenes in which everything moves evenly, and the scenes at rest that they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.builders import (
    NodeGroup,
    collection,
    collection_instance,
    evaluated,
    instances_on_grid,
    made_cube,
    mesh_object,
    object_info,
)
from blender.hair_and_points import cloud_object, hair_object, upright
from perfect_bvh import Snapshot
from perfect_bvh_addon import SceneSync

FRAME = 10
SHUTTER = (-0.25, 0.25)


def keyed(owner: Any, path: str, values: Sequence[Any], frames: tuple[int, int] = (1, 21)) -> None:
    """Animate a property linearly from one value to another between two frames."""
    for frame, value in zip(frames, values, strict=True):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    for curve in _curves_of(owner.id_data.animation_data.action):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


def _curves_of(action: Any) -> list[Any]:
    if hasattr(action, "fcurves"):  # before Blender 5.0
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def pushed_by_time(name: str) -> NodeGroup:
    """Make nodes that move each point along z, by the product of the time in frames and the point's x."""
    group = NodeGroup(name)
    time, place = group.node("GeometryNodeInputSceneTime"), group.node("GeometryNodeInputPosition")
    split, product, offset = (group.node(f"ShaderNode{kind}") for kind in ("SeparateXYZ", "Math", "CombineXYZ"))
    product.operation = "MULTIPLY"
    group.link(place.outputs[0], split.inputs[0])
    group.link(split.outputs["X"], product.inputs[0])
    group.link(time.outputs["Frame"], product.inputs[1])
    group.link(product.outputs[0], offset.inputs["Z"])
    moved = group.node("GeometryNodeSetPosition")
    group.link(group.input.outputs[0], moved.inputs["Geometry"])
    group.link(offset.outputs[0], moved.inputs["Offset"])
    return group.show(moved.outputs[0])


def a_keyed_cube() -> None:
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    keyed(bpy.context.object, "location", [(-4.0, 0.0, 0.0), (4.0, 2.0, 1.0)])
    keyed(bpy.context.object, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, 4.0)])
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, location=(0.0, 3.0, 0.0))


def a_keyed_shape() -> None:
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=2.0)
    obj = bpy.context.object
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Long")
    for point in key.data:
        point.co = (3.0 * point.co.x, point.co.y, 0.3 * point.co.z)
    keyed(key, "value", [0.0, 1.0])


def an_armature() -> None:
    bpy.ops.object.armature_add()
    rig = bpy.context.object
    bone = rig.pose.bones[0]
    bone.rotation_mode = "XYZ"
    keyed(bone, "rotation_euler", [(0.0, 0.0, 0.0), (2.0, 0.0, 1.0)])
    obj = mesh_object("rigged")
    bpy.context.view_layer.objects.active = obj
    group = obj.vertex_groups.new(name=bone.name)
    group.add(range(len(obj.data.vertices)), 1.0, "REPLACE")
    obj.modifiers.new("rig", "ARMATURE").object = rig
    obj.scale = (3.0, 3.0, 3.0)


def hair() -> None:
    strands = upright(60, 1.0, 5) * np.float32([0.1, 1.0, 4.0])
    obj = hair_object("hair", strands - np.float32([3.0, 0.0, 2.0]), 0.1)
    pushed_by_time("push").apply_to(obj)
    obj.scale = (1.0, 1.0, 0.1)
    keyed(obj, "rotation_euler", [(1.0, 0.0, 0.0), (1.0, 0.0, 2.0)])


def a_cloud() -> None:
    random = np.random.default_rng(1)
    obj = cloud_object("cloud", random.normal(0.0, 0.7, (60, 3)), random.uniform(0.1, 0.4, 60))
    pushed_by_time("push").apply_to(obj)


def collection_instances() -> None:
    inner, outer = collection("inner", linked=False), collection("outer", linked=False)
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    cube = bpy.context.object
    for used in list(cube.users_collection):
        used.objects.unlink(cube)
    inner.objects.link(cube)
    keyed(cube, "location", [(0.0, 0.0, -2.0), (0.0, 0.0, 2.0)])
    for x in (-1.0, 1.0):
        collection_instance(f"in {x}", inner, outer, (x, 0.0, 0.0))
    for y in (-2.0, 2.0):
        placed = collection_instance(f"out {y}", outer, location=(0.0, y, 0.0))
        keyed(placed, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, y)])


def instances_of_nodes() -> None:
    field = instances_on_grid("field", made_cube, 3)
    keyed(field, "location", [(-2.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    source = mesh_object("source", location=(0.0, 0.0, 4.0))
    keyed(source, "rotation_euler", [(0.0, 0.0, 0.0), (0.0, 0.0, 3.0)])
    other = instances_on_grid("other", object_info(source), 2)
    other.scale = (0.5, 0.5, 0.5)
    pushed_by_time("push").apply_to(mesh_object("pushed", location=(2.0, 1.0, -2.0)))


def a_curve_object() -> None:
    """Text and curves, which Blender converts to meshes."""
    bpy.ops.object.text_add(location=(-1.5, 0.0, 0.0))
    text = bpy.context.object
    text.data.extrude = 0.3
    text.scale = (2.0, 2.0, 2.0)
    keyed(text, "rotation_euler", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    bpy.ops.curve.primitive_bezier_circle_add(radius=2.0)
    keyed(bpy.context.object.data, "bevel_depth", [0.1, 0.5])


# Scenes in which everything moves in straight lines or turns evenly, as Blender itself moves it between two keys.
EVEN: dict[str, Callable[[], None]] = {
    made.__name__: made for made in (a_keyed_cube, a_keyed_shape, hair, a_cloud, instances_of_nodes, a_curve_object)
}
SCENES = EVEN | {made.__name__: made for made in (an_armature, collection_instances)}


def make(name: str) -> None:
    """Build a scene's content in the empty scene, and set the frame."""
    SCENES[name]()
    bpy.context.scene.frame_set(FRAME)


def rays(count: int = 3000, seed: int = 0) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Rays that start on a sphere around the shown geometry and pass through it."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= 12.0 / np.linalg.norm(origins, axis=1, keepdims=True)
    return origins, random.uniform(-3.0, 3.0, (count, 3)) - origins


class Told:
    """Hits of rays, in terms that can be compared between syncs."""

    def __init__(self, sync: SceneSync, snapshot: Snapshot, times: Any = 0.0, *, seed: int = 0) -> None:
        origins, directions = rays(seed=seed)
        hits = snapshot.cast_rays(origins, directions, times=times, fields=("t_hit", "instance_ids", "primitive_ids"))
        who = sync.describe(hits.instance_ids)
        self.t, self.primitives = hits.t_hit, hits.primitive_ids
        self.names, self.parents, self.ids = who.names, who.parent_names, who.persistent_ids
        self.is_hit = hits.is_hit

    def differs(self, other: Told, ulps: int = 0) -> npt.NDArray[np.bool_]:
        """(R,) bool: another surface is hit, or t differs by more than `ulps` units in the last place."""
        with np.errstate(invalid="ignore"):  # where both miss
            same = (self.t == other.t) | (np.abs(self.t - other.t) <= ulps * np.spacing(other.t))
        same &= self.primitives == other.primitives
        same &= (self.names == other.names) & (self.parents == other.parents)
        return ~(same & (self.ids == other.ids).all(axis=1))

    def is_not_at_moment(self, other: Told) -> npt.NDArray[np.bool_]:
        """(R,) bool: the hit differs from that of `other`, a scene at rest, by more than rounding.

        t is that of the triangle's plane to two units in the last place. The last digits may depend on the extent of a
        mesh. The extent of a mesh that deforms covers all moments.
        """
        return self.differs(other, 2)

    def is_elsewhere(self, other: Told, tolerance: float) -> npt.NDArray[np.bool_]:
        """(R,) bool: another object is hit, or t differs by more than `tolerance`."""
        same = (self.is_hit == other.is_hit) & (self.names == other.names)
        both = self.is_hit & other.is_hit
        far = np.zeros(len(self.t), np.bool_)
        far[both] = np.abs(self.t[both] - other.t[both]) > tolerance
        return ~same | far


def at_frame(offset: float) -> SceneSync:
    """Sync the scene at FRAME + offset with a new sync. The scene stays at that frame."""
    scene, at = bpy.context.scene, FRAME + offset
    scene.frame_set(int(np.floor(at)), subframe=float(at - np.floor(at)))
    sync = SceneSync()
    sync.update(evaluated())
    return sync


def frozen(offset: float, *, seed: int = 0) -> Told:
    """Cast the same rays at FRAME + offset. Afterwards the scene is at FRAME again."""
    sync = at_frame(offset)
    told = Told(sync, sync.scene.snapshot(), seed=seed)
    sync.close()
    bpy.context.scene.frame_set(FRAME)
    return told
