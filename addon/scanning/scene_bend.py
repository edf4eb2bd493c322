"""How far what is scanned may be from where a scan has it: what straight ways between key moments leave of curved ones.

Knows no Blender.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from ..sync.records import Float32Array, Float64Array, InstanceMotions, Int32Array, MeshRecord, SceneRecord

IntArray = npt.NDArray[np.intp]

# A way leaves its chord by an eighth of its second difference.
CHORD = 1.0 / 8.0
# Of matrices of Blender, which are float32: how far those that are scaled alike may differ in that.
ROUNDING = 1e-5


class SceneBend:
    """Takes one stretch after the other; each three key moments in a row tell of the way through them."""

    def __init__(self) -> None:
        self.largest = 0.0
        """In world units, see `PointCloud.scene_error`."""
        self._boxes: dict[Hashable, tuple[Float32Array, Float64Array]] = {}

    def add(self, before: SceneRecord | None, record: SceneRecord, held_rows: Int32Array) -> None:
        """before: the stretch before, if there was one. held_rows: (I,) its row of each instance, -1 for none."""
        if before is None or not (before.motion.count or record.motion.count):
            return
        bends = np.zeros(len(record.instances))
        shapes = shape_bends(before, record)
        (deforming,) = np.nonzero(shapes[record.instances.mesh_indices])
        linear = record.instances.transforms[deforming, :, :3].astype(np.float64)
        bends[deforming] = shapes[record.instances.mesh_indices[deforming]] * np.linalg.norm(linear, 2, axis=(1, 2))
        rows, ways = _ways(before, record, held_rows)
        if len(rows):
            bends[rows] += instance_bends(*ways, self._corners(record, rows))
        self.largest = max(self.largest, float(bends.max(initial=0.0)))

    def _corners(self, record: SceneRecord, rows: IntArray) -> Float64Array:
        """(K, 8, 3): of the boxes of what these instances show."""
        shown, places = np.unique(record.instances.mesh_indices[rows], return_inverse=True)
        boxes = np.stack([self._box(record.meshes[row]) for row in shown])
        bits = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
        return np.asarray(boxes[:, bits, np.arange(3)][places.reshape(-1)])

    def _box(self, mesh: MeshRecord) -> Float64Array:
        """(2, 3), of vertices, or of balls around points. What rests is asked for it once."""
        known = self._boxes.get(mesh.key)
        if known is None or known[0] is not mesh.positions:
            wide = 0.0 if mesh.radii is None else float(mesh.radii.max(initial=0.0))
            lowest = mesh.positions.min(axis=0, initial=np.inf).astype(np.float64) - wide
            box = np.stack([lowest, mesh.positions.max(axis=0, initial=-np.inf).astype(np.float64) + wide])
            known = self._boxes[mesh.key] = mesh.positions, box if len(mesh.positions) else np.zeros((2, 3))
        return known[1]


def instance_bends(
    before: Float64Array, here: Float64Array, after: Float64Array, corners: Float64Array
) -> Float64Array:
    """(K,): how far the corners, (K, N, 3), may be off, of instances whose transforms, (K, 3, 4), are three in a row.

    An even turn is followed exactly: what counts is how far the third is from where the first two lead.
    """
    led = 2.0 * here - before
    turning = (before[:, :, :3] != here[:, :, :3]).any(axis=(1, 2))
    led[turning, :, :3] = _turned_on(before[turning, :, :3], here[turning, :, :3])
    off = after - led
    far = np.einsum("kij,knj->kni", off[:, :, :3], corners) + off[:, None, :, 3]
    return np.asarray(np.linalg.norm(far, axis=2).max(axis=1) * CHORD)


def _turned_on(before: Float64Array, here: Float64Array) -> Float64Array:
    """(K, 3, 3): what comes next, where rotations go on evenly and stretches in straight lines."""
    scales = [matrices.transpose(0, 2, 1) @ matrices for matrices in (before, here)]
    largest = np.abs(scales[1]).max(axis=(1, 2), initial=0.0)
    is_rigid = np.abs(scales[0] - scales[1]).max(axis=(1, 2), initial=0.0) <= ROUNDING * largest
    led = np.empty_like(here)
    first, second = before[is_rigid], here[is_rigid]
    led[is_rigid] = second @ np.linalg.solve(first, second)  # the same turn again, whatever the stretch
    first, second = before[~is_rigid], here[~is_rigid]
    turns = [_rotations(first), _rotations(second)]
    stretches = [turn.transpose(0, 2, 1) @ matrices for turn, matrices in zip(turns, (first, second), strict=True)]
    led[~is_rigid] = turns[1] @ turns[0].transpose(0, 2, 1) @ turns[1] @ (2.0 * stretches[1] - stretches[0])
    return led


def _rotations(matrices: Float64Array) -> Float64Array:
    """(K, 3, 3): of the polar decomposition, without a mirror, as the engine takes matrices apart."""
    u, _, vt = np.linalg.svd(matrices)
    found = u @ vt
    return np.asarray(found * np.sign(np.linalg.det(found))[:, None, None])


def shape_bends(before: SceneRecord, record: SceneRecord) -> Float64Array:
    """(M,): how far vertices of each mesh may be off, in object space; 0 of those that do not deform."""
    bends = np.zeros(len(record.meshes))
    ended = {before.meshes[motion.row].key: motion for motion in before.motion.meshes}
    begun = {motion.row: motion for motion in record.motion.meshes}
    known = {mesh.key: mesh for mesh in before.meshes}
    for row, mesh in enumerate(record.meshes):
        if mesh.key not in known or not (mesh.key in ended or row in begun):
            continue
        earlier, last, now = known[mesh.key], ended.get(mesh.key), begun.get(row)
        arrived = earlier.positions if last is None else last.positions[-1]
        if not are_equal(np.ascontiguousarray(arrived), mesh.positions):
            continue  # it has jumped: it was remade, or edited by hand
        after = mesh.positions if now is None else now.positions[-1]
        bends[row] = _largest_bend(earlier.positions, mesh.positions, after)
        if mesh.radii is not None and earlier.radii is not None:
            wide = mesh.radii if now is None or now.radii is None else now.radii[-1]
            bends[row] += _largest_bend(earlier.radii[:, None], mesh.radii[:, None], wide[:, None])
    return bends


def _largest_bend(before: Float32Array, here: Float32Array, after: Float32Array) -> float:
    second = before.astype(np.float64) - 2.0 * here + after
    return float(np.sqrt(np.einsum("vi,vi->v", second, second).max(initial=0.0))) * CHORD


def _ways(
    before: SceneRecord, record: SceneRecord, held_rows: Int32Array
) -> tuple[IntArray, tuple[Float64Array, Float64Array, Float64Array]]:
    """Rows of the instances that move in either stretch and are there in both, with their transforms, (K, 3, 4) each.

    None that has jumped in between: it could not be followed, or was edited by hand.
    """
    moved = np.zeros(len(held_rows), np.bool_)
    for motions in record.motion.instances:
        moved[motions.rows] = True
    had_moved = np.zeros(len(before.instances) + 1, np.bool_)  # the last is of those that were not there
    for motions in before.motion.instances:
        had_moved[motions.rows] = True
    rows = np.flatnonzero((moved | had_moved[held_rows]) & (held_rows >= 0))
    earlier, here = before.instances.transforms[held_rows[rows]], record.instances.transforms[rows]
    arrived = _ends(before.motion.instances, held_rows[rows], earlier)
    after = _ends(record.motion.instances, rows, here)
    stays = (arrived == here).all(axis=(1, 2))
    parts: Any = tuple(part[stays].astype(np.float64) for part in (earlier, here, after))
    return rows[stays], parts


def _ends(motions: Sequence[InstanceMotions], rows: npt.NDArray[Any], at_rest: Float32Array) -> Float32Array:
    """(K, 3, 4): where the motions of these instances end; those without one are at rest."""
    found = at_rest.copy()
    for one in motions:
        places = np.minimum(np.searchsorted(one.rows, rows), len(one.rows) - 1)
        moves = one.rows[places] == rows
        found[moves] = one.transforms[-1][places[moves]]
    return found
