"""The plan: the expected changes of each mesh, guessed from its object and corrected by observed changes.

The class only selects a strategy (a builder, whether a tree is refitted): no answer depends on it. So it may be wrong
for a while, and it changes slowly: a mesh is expected to repeat an observed change for MEMORY updates.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from .compare import find_look_differences, have_same_layers
from .records import INSTANCE_COLUMNS, MESH_COLUMNS, MESH_LAYERS, MeshRecord, SceneRecord, Usage

# From the one that changes least to the one that changes most.
USAGES: tuple[Usage, ...] = ("static", "rigid", "deforming", "changing")
MEMORY = 16

_OBSERVED: dict[Usage, str] = {
    "rigid": "it was seen to move as a whole",
    "deforming": "its vertices were seen to move",
    "changing": "its triangles were seen to change",
}


@dataclass(frozen=True, slots=True)
class MeshUsage:
    """The expected changes of a mesh, and the sentence that says why."""

    usage: Usage
    reason: str


@dataclass(frozen=True, slots=True)
class Expectation(MeshUsage):
    """until: the first update for which something else is expected even if the mesh does not change."""

    until: float


@dataclass(slots=True)
class _Past:
    """The update in which a mesh was first watched, and those in which it last did something, counted from 1."""

    first: int
    last: dict[Usage, int] = field(default_factory=dict)


class UsageTracker:
    """Remembers the changes of meshes, by key, and predicts new ones. Removed meshes are remembered for a while."""

    def __init__(self) -> None:
        self._now = 0
        self._pasts: dict[Hashable, _Past] = {}

    def begin_update(self) -> int:
        """The update's number. A mesh of which nothing is observed in it did nothing."""
        self._now += 1
        return self._now

    def observe(self, key: Hashable, did: Usage) -> None:
        """Registers a mesh's change in this update."""
        past = self._pasts.get(key)
        if past is None:
            past = self._pasts[key] = _Past(self._now)
        if did != USAGES[0]:
            past.last[did] = self._now

    def expect(self, mesh: MeshRecord) -> Expectation:
        """Returns the largest of the mesh's last changes; before there are many, the object's guess if it is larger.

        A guess that is not confirmed within MEMORY updates is dropped.
        """
        past = self._pasts.get(mesh.key)
        if past is None:
            return Expectation(mesh.usage, mesh.usage_reason, 0)
        ends = {did: last + MEMORY for did, last in past.last.items() if self._now < last + MEMORY}
        until: float = min(ends.values(), default=math.inf)
        seen = max(ends, key=USAGES.index, default=USAGES[0])
        if self._now < past.first + MEMORY:
            until = min(until, past.first + MEMORY)
            if USAGES.index(mesh.usage) > USAGES.index(seen):
                return Expectation(mesh.usage, mesh.usage_reason, until)
        if seen == mesh.usage:
            return Expectation(mesh.usage, mesh.usage_reason, until)
        return Expectation(seen, _OBSERVED.get(seen, f"it did not change for {MEMORY} updates"), until)

    def forget_all_but(self, keys: Iterable[Hashable], limit: int) -> None:
        """Forgets meshes that are gone once there are more than `limit`: nothing may grow with the number of edits."""
        if len(self._pasts) > limit:
            kept = set(keys)
            self._pasts = {key: past for key, past in self._pasts.items() if key in kept}


# Verify --------------------------------------------------------------------------------------------------------------
# Finds where two readings of the same scene differ: the proof that the fast way of reading is right.


# Of meshes read in two ways, in parts of the largest number: radii go by the lengths of strands, uvs by weights
# of corners, and colours by weights of bytes, a step of which they may miss.
RADIUS_ROUNDING = 1e-3
_PARTS = {"radii": RADIUS_ROUNDING, "uvs": 1e-5, "colors": 1e-2}


def find_mismatches(synced: SceneRecord, reference: SceneRecord) -> tuple[str, ...]:
    """Returns a sentence for each difference between the synced scene and a reference; none if they are equal."""
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
    """Returns the possible rounding difference of numbers read in two ways; positions' does not apply to others."""
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
