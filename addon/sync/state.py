"""Keeps one engine scene in step with records: compares, and applies only the difference.

The state describes the contents of the engine's scene, and is updated call by call as edits are made. A commit that
fails or is cancelled leaves edits pending, which the state records. After a failed edit the contents of the engine's
scene are unknown. That scene is then dropped, and the next update fills a new one: costly, rare and never wrong.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from .compare import HeldInstances, compare_instances
from .held import HeldMeshes, MovingScene, compare_motion
from .keys import Int64Array, instance_keys, instance_orders
from .records import Int32Array, SceneRecord
from .report import MeshChange, SyncReport
from .scene_difference import AppliedDifference, SceneDifference

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

Progress = Callable[[float], object]


class EngineScene(MovingScene, Protocol):
    """The part of `perfect_bvh.Scene` that sync uses."""

    @property
    def scene_id(self) -> int: ...
    def add_instances(
        self, meshes: npt.ArrayLike, transforms: npt.ArrayLike, masks: npt.ArrayLike, orders: npt.ArrayLike
    ) -> Int32Array: ...
    def set_masks(self, ids: npt.ArrayLike, masks: npt.ArrayLike) -> None: ...
    def remove_instances(self, ids: npt.ArrayLike) -> None: ...
    def commit(self, **keywords: Any) -> CommitReport: ...
    def mark_stale(self, why: str) -> None: ...


class TimedCommit(NamedTuple):
    """The engine's report, and how long the caller has waited for it."""

    report: CommitReport
    milliseconds: float


class SceneState:
    """One engine scene and its contents.

    make_scene: makes an empty engine scene; called once now, and again only after an edit has failed.
    """

    def __init__(self, make_scene: Callable[[], EngineScene]) -> None:
        self._make_scene = make_scene
        self.scene: EngineScene = make_scene()
        self._meshes = HeldMeshes()
        self._instances = HeldInstances()
        self._record: SceneRecord | None = None
        self._has_waiting_edits = False
        self._told_rays: int | None = None
        self._knows_rays = True  # whether the engine's scene, too, was given their number

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
        """Makes the engine's scene equal to a record, and commits it: the four steps below, one after the other.

        Raises the engine's errors; the scene's queries then raise, too, until an update succeeds.
        """
        self.scene.mark_stale("the last update did not succeed: call update() again")
        applied = self.apply(self.compare(record))
        return self.finish(applied, self.commit(expected_rays, progress), read_milliseconds)

    # The steps of an update ------------------------------------------------------------------------------------------

    def compare(self, record: SceneRecord) -> SceneDifference:
        """Returns the edits that a record needs. Does not use the engine's scene: a commit may be in progress."""
        started = time.perf_counter()
        if self._instances.are_those_of(record):
            keys, orders = self._instances.keys, self._instances.orders
        else:
            keys, orders = instance_keys(record), instance_orders(record)
        meshes, removed = self._meshes.compare(record.meshes)
        instances = compare_instances(self._instances, record, keys, orders, self._meshes)
        return SceneDifference(
            record=record,
            held=self._instances,
            last=self._record,
            keys=keys,
            orders=orders,
            meshes=meshes,
            removed_meshes=removed,
            instances=instances,
            motion=compare_motion(self._record, record, instances, meshes),
            milliseconds=(time.perf_counter() - started) * 1e3,
        )

    def apply(self, difference: SceneDifference) -> AppliedDifference:
        """Edits the engine's scene, which waits for a commit from then on. No commit may be under way."""
        self.scene.mark_stale("the last update did not succeed: call update() again")
        started = time.perf_counter()
        try:
            changes = self._apply(difference)
        except BaseException:
            self._give_up()
            raise
        was_waiting, self._has_waiting_edits = self._has_waiting_edits, True
        return AppliedDifference(difference, tuple(changes), was_waiting, (time.perf_counter() - started) * 1e3)

    def commit(self, expected_rays: int | None = None, progress: Progress | None = None) -> TimedCommit:
        """Commits the edits, on any thread, while no other edits or commits.

        Edits only the engine's scene: the held records stay the same, whether it succeeds or not.
        expected_rays: without it the engine uses the number that it was given last (unless 0). An engine's scene that
        was made since then has no such number, so it is given again.
        """
        started = time.perf_counter()
        rays = self._told_rays if expected_rays is None and not self._knows_rays else expected_rays
        keywords = {"progress": progress, "expected_rays": rays}
        report = self.scene.commit(**{key: value for key, value in keywords.items() if value is not None})
        if rays:
            self._told_rays, self._knows_rays = rays, True
        return TimedCommit(report, (time.perf_counter() - started) * 1e3)

    def finish(self, applied: AppliedDifference, commit: TimedCommit, read_milliseconds: float = 0.0) -> SyncReport:
        """Takes in that the commit has succeeded; to be called for each that has, before the next edits."""
        self._meshes.note_commit(commit.report)
        report = applied.report(commit.report, read_milliseconds, commit.milliseconds)
        self._has_waiting_edits = False  # in the end: if this report gets lost, the next must include the edits
        return report

    # Applying --------------------------------------------------------------------------------------------------------

    def _apply(self, wanted: SceneDifference) -> list[MeshChange]:
        """Edits in an order that the engine allows: no mesh goes while an instance shows it."""
        record, difference = wanted.record, wanted.instances
        self.scene.remove_instances(self._instances.ids[difference.removed])
        changes = [self._meshes.remove(self.scene, key) for key in wanted.removed_meshes]
        moved = np.zeros(len(record.meshes), np.bool_)
        moved[record.instances.mesh_indices[difference.moved]] = True
        changes += self._meshes.apply(self.scene, record.meshes, wanted.meshes, set(np.flatnonzero(moved).tolist()))
        self._instances = self._apply_instances(wanted)
        wanted.motion.apply(self.scene, record, self._instances.ids, self._meshes.ids)
        self._record = record
        return changes

    def _apply_instances(self, wanted: SceneDifference) -> HeldInstances:
        instances, difference = wanted.record.instances, wanted.instances
        added, rows = difference.added, difference.held_rows
        ids = self._instances.ids[rows] if len(self._instances.ids) else np.empty(len(rows), np.int32)
        if added.any():
            ids[added] = self.scene.add_instances(
                self._meshes.ids[instances.mesh_indices[added]],
                instances.transforms[added],
                instances.masks[added],
                wanted.orders[added],
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
            keys=wanted.keys,
            ids=ids,
            orders=wanted.orders,
            meshes=wanted.record.meshes,
            objects=wanted.record.objects,
        )

    def _give_up(self) -> None:
        """Starts over with an empty scene: it is not known how far the failed edit got."""
        self.scene.mark_stale("an update failed and its scene was given up: take the scene from the next update")
        self.scene = self._make_scene()
        self.scene.mark_stale("the last update failed: call update() again")
        self._meshes.clear()
        self._instances = HeldInstances()
        self._record = None
        self._has_waiting_edits = self._knows_rays = False
