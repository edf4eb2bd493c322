"""Reports the mouse's position over 3D viewports to listeners, without blocking anything.

Blender asks each gizmo, at each move of the mouse over a region, whether the mouse is over it. Ours answers that it is
not, and remembers where it was asked. So no operator runs, clicks and keys go where they always go, each region of each
window is covered, and gizmos that Blender recreates after an undo or for another file are recreated here, too.

Gizmos are not asked when the mouse leaves a region. So while it is in one with listeners, a timer checks its position.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import bpy
import numpy as np
import numpy.typing as npt

from ..sync.records import MeshRecord, SceneRecord

if TYPE_CHECKING:
    from perfect_bvh import Snapshot


LOOKING_SECONDS = 0.2


class PointerListener(Protocol):
    """Who wants to know."""

    def wants_pointer(self, context: bpy.types.Context) -> bool:
        """Whether it does, in the 3D viewport of the context."""

    def on_pointer(self, context: bpy.types.Context, place: tuple[int, int]) -> None:
        """The mouse has moved. place: in pixels of the context's region."""

    def on_pointer_left(self) -> None:
        """The mouse is no longer at the last reported position."""


@dataclass(frozen=True, slots=True)
class Pointed:
    """The mouse's position. region: its address. place: in its pixels. view: the region's view at that time."""

    region: int
    place: tuple[int, int]
    view: bytes

    @staticmethod
    def of(context: bpy.types.Context, place: tuple[int, int]) -> Pointed:
        return Pointed(context.region.as_pointer(), place, view_of(context))


def view_of(context: bpy.types.Context) -> bytes:
    """Equal as long as the view is."""
    return np.array(context.region_data.perspective_matrix, np.float32).tobytes()


listeners: list[PointerListener] = []
_region: tuple[int, int] | None = None  # the addresses of the window and of the region that the mouse was in last
_found: tuple[int, int] | None = None  # the window and where the mouse is in it, as the operator has seen it


def _note(context: bpy.types.Context, place: tuple[int, int]) -> None:
    global _region
    told = False
    for listener in listeners:
        if listener.wants_pointer(context):
            listener.on_pointer(context, place)
            told = True
    if not told:
        return
    _region = context.window.as_pointer(), context.region.as_pointer()
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=LOOKING_SECONDS)


def _look() -> float | None:
    """Whether the mouse is still in its region."""
    global _region
    if _region is not None and _is_inside(*_region):
        return LOOKING_SECONDS
    _region = None
    for listener in listeners:
        listener.on_pointer_left()
    return None


def _is_inside(window_pointer: int, region_pointer: int) -> bool:
    for window in bpy.context.window_manager.windows:
        if window.as_pointer() != window_pointer:
            continue
        for area in window.screen.areas:
            for region in area.regions:
                if region.as_pointer() == region_pointer:
                    return _is_over(region, area, _mouse_in(window))
    return False


def _mouse_in(window: bpy.types.Window) -> tuple[int, int]:
    global _found
    with bpy.context.temp_override(window=window):
        bpy.ops.perfect_bvh.find_pointer("INVOKE_DEFAULT")
    assert _found is not None
    return _found


def _is_over(region: bpy.types.Region, area: bpy.types.Area, place: tuple[int, int]) -> bool:
    """Whether a place in a window is in a region, and in none that lies over it."""
    if not _holds(region, place):
        return False
    others = (other for other in area.regions if other.type != "WINDOW" and min(other.width, other.height) > 1)
    return not any(_holds(other, place) for other in others if other.type not in {"HEADER", "TOOL_HEADER", "HUD"})


def _holds(region: bpy.types.Region, place: tuple[int, int]) -> bool:
    return 0 <= place[0] - region.x < region.width and 0 <= place[1] - region.y < region.height


class PERFECT_BVH_OT_find_pointer(bpy.types.Operator):
    """Looks where the mouse is in a window."""

    bl_idname = "perfect_bvh.find_pointer"
    bl_label = "Find Pointer"
    bl_description = "Find the mouse's position in a window"
    bl_options: ClassVar = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        global _found
        _found = event.mouse_x, event.mouse_y
        return {"CANCELLED"}


class PERFECT_BVH_GT_pointer(bpy.types.Gizmo):
    """Never under the mouse, and never seen."""

    bl_idname = "PERFECT_BVH_GT_pointer"

    def draw(self, context: bpy.types.Context) -> None:
        """Nothing."""

    def test_select(self, context: bpy.types.Context, location: Any) -> int:
        _note(context, (int(location[0]), int(location[1])))
        return -1


class PERFECT_BVH_GGT_pointer(bpy.types.GizmoGroup):
    """There where somebody listens."""

    bl_idname = "PERFECT_BVH_GGT_pointer"
    bl_label = "Tree Pointer"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options: ClassVar = {"PERSISTENT", "SCALE"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return any(listener.wants_pointer(context) for listener in listeners)

    def setup(self, context: bpy.types.Context) -> None:
        self.gizmos.new(PERFECT_BVH_GT_pointer.bl_idname)


CLASSES: tuple[Callable[..., Any], ...] = (
    PERFECT_BVH_OT_find_pointer,
    PERFECT_BVH_GT_pointer,
    PERFECT_BVH_GGT_pointer,
)


def register() -> None:
    for kind in CLASSES:
        bpy.utils.register_class(kind)


def unregister() -> None:
    global _region
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
    _region = None
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)


# One object ----------------------------------------------------------------------------------------------------------
# One object of a scene's record: its mesh and its place, without anything of Blender.


@dataclass(frozen=True, slots=True)
class OneObject:
    """An object, and where it is.

    mesh: as rays hit it. matrix: (4, 4) from its space to the world; of an object that only instances show, the first
    of these. instance: its row of the record.
    """

    name: str
    session_uid: int
    mesh: MeshRecord
    matrix: npt.NDArray[np.float64]
    instance: int


def find_object(record: SceneRecord, session_uid: int) -> OneObject | None:
    """Returns an object; None if rays hit no such object. A plain object is preferred to its instances."""
    rows = [row for row, shown in enumerate(record.objects) if shown.session_uid == session_uid]
    places = np.flatnonzero(np.isin(record.instances.object_indices, rows))
    if not len(places):
        return None
    own = places[record.instances.parent_indices[places] < 0]
    place = int(own[0] if len(own) else places[0])
    matrix = np.eye(4)
    matrix[:3] = record.instances.transforms[place]
    mesh = record.meshes[record.instances.mesh_indices[place]]
    name = record.objects[record.instances.object_indices[place]].name
    return OneObject(name, session_uid, mesh, matrix, place)


# Sample rays ---------------------------------------------------------------------------------------------------------
# A few thousand rays for trying trees, always the same ones for the same box. Does not depend on Blender.
#
# Primary rays are like a camera's: from one point, side by side. Diffuse ones are like light's: from the hits of
# primary rays into any direction, weighted by the cosine.


Float64Array = npt.NDArray[np.float64]
Rays = tuple[Float64Array, Float64Array]

SIDE = 64  # rays in a row, and rows
TOWARDS = np.array([0.53, 0.75, -0.39])  # from above, aslant to all axes


@dataclass(frozen=True, slots=True)
class RayCost:
    """The average cost of a ray. nodes: of the trees that rays are traced through."""

    nodes: float
    triangles: float


def primary_rays(lower: npt.ArrayLike, upper: npt.ArrayLike) -> Rays:
    """Origins and directions (R, 3), from outside of a box at all of it. lower, upper: (3,)."""
    low, high = np.asarray(lower, np.float64), np.asarray(upper, np.float64)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-12)
    towards = TOWARDS / np.linalg.norm(TOWARDS)
    across = np.cross(towards, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    up = np.cross(across, towards)
    half = (high - low) / 2
    width, height = np.abs(across) @ half, np.abs(up) @ half
    steps = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    x, y = (values.reshape(-1, 1) for values in np.meshgrid(steps, steps))
    targets = middle + x * (width * across) + y * (height * up)
    origins = np.broadcast_to(middle - 4.0 * radius * towards, targets.shape)
    return np.ascontiguousarray(origins), targets - origins


def diffuse_rays(snapshot: Snapshot, primary: Rays) -> Rays | None:
    """Makes diffuse rays from the hits of primary rays; None without hits. One snapshot makes the rays for all."""
    hits = snapshot.cast_rays(*primary, fields=("t_hit", "positions", "geometric_normals"))
    rows = np.flatnonzero(np.isfinite(hits.t_hit))
    if not len(rows):
        return None
    rows = np.resize(rows, len(primary[0]))
    normals = hits.geometric_normals[rows].astype(np.float64)
    normals *= np.where(np.einsum("ij,ij->i", normals, primary[1][rows]) > 0.0, -1.0, 1.0)[:, None]
    starts = hits.positions[rows].astype(np.float64)
    reach = float(np.abs(starts).max() + np.ptp(starts))
    around = np.random.default_rng(5).normal(size=normals.shape)
    bounced = around / np.linalg.norm(around, axis=-1, keepdims=True) + 1.0001 * normals
    return starts + 1e-5 * reach * normals, bounced


def cost_of(snapshot: Snapshot, rays: Rays) -> RayCost:
    """Returns the cost of rays as the engine counts it."""
    hits = snapshot.cast_rays(*rays, fields=("t_hit", "nodes_visited", "primitives_tested"))
    return RayCost(float(hits.nodes_visited.mean()), float(hits.primitives_tested.mean()))
