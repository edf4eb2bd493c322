"""The meshes of the last reading: what has not been evaluated since is not read, and what is equal is not copied."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

from ...events.evaluation_log import EvaluationLog
from ...sync.records import AttributeRequest, MeshRecord
from .particle_hair import ParticleHair

Place = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class CachedMesh:
    """place: where the mesh was, see `place_of`. uids: whose evaluation would have changed it."""

    record: MeshRecord
    place: Place
    uids: tuple[int, ...]


@dataclass(slots=True)
class MeshCache:
    """One reading's meshes by token, and what the log of evaluations said then.

    A token names a mesh before it is read: what it comes from, and a number among others from there.
    """

    meshes: dict[Hashable, CachedMesh] = field(default_factory=dict)
    attributes: AttributeRequest | None = None
    graph: int = 0
    since: int = -1  # the log's time, -1 if there was no log

    def find_untouched(
        self, token: Hashable, mesh: Any, uids: tuple[int, ...], reading: MeshCache, log: EvaluationLog | None
    ) -> CachedMesh | None:
        """The cached mesh if it is sure to be what a reading would give. reading: the cache that is being made.

        That the mesh lies where it lay proves nothing, but that it does not is reason enough to read it.
        """
        cached = self.meshes.get(token)
        if cached is None or log is None or self.since < 0:
            return None
        if self.graph != reading.graph or self.attributes != reading.attributes:
            return None
        if not log.is_untouched(self.graph, (*uids, *cached.uids), self.since) or cached.place != place_of(mesh):
            return None
        return cached


def place_of(mesh: Any) -> Place:
    """Addresses and sizes of an evaluated mesh's arrays; of particle hair what it is made by, too."""
    if isinstance(mesh, ParticleHair):
        return mesh.place()
    positions, corners = (mesh.attributes[name].data for name in ("position", ".corner_vert"))
    sizes = (len(positions), len(corners), len(mesh.polygons))
    return (*(array[0].as_pointer() if len(array) else 0 for array in (positions, corners)), *sizes)
