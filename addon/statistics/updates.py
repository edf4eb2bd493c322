"""The updates for the last image, object by object: objects of one mesh with the same update share a row.

Made of columns, because a scene may have a hundred thousand objects: only a limited number of rows becomes Python
objects.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
import numpy.typing as npt

from .words import count_of, duration, memory, primitives, sentence, share

if TYPE_CHECKING:
    from perfect_bvh import MeshReport

    from ..sync.records import UnseenMesh
    from ..sync.report import MeshChange, SyncReport
    from .last_result import Owners


State = Literal[
    "kept",
    "unseen",
    "masked",
    "moved",
    "recounted",
    "replaced",
    "added",
    "removed",
    "refitted",
    "rotated",
    "partly_rebuilt",
    "rebuilt",
    "built",
]
# The changes of objects, and then of the trees of their meshes, which are more specific.
STATES: tuple[State, ...] = get_args(State)
OF_TREES = frozenset(STATES[STATES.index("refitted") :])
MOST_CHANGED, MOST_UNCHANGED = 200, 300
_RANK = {state: rank for rank, state in enumerate(STATES)}

Int64Array = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class UpdateRow:
    """Objects of one mesh with the same update.

    name: of the first, count: their number. uids: theirs, as Blender has them. mesh_row: of the scene's meshes.
    milliseconds: of the mesh's tree. share: of the camera rays' work. mesh, tree: the change of the data, and the
    engine's action; None if they were not checked. reason: why they are left out.
    """

    state: State
    name: str
    count: int
    uids: Int64Array
    mesh_row: int = -1
    share: float = 0.0
    mesh: MeshChange | None = None
    tree: MeshReport | None = None
    reason: str = ""

    @property
    def milliseconds(self) -> float:
        """The milliseconds of the tree's update, if there was one."""
        return self.tree.milliseconds if self.tree is not None and self.state in OF_TREES else 0.0

    @property
    def title(self) -> str:
        """The title, such as "Cube", or "Cube and 19 more"."""
        return self.name if self.count <= 1 else f"{self.name} and {self.count - 1:,} more"

    @property
    def short_title(self) -> str:
        """The same where there is little room, such as "Cube +19"."""
        return self.name if self.count <= 1 else f"{self.name} +{self.count - 1:,}"


@dataclass(frozen=True, slots=True)
class Updates:
    """The updates of one image. The rows are the first ones of all, by time or by the cost of their rays.

    changed_count, unchanged_count: the number of objects of each. changed_more, unchanged_more: the number of these
    objects that are in no row.
    """

    changed: tuple[UpdateRow, ...] = ()
    unchanged: tuple[UpdateRow, ...] = ()
    changed_count: int = 0
    unchanged_count: int = 0

    @property
    def changed_more(self) -> int:
        return self.changed_count - sum(row.count for row in self.changed)

    @property
    def unchanged_more(self) -> int:
        return self.unchanged_count - sum(row.count for row in self.unchanged)


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """Objects by mesh and by update, as columns: (G,) each except members.

    members: (P,) rows of the scene's objects, a group's one after the other, from starts on.
    """

    mesh_rows: Int64Array
    states: Int64Array
    starts: Int64Array
    counts: Int64Array
    shares: npt.NDArray[np.float64]
    members: Int64Array


def find_updates(report: SyncReport, owners: Owners, *, by_time: bool = True) -> Updates:
    """Returns the updates of a sync for an image. owners: of the scene that the image shows.

    by_time: whether the first rows are those with the longest times, not those with the most costly rays.
    """
    uids = np.array([obj.session_uid for obj in owners.objects], np.int64)
    trees = {tree.mesh_id: tree for tree in (*report.commit.resting, *report.commit.meshes)}
    groups = _group(owners, uids, _states_of_trees(owners, trees), _states_of_objects(report, uids))
    milliseconds = np.zeros(len(owners.mesh_ids))
    for row, mesh_id in enumerate(owners.mesh_ids.tolist()):
        tree = trees.get(mesh_id)
        if tree is not None:
            milliseconds[row] = tree.milliseconds
    meshes = {mesh.mesh_id: mesh for mesh in report.meshes if mesh.action != "removed"}

    def make(group: int) -> UpdateRow:
        mesh_id = int(owners.mesh_ids[groups.mesh_rows[group]])
        members = slice(groups.starts[group], groups.starts[group] + groups.counts[group])
        rows = groups.members[members]
        return UpdateRow(
            state=STATES[groups.states[group]],
            name=owners.objects[rows[0]].name,
            count=len(rows),
            uids=uids[rows],
            mesh_row=int(groups.mesh_rows[group]),
            share=float(groups.shares[group]),
            mesh=meshes.get(mesh_id),
            tree=trees.get(mesh_id),
        )

    is_changed = groups.states != _RANK["kept"]
    took = np.where(is_changed, milliseconds[groups.mesh_rows], 0.0)
    removed, unseen = tuple(_removed(report)), tuple(map(_row_of_unseen, report.unseen))
    keys = (-groups.counts, -groups.shares, -took) if by_time else (-groups.counts, -took, -groups.shares)
    order = np.lexsort(keys)
    changed = (*_first(make, order[is_changed[order]], MOST_CHANGED - len(removed)), *removed)
    unchanged = (*_first(make, order[~is_changed[order]], MOST_UNCHANGED), *unseen)[:MOST_UNCHANGED]
    return Updates(
        changed=changed,
        unchanged=unchanged,
        changed_count=int(groups.counts[is_changed].sum()) + sum(row.count for row in removed),
        unchanged_count=int(groups.counts[~is_changed].sum()) + len(unseen),
    )


def find_instancers(row: UpdateRow, owners: Owners) -> set[int]:
    """The uids of what shows the objects of a row as instances."""
    uids = np.array([obj.session_uid for obj in owners.objects], np.int64)
    is_of_row = (owners.mesh_rows == row.mesh_row) & np.isin(uids, row.uids)[owners.object_rows]
    parents = np.unique(owners.parent_rows[is_of_row & (owners.parent_rows >= 0)])
    return set(uids[parents].tolist())


def _first(make: Callable[[int], UpdateRow], groups: npt.NDArray[np.intp], most: int) -> list[UpdateRow]:
    return [make(int(group)) for group in groups[:most]]


def _states_of_trees(owners: Owners, trees: dict[int, MeshReport]) -> Int64Array:
    """(M,): what happened to each mesh's tree; "kept" also where its objects tell more."""
    return np.array(
        [_RANK[trees[mesh_id].action if mesh_id in trees else "kept"] for mesh_id in owners.mesh_ids.tolist()], np.int64
    )


def _states_of_objects(report: SyncReport, uids: Int64Array) -> Int64Array:
    """Returns (O,): the change of each object apart from its mesh."""
    from ..sync.report import OBJECT_ACTIONS

    columns = report.object_columns
    states = np.zeros(len(uids), np.int64)
    if not len(columns.session_uids):
        return states
    order = np.argsort(columns.session_uids)
    sorted_uids = columns.session_uids[order]
    places = np.minimum(np.searchsorted(sorted_uids, uids), len(order) - 1)
    is_known = sorted_uids[places] == uids
    # That a mesh was deformed is said by its tree.
    ranks = np.array([_RANK.get(action, 0) for action in OBJECT_ACTIONS])  # type: ignore[call-overload]
    states[is_known] = ranks[columns.actions[order[places[is_known]]]]
    return states


def _group(owners: Owners, uids: Int64Array, of_trees: Int64Array, of_objects: Int64Array) -> _Groups:
    """Groups objects. An object has several rows if its materials differ: only the first one counts."""
    _, first, object_of = np.unique(uids, return_index=True, return_inverse=True)
    objects = first[object_of].astype(np.int64)[owners.object_rows]
    meshes = owners.mesh_rows.astype(np.int64)
    pairs, where, inverse = np.unique(meshes * max(len(uids), 1) + objects, return_index=True, return_inverse=True)
    shares = np.bincount(inverse, weights=owners.shares, minlength=len(pairs)) if owners.shares is not None else None
    mesh_rows, members = meshes[where], objects[where]
    states = np.where(of_trees[mesh_rows] != 0, of_trees[mesh_rows], of_objects[members])
    keys = mesh_rows * len(STATES) + states
    order = np.argsort(keys, kind="stable")
    found, starts, counts = np.unique(keys[order], return_index=True, return_counts=True)
    sums = np.zeros(len(found)) if shares is None or not len(found) else np.add.reduceat(shares[order], starts)
    return _Groups(
        mesh_rows=found // len(STATES),
        states=found % len(STATES),
        starts=starts,
        counts=counts,
        shares=sums,
        members=members[order],
    )


def _removed(report: SyncReport) -> Iterator[UpdateRow]:
    """One row for all objects that are gone."""
    from ..sync.report import OBJECT_ACTIONS

    columns = report.object_columns
    gone = np.flatnonzero(columns.actions == OBJECT_ACTIONS.index("removed"))
    if len(gone):
        yield UpdateRow("removed", str(columns.names[gone[0]]), len(gone), np.empty(0, np.int64))


def _row_of_unseen(mesh: UnseenMesh) -> UpdateRow:
    uids = np.array([mesh.owner_uid], np.int64)
    return UpdateRow("unseen", mesh.owner, 1, uids, reason=mesh.reason)


# Update words --------------------------------------------------------------------------------------------------------
# The text of a row of the list of updates: the action, its reason, and advice for users.


NOTHING = "no action is needed"
# The action on a mesh's tree, or on the objects.
DONE: dict[State, str] = {
    "kept": "Unchanged",
    "unseen": "Left out",
    "masked": "The Ray Visibility was updated",
    "moved": "Moved",
    "recounted": "Instances were added or removed",
    "replaced": "Shows another mesh",
    "added": "Added",
    "removed": "Removed",
    "refitted": "The BVH was refitted",
    "rotated": "The BVH was refitted and improved by rotations",
    "partly_rebuilt": "The BVH was refitted, and parts of it were rebuilt",
    "rebuilt": "The BVH was rebuilt",
    "built": "A BVH was built",
}
_WHY: dict[State, str] = {
    "kept": "nothing has changed",
    "masked": "it is visible to other kinds of rays than before",
    "moved": "its transform changed; the BVH of its mesh is kept",
    "recounted": "there are more or fewer of them than before; the BVH of the mesh is kept",
    "replaced": "the BVH of that mesh existed already",
    "added": "the BVH of its mesh existed already",
    "removed": "deleted, unlinked or hidden",
}
_ADVICE: dict[State, str] = {
    "kept": sentence(NOTHING),
    "masked": f"{sentence(NOTHING)}: this takes hardly any time",
    "moved": f"{sentence(NOTHING)}: moving whole objects takes hardly any time",
    "recounted": f"{sentence(NOTHING)}: instances share one BVH",
    "replaced": f"{sentence(NOTHING)}: objects share the BVH of one mesh",
    "added": f"{sentence(NOTHING)}: objects share the BVH of one mesh",
    "removed": sentence(NOTHING),
    "unseen": "To see it in the image, show it, and enable a kind of ray in its Ray Visibility",
}


def what_was_done(row: UpdateRow) -> str:
    """A sentence: what, in which time, and why."""
    took = f" in {duration(row.milliseconds)}" if row.milliseconds else ""
    reason = row.reason or _WHY.get(row.state) or ("" if row.tree is None else row.tree.reason)
    return f"{DONE[row.state]}{took}: {reason}" if reason else f"{DONE[row.state]}{took}"


def what_to_do(row: UpdateRow) -> str:
    """Returns a sentence: how to make the next update faster, or that there is nothing to improve."""
    if row.state in _ADVICE:
        return _ADVICE[row.state]
    mesh = row.mesh
    if mesh is None:
        return sentence(NOTHING)
    if mesh.usage == "changing":
        return _about_changing(mesh.remade_by, mesh.usage_reason)
    if row.state == "built":
        return f"{sentence(NOTHING)}: the BVH is kept until the mesh changes"
    if mesh.action == "replaced":
        culprit = mesh.remade_by or "An edit or a script"
        return f"{culprit} changed the mesh: {NOTHING}, unless this happens in every frame"
    if row.state == "rebuilt":
        return f"{sentence(NOTHING)}: a new BVH pays off here"
    return f"{sentence(mesh.usage_reason)}: refitting is fast here, {NOTHING}"


def _about_changing(remade_by: str, reason: str) -> str:
    if remade_by:
        return f"{remade_by} changes the mesh in every frame: apply or bake it for faster updates"
    if reason.startswith("metaballs"):
        return f"{sentence(reason)}: convert them to a mesh for faster updates"
    return (
        f"{sentence(reason)}, but not by a modifier: if a script or handler replaces the mesh, let it move "
        "vertices instead for faster updates"
    )


def facts_of(row: UpdateRow) -> str:
    """Returns the size of the mesh, and its cost for rays."""
    found = []
    if row.mesh is not None:
        found.append(count_of(row.mesh.triangle_count, row.mesh.kind.removesuffix("s")))
        if row.mesh.kind == "curves" and row.tree is not None:
            found.append(primitives(row.tree.triangle_count, "curves"))
    if row.tree is not None and row.tree.byte_count:
        found.append(memory(row.tree.byte_count))
    if row.share > 0.0:
        found.append(f"{share(row.share)} of the camera rays' work")
    return ", ".join(found)
