"""The plan: what each mesh is expected to do, found from its object and corrected by what is seen.

The class only picks a strategy (which builder, whether a tree is refitted): no answer depends on it. So it may be wrong
for a while, and it changes slowly: what a mesh did once it is expected to do again for as long as MEMORY updates.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field

from .records import MeshRecord, Usage

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
    """What a mesh is expected to do, and the sentence that says why."""

    usage: Usage
    reason: str


@dataclass(frozen=True, slots=True)
class Expectation(MeshUsage):
    """until: the first update for which something else is to be expected although the mesh does nothing."""

    until: float


@dataclass(slots=True)
class _Past:
    """The update in which a mesh was first watched, and those in which it last did something, counted from 1."""

    first: int
    last: dict[Usage, int] = field(default_factory=dict)


class UsageTracker:
    """Remembers what meshes did, by key, and tells what to expect. A mesh that went away is remembered for a while."""

    def __init__(self) -> None:
        self._now = 0
        self._pasts: dict[Hashable, _Past] = {}

    def begin_update(self) -> int:
        """The update's number. A mesh of which nothing is observed in it did nothing."""
        self._now += 1
        return self._now

    def observe(self, key: Hashable, did: Usage) -> None:
        """Takes in what a mesh did in this update."""
        past = self._pasts.get(key)
        if past is None:
            past = self._pasts[key] = _Past(self._now)
        if did != USAGES[0]:
            past.last[did] = self._now

    def expect(self, mesh: MeshRecord) -> Expectation:
        """The most that the mesh did in its last updates; before those are many, what its object tells if it is more.

        A guess that nothing bore out for MEMORY updates is dropped.
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
        return Expectation(seen, _OBSERVED.get(seen, f"it did nothing for {MEMORY} updates"), until)

    def forget_all_but(self, keys: Iterable[Hashable], limit: int) -> None:
        """Forgets meshes that are gone once there are more than `limit`: nothing may grow with the number of edits."""
        if len(self._pasts) > limit:
            kept = set(keys)
            self._pasts = {key: past for key, past in self._pasts.items() if key in kept}
