"""Committed states of a scene."""

from __future__ import annotations

from . import _core
from .queries import Queries


class Snapshot(Queries):
    """An immutable committed scene. Any number of threads may query it while its scene is edited.

    Get one from `Scene.snapshot()`; `Scene` has the same queries, for the snapshot of the moment.
    """

    __slots__ = ("_snapshot",)

    def __init__(self, core_snapshot: _core.Snapshot) -> None:
        self._snapshot = core_snapshot

    def _committed(self) -> _core.Snapshot:
        return self._snapshot

    @property
    def generation(self) -> int:
        """Counts the scene's commits from 1."""
        return self._snapshot.generation

    @property
    def scene_id(self) -> int:
        """Which `Scene` of this process it came from."""
        return self._snapshot.scene_id
