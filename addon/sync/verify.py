"""Finds where two readings of the same scene differ: the proof that the fast way of reading is right."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .compare import have_same_layers
from .looks import find_look_differences
from .records import INSTANCE_COLUMNS, MESH_COLUMNS, SceneRecord


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
            if _differ(mesh, other, column, max(mesh.rounding, other.rounding))
        ]
        if mesh.form != other.form:
            found.append(f"mesh {mesh.name}: kind differs")
        if not have_same_layers(mesh, other):
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


def _differ_in_view(synced: SceneRecord, reference: SceneRecord) -> bool:
    first, second = synced.camera, reference.camera
    if synced.size != reference.size or first is None or second is None:
        return synced.size != reference.size or first is not second
    return any(_differ(first, second, field.name) for field in fields(first))


def _differ(synced: Any, reference: Any, column: str, rounding: float = 0.0) -> bool:
    """rounding: what numbers that are no whole ones may differ by."""
    first, second = getattr(synced, column), getattr(reference, column)
    if first is None or second is None:
        return first is not second
    if rounding and first.dtype.kind == "f" and first.shape == second.shape:
        return not bool((np.abs(first - second) <= rounding).all())
    return not np.array_equal(first, second)
