"""A ray's walk over 3D viewports: the shown step, and its picture.

The ray and its boxes are drawn in every viewport of the scene, over a veil, so that it can be seen from the side, too.
Their meaning and cost are shown in the viewport in which the ray was chosen. When the scene has changed, a
line there says so instead. The walk ends with an undo or another file.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...events.changes import watch_again
from ...live.pending_commit import PendingCommit
from ...sync.records import VISIBLE_TO_CAMERA
from .. import drawing
from ..compare import compare_view
from ..legend import DrawHandler, OneShown
from ..rendered.redraws import filter_of
from ..rendered.screen import camera_of
from .walk_legend import draw_legend, rows_of
from .walk_picture import CHANGED, HIT, RAY, Lines, Picture, SceneState, ShownWalk, WalkedRay
from .walk_steps import PixelRay, WalkWords, pixel_ray, steps_of

if TYPE_CHECKING:
    from ...live.scene_sync import SceneSync
    from ...sync.records import MeshKind


VEIL = (0.02, 0.02, 0.03)
# Over viewports that Blender shades itself; pictures of light are brighter, and blended as light is.
VEIL_OPACITY, LIT_VEIL_OPACITY = 0.62, 0.85
RING = 7.0  # radius, in points
PLAY_SECONDS = 0.35  # a step, while it plays
ENDING_CHANGES = frozenset({"a step was undone", "a step was redone"})


class _Tool(OneShown[ShownWalk]):
    """Draws while a walk is shown; ends it where a step is undone, too."""

    def show(self, what: ShownWalk) -> None:
        """Shows a walk from its first step."""
        super().show(what)
        for handler in _handlers:
            handler.add()

    def forget(self) -> None:
        for handler in _handlers:
            handler.remove()

    def on_change(self, what: str) -> None:
        if what in ENDING_CHANGES:
            self.hide()


_tool = _Tool()
show, hide = _tool.show, _tool.hide


def shown() -> ShownWalk | None:
    """Return the shown walk, in any viewports; None if there is none."""
    return _tool.found


def shown_in(context: bpy.types.Context) -> ShownWalk | None:
    """Return the context's viewport's walk; None if it is outdated, of another scene, or replaced by two trees."""
    found = _tool.found
    return None if found is None or not _is_of(context, found) or found.is_old(context.scene) else found


def _is_of(context: bpy.types.Context, found: ShownWalk) -> bool:
    return context.scene.session_uid == found.read.scene_uid and compare_view.shown_in(context) is None


def tells(context: bpy.types.Context, found: ShownWalk) -> bool:
    """Whether the region that is being drawn describes the step: only one does, for any number of views."""
    if context.space_data.as_pointer() != found.space:
        return False
    views = [view.as_pointer() for view in context.space_data.region_quadviews]
    if not views:
        return True
    return context.region_data.as_pointer() == (found.view if found.view in views else views[-1])


# Drawing -------------------------------------------------------------------------------------------------------------


def _draw_in_space() -> None:
    if _tool.found is None:
        return
    watch_again()
    found = shown_in(bpy.context)
    if found is None:
        return
    with drawing.blended():
        is_lit = bpy.context.space_data.shading.type in {"MATERIAL", "RENDERED"}
        _draw_veil((*VEIL, LIT_VEIL_OPACITY if is_lit else VEIL_OPACITY))
        _draw_triangles(found.picture)
        for lines in found.picture.lines:
            _draw_lines(lines)


def _draw_in_pixels() -> None:
    context, found = bpy.context, _tool.found
    if found is None or not _is_of(context, found):
        return
    if found.is_old(context.scene):
        if tells(context, found):
            draw_legend(context, CHANGED, ())
        return
    _draw_points(context, found.picture)
    if tells(context, found):
        draw_legend(context, found.heading, rows_of(found.counters, found.steps[-1].counters, found.words.tested()))


def _draw_veil(color: tuple[float, ...]) -> None:
    """Over the scene and below the ray."""
    import gpu
    from mathutils import Matrix

    corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    gpu.state.depth_test_set("NONE")
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(Matrix.Identity(4))
        gpu.matrix.load_projection_matrix(Matrix.Identity(4))
        drawing.draw_shape("UNIFORM_COLOR", "TRI_FAN", {"pos": corners}, color)


def _draw_triangles(picture: Picture) -> None:
    if len(picture.triangles):
        content = {"pos": picture.triangles, "color": picture.triangle_colors}
        drawing.draw_shape("SMOOTH_COLOR", "TRIS", content)


def _draw_lines(lines: Lines) -> None:
    content = {"pos": lines.positions, "color": lines.colors}
    drawing.draw_shape("POLYLINE_SMOOTH_COLOR", "LINES", content, width=lines.width)


def _draw_points(context: bpy.types.Context, picture: Picture) -> None:
    """Draw a dot at the nearest hit so far, and a ring at the ray's current position."""
    if picture.hit is not None and (place := _place_of(context, picture.hit)) is not None:
        for points, color in ((5.0, (0.0, 0.0, 0.0)), (3.5, HIT)):
            radius = drawing.pixels(points)
            drawing.draw_rect(place[0] - radius, place[1] - radius, 2 * radius, 2 * radius, color, radius)
    place = _place_of(context, picture.tip)
    if place is not None:
        radius = drawing.pixels(RING)
        angles = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
        ring = [(place[0] + radius * np.cos(angle), place[1] + radius * np.sin(angle)) for angle in angles]
        drawing.draw_lines_2d(ring, RAY, 1.5, is_closed=True)


def _place_of(context: bpy.types.Context, point: Any) -> tuple[float, float] | None:
    """Returns the position in the region that is being drawn; None behind the eye."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d
    from mathutils import Vector

    place = location_3d_to_region_2d(context.region, context.region_data, Vector(point))
    return None if place is None or not np.isfinite(place).all() else (place.x, place.y)


_handlers = DrawHandler(_draw_in_space, "POST_VIEW"), DrawHandler(_draw_in_pixels, "POST_PIXEL")


def register() -> None:
    """Nothing is shown until somebody walks a ray."""


def unregister() -> None:
    hide()


# Walk reading --------------------------------------------------------------------------------------------------------
# From a place in a region to the walk of the ray through it: the scene is read, its trees are waited for.


@dataclass(frozen=True, slots=True)
class Reading:
    """A scene that was read for the sake of a ray.

    read: the scene then. address, view: of the viewport that it was chosen in, and of its part. space: the viewport
    whose filters count, None if it has none.
    """

    ray: PixelRay
    read: SceneState
    address: int
    view: int
    space: bpy.types.SpaceView3D | None
    sync: SceneSync
    trees: PendingCommit

    def begin(self, context: bpy.types.Context) -> None:
        """Read the current scene. Raises the engine's errors."""
        depsgraph = context.evaluated_depsgraph_get()
        self.trees.begin(self.sync, lambda: self.sync.begin_update(depsgraph, space=self.space))

    def walk(self, context: bpy.types.Context) -> ShownWalk | None:
        """Return the walk of the ray; None while trees are being built.

        Raises ValueError if the scene has changed since it was read, and the engine's errors.
        """
        self._check(context)
        if not self.trees.are_there(lambda: self.begin(context)):
            return None
        self._check(context)  # reading it again may have found out
        scene, ray = context.scene, self.ray
        snapshot = self.sync.scene.snapshot()
        walk = snapshot.walk_ray(ray.origin, ray.direction, t_min=ray.t_min, t_max=ray.t_max, mask=VISIBLE_TO_CAMERA)
        ids = sorted({int(ident) for ident in walk.instance_ids} - {-1})
        names = dict(zip(ids, map(str, self.sync.describe(ids).names), strict=True)) if ids else {}
        length = (lambda t: written_length(scene, t)) if ray.has_eye else None
        walked = WalkedRay.of(walk, ray.origin, ray.direction, ray.t_min)
        kinds = {
            int(instance): self._kind_of(int(mesh))
            for instance, mesh in zip(walk.instance_ids, walk.mesh_ids, strict=True)
            if instance >= 0 and mesh >= 0
        }
        words = WalkWords(walk, names, length, kinds)
        return ShownWalk(walked, words, steps_of(words), self.read, self.address, self.view)

    def _kind_of(self, mesh_id: int) -> MeshKind:
        (row,) = np.flatnonzero(self.sync.mesh_ids == mesh_id)
        return self.sync.record.meshes[int(row)].kind

    def _check(self, context: bpy.types.Context) -> None:
        if SceneState.of(context.scene) != self.read:
            raise ValueError(CHANGED)

    @property
    def state(self) -> str:
        """How far the trees are, as words for the user."""
        return self.trees.state or "Building BVHs"

    def stop(self) -> None:
        """Stop waiting for the trees; other code that needs them has them built."""
        self.sync.ask_to_stop_building()


def read_pixel(context: bpy.types.Context, area: bpy.types.Area, region: bpy.types.Region, x: int, y: int) -> Reading:
    """Read a pixel; x, y: of the window. Raises ValueError where nothing is visible, and the engine's errors."""
    from ...live.scene_sync import SceneSync
    from ...live.sync_cache import sync_of

    depsgraph, space = context.evaluated_depsgraph_get(), area.spaces.active
    camera, _ = camera_of(region.data, space, depsgraph)
    place = (x + 0.5 - region.x) / region.width, (y + 0.5 - region.y) / region.height
    ray = None if camera is None else pixel_ray(camera, *place)
    if ray is None:
        raise ValueError("No ray is cast through this pixel")
    is_filtered = any(filter_of(space))
    sync = SceneSync(watch=False) if is_filtered else sync_of(depsgraph)
    address, view = space.as_pointer(), region.data.as_pointer()
    read = SceneState.of(context.scene)
    reading = Reading(ray, read, address, view, space if is_filtered else None, sync, PendingCommit())
    reading.begin(context)
    return reading


def written_length(scene: bpy.types.Scene, length: float) -> str:
    """A distance in the scene's units."""
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{length:.4g}"
    return bpy.utils.units.to_string(units.system, "LENGTH", length * units.scale_length, precision=4)
