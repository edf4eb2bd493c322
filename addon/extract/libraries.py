"""Linked libraries that Blender did not find: what was linked from them stands there as empties without anything."""

from __future__ import annotations

from typing import Any

import bpy

from ..sync.not_shown import NotShown


def find_missing_libraries() -> list[NotShown]:
    """Of the file that is open, a row for each."""
    return [
        NotShown("library", library.name, library.session_uid, f"the linked library {path_of(library)} is missing")
        for library in bpy.data.libraries
        if library.is_missing
    ]


def find_missing_blocks() -> list[NotShown]:
    """What libraries that are there do not hold any more. Looks at every data-block: for once a file."""
    return [
        NotShown("library", block.name, block.session_uid, f"it is not in the linked library {path_of(library)}")
        for library in bpy.data.libraries
        if not library.is_missing
        for block in library.users_id
        if block.is_missing
    ]


def path_of(library: Any) -> str:
    """As the file system knows it."""
    return str(bpy.path.abspath(library.filepath, library=library.parent))
