"""What operators share: they say why they cannot be pressed, and work in steps of a timer while Blender goes on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ..settings.preferences import native_error
from ..statistics import messages
from ..statistics.words import sentence

# A line in the status bar while an operator waits for clicks, or for work in the background.
#
# Blender keeps a text for each workspace, which would stay if the operator ends while another one is shown. The
# function that draws the bar is the same for all windows and workspaces, so it is replaced: nothing can be left behind.


_is_told = False


def tell(context: bpy.types.Context, text: str) -> None:
    """Shows a line until `clear`, or the next."""
    global _is_told

    def draw(header: Any, _context: bpy.types.Context) -> None:
        """Draw like Blender, with the line in place of the mouse buttons' actions."""
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


def forget() -> None:
    """Clears an operator's line: an operator that is unregistered while it runs does not end."""
    if _is_told:
        clear(bpy.context)


# Ticking -------------------------------------------------------------------------------------------------------------


TIMER_SECONDS = 0.01
# Whose names errors begin with, for scripts.
FUNCTIONS = (
    *("scan", "bench", "compare", "label_image", "bake_rays", "write_attributes"),
    *("Place", "sun_table", "read_epw", "irradiance_table"),
)


def sentence_of(problem: BaseException | str) -> str:
    """Returns the text for users: without a function's name or a number of the operating system's."""
    text = problem.strerror if isinstance(problem, OSError) and problem.strerror else str(problem)
    for function in FUNCTIONS:
        text = text.removeprefix(f"{function}: ")
    return sentence(text or type(problem).__name__)


class Checked:
    """An operator whose button is greyed where it cannot work, and says why."""

    poll_message_set: Callable[..., None]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        complaint = cls.why_not(context)
        if complaint is not None:
            cls.poll_message_set(complaint)
        return complaint is None

    @classmethod
    def why_not(cls, context: bpy.types.Context) -> str | None:
        """Why its button is grey; None if it is not."""
        return native_error() or cls._find_complaint(context)

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        """Why it cannot work here."""
        return None


class Ticking(Checked):
    """An operator that ticks: a timer that calls its `modal`, a bar at the pointer, a line in the status bar.

    Without a window, or when a script calls it, it runs `execute` instead.
    """

    bl_label: str
    report: Callable[[set[str], str], None]
    _timer: bpy.types.Timer | None = None
    _told = ""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        self._begin_ticking(context)
        self._show_state(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" or self._is_closed(context):
            self._end(context)
            return self._stop(context)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        ended = self._tick(context)
        return {"RUNNING_MODAL"} if ended is None else ended

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends or opens another file."""
        self._end(context)

    # What each of them has its own of --------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        """Reads the input; returns False if the work is impossible, with the reason reported."""
        raise NotImplementedError

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        """Works for a moment; returns the operator's result after the last one."""
        raise NotImplementedError

    def _end(self, context: bpy.types.Context) -> None:
        """Cancels the current work."""
        raise NotImplementedError

    def _stop(self, context: bpy.types.Context) -> set[str]:
        """Returns the operator's result when the user has ended it."""
        self.report({"INFO"}, self._stopped())
        return {"CANCELLED"}

    def _stopped(self) -> str:
        """Returns the message to the user then."""
        raise NotImplementedError

    def _show_state(self, context: bpy.types.Context) -> None:
        """How far it is."""

    def _is_closed(self, context: bpy.types.Context) -> bool:
        """Whether the owner of its work was closed."""
        return False

    # Ticking ---------------------------------------------------------------------------------------------------------

    def _begin_ticking(self, context: bpy.types.Context) -> None:
        manager = context.window_manager
        self._timer = manager.event_timer_add(TIMER_SECONDS, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)

    def _tell(self, context: bpy.types.Context, state: str) -> None:
        """Shows a line until the end, or the next."""
        if state != self._told:  # each call draws the status bar again
            self._told = state
            tell(context, state)

    def _forget_complaints(self) -> None:
        """Drops the messages of an earlier run."""
        messages.tell(bpy.context.scene, self.bl_label)

    def _complain(self, problem: BaseException | str, kind: str = "ERROR") -> None:
        """Report an error, and keep it in the panels until the next run."""
        text = sentence_of(problem)
        self.report({kind}, text)
        messages.add(bpy.context.scene, self.bl_label, text, is_error=kind == "ERROR")

    def _conclude(self, text: str) -> None:
        """Reports the result, and keeps it in the operator's panel until the next run."""
        self.report({"INFO"}, text)
        messages.add(bpy.context.scene, self.bl_label, text, is_note=True)

    def _end_ticking(self, context: bpy.types.Context) -> None:
        """Ends the ticking; does nothing if it has not begun, or has ended before."""
        if self._timer is None:
            return
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        clear(context)
        self._timer = None
