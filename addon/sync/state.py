"""Keeps one engine scene in step with records: compares, and applies nothing but the difference.

The state is what the engine holds, updated call by call as edits are made. A commit that fails or is cancelled
leaves edits that wait, of which the state knows. An edit that fails leaves doubt about what the engine holds, so
that scene is given up and the next update fills a fresh one: dear, rare and never wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from .compare import HeldInstances, InstanceDifference, MeshDifference, compare_instances
from .held_meshes import HeldMeshes, MeshScene
from .keys import Int64Array, Uint64Array, instance_keys, instance_orders
from .looks import find_look_differences
from .object_changes import summarise_objects
from .records import Int32Array, SceneRecord
from .report import MeshChange, SyncReport

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

Progress = Callable[[float], object]


class EngineScene(MeshScene, Protocol):
    """The part of `perfect_bvh.Scene` that sync uses."""

    @property
    def scene_id(self) -> int: ...
    def add_instances(
        self, meshes: npt.ArrayLike, transforms: npt.ArrayLike, masks: npt.ArrayLike, orders: npt.ArrayLike
    ) -> Int32Array: ...
    def set_transforms(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...
    def set_masks(self, ids: npt.ArrayLike, masks: npt.ArrayLike) -> None: ...
    def remove_instances(self, ids: npt.ArrayLike) -> None: ...
    def commit(self, **keywords: Any) -> CommitReport: ...
    def mark_stale(self, why: str) -> None: ...


@dataclass(frozen=True, slots=True)
class _Plan:
    """The difference between what is held and a new record."""

    record: SceneRecord
    keys: Uint64Array
    orders: Int64Array
    meshes: Sequence[MeshDifference]  # one for each mesh of the record
    removed_meshes: list[Hashable]
    instances: InstanceDifference


class SceneState:
    """One engine scene and what it holds.

    make_scene: makes an empty engine scene; called once now, and again only after an edit has failed.
    """

    def __init__(self, make_scene: Callable[[], EngineScene]) -> None:
        self._make_scene = make_scene
        self.scene: EngineScene = make_scene()
        self._meshes = HeldMeshes()
        self._instances = HeldInstances()
        self._record: SceneRecord | None = None
        self._has_waiting_edits = False

    @property
    def record(self) -> SceneRecord | None:
        """The record that was applied last, None before the first or after a failure."""
        return self._record

    @property
    def instance_ids(self) -> Int32Array:
        """(I,) int32: the engine's id of each instance of the record."""
        return self._instances.ids

    @property
    def mesh_generations(self) -> Int64Array:
        """(M,) int64: the commit of the scene since which each mesh of the record has its triangles."""
        return self._meshes.generations

    @property
    def mesh_ids(self) -> Int32Array:
        """(M,) int32: the engine's id of each mesh of the record."""
        return self._meshes.ids

    def update(
        self,
        record: SceneRecord,
        *,
        expected_rays: int | None = None,
        progress: Progress | None = None,
        read_milliseconds: float = 0.0,
    ) -> SyncReport:
        """Makes the engine's scene equal to a record, and commits it.

        Raises what the engine raises; the scene's queries then raise too, until an update succeeds.
        """
        self.scene.mark_stale("the last update did not succeed: call update() again")
        started = time.perf_counter()
        plan = self._compare(record)
        compared = time.perf_counter()
        held, last = self._instances, self._record
        try:
            changes = self._apply(plan)
        except BaseException:
            self._give_up()
            raise
        applied = time.perf_counter()
        was_waiting, self._has_waiting_edits = self._has_waiting_edits, True
        keywords = {"progress": progress, "expected_rays": expected_rays}
        commit = self.scene.commit(**{key: value for key, value in keywords.items() if value is not None})
        self._has_waiting_edits = False
        self._meshes.note_commit(commit)
        finished = time.perf_counter()

        difference = plan.instances
        return SyncReport(
            frame=record.frame,
            meshes=tuple(changes),
            object_columns=summarise_objects(held, record, difference, [mesh.action for mesh in plan.meshes]),
            added_count=int(difference.added.sum()),
            removed_count=int(difference.removed.sum()),
            moved_count=int(difference.moved.sum()),
            masked_count=int(difference.masked.sum()),
            kept_count=int(difference.kept.sum()),
            camera_changed=last is None or not _have_same_camera(last, record),
            materials_changed=last is None or not _have_same_looks(last, record),
            attributes_changed=last is None or any(mesh.attributes_changed for mesh in plan.meshes),
            finishes_earlier_update=was_waiting,
            commit=commit,
            unseen=record.unseen,
            warnings=record.warnings,
            read_milliseconds=read_milliseconds,
            compare_milliseconds=(compared - started) * 1e3,
            apply_milliseconds=(applied - compared) * 1e3,
            commit_milliseconds=(finished - applied) * 1e3,
        )

    # Comparing -------------------------------------------------------------------------------------------------------

    def _compare(self, record: SceneRecord) -> _Plan:
        if self._instances.are_those_of(record):
            keys, orders = self._instances.keys, self._instances.orders
        else:
            keys, orders = instance_keys(record), instance_orders(record)
        meshes, removed = self._meshes.compare(record.meshes)
        return _Plan(
            record=record,
            keys=keys,
            orders=orders,
            meshes=meshes,
            removed_meshes=removed,
            instances=compare_instances(self._instances, record, keys, orders, self._meshes),
        )

    # Applying --------------------------------------------------------------------------------------------------------

    def _apply(self, plan: _Plan) -> list[MeshChange]:
        """Edits in an order that the engine allows: no mesh goes while an instance shows it."""
        self.scene.remove_instances(self._instances.ids[plan.instances.removed])
        changes = [self._meshes.remove(self.scene, key) for key in plan.removed_meshes]
        moved = np.zeros(len(plan.record.meshes), np.bool_)
        moved[plan.record.instances.mesh_indices[plan.instances.moved]] = True
        changes += self._meshes.apply(self.scene, plan.record.meshes, plan.meshes, set(np.flatnonzero(moved).tolist()))
        self._instances = self._apply_instances(plan)
        self._record = plan.record
        return changes

    def _apply_instances(self, plan: _Plan) -> HeldInstances:
        instances, difference = plan.record.instances, plan.instances
        added, rows = difference.added, difference.held_rows
        ids = self._instances.ids[rows] if len(self._instances.ids) else np.empty(len(rows), np.int32)
        if added.any():
            ids[added] = self.scene.add_instances(
                self._meshes.ids[instances.mesh_indices[added]],
                instances.transforms[added],
                instances.masks[added],
                plan.orders[added],
            )
        moved, masked = difference.moved, difference.masked
        if moved.all() and len(moved):
            self.scene.set_transforms(ids, instances.transforms)
        elif moved.any():
            self.scene.set_transforms(ids[moved], instances.transforms[moved])
        if masked.any():
            self.scene.set_masks(ids[masked], instances.masks[masked])
        return HeldInstances(
            columns=instances,
            keys=plan.keys,
            ids=ids,
            orders=plan.orders,
            meshes=plan.record.meshes,
            objects=plan.record.objects,
        )

    def _give_up(self) -> None:
        """Starts over with an empty scene: nobody knows how far the failed edit got."""
        self.scene.mark_stale("an update failed and its scene was given up: take the scene from the next update")
        self.scene = self._make_scene()
        self.scene.mark_stale("the last update failed: call update() again")
        self._meshes.clear()
        self._instances = HeldInstances()
        self._record = None
        self._has_waiting_edits = False


def _have_same_camera(old: SceneRecord, new: SceneRecord) -> bool:
    if old.size != new.size:
        return False
    if old.camera is None or new.camera is None:
        return old.camera is new.camera
    names = ("window", "projection", "clip_start", "clip_end", "border")
    same_settings = all(getattr(old.camera, name) == getattr(new.camera, name) for name in names)
    return same_settings and bool(np.array_equal(old.camera.matrix, new.camera.matrix))


def _have_same_looks(old: SceneRecord, new: SceneRecord) -> bool:
    return not find_look_differences(old, new)
