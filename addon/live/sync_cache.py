"""The syncs that the add-on itself keeps: one for each scene, view layer and kind of view, while there is room.

They live on between renders and frames, so that the next one needs only the difference. No change makes one of them
stale: each is updated before it is used. They go with the scenes and the file that they were made from.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy

from ..events.changes import listen, stop_listening
from ..settings.preferences import cache_byte_limit
from ..sync.report import SyncReport
from .scene_sync import SceneSync

# By the scene's session uid, the view layer's name and the depsgraph's mode, ordered from least to most recently used.
_syncs: dict[tuple[int, str, str], SceneSync] = {}


class _CachedSync(SceneSync):
    """One of them."""

    def __init__(self) -> None:
        super().__init__(watch=False)

    def _take_in(self, report: SyncReport) -> SyncReport:
        report = super()._take_in(report)
        _forget_beyond_limit(self)
        return report


def sync_of(depsgraph: Any) -> SceneSync:
    """Returns the add-on's own sync for a depsgraph: one per scene, view layer and kind (viewport or render)."""
    scene = depsgraph.scene.original
    key = (scene.session_uid, depsgraph.view_layer.name, depsgraph.mode)
    sync = _syncs.pop(key, None)
    if sync is None:
        sync = _CachedSync()
    _syncs[key] = sync
    return sync


def syncs_of(scene: Any) -> tuple[SceneSync, ...]:
    """The add-on's syncs of a `bpy.types.Scene` that exist, most recently used last."""
    return tuple(sync for key, sync in list(_syncs.items()) if key[0] == scene.session_uid)


def _forget_beyond_limit(used: SceneSync) -> None:
    """Drops the least recently used syncs first; they are read and built again when shown. `used` stays at any size."""
    limit = cache_byte_limit()
    held = list(_syncs.items())
    if limit is None or not any(sync is used for _, sync in held):
        return
    total = sum(sync.byte_count for _, sync in held)
    for key, sync in held:
        if total <= limit:
            return
        if sync is not used:
            # Not closed: code that is still tracing it keeps it alive.
            _syncs.pop(key, None)
            total -= sync.byte_count


def drop_missing(scenes: Iterable[Any]) -> None:
    """Forgets the syncs of scenes and view layers that are not among `bpy.data.scenes` any more."""
    if not _syncs:
        return
    shown = {(scene.session_uid, layer.name) for scene in scenes for layer in scene.view_layers}
    for key in [key for key in list(_syncs) if key[:2] not in shown]:
        # Not closed: code that is still tracing it keeps it alive.
        sync = _syncs.pop(key, None)
        if sync is not None:
            sync.ask_to_stop_building()  # this may be a render's thread: it waits for nothing


def clear_syncs() -> None:
    """Forgets all of the add-on's own syncs and frees their trees."""
    while _syncs:
        _syncs.popitem()[1].close()


class _FileWatcher:
    """Drops syncs with what they were made from. Marking stale what scripts hold is each `SceneSync`'s own matter."""

    def on_change(self, what: str) -> None:
        drop_missing(bpy.data.scenes)

    def on_file_change(self) -> None:
        clear_syncs()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    clear_syncs()
