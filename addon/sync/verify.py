"""Finds where two readings of the same scene differ: the proof that the fast way of reading is right."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt

from .compare import find_look_differences, have_same_layers
from .records import INSTANCE_COLUMNS, MESH_COLUMNS, MESH_LAYERS, MeshRecord, SceneRecord

# Of meshes read in two ways, in parts of the largest number: radii go by the lengths of strands, uvs by weights
# of corners, and colours by weights of bytes, a step of which they may miss.
RADIUS_ROUNDING = 1e-3
_PARTS = {"radii": RADIUS_ROUNDING, "uvs": 1e-5, "colors": 1e-2}


def find_mismatches(synced: SceneRecord, reference: SceneRecord) -> tuple[str, ...]:
    """A sentence for each difference between what was synced and a reference; none if they are equal."""
    found = []
    references = {mesh.key: mesh for mesh in reference.meshes}
    for mesh in synced.meshes:
        other = references.pop(mesh.key, None)
        if other is None:
            found.append(f"mesh {mesh.name}: synced, but Blender does not show it")
            continue
        found += [
            f"mesh {mesh.name}: {column} differ"
            for column in MESH_COLUMNS
            if _differ(mesh, other, column, _rounding_of(mesh, other, column, getattr(mesh, column)))
        ]
        if mesh.form != other.form:
            found.append(f"mesh {mesh.name}: kind differs")
        if not _have_like_layers(mesh, other):
            found.append(f"mesh {mesh.name}: uv maps or colors differ")
    found += [f"mesh {mesh.name}: not synced" for mesh in references.values()]
    found += [
        f"instances: {column} differ"
        for column in INSTANCE_COLUMNS
        if _differ(synced.instances, reference.instances, column)
    ]
    found += [f"{what} differ" for what in find_look_differences(synced, reference)]
    if _differ_in_view(synced, reference):
        found.append("camera or image size differ")
    return tuple(found)


def _rounding_of(mesh: MeshRecord, other: MeshRecord, column: str, values: npt.NDArray[Any] | None) -> float:
    """What numbers may differ by if the mesh is read in two ways; that of its places says nothing of the others."""
    rounding = max(mesh.rounding, other.rounding)
    if rounding == 0.0 or column == "positions" or values is None:
        return rounding
    largest = float(np.abs(values).max(initial=0.0))
    part = _PARTS.get(column.split("_")[-1], 0.0)
    return part * (largest if column == "radii" else max(1.0, largest))


def _have_like_layers(mesh: MeshRecord, other: MeshRecord) -> bool:
    if mesh.rounding == other.rounding == 0.0:
        return have_same_layers(mesh, other)
    for name in MESH_LAYERS:
        first, second = getattr(mesh, name), getattr(other, name)
        if first.keys() != second.keys():
            return False
        pairs = [(values, second[key]) for key, values in first.items()]
        if any(_are_other(*pair, _rounding_of(mesh, other, name, pair[0])) for pair in pairs):
            return False
    return True


def _differ_in_view(synced: SceneRecord, reference: SceneRecord) -> bool:
    first, second = synced.camera, reference.camera
    if synced.size != reference.size or first is None or second is None:
        return synced.size != reference.size or first is not second
    return any(_differ(first, second, field.name) for field in fields(first))


def _differ(synced: Any, reference: Any, column: str, rounding: float = 0.0) -> bool:
    """rounding: what numbers that are no whole ones may differ by."""
    return _are_other(getattr(synced, column), getattr(reference, column), rounding)


def _are_other(first: Any, second: Any, rounding: float) -> bool:
    if first is None or second is None:
        return first is not second
    if rounding and first.dtype.kind == "f" and first.shape == second.shape:
        return not bool((np.abs(first - second) <= rounding).all())
    return not np.array_equal(first, second)
