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
    """positions: (V, 3) float32. triangles: (T, 3) int32. is_inside: the camera stands inside, as in a hall."""

    name: str
    positions: npt.NDArray[np.float32]
    triangles: npt.NDArray[np.int32]
    is_inside: bool = False

    def write(self, path: Path) -> None:
        """As the native programs read it: uint32 counts of vertices and triangles, then both arrays."""
        counts = np.array([len(self.positions), len(self.triangles)], "<u4")
        arrays = (counts, self.positions.astype("<f4"), self.triangles.astype("<u4"))
        path.write_bytes(b"".join(array.tobytes() for array in arrays))


def load(path: Path) -> BenchMesh:
    """A .npz file with arrays `positions` and `triangles`, or a .ply or .obj file that Blender reads."""
    if not path.is_file():
        raise MeshError(f"{path}: there is no such file")
    readers: dict[str, Callable[[Path], BenchMesh]] = {".npz": _load_npz, ".ply": _load_ply, ".obj": _load_obj}
    if path.suffix.lower() not in readers:
        raise MeshError(f"{path}: expected a .npz, .ply or .obj file")
    return readers[path.suffix.lower()](path)


def default_meshes(detail: float = 1.0) -> list[BenchMesh]:
    """Four that Blender makes, of some 30,000 to 200,000 triangles each, times `detail`."""
    return _with_blender().make_all(detail)


def _load_npz(path: Path) -> BenchMesh:
    with np.load(path) as arrays:
        missing = {"positions", "triangles"} - set(arrays.files)
        if missing:
            raise MeshError(f"{path}: has no array {' and no array '.join(sorted(missing))}")
        positions = np.ascontiguousarray(arrays["positions"], np.float32).reshape(-1, 3)
        triangles = np.ascontiguousarray(arrays["triangles"], np.int32).reshape(-1, 3)
    return BenchMesh(path.stem, positions, triangles, is_inside=path.stem == "sponza")


def _load_ply(path: Path) -> BenchMesh:
    return _with_blender().import_file(path, "ply_import")


def _load_obj(path: Path) -> BenchMesh:
    return _with_blender().import_file(path, "obj_import")


def _with_blender() -> ModuleType:
    try:
        from benchmarks import blender_meshes
    except ModuleNotFoundError as error:
        if error.name != "bpy":
            raise
        raise MeshError(NO_BLENDER) from None
    return blender_meshes
