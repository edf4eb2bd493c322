"""The actions of one sync, their objects, meshes and reasons, and their cost."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from .compare import MeshAction
from .not_shown import NotShown
from .records import MeshKind, UnseenMesh, Usage

if TYPE_CHECKING:
    from perfect_bvh import CommitReport

ObjectAction = Literal["added", "removed", "replaced", "deformed", "recounted", "moved", "masked", "kept"]
# From the least to the most that can happen to an object: the strongest names what happened to it.
OBJECT_ACTIONS: tuple[ObjectAction, ...] = (
    "kept",
    "masked",
    "moved",
    "recounted",
    "deformed",
    "replaced",
    "removed",
    "added",
)


@dataclass(frozen=True, slots=True)
class MeshChange:
    """One distinct mesh, hair or point cloud. mesh_id: the engine's.

    triangle_count: now, or of the removed mesh; for another `kind`, the number of curves or points.
    action is the change of the data; the engine's action (refit or rebuild) is in `SyncReport.commit`.
    usage: the class by which the engine plans, see `plan`; usage_reason: the sentence that says why.
    remade_by: as a `MeshRecord` has it.
    """

    key: Hashable
    name: str
    mesh_id: int
    action: MeshAction
    reason: str
    triangle_count: int
    usage: Usage = "static"
    usage_reason: str = ""
    remade_by: str = ""
    kind: MeshKind = "triangles"


@dataclass(frozen=True, slots=True)
class ObjectChange:
    """One object. instance_count: how many instances of it there are. changed_count: how many of them changed."""

    name: str
    session_uid: int
    action: ObjectAction
    reason: str
    instance_count: int
    changed_count: int


@dataclass(frozen=True, slots=True)
class ObjectColumns:
    """`ObjectChange`s as columns, so that a scene of many objects costs no Python object for each.

    names: (O,) object. session_uids: (O,) int64. actions: (O,) int8, rows of OBJECT_ACTIONS.
    instance_counts, changed_counts: (O,) int64.
    """

    names: npt.NDArray[np.object_]
    session_uids: npt.NDArray[np.int64]
    actions: npt.NDArray[np.int8]
    instance_counts: npt.NDArray[np.int64]
    changed_counts: npt.NDArray[np.int64]


_OBJECT_REASONS: dict[ObjectAction, str] = {
    "kept": "nothing changed",
    "masked": "its visibility to rays changed",
    "moved": "its transform changed",
    "recounted": "it has more or fewer instances than before",
    "deformed": "its mesh, hair or points were deformed",
    "replaced": "it shows other triangles, curves or points than before",
    "removed": "it is deleted, unlinked or hidden",
    "added": "seen for the first time, or shown again",
}


@dataclass(frozen=True, slots=True)
class SyncReport:
    """The actions of one `update()`.

    meshes: every mesh, also those that were kept. The counts are of instances.
    motion_count: the number of instances and meshes that move within the shutter. motion_changed: whether they or their
        motions are different. Their actions (kept, moved or deformed) are those at the frame itself.
    camera_changed, materials_changed, attributes_changed: changes of an image without changes of the geometry.
    finishes_earlier_update: an earlier update's commit failed or was cancelled, and its edits were committed now.
    commit: the engine's own report: the trees that were built or refitted.
    mismatches: only with verify=True: differences between the engine's copy and Blender's own data.
    unseen: meshes that no ray can hit, which were not built. warnings: data that could not be read.
    not_shown: parts that an image of the scene lacks or shows differently, a row each.
    byte_count: of the committed scene.
    """

    frame: float
    meshes: tuple[MeshChange, ...]
    object_columns: ObjectColumns
    added_count: int
    removed_count: int
    moved_count: int
    masked_count: int
    kept_count: int
    camera_changed: bool
    materials_changed: bool
    attributes_changed: bool
    finishes_earlier_update: bool
    commit: CommitReport
    motion_count: int = 0
    motion_changed: bool = False
    unseen: tuple[UnseenMesh, ...] = ()
    warnings: tuple[str, ...] = ()
    not_shown: tuple[NotShown, ...] = ()
    mismatches: tuple[str, ...] = ()
    read_milliseconds: float = 0.0
    compare_milliseconds: float = 0.0
    apply_milliseconds: float = 0.0
    commit_milliseconds: float = 0.0

    @property
    def milliseconds(self) -> float:
        """The sum of all times: read, compare, apply, commit."""
        return self.read_milliseconds + self.compare_milliseconds + self.apply_milliseconds + self.commit_milliseconds

    @property
    def byte_count(self) -> int:
        """Bytes of the committed scene: geometry, trees and instances."""
        return self.commit.byte_count

    @property
    def objects(self) -> tuple[ObjectChange, ...]:
        """Every object with what happened to it; made at each access."""
        columns = self.object_columns
        changes = []
        for row in range(len(columns.names)):
            action = OBJECT_ACTIONS[columns.actions[row]]
            changes.append(
                ObjectChange(
                    name=str(columns.names[row]),
                    session_uid=int(columns.session_uids[row]),
                    action=action,
                    reason=_OBJECT_REASONS[action],
                    instance_count=int(columns.instance_counts[row]),
                    changed_count=int(columns.changed_counts[row]),
                )
            )
        return tuple(changes)

    @property
    def has_changes(self) -> bool:
        """Whether anything changed that an image could show."""
        instances = self.added_count + self.removed_count + self.moved_count + self.masked_count
        meshes = any(mesh.action != "kept" for mesh in self.meshes)
        looks = self.motion_changed or self.camera_changed or self.materials_changed or self.attributes_changed
        return bool(instances or meshes or looks or self.finishes_earlier_update)

    @property
    def ledger(self) -> list[dict[str, Any]]:
        """Returns a row for each decision of the engine about a mesh, of plain values for JSON; also for keeping it.

        A row has the mesh's name, its class and the reason, the action and the reason, the expected cost of each
        alternative, and the quality of the tree when it was built, when it was refitted, and now.
        """
        changes = {mesh.mesh_id: mesh for mesh in self.meshes}
        rows = []
        for row in (*self.commit.meshes, *self.commit.resting):
            change = changes.get(row.mesh_id)
            rows.append(
                {
                    "mesh": change.name if change else str(row.mesh_id),
                    "class": change.usage if change else row.usage,
                    "class_reason": change.usage_reason if change else "",
                    "action": row.action,
                    "reason": row.reason,
                    "builder": row.builder,
                    "triangles": row.triangle_count,
                    "expected_rays": row.expected_rays,
                    "fresh_cost": row.fresh_cost,
                    "refitted_cost": row.refitted_cost,
                    "cost": row.cost,
                    "milliseconds": row.milliseconds,
                    "alternatives": [asdict(alternative) for alternative in row.alternatives],
                }
            )
        return rows

    def count_meshes(self, action: MeshAction) -> int:
        """How many meshes this happened to."""
        return sum(mesh.action == action for mesh in self.meshes)

    def __str__(self) -> str:
        parts = [
            f"meshes: {self.count_meshes('added')} added, {self.count_meshes('removed')} removed, "
            f"{self.count_meshes('replaced')} replaced, {self.count_meshes('deformed')} deformed, "
            f"{self.count_meshes('kept')} kept",
            f"instances: {self.added_count} added, {self.removed_count} removed, {self.moved_count} moved, "
            f"{self.masked_count} masked, {self.kept_count} kept",
            *([f"{self.motion_count} moving within the shutter"] if self.motion_count else []),
            f"{self.milliseconds:.1f} ms: read {self.read_milliseconds:.1f}, compare {self.compare_milliseconds:.1f}, "
            f"apply {self.apply_milliseconds:.1f}, commit {self.commit_milliseconds:.1f}",
        ]
        return "; ".join(parts)
