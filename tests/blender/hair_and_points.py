"""Hair curves and point clouds for tests, made from arrays."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.builders import mesh_data, mesh_object


def hair_data(name: str, strands: npt.ArrayLike, radius: float | npt.ArrayLike | None = 0.1) -> Any:
    """strands: (C, K, 3). radius: one for all, or (C, K); None: no attribute."""
    points = np.asarray(strands, np.float32)
    data = bpy.data.hair_curves.new(name)
    data.add_curves([points.shape[1]] * len(points))
    set_points(data, points)
    if radius is not None:
        set_radii(data, radius)
    return data


def cloud_data(name: str, points: npt.ArrayLike, radius: float | npt.ArrayLike | None = 0.1) -> Any:
    """points: (N, 3). Blender converts a mesh to the points, because some versions do not let Python resize them."""
    places = np.asarray(points, np.float32)
    mesh = mesh_data(name, np.zeros_like(places).tolist(), [])
    holder = mesh_object(name, mesh)
    with bpy.context.temp_override(
        active_object=holder, object=holder, selected_objects=[holder], selected_editable_objects=[holder]
    ):
        bpy.ops.object.convert(target="POINTCLOUD")
    data = holder.data
    bpy.data.objects.remove(holder)
    bpy.data.meshes.remove(mesh)
    set_points(data, places)
    if radius is not None:
        set_radii(data, radius)
    elif (attribute := data.attributes.get("radius")) is not None:
        data.attributes.remove(attribute)
    return data


def set_points(data: Any, points: npt.ArrayLike) -> None:
    """Set the positions of all points."""
    attribute = data.attributes.get("position") or data.attributes.new("position", "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", np.ascontiguousarray(points, np.float32).ravel())
    data.update_tag()


def set_radii(data: Any, radius: float | npt.ArrayLike) -> None:
    """Set the radii: one for all, or one for each point."""
    attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    values = np.broadcast_to(np.asarray(radius, np.float32).ravel(), len(attribute.data))
    attribute.data.foreach_set("value", np.ascontiguousarray(values))
    data.update_tag()


def make_poly(data: Any) -> None:
    """Make the curves straight from point to point."""
    data.set_types(type="POLY")
    data.update_tag()


def hair_object(name: str, strands: npt.ArrayLike, radius: Any = 0.1) -> Any:
    return mesh_object(name, hair_data(name, strands, radius))


def cloud_object(name: str, points: npt.ArrayLike, radius: Any = 0.1) -> Any:
    return mesh_object(name, cloud_data(name, points, radius))


def upright(count: int = 5, height: float = 1.0, points: int = 4) -> npt.NDArray[np.float32]:
    """Strands side by side along x, one unit apart, from z = 0 up."""
    steps = np.linspace(0.0, height, points)
    strands = np.zeros((count, points, 3), np.float32)
    strands[:, :, 0] = np.arange(count)[:, None]
    strands[:, :, 2] = steps
    return strands
