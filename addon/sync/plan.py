"""The plan: what each mesh is expected to do, found from its object and corrected by what is seen.

The class only picks a strategy (which builder, whether a tree is refitted): no answer depends on it. So it may be wrong
for a while, and it changes slowly: what a mesh did once it is expected to do again for as long as MEMORY updates.
"""

from __future__ import annotations

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


@dataclass(slots=True)
class _Past:
    """Updates a mesh was in, and in which of them, counted from 1, it last did what; 0 for never."""

    update_count: int = 0
    last: dict[Usage, int] = field(default_factory=lambda: dict.fromkeys(USAGES, 0))


class UsageTracker:
    """Remembers what meshes did, by key, and tells what to expect. A mesh that went away is remembered for a while."""

    def __init__(self) -> None:
        self._pasts: dict[Hashable, _Past] = {}

    def observe(self, key: Hashable, did: Usage) -> None:
        """Takes in what a mesh did in one update."""
        past = self._pasts.setdefault(key, _Past())
        past.update_count += 1
        past.last[did] = past.update_count

    def expect(self, mesh: MeshRecord) -> MeshUsage:
        """The most that the mesh did in its last updates; before those are many, what its object tells if it is more.

        A guess that nothing bore out for MEMORY updates is dropped.
        """
        past = self._pasts.get(mesh.key)
        guess = MeshUsage(mesh.usage, mesh.usage_reason)
        if past is None:
            return guess
        seen = max(
            (usage for usage in USAGES if past.last[usage] and past.update_count - past.last[usage] < MEMORY),
            key=USAGES.index,
            default=USAGES[0],
        )
        if past.update_count <= MEMORY and USAGES.index(guess.usage) > USAGES.index(seen):
            return guess
        if seen == guess.usage:
            return guess
        return MeshUsage(seen, _OBSERVED.get(seen, f"it did nothing for {MEMORY} updates"))

    def forget_all_but(self, keys: Iterable[Hashable], limit: int) -> None:
        """Forgets meshes that are gone once there are more than `limit`: nothing may grow with the number of edits."""
        if len(self._pasts) > limit:
            kept = set(keys)
            self._pasts = {key: past for key, past in self._pasts.items() if key in kept}
