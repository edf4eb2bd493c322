"""Which geometry Blender has evaluated again, and since when that is known: what lets a sync pass over a mesh.

The depsgraph names what it has evaluated only while its handlers run, and once for each depsgraph (a viewport's, a
render's, one a view layer). The log keeps that. Where anything may have happened unseen (an undo, a file, handlers
that were missing) it knows nothing from before, and says so.

What it cannot know is an edit that Blender itself does not notice: Blender 4.2 lets `foreach_set` write into a mesh
without evaluating anything, and a script may write into evaluated data. `SceneSync.update(verify=True)` finds those.
"""

from __future__ import annotations

from typing import Any

_MOST_GRAPHS = 16
_MOST_IDS = 100_000


class GeometryLog:
    """When each data-block's geometry was last evaluated, in one depsgraph and another."""

    def __init__(self) -> None:
        self._now = 0
        self._known_since = 0
        self._graphs: dict[int, dict[int, int]] = {}

    def add(self, depsgraph: Any) -> None:
        """Notes what a depsgraph has just evaluated; only while its handlers run does it know."""
        times: dict[int, int] | None = None
        for update in depsgraph.updates:
            if not update.is_updated_geometry:
                continue
            if times is None:
                self._now += 1
                times = self._times_of(depsgraph.as_pointer())
            times[update.id.original.session_uid] = self._now
        if times is not None and len(times) > _MOST_IDS:
            self.forget()

    def forget(self) -> None:
        """Whatever happened up to now may have been missed."""
        self._now += 1
        self._known_since = self._now
        self._graphs.clear()

    @property
    def now(self) -> int:
        """The present, for `is_untouched` later."""
        return self._now

    def is_untouched(self, graph: int, uids: tuple[int, ...], since: int) -> bool:
        """Whether no data-block of these session uids had its geometry evaluated after `since`.

        graph: the depsgraph's address.
        """
        if since < self._known_since:
            return False
        times = self._graphs.get(graph, {})
        return all(times.get(uid, 0) <= since for uid in uids)

    def _times_of(self, graph: int) -> dict[int, int]:
        times = self._graphs.get(graph)
        if times is None:
            if len(self._graphs) >= _MOST_GRAPHS:  # renders make a new one for each frame
                self.forget()
            times = self._graphs[graph] = {}
        return times
