"""The request of the Scan panel, read from its settings. All functions raise ValueError for invalid settings."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from ..events.changes import edit_count, listen, stop_listening
from ..settings.scan_choices import FORMATS, KITTI, OTHER
from ..settings.scan_settings import label_names
from ..statistics.words import sentence
from .ticking import Checked

if TYPE_CHECKING:
    from ..scanning.piece_scan import ScanPlan


def frames_of(scene: bpy.types.Scene, settings: bpy.types.PropertyGroup) -> tuple[int, int] | None:
    """The first and the last one; None for the current one alone. settings: of scans or of labels."""
    if settings.frames == "CURRENT":
        return None
    if settings.frames == "SCENE":
        return scene.frame_start, scene.frame_end
    if settings.frame_end < settings.frame_start:
        raise ValueError(f"The range must end at or after its start, {settings.frame_start}: got {settings.frame_end}")
    return settings.frame_start, settings.frame_end


def exclude_mount_of(scene: bpy.types.Scene) -> bool | None:
    """Returns the setting as `scan` has it; None to decide by the object."""
    return {"AUTO": None, "EXCLUDE": True, "SCAN": False}[scene.perfect_bvh.scan.mount]


def threads_of(scene: bpy.types.Scene) -> int:
    """Returns the number of threads of renders."""
    return scene.render.threads if scene.render.threads_mode == "FIXED" else 0


def plan_of(scene: bpy.types.Scene) -> ScanPlan:
    """Plans a scan into files."""
    from ..scanning.formats import check_format
    from ..scanning.piece_scan import ScanPlan
    from ..scanning.sensor_settings import sensor_of

    settings = scene.perfect_bvh.scan
    frames = frames_of(scene, settings)
    suffix = f".{settings.file_format}"
    boxes = settings.use_boxes and FORMATS[suffix].has_boxes  # others do not show the setting
    steps = 1 if frames is None else settings.steps_per_frame
    try:
        check_format(suffix, label_names(settings), steps=steps)
    except ImportError as problem:
        raise ValueError(f"{settings.file_format}: {problem}") from problem
    return ScanPlan(
        sensor=sensor_of(settings),
        frames=(scene.frame_current,) if frames is None else tuple(range(frames[0], frames[1] + 1)),
        is_one_pass=frames is None,
        suffix=suffix,
        size=settings.frames_per_file,
        steps=settings.steps_per_frame,
        threads=threads_of(scene),
        labels=label_names(settings),
        boxes=boxes,
        category=(settings.category.strip() or None) if suffix == KITTI else None,
        seed=settings.seed,
        exclude_mount=exclude_mount_of(scene),
        for_viewport=settings.use_viewport,
    )


def folder_of(text: str) -> Path:
    """Returns the folder of files, from a panel's field."""
    from ..scanning.sensor_settings import absolute

    if not text.strip():
        raise ValueError("Choose a folder for the files")
    path = absolute(text).resolve()
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path} is a file: choose a folder")
    return path


def check_colors(settings: bpy.types.PropertyGroup) -> None:
    """Refuses a column that the points will not have: to know it before the work."""
    from ..scanning.point_cloud import column_names
    from ..scanning.point_data import column_names_of_points

    known = [*column_names_of_points(), *column_names(label_names(settings)).values()]
    if settings.point_color == OTHER and settings.point_column not in known:
        raise ValueError(f"Color: the points have no column {settings.point_column!r}, but {', '.join(known)}")


# Scanned file --------------------------------------------------------------------------------------------------------
# Identifies the file and its state from which chunks of a scan are made: so that other files' are not reused.
#
# A saved file is identified by its contents on the disk, as on the command line. If it was edited since, or never
# saved, chunks are recognised while Blender runs and nothing but the Scan panel's own settings, the frame or the
# selection changes.


_session = secrets.token_hex(8)


class _Watch:
    """Has edits counted.

    known: the last seen state by the scene's session uid, and its name in chunks: "" as on the disk.
    """

    def __init__(self) -> None:
        self.known: dict[int, tuple[str, str]] = {}

    def on_change(self, what: str) -> None:
        """They are counted for all listeners."""

    def on_file_change(self) -> None:
        self.known.clear()


_watch = _Watch()


class ScannedFile:
    """The current state of a scene's file."""

    def __init__(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        listen(_watch)
        view_layer.update()  # also counts edits that were not evaluated
        self._uid = scene.session_uid
        self._edits = edit_count(self._uid)
        state = _state_of(scene, view_layer)
        if bpy.data.filepath and not is_dirty():
            _watch.known[self._uid] = (state, "")
        elif _watch.known.get(self._uid, ("", ""))[0] != state:
            _watch.known[self._uid] = (state, f"edited {_session} {state}")
        self._name = _watch.known[self._uid][1]

    def inputs_of(self, inputs_of: Callable[[SimpleNamespace], dict[str, Any]], **choices: Any) -> dict[str, Any]:
        """Returns the inputs of chunks, as the command line has them for a saved file.

        inputs_of: makes them from the command's arguments. choices: the panels' settings.
        """
        from ..extract.label_values import find_missing_libraries

        path = Path(bpy.data.filepath)
        arguments = SimpleNamespace(
            file=path,
            autoexec=bpy.context.preferences.filepaths.use_scripts_auto_execute,
            allow_missing=bool(find_missing_libraries()),
            **choices,
        )
        inputs = inputs_of(arguments)
        if self._name:
            inputs["files"][path.name or "not saved"] = self._name
        return inputs

    @property
    def was_edited(self) -> bool:
        """Whether the scene was edited since this was made."""
        return is_dirty() and edit_count(self._uid) != self._edits

    def check_unedited(self, frame: int) -> None:
        """Raises ValueError if the scene was edited since. frame: the first whose chunks are not written."""
        if self.was_edited:
            raise ValueError(
                f"The scene was edited during the work: the files from frame {frame} on are not written. Save the "
                "file, then start again"
            )

    def points_were_added(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> None:
        """Notes that the scan itself added points, which its rays do not hit."""
        view_layer.update()
        _watch.known[self._uid] = (_state_of(scene, view_layer), self._name)


def is_dirty() -> bool:
    """Whether the file was edited since it was saved, by Blender's count of undo steps.

    Without windows Blender does not count them: there a script is trusted to have saved its edits.
    """
    return bool(bpy.data.is_dirty) and not bpy.app.background


def forget() -> None:
    """Counts no more."""
    stop_listening(_watch)
    _watch.on_file_change()


def _state_of(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> str:
    """Returns settings whose changes are no edits of objects or their data: the frame rate, the layer's visibility."""
    shown = sorted(obj.name for obj in view_layer.objects if obj.visible_get(view_layer=view_layer))
    parts = (edit_count(scene.session_uid), scene.render.fps, scene.render.fps_base, view_layer.name, shown)
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


# Color points --------------------------------------------------------------------------------------------------------
# Colours the points of scans by another column: these are their attributes, so that nothing is scanned again.


class PERFECT_BVH_OT_color_points(Checked, bpy.types.Operator):
    """Writes the points' attribute of colours again."""

    bl_idname = "perfect_bvh.color_points"
    bl_label = "Color Points"
    bl_description = "Color the points of the selected scans as chosen, or of the last one if none is selected"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        """Returns why no points can be coloured; called in each redraw, so it does not go through all objects."""
        from ..scanning.point_data import may_have_points

        if context.mode != "OBJECT":
            return "Points can be colored in Object Mode only"
        return None if may_have_points() else "No scan to color"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..scanning.point_data import color_points

        settings = context.scene.perfect_bvh.scan
        scans, colored = _chosen(context), []
        if not scans:
            self.report({"ERROR"}, "No scan to color in this view layer")
        for scan in scans:
            try:
                color_points(scan.data, settings.point_color, settings.point_column)
            except ValueError as problem:
                self.report({"ERROR"}, sentence(str(problem).removeprefix("color_points: ")))
            else:
                colored.append(scan.name)
        if not colored:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Recolored {len(colored)} point cloud{'s' if len(colored) != 1 else ''}")
        return {"FINISHED"}


def _chosen(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The selected scans; where none is selected, the one whose points were made last."""
    from ..extract.label_values import has_points  # here: it needs the engine, which may be missing

    scans = [obj for obj in context.view_layer.objects if has_points(obj) and obj.data.is_editable]
    selected = [scan for scan in scans if scan.select_get()]
    return selected or sorted(scans, key=lambda scan: scan.data.session_uid)[-1:]


CLASSES = (PERFECT_BVH_OT_color_points,)
