"""Writes a mesh record into an engine's scene: triangles, curves or points."""

from __future__ import annotations

from typing import Any, Protocol

import numpy.typing as npt

from .records import MeshMotion, MeshRecord


class MeshScene(Protocol):
    """The part of `perfect_bvh.Scene` that edits meshes."""

    def add_mesh(self, positions: npt.ArrayLike, triangles: npt.ArrayLike, **options: Any) -> int: ...
    def update_mesh(self, mesh: int, positions: npt.ArrayLike) -> None: ...
    def replace_mesh(self, mesh: int, positions: npt.ArrayLike, triangles: npt.ArrayLike) -> None: ...
    def add_curves(
        self, points: npt.ArrayLike, radii: npt.ArrayLike, curve_offsets: npt.ArrayLike, **options: Any
    ) -> int: ...
    def update_curves(self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike) -> None: ...
    def replace_curves(
        self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike, curve_offsets: npt.ArrayLike, **options: Any
    ) -> None: ...
    def add_points(self, centers: npt.ArrayLike, radii: npt.ArrayLike, **options: Any) -> int: ...
    def update_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike) -> None: ...
    def replace_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike) -> None: ...
    def set_mesh_motion(self, mesh: int, positions: npt.ArrayLike) -> None: ...
    def set_curves_motion(self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike) -> None: ...
    def set_points_motion(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike) -> None: ...
    def set_usage(self, mesh: int, usage: str) -> None: ...
    def remove_mesh(self, mesh: int) -> None: ...


def add(scene: MeshScene, mesh: MeshRecord, **options: Any) -> int:
    """The engine's id. options: `build`, `usage`."""
    if mesh.kind == "triangles":
        return scene.add_mesh(mesh.positions, mesh.triangles, **options)
    if mesh.kind == "points":
        return scene.add_points(mesh.positions, _radii(mesh), **options)
    return scene.add_curves(mesh.positions, _radii(mesh), _offsets(mesh), **_division(mesh), **options)


def move(scene: MeshScene, mesh_id: int, mesh: MeshRecord) -> None:
    """Updates the positions and radii of an existing mesh."""
    if mesh.kind == "triangles":
        scene.update_mesh(mesh_id, mesh.positions)
    elif mesh.kind == "points":
        scene.update_points(mesh_id, mesh.positions, _radii(mesh))
    else:
        scene.update_curves(mesh_id, mesh.positions, _radii(mesh))


def set_motion(scene: MeshScene, mesh_id: int, mesh: MeshRecord, motion: MeshMotion) -> None:
    """Other positions and radii within the shutter."""
    if mesh.kind == "triangles":
        scene.set_mesh_motion(mesh_id, motion.positions)
        return
    assert motion.radii is not None
    if mesh.kind == "points":
        scene.set_points_motion(mesh_id, motion.positions, motion.radii)
    else:
        scene.set_curves_motion(mesh_id, motion.positions, motion.radii)


def replace(scene: MeshScene, mesh_id: int, mesh: MeshRecord) -> None:
    """Others of the same kind."""
    if mesh.kind == "triangles":
        scene.replace_mesh(mesh_id, mesh.positions, mesh.triangles)
    elif mesh.kind == "points":
        scene.replace_points(mesh_id, mesh.positions, _radii(mesh))
    else:
        scene.replace_curves(mesh_id, mesh.positions, _radii(mesh), _offsets(mesh), **_division(mesh))


def _radii(mesh: MeshRecord) -> npt.ArrayLike:
    assert mesh.radii is not None
    return mesh.radii


def _offsets(mesh: MeshRecord) -> npt.ArrayLike:
    assert mesh.curve_offsets is not None
    return mesh.curve_offsets


def _division(mesh: MeshRecord) -> dict[str, Any]:
    pieces = {} if mesh.curve_kind == "poly" else {"segments": mesh.curve_pieces}
    return {"kind": mesh.curve_kind, "shape": mesh.curve_shape, **pieces}
