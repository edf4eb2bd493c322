"""Meshes to measure with: from files, or made by Blender."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

NO_BLENDER = "Blender's module (bpy) is not installed"


class MeshError(Exception):
    """A mesh that cannot be had; the message says why."""


@dataclass(frozen=True)
class BenchMesh:
    """positions: (V, 3) float32. triangles: (T, 3) int32. is_inside: the camera is inside, as in a hall."""

    name: str
    positions: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    is_inside: bool = False

    def write(self, path: Path) -> None:
        """Writes the native programs' format: uint32 counts of vertices and triangles, then both arrays."""
        counts = np.array([len(self.positions), len(self.triangles)], "<u4")
        arrays = (counts, self.positions.astype("<f4"), self.triangles.astype("<u4"))
        path.write_bytes(b"".join(array.tobytes() for array in arrays))


def load(path: Path) -> BenchMesh:
    """A .npz file with arrays `positions` and `triangles`, or a .ply, .obj or .blend file that Blender reads."""
    if not path.is_file():
        raise MeshError(f"{path}: there is no such file")
    readers: dict[str, Callable[[Path], BenchMesh]] = {
        ".npz": _load_npz,
        ".ply": lambda path: _with_blender().import_file(path, "ply_import"),
        ".obj": lambda path: _with_blender().import_file(path, "obj_import"),
        ".blend": lambda path: _with_blender().open_scene(path),
    }
    if path.suffix.lower() not in readers:
        raise MeshError(f"{path}: expected a .npz, .ply, .obj or .blend file")
    return readers[path.suffix.lower()](path)


def default_meshes(detail: float = 1.0) -> list[BenchMesh]:
    """Four that Blender makes, of some 30,000 to 200,000 triangles each, times `detail`."""
    return _with_blender().make_all(detail)


def subdivided(mesh: BenchMesh, times: int, jitter: float = 0.06) -> BenchMesh:
    """Each triangle cut into four at the middles of its edges, so often; new corners moved by a share of the edge."""
    positions, triangles = mesh.positions.astype(np.float64), mesh.triangles.astype(np.int64)
    random = np.random.default_rng(17)
    for _ in range(times):
        sides = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
        codes, places = np.unique(sides[:, 0] * len(positions) + sides[:, 1], return_inverse=True)
        ends = positions[np.stack([codes // len(positions), codes % len(positions)])]
        lengths = np.linalg.norm(ends[1] - ends[0], axis=1, keepdims=True)
        middles = ends.mean(axis=0) + random.normal(size=lengths.shape[:1] + (3,)) * lengths * jitter / 3.0**0.5
        ab, bc, ca = places.reshape(3, -1) + len(positions)
        a, b, c = triangles.T
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        positions = np.concatenate([positions, middles])
    name = f"{mesh.name} x{4**times}"
    return BenchMesh(name, positions.astype(np.float32), triangles.astype(np.int32), mesh.is_inside)


def _load_npz(path: Path) -> BenchMesh:
    with np.load(path) as arrays:
        missing = {"positions", "triangles"} - set(arrays.files)
        if missing:
            raise MeshError(f"{path}: has no array {' and no array '.join(sorted(missing))}")
        positions = np.ascontiguousarray(arrays["positions"], np.float32).reshape(-1, 3)
        triangles = np.ascontiguousarray(arrays["triangles"], np.int32).reshape(-1, 3)
    return BenchMesh(path.stem, positions, triangles, is_inside=path.stem == "sponza")


def _with_blender() -> ModuleType:
    try:
        from benchmarks import blender_meshes
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        raise MeshError(NO_BLENDER) from None
    return blender_meshes
