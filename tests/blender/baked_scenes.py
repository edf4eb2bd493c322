"""Scenes for tests of bakes: boxes and grounds, whose faces are known."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from blender.builders import mesh_object

Floats = npt.NDArray[np.float64]
BOX = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
SUN_PATH = np.radians(np.arange(1.0, 180.0))
SUNS = np.stack([np.cos(SUN_PATH), np.zeros(len(SUN_PATH)), np.sin(SUN_PATH)], axis=1)  # over the x axis
UP = [[0.0, 0.0, 1.0]]


def made(name: str, vertices: Any, faces: Sequence[Sequence[int]], **how: Any) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices, np.float64).tolist(), [], faces)
    return mesh_object(name, mesh, **how)


def box(name: str, low: Sequence[float], high: Sequence[float], **how: Any) -> Any:
    """A box whose faces show outwards: below, above, and the sides."""
    (x, y, z), (u, v, w) = low, high
    bottom, top = ((x, y), (u, y), (u, v), (x, v)), ((x, y), (u, y), (u, v), (x, v))
    return made(name, [(*xy, z) for xy in bottom] + [(*xy, w) for xy in top], BOX, **how)


def ground(name: str, size: tuple[float, float], counts: tuple[int, int], **how: Any) -> Any:
    """A grid in the plane z = 0, around the origin; faces show up."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=counts[0], y_subdivisions=counts[1], size=1.0)
    obj = bpy.context.object
    for vertex in obj.data.vertices:
        vertex.co.x, vertex.co.y = vertex.co.x * size[0], vertex.co.y * size[1]
    obj.name, obj.location = name, how.get("location", (0.0, 0.0, 0.0))
    return obj


def centres(obj: Any) -> Floats:
    return np.array([face.center for face in obj.data.polygons])


def normals(obj: Any) -> Floats:
    return np.array([face.normal for face in obj.data.polygons])


def end_of(steps: Generator[float, None, Any]) -> Any:
    """What a generator returns."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def world_corners(obj: Any) -> Floats:
    matrix = np.array(obj.matrix_world, np.float64)
    return np.array([vertex.co for vertex in obj.data.vertices]) @ matrix[:3, :3].T + matrix[:3, 3]


def world_quads(obj: Any) -> Floats:
    return world_corners(obj)[[list(face.vertices) for face in obj.data.polygons]]
