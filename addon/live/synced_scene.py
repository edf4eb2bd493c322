"""The result of a sync: scene, camera, looks, and the lookup from ids back to Blender."""

from __future__ import annotations

import weakref
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh import Appearance, Camera, Scene

from ..events import changes
from ..events.asking import evaluate_pending, is_asking, may_ask
from ..sync.appearance import as_camera, make_appearance
from ..sync.lookup import HitIds, InstanceDescription, SceneLookup
from ..sync.records import Int32Array, SceneRecord
from ..sync.state import SceneState


class SyncedScene:
    """The result of the last update of a `SceneSync`, which is one."""

    _state: SceneState
    _lookup: SceneLookup | None
    _appearance: Appearance | None
    _tree_byte_count: int

    @property
    def scene(self) -> Scene:
        """The engine's scene, for queries. Do not edit it."""
        scene = self._state.scene
        assert isinstance(scene, Scene)
        return scene

    @property
    def record(self) -> SceneRecord:
        """The record of the last update. Raises `perfect_bvh.StaleSceneError` if there is none."""
        record = self._state.record
        if record is None:
            raise perfect_bvh.StaleSceneError("nothing was synced yet, or the last update failed: call update()")
        return record

    @property
    def camera(self) -> Camera | None:
        """The camera of the last update; None if the scene has none that can be rendered (see `warnings`)."""
        camera = self.record.camera
        return None if camera is None else as_camera(camera)

    @property
    def camera_motion(self) -> tuple[Camera, ...]:
        """The camera at moments at equal intervals of the last update's shutter, from time 0 to 1.

        Empty without a shutter, if it does not move, or its motion blur is off.
        """
        return tuple([as_camera(camera) for camera in self.record.motion.camera])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of a render in pixels."""
        return self.record.size

    @property
    def byte_count(self) -> int:
        """Bytes of the trees with their geometry, and of the images, all of which are kept for the next update."""
        record = self._state.record
        return self._tree_byte_count + sum(image.byte_count for image in (record.images if record else ()))

    @property
    def mesh_ids(self) -> npt.NDArray[np.int32]:
        """(M,) int32: the engine's id of each mesh of `record`."""
        return self._state.mesh_ids

    @property
    def warnings(self) -> tuple[str, ...]:
        """The parts of the scene that the last update could not read, as sentences for the user."""
        return self.record.warnings

    @property
    def appearance(self) -> Appearance:
        """Materials, attributes and visibility for `perfect_bvh.render`."""
        if self._appearance is None:
            self._appearance = make_appearance(self.record, self._state.instance_ids, self._state.mesh_ids)
        return self._appearance

    # From ids back to Blender ----------------------------------------------------------------------------------------

    def describe(self, instance_ids: npt.ArrayLike) -> InstanceDescription:
        """Object names, session uids and persistent ids of instances, -1 for a miss, as arrays of the same shape."""
        return self._get_lookup().describe(instance_ids)

    def instance_rows(self, instance_ids: npt.NDArray[Any]) -> Int32Array:
        """(...) int32: rows of the instances of `record`, -1 for a miss. Raises ValueError for ids it does not have."""
        return self._get_lookup().instance_rows(instance_ids)

    def polygon_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: the polygon of the evaluated mesh that each ray hit, -1 on a miss.

        Raises ValueError, as the other lookups by hits do, for hits on a mesh whose triangles a later update replaced.
        """
        return self._get_lookup().polygon_ids(hits)

    def triangle_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: the hit triangle as Blender counts the evaluated mesh's, -1 on a miss."""
        return self._get_lookup().triangle_ids(hits)

    def material_ids(self, hits: HitIds) -> Int32Array:
        """(...) int32: rows of `material_names`, -1 on a miss and for an empty slot."""
        return self._get_lookup().material_ids(hits)

    @property
    def material_names(self) -> npt.NDArray[np.object_]:
        """(M,) object array of str: the names that `material_ids` are rows of."""
        materials = self.record.materials
        names = np.empty(len(materials), dtype=object)
        names[:] = [material.name for material in materials]
        return names

    def _get_lookup(self) -> SceneLookup:
        if self._lookup is None:
            state = self._state
            self._lookup = SceneLookup(
                self.record, state.instance_ids, state.mesh_ids, state.scene.scene_id, state.mesh_generations
            )
        return self._lookup


# Scene watch ---------------------------------------------------------------------------------------------------------
# Marks an engine's scene stale, before it answers, if Blender has changed since the sync.


Place = tuple[int, str]  # a scene's session uid, and the name of one of its view layers


class SceneWatch:
    """Marks its scene stale: when Blender reports a change, and when a query finds one.

    Before a query on Blender's main thread, Blender evaluates pending changes, and thereby reports them. Other threads,
    handlers, drivers and renders must not start an evaluation: there, only changes that were reported before count.

    The scene keeps its watch alive, even if the sync is dropped.
    """

    def __init__(self) -> None:
        self._scene: weakref.ref[Scene] | None = None
        self._synced: Place | None = None
        self._active: Place | None = None

    def make_scene(self) -> Scene:
        """Makes a scene of the engine's, and watches over it from now on, and no other."""
        scene = Scene()
        self._scene = weakref.ref(scene)
        scene.before_query = self.check
        return scene

    def start(self) -> None:
        """Listens to Blender until `stop` is called."""
        changes.listen(self)

    def stop(self) -> None:
        changes.stop_listening(self)

    def settle(self, depsgraph: Any) -> None:
        """Lets Blender evaluate pending changes, if allowed here: else a query after the update would find them."""
        if may_ask():
            evaluate_pending(depsgraph.view_layer)

    def note_synced(self, depsgraph: Any) -> None:
        """Registers the state of Blender that the scene is about to equal."""
        self._synced = (depsgraph.scene.original.session_uid, depsgraph.view_layer.name)
        shown = _shown()
        self._active = None if shown is None else _place_of(shown)

    # What makes it stale ---------------------------------------------------------------------------------------------

    def on_change(self, what: str) -> None:
        """Makes queries raise `perfect_bvh.StaleSceneError` until the next update."""
        scene = None if self._scene is None else self._scene()
        if scene is not None:
            scene.mark_stale(f"{what} since the last update: call update()")

    def on_file_change(self) -> None:
        """The same, for another file."""
        self.on_change("another file was loaded")

    def check(self) -> None:
        """Finds changes that Blender has not reported yet. Called before each query that would be answered."""
        if may_ask():
            changes.watch_again()
            self._ask()
        elif is_asking():  # a handler that asks, while Blender evaluates for a query
            self.on_change("something was changed")
        elif not changes.are_installed():
            self.on_change(changes.HANDLERS_REMOVED)

    def _ask(self) -> None:
        shown = _shown()
        if shown is None or self._synced is None:
            return
        active = _place_of(shown)
        view_layer = shown.view_layer if active == self._synced else _find_layer(self._synced)
        if view_layer is None:
            self.on_change("its scene or view layer was removed")
        elif active not in (self._synced, self._active):
            self.on_change("another scene or view layer was shown")
        elif not evaluate_pending(view_layer):
            self.on_change("Blender was asked during an evaluation")


def _shown() -> Any:
    """Returns the owner of the active scene and view layer: the window, or the context if there is none."""
    context = bpy.context
    shown = context.window or context
    return shown if shown.scene is not None else None


def _place_of(shown: Any) -> Place:
    return shown.scene.session_uid, shown.view_layer.name


def _find_layer(place: Place) -> Any:
    uid, name = place
    return next((scene.view_layers.get(name) for scene in bpy.data.scenes if scene.session_uid == uid), None)
