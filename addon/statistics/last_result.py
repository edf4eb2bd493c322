"""What was done last for each scene, by a render or of a view, and whether the scene still is as it was.

That is told by the count of a scene's edits (`events/changes.py`), taken when the scene was read. Panels that tell of
it are drawn again when it changes, without anybody moving the mouse. A render ends on a thread of its own, from which
Blender's interface must not be touched: a timer on the main thread finds what is new.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import bpy
import numpy as np
import numpy.typing as npt

from ..events.changes import edit_count, listen, stop_listening
from ..settings.preferences import redraw_properties, redraw_sidebars
from ..settings.scene_settings import read_settings
from ..sync.records import Int32Array, ObjectRecord
from .words import duration, memory, rate

if TYPE_CHECKING:
    from perfect_bvh import Audit

    from ..settings.scene_settings import RenderSettings
    from ..sync.report import SyncReport


TIMER_SECONDS = 0.2


@dataclass(frozen=True, slots=True, eq=False)
class _Done:
    """edits: of the scene, when it was read for this."""

    statistics: FrameStatistics
    edits: int


_latest: dict[int, _Done] = {}  # by the scene's session uid
_render_modes: dict[int, str] = {}  # of each scene's last render, whatever its viewports have done since
_image_modes: dict[int, str] = {}  # of the images that views were rendered to, by their session uid
_shown: dict[int, tuple[_Done, bool]] = {}  # as panels have it, with whether the scene was edited since
_has_news = False  # beside that


def edits_of(scene: bpy.types.Scene) -> int:
    """How often `scene` was edited so far: to be asked before it is read, and given to `remember`."""
    return edit_count(scene.original.session_uid)


def remember(scene: bpy.types.Scene, statistics: FrameStatistics, edits: int) -> None:
    """What was done last for `scene` as it was at so many edits; from any thread."""
    uid = scene.original.session_uid
    _latest[uid] = _Done(statistics, edits)
    if statistics.source == "Render":
        _render_modes[uid] = statistics.settings.mode


def confirm_view(scene: bpy.types.Scene, last_change: SyncReport | None) -> None:
    """A viewport has read `scene` again and found nothing else: what was done last for its trees still holds.

    last_change: of the viewport's sync, which says whose trees they are.
    """
    uid = scene.original.session_uid
    done = _latest.get(uid)
    if done is not None and done.statistics.source == "Viewport" and done.statistics.report is last_change:
        _latest[uid] = _Done(done.statistics, edit_count(uid))


def last_statistics(scene: bpy.types.Scene) -> FrameStatistics | None:
    """Of what was done last for `scene`, None if nothing was."""
    done = _latest.get(scene.session_uid)
    return None if done is None else done.statistics


def last_render_mode(scene: bpy.types.Scene) -> str | None:
    """What the last render of `scene` shows, None if there was none."""
    return _render_modes.get(scene.session_uid)


def note_image(image: bpy.types.Image, mode: str) -> None:
    """A view was rendered to this image."""
    _image_modes[image.session_uid] = mode


def image_mode(image: bpy.types.Image) -> str | None:
    """What the view shows that was last rendered to an image, None if none was."""
    return _image_modes.get(image.session_uid)


def is_outdated(scene: bpy.types.Scene) -> bool:
    """Whether `scene` was edited, set to another frame or given other settings since."""
    done = _latest.get(scene.session_uid)
    if done is None:
        return False
    statistics = done.statistics
    is_viewport = statistics.source == "Viewport"
    settings = read_settings(scene, is_viewport=is_viewport)
    if is_viewport or statistics.has_own_mode:
        settings = replace(settings, mode=statistics.settings.mode)
    return (
        done.edits != edits_of(scene)
        or statistics.frame != scene.frame_current_final
        or statistics.settings != settings
    )


def drop_missing(scenes: Iterable[bpy.types.Scene]) -> None:
    """Forgets what was done for scenes that are not among `bpy.data.scenes` any more."""
    there = {scene.session_uid for scene in scenes}
    for uid in [uid for uid in list(_latest) if uid not in there]:
        _latest.pop(uid, None)
        _render_modes.pop(uid, None)


def forget() -> None:
    """Forgets all of it."""
    _latest.clear()
    _render_modes.clear()
    _image_modes.clear()


def tell_of_news() -> None:
    """Panels show something of a scene that is not kept here, and it has changed; from any thread."""
    global _has_news
    _has_news = True


def _show_news() -> float:
    global _shown, _has_news
    before, _shown = _shown, {uid: (done, done.edits != edit_count(uid)) for uid, done in _latest.copy().items()}
    if _shown != before or _has_news:
        _has_news = False
        redraw_properties()
        redraw_sidebars()
    return TIMER_SECONDS


class _FileWatcher:
    """What was done for a scene is forgotten with it, or with its file."""

    def on_change(self, what: str) -> None:
        drop_missing(bpy.data.scenes)

    def on_file_change(self) -> None:
        forget()


_watcher = _FileWatcher()


def register() -> None:
    listen(_watcher)
    if not bpy.app.background:
        bpy.app.timers.register(_show_news, persistent=True)


def unregister() -> None:
    stop_listening(_watcher)
    if bpy.app.timers.is_registered(_show_news):
        bpy.app.timers.unregister(_show_news)
    forget()


# Frame statistics ----------------------------------------------------------------------------------------------------
# What one image cost, however it was made.


Source = Literal["Render", "View to Image", "Viewport"]


@dataclass(frozen=True, slots=True)
class FrameStatistics:
    """What one frame cost.

    source: what it was made for. size: (width, height). camera_rays: of all pixels in the border, 0 if untraced.
    samples: of a pixel, on average. trace_milliseconds: without those of the audit. audit: what checking a share of the
    camera rays has shown, None if it was not asked for. denoiser: its name, None if the image was not denoised;
    trace_milliseconds are without it too.
    complaints: what went wrong beside the scene itself, a sentence each.
    owners: which objects show which meshes, and how much of the camera rays' work each takes.
    has_own_mode: whether the mode is that of the viewport which it is a view of, and not the scene's.
    """

    frame: float
    size: tuple[int, int]
    settings: RenderSettings
    report: SyncReport
    trace_milliseconds: float
    camera_rays: int
    samples: float = 0.0
    audit: Audit | None = None
    audit_milliseconds: float = 0.0
    denoiser: str | None = None
    denoise_milliseconds: float = 0.0
    complaints: tuple[str, ...] = ()
    owners: Owners | None = None
    source: Source = "Render"
    has_own_mode: bool = False

    @property
    def rays_per_second(self) -> float:
        """Camera rays, with all that followed from each, a second; 0 if nothing was traced."""
        return self.camera_rays / self.trace_milliseconds * 1e3 if self.trace_milliseconds else 0.0


# Summary -------------------------------------------------------------------------------------------------------------
# What a frame cost and what was done for it, as short rows of text for a panel. Knows no panel.


def statistics_rows(statistics: FrameStatistics) -> list[tuple[str, str]]:
    """(name, value) of the steps of a frame in their order, then of what they were done to."""
    report = statistics.report
    width, height = statistics.size
    rows = [
        (statistics.source, f"Frame {statistics.frame:g}"),
        ("Resolution", f"{width} x {height} px"),
        ("Sync", duration(report.read_milliseconds + report.compare_milliseconds + report.apply_milliseconds)),
        ("Build", duration(report.commit_milliseconds)),
        ("Trace", duration(statistics.trace_milliseconds)),
        *([("Denoise", duration(statistics.denoise_milliseconds))] if statistics.denoiser else []),
        ("Samples", f"{statistics.samples:.4g} a pixel"),
        ("Camera Rays", rate(statistics.rays_per_second)),
        ("Instances", f"{report.commit.instance_count:,}"),
        ("Memory", memory(report.byte_count)),
    ]
    for action in ("built", "rebuilt", "refitted", "rotated", "partly_rebuilt"):
        count = sum(mesh.action == action for mesh in report.commit.meshes)
        if count:
            rows.append((action.replace("_", " ").title(), f"{count:,} of {count_meshes(report):,} trees"))
    return rows


def count_meshes(report: SyncReport) -> int:
    """How many distinct meshes the scene has."""
    return len(report.meshes) - report.count_meshes("removed")


# Owners --------------------------------------------------------------------------------------------------------------
# Which objects show which meshes in an image: users know their objects, the engine its meshes.


@dataclass(frozen=True, slots=True, eq=False)
class Owners:
    """A scene's instances, as columns of its record: nothing is copied.

    mesh_ids: (M,) int32, the engine's, by mesh. mesh_rows, object_rows: (I,) int32, of each instance, rows of mesh_ids
    and of objects; parent_rows: of the instancer, -1 for a plain object. shares: (I,), which part of the camera rays'
    work went into those that end on each; None if nothing was traced.
    """

    mesh_ids: Int32Array
    objects: tuple[ObjectRecord, ...]
    mesh_rows: Int32Array
    object_rows: Int32Array
    parent_rows: Int32Array
    shares: npt.NDArray[np.float64] | None = None
