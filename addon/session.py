"""The syncs that the add-on itself keeps: one for each scene, view layer and kind of view, while there is room."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .scene_sync import SceneSync
from .sync.report import SyncReport

# The one used last is the last. A render's thread changes it as well: who goes through it goes through a copy.
_sessions: dict[tuple[int, str, str], SceneSync] = {}
_byte_limit: int | None = None


class _KeptSync(SceneSync):
    """One of them."""

    def __init__(self) -> None:
        super().__init__(watch=False)

    def _take_in(self, report: SyncReport) -> SyncReport:
        report = super()._take_in(report)
        _forget_beyond_limit(self)
        return report


def session_of(depsgraph: Any) -> SceneSync:
    """The add-on's own sync for what a depsgraph shows: one a scene, view layer and kind (viewport or render).

    It lives on between renders and frames, so that the next one needs only the difference. Its engine scene does
    not go stale by itself: whoever draws or renders updates it first.
    """
    scene = depsgraph.scene.original
    key = (scene.session_uid, depsgraph.view_layer.name, depsgraph.mode)
    sync = _sessions.pop(key, None)
    if sync is None:
        sync = _KeptSync()
    _sessions[key] = sync
    return sync


def limit_sessions(byte_count: int | None) -> None:
    """Lets the add-on's own syncs hold so many bytes together, heeded whenever one is updated; None: any number.

    Those used longest ago are forgotten first: their scenes are read and built anew when they are shown again. The one
    that is updated stays, however large it is.
    """
    global _byte_limit
    _byte_limit = byte_count


def _forget_beyond_limit(used: SceneSync) -> None:
    held = list(_sessions.items())
    if _byte_limit is None or not any(sync is used for _, sync in held):
        return
    total = sum(sync.byte_count for _, sync in held)
    for key, sync in held:
        if total <= _byte_limit:
            return
        if sync is not used:
            # Not closed: whoever is tracing it keeps it for so long.
            _sessions.pop(key, None)
            total -= sync.byte_count


def sessions_of(scene: Any) -> tuple[SceneSync, ...]:
    """The add-on's syncs of a `bpy.types.Scene` that exist, most recently used last."""
    return tuple(sync for key, sync in list(_sessions.items()) if key[0] == scene.session_uid)


def drop_missing(scenes: Iterable[Any]) -> None:
    """Forgets the add-on's own syncs of scenes and view layers that are not among `bpy.data.scenes` any more."""
    if not _sessions:
        return
    shown = {(scene.session_uid, layer.name) for scene in scenes for layer in scene.view_layers}
    for key in [key for key in list(_sessions) if key[:2] not in shown]:
        # Not closed: whoever is tracing it keeps it for so long.
        sync = _sessions.pop(key, None)
        if sync is not None:
            sync.ask_to_stop_building()  # this may be a render's thread: it waits for nothing


def clear_sessions() -> None:
    """Forgets all of the add-on's own syncs and frees their trees."""
    while _sessions:
        _sessions.popitem()[1].close()
