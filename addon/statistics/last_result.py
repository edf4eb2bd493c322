"""The last result of each scene, of a render or of a view, and whether the scene has changed since.

The count of a scene's edits (`events/changes.py`) when the scene was read shows that. Panels with these results
are redrawn when it changes, even if the mouse does not move. A render ends on another thread, on which
Blender's interface must not be used: a timer on the main thread finds new results.

Modules that need the native engine are imported where they are used: without it the add-on must still register.
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
_render_modes: dict[int, str] = {}  # of each scene's last render, independent of its viewports
_image_modes: dict[int, str] = {}  # of the images that views were rendered to, by their session uid
_shown: dict[int, tuple[_Done, bool]] = {}  # as panels have it, with whether the scene was edited since
_has_news = False  # other news


def edits_of(scene: bpy.types.Scene) -> int:
    """Returns the number of edits of `scene`: call it before reading the scene, and give it to `remember`."""
    return edit_count(scene.original.session_uid)


def remember(scene: bpy.types.Scene, statistics: FrameStatistics, edits: int) -> None:
    """Stores the last result of `scene` at this number of edits; from any thread."""
    uid = scene.original.session_uid
    _latest[uid] = _Done(statistics, edits)
    if statistics.source == "Render":
        _render_modes[uid] = statistics.settings.mode


def confirm_view(scene: bpy.types.Scene, last_change: SyncReport | None) -> None:
    """Confirms the last result of a scene's trees: a viewport has read `scene` again and found no difference.

    last_change: of the viewport's sync, which identifies the trees.
    """
    uid = scene.original.session_uid
    done = _latest.get(uid)
    if done is not None and done.statistics.source == "Viewport" and done.statistics.report is last_change:
        _latest[uid] = _Done(done.statistics, edit_count(uid))


def last_statistics(scene: bpy.types.Scene) -> FrameStatistics | None:
    """Returns the last result of `scene`, None if there is none."""
    done = _latest.get(scene.session_uid)
    return None if done is None else done.statistics


def last_render_mode(scene: bpy.types.Scene) -> str | None:
    """Returns the mode of the last render of `scene`, None if there was none."""
    return _render_modes.get(scene.session_uid)


def note_image(image: bpy.types.Image, mode: str) -> None:
    """A view was rendered to this image."""
    _image_modes[image.session_uid] = mode


def image_mode(image: bpy.types.Image) -> str | None:
    """Returns the mode of the view that was last rendered to an image, None if there was none."""
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
    """Drops results of scenes that are no longer in `bpy.data.scenes`."""
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
    """Drops results with their scene, or with its file."""

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
    """The cost of one frame.

    source: its purpose. size: (width, height). camera_rays: of all pixels in the border, 0 if untraced.
    samples: of a pixel, on average. trace_milliseconds: without those of the audit. audit: the result of checking a
    share of the camera rays, None if it was not requested. denoiser: its name, None if the image was not denoised;
    trace_milliseconds are without it too.
    complaints: problems other than those of the scene itself, a sentence each.
    owners: which objects show which meshes, and the share of the camera rays' work of each.
    has_own_mode: whether the mode is that of the shown viewport, and not the scene's.
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
# The cost of a frame and its updates, as short rows of text for a panel. Does not depend on panels.


def statistics_rows(statistics: FrameStatistics) -> list[tuple[str, str]]:
    """(name, value) of the steps of a frame in their order, then of what they were done to."""
    report = statistics.report
    width, height = statistics.size
    rows = [
        (statistics.source, f"Frame {statistics.frame:g}"),
        ("Resolution", f"{width} x {height} px"),
        ("Read Scene", duration(report.read_milliseconds + report.compare_milliseconds + report.apply_milliseconds)),
        ("Build BVHs", duration(report.commit_milliseconds)),
        ("Trace Rays", duration(statistics.trace_milliseconds)),
        *([("Denoise", duration(statistics.denoise_milliseconds))] if statistics.denoiser else []),
        ("Samples", f"{statistics.samples:.4g} per pixel"),
        ("Camera Rays", rate(statistics.rays_per_second)),
        ("Instances", f"{report.commit.instance_count:,}"),
        ("Memory", memory(report.byte_count)),
    ]
    for action in ("built", "rebuilt", "refitted", "rotated", "partly_rebuilt"):
        count = sum(mesh.action == action for mesh in report.commit.meshes)
        if count:
            rows.append((action.replace("_", " ").title(), f"{count:,} of {count_meshes(report):,} BVHs"))
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
