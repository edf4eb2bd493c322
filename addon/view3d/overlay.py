"""The boxes of the trees, drawn over 3D viewports: the top level, and the tree of the active object.

The boxes are those of the cached sync, which is brought in step when something has changed and a viewport is drawn.
The lines of a tree are made once and kept until its boxes are others: moving an object only draws its lines elsewhere.
While trees are built, the last boxes are drawn in grey, not to be taken for those of the scene as it is. An animation
that plays waits for each frame's own.

What needs the native engine is imported where it is used: without it the add-on must still register, and say why.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ..live.pending_commit import PendingCommit
from ..settings.preferences import native_error
from ..settings.scene_settings import ENGINE_NAME
from .box_lines import BoxLines, box_lines

if TYPE_CHECKING:
    import gpu
    from perfect_bvh import Snapshot, TreeBoxes

    from ..live.scene_sync import SceneSync

# More can no longer be told apart, and every viewport that is drawn would wait for them.
MOST_BOXES = 100_000
# Of boxes that are about to be others: as RGBA.
GREY = (0.5, 0.5, 0.5, 0.4)
# Between two looks whether the trees are there.
REDRAW_SECONDS = 0.05


@dataclass(frozen=True, slots=True)
class Shown:
    """What is drawn of a tree. level: the one that was asked for, or the deepest that there is.

    count: boxes drawn; total: of those levels, more than count where not all are drawn. depth: of the whole tree.
    """

    level: int
    count: int
    total: int
    depth: int


class TreeLines:
    """The lines of one tree, made again only where its boxes or their colours are others."""

    def __init__(self) -> None:
        self.shown: Shown | None = None
        self._asked: tuple[Any, ...] = ()
        self._boxes: TreeBoxes | None = None
        self._lines: BoxLines | None = None
        self._batch: gpu.types.GPUBatch | None = None
        self._grey_batch: gpu.types.GPUBatch | None = None

    def follow(self, snapshot: Snapshot, mesh: int | None, settings: bpy.types.PropertyGroup) -> None:
        """Make the lines those of a tree (None: the top level) as a snapshot has it, if they are not."""
        choice = (settings.level, settings.use_all_to_level, settings.color_by)
        asked = (snapshot.scene_id, snapshot.generation, mesh, *choice)
        if asked == self._asked:
            return
        boxes, level = list_levels(snapshot, mesh, settings.level, settings.use_all_to_level)
        had_same_colors = self._asked[3:] == choice
        self._asked = asked
        if had_same_colors and self._boxes is not None and are_equal(boxes, self._boxes):
            return
        self._boxes = boxes
        self._lines = box_lines(boxes.head(MOST_BOXES), settings.color_by) if len(boxes) else None
        self.shown = Shown(level, min(len(boxes), MOST_BOXES), len(boxes), boxes.depth)
        self._batch = None if self._lines is None else _make_batch(self._lines)
        self._grey_batch = None

    def draw(self, matrix: Any = None, *, in_grey: bool = False) -> None:
        """Draw them in the 3D viewport that is being drawn. matrix: (4, 4) from the boxes' space to the world."""
        if self._batch is None:
            return
        batch = self._in_grey() if in_grey else self._batch
        import gpu
        from mathutils import Matrix

        with gpu.matrix.push_pop():
            if matrix is not None:
                gpu.matrix.multiply_matrix(Matrix(matrix.tolist()))
            batch.draw(gpu.shader.from_builtin("FLAT_COLOR"))

    def _in_grey(self) -> gpu.types.GPUBatch:
        if self._grey_batch is None:
            assert self._lines is not None
            self._grey_batch = _make_batch(replace(self._lines, colors=np.full_like(self._lines.colors, GREY)))
        return self._grey_batch


class SceneOverlay:
    """The overlay of one scene's view layer. message: why it cannot be shown, "" if all is well."""

    def __init__(self) -> None:
        self.message = ""
        self.top_level: TreeLines | None = None
        self.active: TreeLines | None = None
        self._is_stale = True
        self._trees = PendingCommit()
        self._matrix: Any = None

    def on_change(self, what: str) -> None:
        """Something of the scene may have changed."""
        self._is_stale = True

    def on_file_change(self) -> None:
        """All data is about to go, or has just come."""
        self._is_stale, self._trees = True, PendingCommit()
        self.top_level = self.active = None

    def draw(self, context: bpy.types.Context, settings: bpy.types.PropertyGroup) -> None:
        """Bring the trees in step and draw what the settings ask for."""
        import perfect_bvh

        try:
            is_there = self._follow(context, settings)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self.message = str(problem) or type(problem).__name__
            return
        self.message = self._trees.state or ""
        if not is_there:
            _redraw_soon()
        top_level = self.top_level if settings.show_top_level else None
        active = self.active if settings.show_active else None
        if top_level is None and active is None:
            return
        with _drawing_state(settings.use_in_front):
            if top_level is not None:
                top_level.draw(in_grey=not is_there)
            if active is not None:
                active.draw(self._matrix, in_grey=not is_there)

    def _follow(self, context: bpy.types.Context, settings: bpy.types.PropertyGroup) -> bool:
        """Whether there are trees to draw."""
        from ..events.changes import watch_again

        watch_again()
        if self._is_stale or self._trees.sync is None:
            self._is_stale = False
            self._begin(context)
        if not self._trees.are_there(lambda: self._begin(context)):
            return False
        sync = self._trees.sync
        assert sync is not None
        snapshot = sync.scene.snapshot()
        self.top_level = (self.top_level or TreeLines()) if settings.show_top_level else None
        if self.top_level is not None:
            self.top_level.follow(snapshot, None, settings)
        found = find_object(sync, context.active_object) if settings.show_active else None
        self.active = (self.active or TreeLines()) if found is not None else None
        if self.active is not None:
            mesh, self._matrix = found
            self.active.follow(snapshot, mesh, settings)
        return True

    def _begin(self, context: bpy.types.Context) -> None:
        from ..live.sync_cache import sync_of

        depsgraph = context.evaluated_depsgraph_get()
        sync = sync_of(depsgraph)
        is_playing = context.screen.is_animation_playing  # the next frame would stop what this one has begun
        self._trees.begin(sync, lambda: sync.begin_update(depsgraph), to_the_end=is_playing)


def list_levels(snapshot: Snapshot, mesh: int | None, level: int, use_all: bool) -> tuple[TreeBoxes, int]:
    """The boxes of a level, or of all to it, and which it is: the tree's deepest if it is not so deep."""
    boxes = snapshot.tree_boxes(mesh, first_level=0 if use_all else level, last_level=level)
    if level <= boxes.depth:
        return boxes, level
    return list_levels(snapshot, mesh, boxes.depth, use_all)


def are_equal(one: TreeBoxes, other: TreeBoxes) -> bool:
    """Whether two lists hold the same boxes, levels, costs and overlaps."""
    return one.depth == other.depth and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ("boxes", "levels", "costs", "overlaps")
    )


def find_object(sync: SceneSync, obj: bpy.types.Object | None) -> tuple[int, Any] | None:
    """The engine's mesh of an object and the (4, 4) matrix that places it; None if the scene shows no such object.

    Of an object that is shown by instances alone, the first.
    """
    if obj is None:
        return None
    record = sync.record
    rows = [row for row, shown in enumerate(record.objects) if shown.session_uid == obj.session_uid]
    places = np.flatnonzero(np.isin(record.instances.object_indices, rows))
    if not len(places):
        return None
    own = places[record.instances.parent_indices[places] < 0]
    place = int(own[0] if len(own) else places[0])
    matrix = np.eye(4)
    matrix[:3] = record.instances.transforms[place]
    return int(sync.mesh_ids[record.instances.mesh_indices[place]]), matrix


# Blender's side ------------------------------------------------------------------------------------------------------

_overlays: dict[tuple[int, str], SceneOverlay] = {}
_handle: Any = None


def overlay_of(context: bpy.types.Context) -> SceneOverlay | None:
    """What is drawn of the context's scene, for the panel to tell of it; None if nothing is."""
    return _overlays.get((context.scene.session_uid, context.view_layer.name))


def _draw() -> None:
    context = bpy.context
    settings = context.scene.perfect_bvh.overlay
    key = (context.scene.session_uid, context.view_layer.name)
    is_wanted = settings.show_top_level or settings.show_active
    if not is_wanted or context.engine != ENGINE_NAME or native_error() is not None:
        _drop(key)
        return
    if not context.space_data.overlay.show_overlays:
        return
    if key not in _overlays:
        from ..events.changes import listen

        _overlays[key] = SceneOverlay()
        listen(_overlays[key])
    _overlays[key].draw(context, settings)


def _redraw_soon() -> None:
    """An area that is being drawn cannot be redrawn at once."""
    if not bpy.app.timers.is_registered(_redraw):
        bpy.app.timers.register(_redraw, first_interval=REDRAW_SECONDS)


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _drop(key: tuple[int, str]) -> None:
    overlay = _overlays.pop(key, None)
    if overlay is not None:
        from ..events.changes import stop_listening

        stop_listening(overlay)


def _make_batch(lines: BoxLines) -> gpu.types.GPUBatch:
    import gpu

    layout = gpu.types.GPUVertFormat()
    position = layout.attr_add(id="pos", comp_type="F32", len=3, fetch_mode="FLOAT")
    color = layout.attr_add(id="color", comp_type="F32", len=4, fetch_mode="FLOAT")
    vertices = gpu.types.GPUVertBuf(layout, len(lines.positions))
    vertices.attr_fill(position, lines.positions)
    vertices.attr_fill(color, lines.colors)
    return gpu.types.GPUBatch(type="LINES", buf=vertices, elem=gpu.types.GPUIndexBuf(type="LINES", seq=lines.lines))


@contextmanager
def _drawing_state(is_in_front: bool) -> Iterator[None]:
    import gpu

    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE" if is_in_front else "LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    try:
        yield
    finally:
        gpu.state.depth_mask_set(True)
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")


def register() -> None:
    """Draw over every 3D viewport from now on, where the scene asks for it."""
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW")


def unregister() -> None:
    """Draw no more, and forget what was drawn."""
    global _handle
    bpy.types.SpaceView3D.draw_handler_remove(_handle, "WINDOW")
    _handle = None
    if bpy.app.timers.is_registered(_redraw):
        bpy.app.timers.unregister(_redraw)
    for key in list(_overlays):
        _drop(key)
