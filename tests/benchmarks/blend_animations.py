"""The meshes of .blend files that keep their triangles and change their shape from frame to frame, by Blender."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt
from benchmarks.moving_meshes import MovingMesh

_FEWEST = 500  # vertices


def read(path: Path, count: int) -> list[MovingMesh]:
    """One for each such object, at so many frames of the scene's range, in its own space."""
    bpy.ops.wm.open_mainfile(filepath=str(path.resolve()))
    scene = bpy.context.scene
    frames = np.unique(np.linspace(scene.frame_start, scene.frame_end, count).astype(int))
    found: dict[str, list[tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]]] = {}
    for frame in frames:
        scene.frame_set(int(frame))
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for item in bpy.data.objects:
            if item.type == "MESH":
                found.setdefault(item.name, []).append(_geometry(item.evaluated_get(depsgraph).data))
    return [
        MovingMesh(path.stem, np.stack([positions for positions, _ in shapes]), shapes[0][1])
        for shapes in found.values()
        if _deforms(shapes)
    ]


def _geometry(mesh: bpy.types.Mesh) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]:
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return positions.reshape(-1, 3), triangles.reshape(-1, 3)


def _deforms(shapes: list[tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]]) -> bool:
    first, triangles = shapes[0]
    if len(first) < _FEWEST or any(not np.array_equal(other, triangles) for _, other in shapes):
        return False
    return any(not np.array_equal(positions, first) for positions, _ in shapes)
