"""The boxes of one scene's trees in a viewport: the drawn boxes, their description, and the one under the mouse.

The boxes are those of the cached sync. It is updated when something has changed and a viewport is drawn,
for any render engine of the scene. The lines of a tree are made once and kept until its boxes change: moving an
object only draws its lines elsewhere. While trees are built, the last boxes are drawn in grey, to mark them as
outdated. An animation that plays waits for each frame's own.

The box under the mouse is looked up when the mouse moves, or when boxes change; not while only the view
moves, as each redraw would have to test all boxes again.

Modules that need the native engine are imported where they are used: without it the add-on must still register.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...live.pending_commit import PendingCommit
from ...settings.preferences import redraw_viewports
from ...statistics.words import reason_of
from .. import pointer
from ..drawing import ramp_colors
from ..legend import Section
from ..pointer import Pointed, view_of
from .hovered_box import HoveredBox, HoveredPicture, box_under
from .tree_lines import TreeLines, describe

if TYPE_CHECKING:
    from ...live.scene_sync import SceneSync

# Between two looks whether the trees are there.
REDRAW_SECONDS = 0.05
BAR_STOPS = 9


class SceneOverlay:
    """The overlay of a viewport that shows one scene's view layer. message: why it cannot be shown, "" if all is well.

    hovered: the box under the mouse, None if there is none.
    """

    def __init__(self) -> None:
        self.message = ""
        self.top_level: TreeLines | None = None
        self.active: TreeLines | None = None
        self.hovered: HoveredBox | None = None
        self._pointed: Pointed | None = None
        self._looked_at: tuple[Any, ...] = ()
        self._picture = HoveredPicture()
        self._is_stale = True
        self._trees = PendingCommit()
        self._asked: tuple[int, ...] = ()
        self._found: tuple[int, Any] | None = None  # the active object's mesh and where it is placed
        self._name = ""

    def on_change(self, what: str) -> None:
        """Something of the scene may have changed."""
        self._is_stale = True

    def on_file_change(self) -> None:
        """Drops references to data, which will be removed, or has just been loaded."""
        self._is_stale, self._trees = True, PendingCommit()
        self.top_level = self.active = self.hovered = self._pointed = self._found = None
        self._asked = self._looked_at = ()

    def draw(self, context: bpy.types.Context, settings: bpy.types.PropertyGroup) -> None:
        """Update the trees and draw the boxes that the settings select."""
        import perfect_bvh

        try:
            is_there = self._follow(context, settings)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self.message = reason_of(problem)
            return
        self.message = self._trees.state or ""
        if not is_there:
            redraw_soon()
        top_level = self.top_level if settings.show_top_level else None
        active = self.active if settings.show_active else None
        if top_level is None and active is None:
            return
        with _drawing_state(settings.use_in_front):
            if top_level is not None:
                top_level.draw(in_grey=not is_there)
            if active is not None:
                active.draw(self._matrix, in_grey=not is_there)
        if is_there and self._is_hovered(context):
            assert self.hovered is not None
            assert self._trees.sync is not None
            with _drawing_state(is_in_front=True):
                self._picture.draw(self.hovered, self._trees.sync)

    @property
    def _matrix(self) -> Any:
        return None if self._found is None else self._found[1]

    def _follow(self, context: bpy.types.Context, settings: bpy.types.PropertyGroup) -> bool:
        """Whether there are trees to draw."""
        from ...events.changes import watch_again

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
        found = self._find_active(sync, context.active_object) if settings.show_active else None
        self.active = (self.active or TreeLines()) if found is not None else None
        if self.active is not None and found is not None:
            self.active.follow(snapshot, found[0], settings)
        return True

    def _find_active(self, sync: SceneSync, obj: bpy.types.Object | None) -> tuple[int, Any] | None:
        """Finds the active object by `find_object`, which goes through all instances, only if the answer may change."""
        asked = (sync.scene.scene_id, sync.revision, 0 if obj is None else obj.session_uid)
        if asked != self._asked:
            self._asked, self._found = asked, find_object(sync, obj)
        self._name = "" if obj is None else obj.name
        return self._found

    def _begin(self, context: bpy.types.Context) -> None:
        from ...live.sync_cache import sync_of

        depsgraph = context.evaluated_depsgraph_get()
        sync = sync_of(depsgraph)
        is_playing = context.screen.is_animation_playing  # the next frame would stop what this one has begun
        self._trees.begin(sync, lambda: sync.begin_update(depsgraph), to_the_end=is_playing)

    # The box under the mouse -----------------------------------------------------------------------------------------

    def point(self, context: bpy.types.Context, place: tuple[int, int] | None) -> None:
        """The mouse is at a place in the context's region, or nowhere: have drawn what changes by that."""
        before, last = self.hovered, self._pointed
        self._pointed = None if place is None else Pointed.of(context, place)
        self._look(context)
        if before is None and self.hovered is None:
            return
        if place is None or (last is not None and last.region != context.region.as_pointer()):
            redraw_viewports()  # where it was it is no longer
        else:
            context.region.tag_redraw()

    def _is_hovered(self, context: bpy.types.Context) -> bool:
        """Whether there is a box under the mouse to draw in the context's region."""
        pointed = self._pointed
        if pointed is None or pointed.region != context.region.as_pointer():
            return False
        if pointed.view != view_of(context):
            return False
        self._look(context)
        return self.hovered is not None

    def _look(self, context: bpy.types.Context) -> None:
        """Find the box under the mouse, if that or the boxes are others than when it was looked for last."""
        trees: list[tuple[TreeLines, int | None, Any]] = []
        if self.active is not None and self._found is not None:
            trees.append((self.active, *self._found))  # it is within the boxes of the top level
        if self.top_level is not None:
            trees.append((self.top_level, None, None))
        numbers = tuple((id(tree), tree.number) for tree, _, _ in trees)
        looked_at = (self._pointed, numbers, None if self._matrix is None else self._matrix.tobytes())
        if looked_at == self._looked_at:
            return
        self._looked_at = looked_at
        self.hovered = None if self._pointed is None else box_under(context, self._pointed.place, trees)

    # Description -----------------------------------------------------------------------------------------------------

    def sections(self, settings: bpy.types.PropertyGroup) -> list[Section]:
        """The parts of the legend."""
        sections = []
        for name, tree in (("Top Level", self.top_level), (self._name, self.active)):
            if tree is not None and tree.shown is not None:
                sections.append(section_of(name, tree))
        if settings.show_active and self.active is None and not self.message:
            text = "The active object has nothing that rays can hit" if self._name else "No active object"
            sections.append(Section((text,)))
        if self.message:
            sections.append(Section((self.message,)))
        return sections

    def tip(self, context: bpy.types.Context) -> tuple[tuple[int, int], list[str]] | None:
        """Return the mouse's position in the region that is being drawn, and the tip there."""
        if self.message or not self._is_hovered(context):
            return None
        assert self.hovered is not None
        assert self._trees.sync is not None
        assert self._pointed is not None
        return self._pointed.place, self.hovered.lines(self._trees.sync)


def section_of(name: str, tree: TreeLines) -> Section:
    """Return the part of a legend that describes a tree."""
    shown, scale = tree.shown, tree.scale
    assert shown is not None
    assert scale is not None
    places = [place for place, _ in scale.labels] if scale.levels else np.linspace(0.0, 1.0, BAR_STOPS)
    levels = tree.levels if scale.levels else frozenset()
    colors = tuple(tuple(color[:3]) for color in ramp_colors(np.array(places)).tolist())
    return Section((name, describe(shown)), scale if shown.total else None, colors, levels)


def find_object(sync: SceneSync, obj: bpy.types.Object | None) -> tuple[int, Any] | None:
    """The engine's mesh of an object and the (4, 4) matrix that places it; None if the scene shows no such object.

    Of an object that is shown by instances alone, the first.
    """
    if obj is None:
        return None
    record = sync.record
    found = pointer.find_object(record, obj.session_uid)
    if found is None:
        return None
    return int(sync.mesh_ids[record.instances.mesh_indices[found.instance]]), found.matrix


def redraw_soon() -> None:
    """An area that is being drawn cannot be redrawn at once."""
    if not bpy.app.timers.is_registered(redraw_viewports):
        bpy.app.timers.register(redraw_viewports, first_interval=REDRAW_SECONDS)


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
