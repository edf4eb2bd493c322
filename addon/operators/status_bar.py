"""A line in the status bar while an operator waits for clicks, or for work that goes on beside it.

Blender keeps a text for each workspace, where it would stay if the operator ends while another one is shown. What draws
the bar is the same for all windows and workspaces: so that is what changes, and nothing can be left behind.
"""

from __future__ import annotations

from typing import Any

import bpy

_is_told = False


def tell(context: bpy.types.Context, text: str) -> None:
    """Shows a line until `clear`, or the next."""
    global _is_told

    def draw(header: Any, _context: bpy.types.Context) -> None:
        """As Blender does, with the line in the place of what the mouse's buttons do."""
        layout = header.layout
        layout.label(text=text)
        layout.separator_spacer()
        layout.template_reports_banner()
        layout.template_running_jobs()
        layout.separator_spacer()
        layout.template_status_info()

    context.workspace.status_text_set(draw)
    _is_told = True


def clear(context: bpy.types.Context) -> None:
    """Shows what Blender has to tell again."""
    global _is_told
    _is_told = False
    workspace = context.workspace or next(iter(bpy.data.workspaces), None)  # none in a window that goes
    if workspace is not None:
        workspace.status_text_set(None)


def register() -> None:
    """Nothing is told until an operator does."""


def unregister() -> None:
    """Operators that are unregistered while they run do not end."""
    if _is_told:
        clear(bpy.context)
