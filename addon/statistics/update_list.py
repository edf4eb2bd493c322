"""The updates for the last image of each scene, as rows of a list that Blender draws.

A timer on the main thread fills it, only while it is visible: a panel requests it when it is drawn. It belongs to
the window manager, so that it does not count as an edit of a scene. The row's data stays in Python, by its number.
"""

from __future__ import annotations

import time
from typing import Any

import bpy

from ..events.changes import listen, stop_listening
from ..settings.preferences import redraw_sidebars
from .last_result import FrameStatistics, last_statistics
from .updates import UpdateRow, Updates, facts_of, find_instancers, find_updates, what_to_do, what_was_done
from .words import count_of, duration, share

TIMER_SECONDS = 0.1
# Of rows that are not about objects.
FOLD, MORE = "fold", "more"

_asked: set[int] = set()  # session uids of scenes
_listed: dict[int, tuple[FrameStatistics, Updates]] = {}  # by the scene's session uid, as the collection has it
_is_filling = False


def _on_active(rows: Any, _: bpy.types.Context) -> None:
    if not _is_filling:
        choose(rows)


def _on_order(rows: Any, _: bpy.types.Context) -> None:
    _asked.add(rows.scene_uid)


class PERFECT_BVH_PG_update(bpy.types.PropertyGroup):
    """A row of the list."""

    state: bpy.props.StringProperty(name="State", description="The action on the objects")
    short_name: bpy.props.StringProperty(name="Short Name", description="The name in narrow panels")
    time: bpy.props.StringProperty(name="Time", description="Time for the BVH of the mesh")
    share: bpy.props.StringProperty(name="Share", description="Share of the camera rays' work")
    is_folded: bpy.props.BoolProperty(name="Folded", description="Whether it is one of the rows that can be folded")
    number: bpy.props.IntProperty(name="Number", description="Position of the update in the list")


class PERFECT_BVH_PG_updates(bpy.types.PropertyGroup):
    """The rows of one scene, and which of them is chosen."""

    rows: bpy.props.CollectionProperty(
        name="Updates",
        description="Objects, and their updates for the last image",
        type=PERFECT_BVH_PG_update,
        options={"SKIP_SAVE"},
    )
    active: bpy.props.IntProperty(
        name="Active",
        description="Select the objects of this row in the scene",
        default=-1,
        update=_on_active,
        options={"SKIP_SAVE"},
    )
    sort_by: bpy.props.EnumProperty(
        name="Sort By",
        description="Which objects come first in the list",
        items=[
            ("SHARE", "Share", "Those that cost the camera's rays most", 0),
            ("TIME", "Time", "Those whose BVH took longest to build or refit", 1),
        ],
        default="SHARE",
        update=_on_order,
        options={"SKIP_SAVE"},
    )
    is_unfolded: bpy.props.BoolProperty(
        name="Show Unchanged", description="Also list objects without updates", options={"SKIP_SAVE"}
    )
    scene_uid: bpy.props.IntProperty(name="Scene UID", description="Number of the scene")
    done: bpy.props.StringProperty(name="Done", description="The action on the row's objects, and its reason")
    advice: bpy.props.StringProperty(name="Advice", description="How the next update can be faster")
    facts: bpy.props.StringProperty(name="Facts", description="Size of the mesh, and its cost for rays")
    note: bpy.props.StringProperty(name="Note", description="Why the objects could not be selected")


def rows_of(scene: bpy.types.Scene) -> PERFECT_BVH_PG_updates | None:
    """Returns the list of a scene; None if it has none yet. A missing or outdated list is filled soon."""
    statistics = last_statistics(scene)
    known = _listed.get(scene.session_uid)
    if statistics is not None and (known is None or known[0] is not statistics):
        _asked.add(scene.session_uid)
    return _find(scene.session_uid)


def updates_of(scene_uid: int) -> Updates:
    """Returns the data of a scene's list."""
    known = _listed.get(scene_uid)
    return Updates() if known is None else known[1]


def row_of(rows: PERFECT_BVH_PG_updates, index: int) -> UpdateRow | None:
    """Returns the data of a row of the list; None if it is not about objects."""
    if not 0 <= index < len(rows.rows) or rows.rows[index].state in {FOLD, MORE}:
        return None
    updates = updates_of(rows.scene_uid)
    found = (*updates.changed, *updates.unchanged)
    number = rows.rows[index].number
    return found[number] if number < len(found) else None


def instancers_of(rows: PERFECT_BVH_PG_updates, row: UpdateRow) -> set[int]:
    """The uids of what shows the objects of a row of the list as instances."""
    known = _listed.get(rows.scene_uid)
    return set() if known is None or known[0].owners is None else find_instancers(row, known[0].owners)


def choose(rows: PERFECT_BVH_PG_updates) -> None:
    """Describes the active row, and selects its objects; unfolds or folds, if it is the row for that."""
    _describe(rows)
    if 0 <= rows.active < len(rows.rows) and rows.rows[rows.active].state == FOLD:
        rows.is_unfolded = not rows.is_unfolded
    if row_of(rows, rows.active) is None or bpy.context.scene.session_uid != rows.scene_uid:
        return
    operator = bpy.ops.perfect_bvh.select_updated
    if operator.poll():
        operator("EXEC_DEFAULT", True)
    else:
        rows.note = "Objects can be selected in Object Mode only"


def _describe(rows: PERFECT_BVH_PG_updates) -> None:
    row = row_of(rows, rows.active)
    rows.note = ""
    rows.done, rows.advice, rows.facts = (
        ("",) * 3 if row is None else (what_was_done(row), what_to_do(row), facts_of(row))
    )


def fill() -> bool:
    """Update the lists of the requested scenes; returns whether any has changed."""
    global _is_filling
    if not _asked:
        return False
    asked = [scene for scene in bpy.data.scenes if scene.session_uid in _asked]
    _asked.clear()
    _is_filling = True
    try:
        for scene in asked:
            _fill_scene(scene)
    finally:
        _is_filling = False
    return bool(asked)


def _fill_scene(scene: bpy.types.Scene) -> None:
    uid, statistics = scene.session_uid, last_statistics(scene)
    if statistics is None:
        return
    made = _find(uid)
    if made is None:
        made = bpy.context.window_manager.perfect_bvh_updates.add()
        made.scene_uid = uid
    before = row_of(made, made.active)
    owners = statistics.owners
    by_time = made.sort_by == "TIME"
    updates = Updates() if owners is None else find_updates(statistics.report, owners, by_time=by_time)
    _listed[uid] = statistics, updates
    _write(made, updates)
    made.active = _index_of(made, before)
    _describe(made)


def _write(made: PERFECT_BVH_PG_updates, updates: Updates) -> None:
    """Unchanged objects can be folded, unless there are no others."""
    made.rows.clear()
    is_folded = bool(updates.changed)
    for number, row in enumerate(updates.changed):
        _write_row(made, number, row, is_folded=False)
    _write_more(made, updates.changed_more, is_folded=False)
    if updates.changed and updates.unchanged:
        fold = made.rows.add()
        fold.name, fold.state = f"{updates.unchanged_count:,} unchanged", FOLD
    for number, row in enumerate(updates.unchanged, len(updates.changed)):
        _write_row(made, number, row, is_folded=is_folded)
    _write_more(made, updates.unchanged_more, is_folded=is_folded)


def _write_row(made: PERFECT_BVH_PG_updates, number: int, row: UpdateRow, *, is_folded: bool) -> None:
    item = made.rows.add()
    item.name, item.state, item.number, item.is_folded = row.title, row.state, number, is_folded
    item.short_name = row.short_title
    if row.milliseconds:
        item.time = duration(row.milliseconds).replace("under ", "<")
    if row.share > 0.0:
        item.share = share(row.share)


def _write_more(made: PERFECT_BVH_PG_updates, count: int, *, is_folded: bool) -> None:
    if count > 0:
        item = made.rows.add()
        item.name, item.state, item.is_folded = f"And {count_of(count, 'more object')}", MORE, is_folded


def _index_of(made: PERFECT_BVH_PG_updates, before: UpdateRow | None) -> int:
    """Return the row of the previous selection, at its new position: the first changed one if it is missing."""
    found = [*updates_of(made.scene_uid).changed, *updates_of(made.scene_uid).unchanged]
    if before is not None and len(before.uids):
        uid = before.uids[0]
        numbers = {number for number, row in enumerate(found) if uid in row.uids[:1] or uid in row.uids}
        for index, item in enumerate(made.rows):
            if item.number in numbers and item.state not in {FOLD, MORE}:
                return index
    return 0 if updates_of(made.scene_uid).changed else -1


def _find(scene_uid: int) -> PERFECT_BVH_PG_updates | None:
    lists = bpy.context.window_manager.perfect_bvh_updates
    return next((made for made in lists if made.scene_uid == scene_uid), None)


def _show_news() -> float:
    started = time.perf_counter()
    if fill():
        redraw_sidebars()
    # Where a scene is so large that listing it takes long, playing it is not held up by more than a tenth.
    return max(TIMER_SECONDS, 10.0 * (time.perf_counter() - started))


class _FileWatcher:
    """Drops lists with their scene, or with its file."""

    def on_change(self, what: str) -> None:
        there = {scene.session_uid for scene in bpy.data.scenes}
        for uid in [uid for uid in list(_listed) if uid not in there]:
            _listed.pop(uid, None)

    def on_file_change(self) -> None:
        _forget()


def _forget() -> None:
    _asked.clear()
    _listed.clear()
    # While Blender starts, when a failure may undo the registration, there is no data.
    for manager in getattr(bpy.data, "window_managers", ()):
        manager.perfect_bvh_updates.clear()


_watcher = _FileWatcher()
CLASSES = (PERFECT_BVH_PG_update, PERFECT_BVH_PG_updates)


def register() -> None:
    for group in CLASSES:
        bpy.utils.register_class(group)
    bpy.types.WindowManager.perfect_bvh_updates = bpy.props.CollectionProperty(
        name="Updates",
        description="Updates for the last image of each scene",
        type=PERFECT_BVH_PG_updates,
        options={"SKIP_SAVE"},
    )
    listen(_watcher)
    if not bpy.app.background:
        bpy.app.timers.register(_show_news, persistent=True)


def unregister() -> None:
    stop_listening(_watcher)
    if bpy.app.timers.is_registered(_show_news):
        bpy.app.timers.unregister(_show_news)
    _forget()
    del bpy.types.WindowManager.perfect_bvh_updates
    for group in reversed(CLASSES):
        bpy.utils.unregister_class(group)
