"""From a place in a region to the walk of the ray through it: the scene is read, its trees are waited for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...live.pending_commit import PendingCommit
from ...sync.records import VISIBLE_TO_CAMERA
from ..rendered.awaited_view import filter_of
from ..rendered.region_camera import camera_of
from .pixel_ray import PixelRay, pixel_ray
from .shown_walk import CHANGED, SceneState, ShownWalk
from .walk_picture import WalkedRay
from .walk_steps import steps_of
from .walk_words import WalkWords

if TYPE_CHECKING:
    from ...live.scene_sync import SceneSync
    from ...sync.records import MeshKind


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
        """Have the scene read as it is now. Raises what the engine raises."""
        depsgraph = context.evaluated_depsgraph_get()
        self.trees.begin(self.sync, lambda: self.sync.begin_update(depsgraph, space=self.space))

    def walk(self, context: bpy.types.Context) -> ShownWalk | None:
        """What the ray does; None as long as trees are being built.

        Raises ValueError where the scene has changed since it was read, and what the engine raises.
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
        return self.trees.state or "Building trees"

    def stop(self) -> None:
        """Its trees are not waited for any more; whoever else needs them has them built."""
        self.sync.ask_to_stop_building()


def read_pixel(context: bpy.types.Context, area: bpy.types.Area, region: bpy.types.Region, x: int, y: int) -> Reading:
    """x, y: pixels of the window. Raises ValueError where nothing can be seen, and what the engine raises."""
    from ...live.scene_sync import SceneSync
    from ...live.sync_cache import sync_of

    depsgraph, space = context.evaluated_depsgraph_get(), area.spaces.active
    camera, _ = camera_of(region.data, space, depsgraph)
    place = (x + 0.5 - region.x) / region.width, (y + 0.5 - region.y) / region.height
    ray = None if camera is None else pixel_ray(camera, *place)
    if ray is None:
        raise ValueError("Nothing is seen through this pixel")
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
