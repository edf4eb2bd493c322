"""What the last image of each scene lacks: a line for viewports, and rows for a panel's list.

Panels list the contents of a collection of Blender's, which must not be written while they are drawn, nor from a
render's thread: a timer on the main thread updates it. It belongs to the window manager, so that it does not count as
an edit of a scene.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field

import bpy

from ..events.changes import listen, stop_listening
from ..settings.preferences import redraw_properties
from ..sync.not_shown import NotShown, is_of_looks, summarize, without_looks

TIMER_SECONDS = 0.2

Rows = tuple[NotShown, ...]


@dataclass(slots=True)
class _OfScene:
    """image: of the last one that was rendered. views: of each viewport that was read since."""

    image: Rows = ()
    views: dict[weakref.ref[object], Rows] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        return _once(*self.image, *(row for rows in list(self.views.values()) for row in rows))


_told: dict[int, _OfScene] = {}  # by the scene's session uid
_listed: dict[int, Rows] | None = None  # as the collection has them; None if it may hold anything


class PERFECT_BVH_PG_not_shown(bpy.types.PropertyGroup):
    """A row of the list."""

    kind: bpy.props.StringProperty(name="Kind", description="The kind of data")
    text: bpy.props.StringProperty(name="Text", description="What is not shown, and what is shown instead")
    advice: bpy.props.StringProperty(name="Advice", description="What can be done about it")
    session_uid: bpy.props.IntProperty(name="Session UID", description="Blender's number of the data-block, 0 for none")
    scene_uid: bpy.props.IntProperty(name="Scene UID", description="Blender's number of the scene")


class PERFECT_BVH_PG_not_shown_list(bpy.types.PropertyGroup):
    """The rows of all scenes, and which one is chosen."""

    rows: bpy.props.CollectionProperty(
        name="Not Shown",
        description="What the last image lacks, or shows differently from Cycles",
        type=PERFECT_BVH_PG_not_shown,
        options={"SKIP_SAVE"},
    )
    active: bpy.props.IntProperty(name="Active", description="The selected row", options={"SKIP_SAVE"})


def tell(scene: bpy.types.Scene, rows: Rows, *, goes_on: bool = False) -> None:
    """Stores what an image of `scene`, as it was read last, lacks; from any thread.

    goes_on: whether it is another part of the last image, to whose rows it adds its own.
    """
    of_scene = _of(scene)
    of_scene.image = _once(*(of_scene.image if goes_on else ()), *rows)


def tell_of_view(scene: bpy.types.Scene, view: object, read: Rows, *, with_looks: bool) -> None:
    """Stores what a viewport lacks in addition to the last image; on the main thread.

    read: all that was found, for images, too. Rows of the image that are not among it were fixed since.
    view: the owner, while it exists. with_looks: whether the viewport shows materials, lights and the world.
    """
    of_scene, found = _of(scene), set(read)

    def holds(row: NotShown) -> bool:
        return row in found or not row.session_uid or (is_of_looks(row) and not with_looks)

    of_scene.image = tuple([row for row in of_scene.image if holds(row)])
    for gone in [reference for reference in of_scene.views if reference() is None]:
        del of_scene.views[gone]
    of_scene.views[weakref.ref(view)] = _in_viewports(read if with_looks else without_looks(read))


def told(scene: bpy.types.Scene) -> Rows:
    """Returns what the last image of `scene` lacks, and those of viewports."""
    of_scene = _told.get(scene.original.session_uid)
    return () if of_scene is None else of_scene.rows


def was_read(scene: bpy.types.Scene) -> bool:
    """Whether an image of `scene` was made."""
    return scene.original.session_uid in _told


def line_of(scene: bpy.types.Scene) -> str:
    """The same in one line, empty if nothing lacks."""
    return summarize(told(scene))


def line_in_viewports(scene: bpy.types.Scene) -> str:
    """Returns the same as a line over viewports."""
    return summarize(_in_viewports(told(scene)))


def _of(scene: bpy.types.Scene) -> _OfScene:
    return _told.setdefault(scene.original.session_uid, _OfScene())


def _once(*rows: NotShown) -> Rows:
    return tuple(dict.fromkeys(rows))


def _in_viewports(rows: Rows) -> Rows:
    """These show the points of scans by themselves."""
    return tuple([row for row in rows if row.kind != "scan"])


def list_rows() -> bool:
    """Update the collection; returns whether anything was new. On the main thread."""
    global _listed
    wanted = {uid: of_scene.rows for uid, of_scene in _told.copy().items()}
    if wanted == _listed:
        return False
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    listed.rows.clear()
    for scene_uid, rows in wanted.items():
        for row in rows:
            made = listed.rows.add()
            made.name, made.kind, made.text, made.advice = row.name, row.kind, row.text, row.what_to_do
            made.session_uid, made.scene_uid = row.session_uid, scene_uid
    listed.active = min(listed.active, max(len(listed.rows) - 1, 0))
    _listed = wanted
    return True


def _show_news() -> float:
    if list_rows():
        redraw_properties()
    return TIMER_SECONDS


class _FileWatcher:
    """Drops rows with their scene, or with its file."""

    def on_change(self, what: str) -> None:
        there = {scene.session_uid for scene in bpy.data.scenes}
        for uid in [uid for uid in list(_told) if uid not in there]:
            _told.pop(uid, None)

    def on_file_change(self) -> None:
        global _listed
        _told.clear()
        _listed = None


_watcher = _FileWatcher()
CLASSES = (PERFECT_BVH_PG_not_shown, PERFECT_BVH_PG_not_shown_list)


def register() -> None:
    global _listed
    _listed = None
    for group in CLASSES:
        bpy.utils.register_class(group)
    bpy.types.WindowManager.perfect_bvh_not_shown = bpy.props.PointerProperty(
        name="Not Shown",
        description="What images lack, or show differently",
        type=PERFECT_BVH_PG_not_shown_list,
        options={"SKIP_SAVE"},
    )
    listen(_watcher)
    if not bpy.app.background:
        bpy.app.timers.register(_show_news, persistent=True)


def unregister() -> None:
    stop_listening(_watcher)
    if bpy.app.timers.is_registered(_show_news):
        bpy.app.timers.unregister(_show_news)
    _told.clear()
    del bpy.types.WindowManager.perfect_bvh_not_shown
    for group in reversed(CLASSES):
        bpy.utils.unregister_class(group)
