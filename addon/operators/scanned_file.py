"""Which file, in which state, pieces of a scan are made from: so that others are not taken for theirs.

A saved file is known by what is on the disk, as on the command line. Where it was edited since, or never saved, pieces
are known as long as Blender runs and nothing but the Scan panel's own settings, the frame or the selection changes.
"""

from __future__ import annotations

import hashlib
import secrets
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ..events.changes import edit_count, listen, stop_listening

if TYPE_CHECKING:
    from ..scanning.piece_scan import ScanPlan

_session = secrets.token_hex(8)


class _Watch:
    """Has edits counted.

    known: by the scene's session uid the state that it was last seen in, and how pieces name that: "" as on the disk.
    """

    def __init__(self) -> None:
        self.known: dict[int, tuple[str, str]] = {}

    def on_change(self, what: str) -> None:
        """They are counted for all listeners."""

    def on_file_change(self) -> None:
        self.known.clear()


_watch = _Watch()


class ScannedFile:
    """The file of a scene, as it is now."""

    def __init__(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        listen(_watch)
        view_layer.update()  # what was edited without an evaluation counts
        self._uid = scene.session_uid
        self._edits = edit_count(self._uid)
        state = _state_of(scene, view_layer)
        if bpy.data.filepath and not is_dirty():
            _watch.known[self._uid] = (state, "")
        elif _watch.known.get(self._uid, ("", ""))[0] != state:
            _watch.known[self._uid] = (state, f"edited {_session} {state}")
        self._name = _watch.known[self._uid][1]

    def inputs_of(self, plan: ScanPlan, carrier: bpy.types.Object | None) -> dict[str, Any]:
        """What pieces are made from, as the command line has it of a file that is saved."""
        from ..extract.libraries import find_missing_libraries

        path = Path(bpy.data.filepath)
        inputs = plan.inputs(
            path,
            carrier,
            autoexec=bpy.context.preferences.filepaths.use_scripts_auto_execute,
            allow_missing=bool(find_missing_libraries()),
        )
        if self._name:
            inputs["files"][path.name or "not saved"] = self._name
        return inputs

    def check_unedited(self, frame: int) -> None:
        """Raises ValueError if the scene was edited meanwhile. frame: from which on pieces are not written."""
        if is_dirty() and edit_count(self._uid) != self._edits:
            raise ValueError(
                f"The scene was edited during the scan: the pieces from frame {frame} on are not written. Start again, "
                "after saving it if scripts have edited it"
            )

    def points_were_added(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        """By the scan itself, whose rays do not meet them."""
        view_layer.update()
        _watch.known[self._uid] = (_state_of(scene, view_layer), self._name)


def is_dirty() -> bool:
    """Whether the file was edited since it was saved, as Blender has it: by steps that can be undone.

    Without windows it keeps no account of that: there a script is trusted to have saved what it has edited.
    """
    return bool(bpy.data.is_dirty) and not bpy.app.background


def forget() -> None:
    """Counts no more."""
    stop_listening(_watch)
    _watch.on_file_change()


def _state_of(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> str:
    """What is no edit of an object or of its data is here by itself: the rate of frames, what the view layer shows."""
    shown = sorted(obj.name for obj in view_layer.objects if obj.visible_get(view_layer=view_layer))
    parts = (edit_count(scene.session_uid), scene.render.fps, scene.render.fps_base, view_layer.name, shown)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]
