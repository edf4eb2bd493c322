"""What a new record asks of an engine's scene, and the report of what came of it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .compare import HeldInstances, InstanceDifference, MeshDifference, find_look_differences, is_same_camera
from .held_motion import MotionDifference
from .keys import Int64Array, Uint64Array
from .object_changes import summarise_objects
from .records import SceneRecord
from .report import MeshChange, SyncReport

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

# Of a record, what nothing but words and panels depend on.
PLAIN_FIELDS = ("name", "frame", "warnings", "unseen", "not_shown")


@dataclass(frozen=True, slots=True)
class SceneDifference:
    """The difference between what is held and a new record.

    held, last: the instances and the record before, the latter None if there was none. meshes: one for each mesh of the
    record. removed_meshes: keys.
    """

    record: SceneRecord
    held: HeldInstances
    last: SceneRecord | None
    keys: Uint64Array
    orders: Int64Array
    meshes: Sequence[MeshDifference]
    removed_meshes: list[Hashable]
    instances: InstanceDifference
    motion: MotionDifference
    milliseconds: float

    @property
    def camera_changed(self) -> bool:
        """Or its motion, or the size of the image."""
        return self.last is None or not _have_same_camera(self.last, self.record)

    @property
    def materials_changed(self) -> bool:
        """Or anything else that no ray could tell."""
        return self.last is None or bool(find_look_differences(self.last, self.record))

    @property
    def attributes_changed(self) -> bool:
        """Of any mesh."""
        return self.last is None or any(mesh.attributes_changed for mesh in self.meshes)

    @property
    def is_none(self) -> bool:
        """Whether what is held is what the record says."""
        return bool(
            self.last is not None
            and not self.removed_meshes
            and all(mesh.action == "kept" for mesh in self.meshes)
            and self.instances.kept.all()
            and not self.instances.removed.any()
            and self.motion.is_none
            and not self.camera_changed
            and not self.materials_changed
            and not self.attributes_changed
            and all(getattr(self.last, name) == getattr(self.record, name) for name in PLAIN_FIELDS)
            and [mesh.name for mesh in self.last.meshes] == [mesh.name for mesh in self.record.meshes]
        )


@dataclass(frozen=True, slots=True)
class AppliedDifference:
    """A difference that the engine's scene was given as edits, which wait for a commit.

    finishes_earlier_update: whether edits of an earlier one waited, too.
    """

    difference: SceneDifference
    changes: tuple[MeshChange, ...]
    finishes_earlier_update: bool
    milliseconds: float

    def report(self, commit: CommitReport, read_milliseconds: float, commit_milliseconds: float) -> SyncReport:
        """What came of it."""
        difference = self.difference
        record, instances = difference.record, difference.instances
        return SyncReport(
            frame=record.frame,
            meshes=self.changes,
            object_columns=summarise_objects(
                difference.held, record, instances, [mesh.action for mesh in difference.meshes]
            ),
            added_count=int(instances.added.sum()),
            removed_count=int(instances.removed.sum()),
            moved_count=int(instances.moved.sum()),
            masked_count=int(instances.masked.sum()),
            kept_count=int(instances.kept.sum()),
            motion_count=record.motion.count,
            motion_changed=not difference.motion.is_none,
            camera_changed=difference.camera_changed,
            materials_changed=difference.materials_changed,
            attributes_changed=difference.attributes_changed,
            finishes_earlier_update=self.finishes_earlier_update,
            commit=commit,
            unseen=record.unseen,
            warnings=record.warnings,
            not_shown=record.not_shown,
            read_milliseconds=read_milliseconds,
            compare_milliseconds=difference.milliseconds,
            apply_milliseconds=self.milliseconds,
            commit_milliseconds=commit_milliseconds,
        )


def _have_same_camera(old: SceneRecord, new: SceneRecord) -> bool:
    if old.size != new.size:
        return False
    if old.camera is None or new.camera is None:
        return old.camera is new.camera
    moments = (old.motion.camera, new.motion.camera)
    if len(moments[0]) != len(moments[1]) or not is_same_camera(old.camera, new.camera):
        return False
    return all(is_same_camera(*pair) for pair in zip(*moments, strict=True))
