"""What the add-on does when Blender loads a file: its own syncs are of scenes that are gone.

Marking stale scenes needs nothing from here: every watching `SceneSync` sees to that itself, see
`extract/changes.py`.
"""

from __future__ import annotations

from .extract.changes import listen, stop_listening
from .session import clear_sessions


class _FileWatcher:
    """Drops the add-on's syncs with the file they were made from."""

    def on_change(self, what: str) -> None:
        """Nothing: the add-on's own syncs are updated before each use."""

    def on_file_change(self) -> None:
        clear_sessions()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)


def unregister() -> None:
    stop_listening(_watcher)
    clear_sessions()
