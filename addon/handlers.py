"""What the add-on does when Blender loads a file or loses a scene: its own syncs of what is gone go as well.

Marking stale scenes needs nothing from here: every watching `SceneSync` sees to that itself, see
`extract/changes.py`.
"""

from __future__ import annotations

import bpy

from . import latest
from .extract.changes import listen, stop_listening
from .session import clear_sessions, drop_missing


class _FileWatcher:
    """Drops the add-on's syncs with the scenes and the file they were made from.

    A change makes none of them stale: they are updated before each use.
    """

    def on_change(self, what: str) -> None:
        drop_missing(bpy.data.scenes)
        latest.drop_missing(bpy.data.scenes)

    def on_file_change(self) -> None:
        clear_sessions()
        latest.forget()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    clear_sessions()
