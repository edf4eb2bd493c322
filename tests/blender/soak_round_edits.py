"""Edits of the hair curves and point clouds in a soak's scene, and of curves that nodes make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from blender.builders import NodeGroup, mesh_object
from blender.hair_and_points import cloud_data, hair_data, set_points, set_radii, upright
from blender.soak_look_edits import NothingToEditError

if TYPE_CHECKING:
    from blender.soak import Soak

ROUND_TYPES = ("CURVES", "POINTCLOUD")


def some_hair(soak: Soak, name: str) -> Any:
    """A few curves with the same number of points each, bent at random."""
    count, points = int(soak.number(1, 6)), int(soak.number(2, 6))
    strands = _steps(soak, (count, points, 3), 0.6).cumsum(axis=1) + _steps(soak, (count, 1, 3), 1.0)
    data = hair_data(name, strands, _radii(soak, count * points))
    if soak.number() > 1.0:
        data.set_types(type="POLY")
    return data


def some_points(soak: Soak, name: str) -> Any:
    count = int(soak.number(1, 20))
    return cloud_data(name, _steps(soak, (count, 3), 1.0), _radii(soak, count))


def fur_of_nodes(name: str, *, hides: str = "") -> Any:
    """Hair from whose points nodes grow curves and points. hides: which of the two is made but not shown."""
    group = NodeGroup(name)
    line = group.node("GeometryNodeCurvePrimitiveLine", Start=(0.0, 0.0, 0.0), End=(0.2, 0.0, 1.5))
    on_points = group.node("GeometryNodeInstanceOnPoints")
    roots = group.node("GeometryNodeCurveToPoints")
    roots.mode = "EVALUATED"
    group.link(group.input.outputs[0], roots.inputs["Curve"])
    group.link(roots.outputs["Points"], on_points.inputs["Points"])
    group.link(line.outputs["Curve"], on_points.inputs["Instance"])
    realize = group.node("GeometryNodeRealizeInstances")
    group.link(on_points.outputs["Instances"], realize.inputs["Geometry"])
    radius = group.node("GeometryNodeSetCurveRadius", Radius=0.15)
    group.link(realize.outputs["Geometry"], radius.inputs["Curve"])
    points = group.node("GeometryNodeSetPointRadius", Radius=0.3)
    group.link(roots.outputs["Points"], points.inputs["Points"])
    made = {"curves": radius.outputs["Curve"], "points": points.outputs["Points"]}
    group.show(group.input.outputs[0], *(socket for what, socket in made.items() if what != hides))
    obj = mesh_object(name, hair_data(name, upright(3)))
    group.apply_to(obj)
    return obj


def _steps(soak: Soak, shape: tuple[int, ...], size: float) -> np.ndarray:
    return np.array([soak.number(-size, size) for _ in range(int(np.prod(shape)))], np.float32).reshape(shape)


def _radii(soak: Soak, count: int) -> Any:
    """Radii: one for all, one for each, some of them zero, or no attribute."""
    some = np.maximum(_steps(soak, (count,), 0.3), 0.0)
    return soak.pick((0.1, some, some + np.float32(0.05), None))


def _a_round_object(soak: Soak) -> Any:
    return soak.pick(obj for obj in bpy.data.objects if obj.type in ROUND_TYPES)


def sway(soak: Soak) -> None:
    """Move the points of a round object; now and then one gets a position that is not finite."""
    data = _a_round_object(soak).data
    moved = np.empty(len(data.points) * 3, np.float32)
    data.attributes["position"].data.foreach_get("vector", moved)
    moved = np.nan_to_num(moved) * np.float32(soak.number(0.7, 1.4)) + _steps(soak, moved.shape, 0.2)
    if soak.number() > 2.5:
        moved[int(soak.number(0, len(moved) - 1))] = np.nan
    set_points(data, moved)


def thicken(soak: Soak) -> None:
    data = _a_round_object(soak).data
    radii = _radii(soak, len(data.points))
    if radii is not None:
        set_radii(data, radii)
    elif (attribute := data.attributes.get("radius")) is not None:
        data.attributes.remove(attribute)
        data.update_tag()


def grow(soak: Soak) -> None:
    """Add curves to the same data."""
    data = soak.an_object("CURVES").data
    if len(data.curves) > 12:
        raise NothingToEditError
    data.add_curves([int(soak.number(1, 5)) for _ in range(int(soak.number(1, 3)))])
    set_points(data, _steps(soak, (len(data.points), 3), 1.5))


def straighten(soak: Soak) -> None:
    data = soak.an_object("CURVES").data
    data.set_types(type=soak.pick(("POLY", "CATMULL_ROM", "BEZIER")))
    data.update_tag()


def replace_round(soak: Soak) -> None:
    """Replace the data, mostly by data of another size; remove the old data if it has no users left."""
    obj = _a_round_object(soak)
    old, make = obj.data, some_hair if obj.type == "CURVES" else some_points
    obj.data = make(soak, soak.name("round data"))
    if not old.users:
        (bpy.data.hair_curves if obj.type == "CURVES" else bpy.data.pointclouds).remove(old)


def share_round(soak: Soak) -> None:
    """Use the data of another object of the same type, or a copy of the present data."""
    obj = _a_round_object(soak)
    obj.data = soak.pick((soak.an_object(obj.type).data, obj.data.copy()))


def paint_round(soak: Soak) -> None:
    materials = _a_round_object(soak).data.materials
    if len(materials) < 2:
        materials.append(soak.pick((None, *bpy.data.materials)))
    else:
        materials.pop()


def change_fur(soak: Soak) -> None:
    """Change the length or the thickness of the geometry that nodes make."""
    node = soak.pick(
        node
        for group in bpy.data.node_groups
        for node in group.nodes
        if node.bl_idname
        in {"GeometryNodeCurvePrimitiveLine", "GeometryNodeSetCurveRadius", "GeometryNodeSetPointRadius"}
    )
    if node.bl_idname == "GeometryNodeCurvePrimitiveLine":
        node.inputs["End"].default_value = soak.vector()
    else:
        node.inputs["Radius"].default_value = soak.number(0.0, 0.4)


def _add_hair(soak: Soak, name: str) -> Any:
    return mesh_object(name, some_hair(soak, name), soak.pick((None, bpy.data.collections["inner"])))


def _add_cloud(soak: Soak, name: str) -> Any:
    return mesh_object(name, some_points(soak, name), soak.pick((None, bpy.data.collections["inner"])))


def _add_fur(soak: Soak, name: str) -> Any:
    return fur_of_nodes(name, hides=soak.pick(("", "curves", "points")))


# The functions that add an object of each kind.
ROUND_ADDITIONS = {"hair": _add_hair, "cloud": _add_cloud, "fur": _add_fur}
ROUND_EDITS: tuple[Any, ...] = (
    sway,
    thicken,
    grow,
    straighten,
    replace_round,
    share_round,
    paint_round,
    change_fur,
)
