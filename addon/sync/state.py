"""Keeps one engine scene in step with records: compares, and applies nothing but the difference.

The state is what the engine holds, updated call by call as edits are made. A commit that fails or is cancelled
leaves edits that wait, of which the state knows. An edit that fails leaves doubt about what the engine holds, so
that scene is given up and the next update fills a fresh one: dear, rare and never wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from .compare import (
    HeldInstances,
    InstanceDifference,
    MeshDifference,
    compare_instances,
    compare_mesh,
    object_uids,
)
from .keys import Int64Array, Uint64Array, instance_keys, instance_orders
from .looks import find_look_differences
from .object_changes import summarise_objects
from .plan import MeshUsage, UsageTracker
from .records import Int32Array, MeshRecord, SceneRecord
from .report import MeshChange, SyncReport

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

Progress = Callable[[float], object]

# Later than any hit: the commit that brought the triangles has not succeeded.
_NEVER = np.iinfo(np.int64).max
# Meshes that are gone of which it is still known what they did.
_MOST_REMEMBERED = 256


class EngineScene(Protocol):
    """The part of `perfect_bvh.Scene` that sync uses."""

    @property
    def scene_id(self) -> int: ...
    def add_mesh(self, positions: npt.ArrayLike, triangles: npt.ArrayLike, *, usage: str) -> int: ...
    def update_mesh(self, mesh: int, positions: npt.ArrayLike) -> None: ...
    def replace_mesh(self, mesh: int, positions: npt.ArrayLike, triangles: npt.ArrayLike) -> None: ...
    def set_usage(self, mesh: int, usage: str) -> None: ...
    def remove_mesh(self, mesh: int) -> None: ...
    def add_instances(
        self, meshes: npt.ArrayLike, transforms: npt.ArrayLike, masks: npt.ArrayLike, orders: npt.ArrayLike
    ) -> Int32Array: ...
    def set_transforms(self, ids: npt.ArrayLike, transforms: npt.ArrayLike) -> None: ...
    def set_masks(self, ids: npt.ArrayLike, masks: npt.ArrayLike) -> None: ...
    def remove_instances(self, ids: npt.ArrayLike) -> None: ...
    def commit(self, **keywords: Any) -> CommitReport: ...
    def mark_stale(self, why: str) -> None: ...


@dataclass(slots=True)
class _HeldMesh:
    """A mesh in the engine: its id and usage there, the record it was last given, and since when it has its triangles.

    generation: of the scene's commit that brought the triangles; None until it has succeeded.
    """

    mesh_id: int
    record: MeshRecord
    usage: str
    generation: int | None = None


@dataclass(frozen=True, slots=True)
class _Plan:
    """The difference between what is held and a new record."""

    record: SceneRecord
    keys: Uint64Array
    orders: Int64Array
    meshes: list[MeshDifference]  # one for each mesh of the record
    removed_meshes: list[Hashable]
    instances: InstanceDifference


class SceneState:
    """One engine scene and what it holds.

    make_scene: makes an empty engine scene; called once now, and again only after an edit has failed.
    """

    def __init__(self, make_scene: Callable[[], EngineScene]) -> None:
        self._make_scene = make_scene
        self.scene: EngineScene = make_scene()
        self._meshes: dict[Hashable, _HeldMesh] = {}
        self._instances = HeldInstances()
        self._object_names: dict[int, str] = {}
        self._record: SceneRecord | None = None
        self._has_waiting_edits = False
        self._fresh_meshes: list[_HeldMesh] = []  # whose triangles wait for a commit
        self._usages = UsageTracker()

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
        meshes = () if self._record is None else self._record.meshes
        generations = (self._meshes[mesh.key].generation for mesh in meshes)
        return np.array([_NEVER if generation is None else generation for generation in generations], np.int64)

    @property
    def mesh_ids(self) -> Int32Array:
        """(M,) int32: the engine's id of each mesh of the record."""
        meshes = () if self._record is None else self._record.meshes
        return np.array([self._meshes[mesh.key].mesh_id for mesh in meshes], np.int32)

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
        before = self._instances, self._object_names, self._record
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
        for fresh in self._fresh_meshes:
            fresh.generation = commit.generation
        self._fresh_meshes = []
        finished = time.perf_counter()

        held, names, last = before
        difference = plan.instances
        return SyncReport(
            frame=record.frame,
            meshes=tuple(changes),
            object_columns=summarise_objects(held, names, record, difference, [mesh.action for mesh in plan.meshes]),
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
        meshes = [compare_mesh(self._held_record(mesh.key), mesh) for mesh in record.meshes]
        wanted = {mesh.key for mesh in record.meshes}
        if len(wanted) != len(record.meshes):
            raise ValueError("update: two meshes of the record have the same key")
        return _Plan(
            record=record,
            keys=keys,
            orders=orders,
            meshes=meshes,
            removed_meshes=[key for key in self._meshes if key not in wanted],
            instances=compare_instances(self._instances, record, keys, orders, self._meshes),
        )

    def _held_record(self, key: Hashable) -> MeshRecord | None:
        held = self._meshes.get(key)
        return None if held is None else held.record

    # Applying --------------------------------------------------------------------------------------------------------

    def _apply(self, plan: _Plan) -> list[MeshChange]:
        """Edits in an order that the engine allows: no mesh goes while an instance shows it."""
        self.scene.remove_instances(self._instances.ids[plan.instances.removed])
        changes = [self._remove_mesh(key) for key in plan.removed_meshes]
        moved = self._find_moved_meshes(plan)
        for mesh, difference in zip(plan.record.meshes, plan.meshes, strict=True):
            usage = self._plan_mesh(mesh, difference, mesh.key in moved)
            changes.append(self._apply_mesh(mesh, difference, usage))
        self._usages.forget_all_but(self._meshes, 2 * len(self._meshes) + _MOST_REMEMBERED)
        self._instances = self._apply_instances(plan)
        self._object_names = {obj.session_uid: obj.name for obj in plan.record.objects}
        self._record = plan.record
        return changes

    def _remove_mesh(self, key: Hashable) -> MeshChange:
        held = self._meshes.pop(key)
        self.scene.remove_mesh(held.mesh_id)
        reason = "nothing shows it any more"
        return MeshChange(key, held.record.name, held.mesh_id, "removed", reason, len(held.record.triangles))

    def _find_moved_meshes(self, plan: _Plan) -> set[Hashable]:
        """Keys of the meshes of which an instance moved."""
        if not plan.instances.moved.any():
            return set()
        rows = np.unique(plan.record.instances.mesh_indices[plan.instances.moved])
        return {plan.record.meshes[row].key for row in rows}

    def _plan_mesh(self, mesh: MeshRecord, difference: MeshDifference, has_moved: bool) -> MeshUsage:
        """Takes in what the mesh did, and tells what to expect of it."""
        if difference.action == "replaced":
            self._usages.observe(mesh.key, "changing")
        elif difference.action == "deformed":
            self._usages.observe(mesh.key, "deforming")
        elif difference.action == "kept":
            self._usages.observe(mesh.key, "rigid" if has_moved else "static")
        return self._usages.expect(mesh)

    def _apply_mesh(self, mesh: MeshRecord, difference: MeshDifference, plan: MeshUsage) -> MeshChange:
        held = self._meshes.get(mesh.key)
        usage = "static" if plan.usage == "rigid" else plan.usage  # the engine builds the same tree for both
        if held is not None and held.usage != usage:
            self.scene.set_usage(held.mesh_id, usage)
            held.usage = usage
        if held is None:
            held = _HeldMesh(self.scene.add_mesh(mesh.positions, mesh.triangles, usage=usage), mesh, usage)
            self._meshes[mesh.key] = held
            self._fresh_meshes.append(held)
        elif difference.action == "deformed":
            self.scene.update_mesh(held.mesh_id, mesh.positions)
        elif difference.action == "replaced":
            self.scene.replace_mesh(held.mesh_id, mesh.positions, mesh.triangles)
            held.generation = None
            self._fresh_meshes.append(held)
        held.record = mesh
        return MeshChange(
            mesh.key,
            mesh.name,
            held.mesh_id,
            difference.action,
            difference.reason,
            len(mesh.triangles),
            plan.usage,
            plan.reason,
        )

    def _apply_instances(self, plan: _Plan) -> HeldInstances:
        instances, difference = plan.record.instances, plan.instances
        added, rows = difference.added, difference.held_rows
        ids = self._instances.ids[rows] if len(self._instances.ids) else np.empty(len(rows), np.int32)
        if added.any():
            mesh_ids = np.array([self._meshes[mesh.key].mesh_id for mesh in plan.record.meshes], np.int32)
            ids[added] = self.scene.add_instances(
                mesh_ids[instances.mesh_indices[added]],
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
            mesh_keys=tuple([mesh.key for mesh in plan.record.meshes]),
            object_uids=object_uids(plan.record),
        )

    def _give_up(self) -> None:
        """Starts over with an empty scene: nobody knows how far the failed edit got."""
        self.scene.mark_stale("an update failed and its scene was given up: take the scene from the next update")
        self.scene = self._make_scene()
        self.scene.mark_stale("the last update failed: call update() again")
        self._meshes = {}
        self._instances = HeldInstances()
        self._object_names = {}
        self._record = None
        self._has_waiting_edits = False
        self._fresh_meshes = []


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
