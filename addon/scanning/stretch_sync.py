"""A `SceneSync` that goes from time sample to time sample, and moves objects between two of them.

Each time sample is evaluated and read once: the data at the end of an interval is reused at the beginning of the next
one, unless Blender has changed anything in between. So a scan of a static scene reads one sample per interval, and data
that Blender has not evaluated again is not read again.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal

from ..events.changes import listen, stop_listening, watch_again
from ..live.scene_sync import SceneSync, UpdateCommit
from ..sync.moments import MomentRecord, MotionSettings
from ..sync.motion import StretchWords, add_motion
from ..sync.records import (
    VISIBLE_TO_CAMERA,
    AttributeRequest,
    Float32Array,
    Float64Array,
    InstanceMotions,
    Int32Array,
    MeshRecord,
    SceneRecord,
)
from ..sync.scene_difference import AppliedDifference, SceneDifference
from .light.beams import Batch, BeamCaster
from .light.model import Light, RayNoise, axis_across
from .mount import Mount
from .outcomes import MissJudge, Outcome, Outcomes, mark_mount
from .patterns import Pattern, Rays
from .point_cloud import Collector
from .stretches import Path, drop_hidden

if TYPE_CHECKING:
    from perfect_bvh import Hits, Snapshot

    from ..sync.lookup import SceneLabel

# The position error of a scan's objects: it interpolates straight lines between time samples, and real paths may be
# curved.
#
# Does not depend on Blender.


IntArray = npt.NDArray[np.intp]

# A way leaves its chord by an eighth of its second difference.
CHORD = 1.0 / 8.0
# Of matrices of Blender, which are float32: how far those that are scaled alike may differ in that.
ROUNDING = 1e-5


class SceneBend:
    """Takes one stretch after the other; three consecutive time samples define the path through them."""

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
        """(2, 3), of vertices, or of spheres around points. What rests is asked for it once."""
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
    """Extrapolates (K, 3, 3): rotations continue evenly, and the other parts linearly."""
    scales = [matrices.transpose(0, 2, 1) @ matrices for matrices in (before, here)]
    largest = np.abs(scales[1]).max(axis=(1, 2), initial=0.0)
    is_rigid = np.abs(scales[0] - scales[1]).max(axis=(1, 2), initial=0.0) <= ROUNDING * largest
    led = np.empty_like(here)
    first, second = before[is_rigid], here[is_rigid]
    led[is_rigid] = second @ np.linalg.solve(first, second)  # the same turn again, for any interval
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


# Stretch sync --------------------------------------------------------------------------------------------------------


_BEGIN, _END = Fraction(0), Fraction(1)


class StretchSync(SceneSync):
    """A sync for scans: it does not watch Blender, so the user's edits do not make its snapshots stale.

    hidden: instances that no ray hits, in all later readings.
    """

    hidden: Mount | None = None

    def __init__(self, attributes: AttributeRequest) -> None:
        super().__init__(attributes, watch=False)
        self._ahead: SceneRecord | None = None  # the data at the last interval's end, if it is still current
        self._bend = SceneBend()
        listen(self)  # the reported changes decide which meshes the next reading may keep

    @property
    def scene_error(self) -> float:
        """See `PointCloud.scene_error`; of the intervals so far."""
        return self._bend.largest

    def begin_moment(self, depsgraph: Any, expected_rays: int) -> UpdateCommit:
        """Begins the update to the current scene, for a sensor that is no camera."""
        return self.begin_update(depsgraph, expected_rays, camera=_no_camera)

    def begin_stretch(self, depsgraph: Any, expected_rays: int, go_on: Callable[[], Any]) -> UpdateCommit:
        """Begins an interval: from the scene here, time 0 of the rays, to the next time sample, time 1.

        depsgraph: evaluated at the beginning of the interval. go_on: makes Blender evaluate the end, and returns the
        scene to read there. Blender stays at the end. All motion is followed: Cycles' switches of motion blur are only
        for its images. Objects whose motion cannot be followed do not move, and are listed in `warnings`.
        """
        return self._begin(lambda: self._read_stretch(depsgraph, go_on), expected_rays)

    def _read_stretch(self, depsgraph: Any, go_on: Callable[[], Any]) -> SceneRecord:
        watch_again()  # without handlers no changes were reported
        record = self._read_here(depsgraph) if self._ahead is None else self._ahead
        ahead = self._read_here(go_on())
        self._ahead = ahead
        count = len(record.objects)
        settings = MotionSettings(steps=np.full(count, 2, np.int32), deforms=np.ones(count, np.bool_))
        return add_motion(record, {_BEGIN: _moment(record), _END: _moment(ahead)}, settings, StretchWords)

    def _read_record(self, depsgraph: Any, view: dict[str, Any], **how: Any) -> SceneRecord:
        record = super()._read_record(depsgraph, view, **how)
        return record if self.hidden is None else self.hidden.hide(record)

    def _read_here(self, depsgraph: Any) -> SceneRecord:
        return self._read_record(depsgraph, {"camera": _no_camera}, cache=self._cache)

    def _apply(self, difference: SceneDifference) -> AppliedDifference:
        self._bend.add(difference.last, difference.record, difference.instances.held_rows)
        return super()._apply(difference)

    def close(self) -> None:
        """Forgets the scene, and listens no more."""
        stop_listening(self)
        self._ahead = None
        super().close()

    # After any change, the data that was read ahead is not the beginning of the next interval.

    def on_change(self, what: str) -> None:
        """Keeps the current interval: it shows the data that was read."""
        self._ahead = None

    def on_file_change(self) -> None:
        """The next stretch finds no scene, and says so."""
        self._ahead = None


def _moment(record: SceneRecord) -> MomentRecord:
    return MomentRecord(record.meshes, record.objects, record.instances)


def _no_camera(_: Any) -> None:
    """Whether the scene has a camera is nothing to such a sensor."""


# Traced stretch ------------------------------------------------------------------------------------------------------
# Casts the rays of an interval, batch after batch, and collects their hits. Does not depend on Blender.


# The number of rays of a batch: a quarter of a million take a fraction of a second.
RAYS_IN_A_STEP = 1 << 18
FIELDS = ("instance_ids", "mesh_ids", "primitive_ids", "geometric_normals", "positions", "distances")


@dataclass(frozen=True, slots=True)
class TracedStretch:
    """The scene that is traced, and the sensor's poses. shares: (R,), the time of each ray in the interval, 0 to 1.

    is_mount: (I,) bool, the instances of the record that belong to the mount; None if none does.
    """

    sync: SceneSync
    snapshot: Snapshot
    pattern: Pattern
    rays: Rays
    path: Path
    shares: Float64Array
    labels: Mapping[str, SceneLabel]
    threads: int
    is_mount: npt.NDArray[np.bool_] | None = None

    def collect(self, collector: Collector, light: Light | None, random: RayNoise) -> Iterator[tuple[int, float]]:
        """Yields after each batch the number of rays cast so far, and the distance of its farthest point."""
        return self._hits(collector) if light is None else self._returns(collector, light, random)

    def _hits(self, collector: Collector) -> Iterator[tuple[int, float]]:
        """Collects the hits of ideal rays."""
        rays, snapshot = self.rays, self.snapshot
        origins, directions = self.path.place(rays.origins, rays.directions, self.shares)
        for first in range(0, len(rays), RAYS_IN_A_STEP):
            rows = slice(first, first + RAYS_IN_A_STEP)
            times = self.shares[rows] if self.moves else 0.0
            hits = snapshot.cast_rays(
                origins[rows],
                directions[rows],
                t_min=rays.t_min,
                t_max=rays.t_max,
                mask=VISIBLE_TO_CAMERA,
                times=times,
                fields=FIELDS,
                threads=self.threads,
            )
            eyes = self._eyes(rows)
            if eyes is not None:
                drop_hidden(hits, eyes, snapshot, VISIBLE_TO_CAMERA, times, self.threads)
            part = rays.part(rows)
            outcomes = np.full(len(part), Outcome.ON_OBJECTS, np.int8)
            judge = MissJudge(snapshot, VISIBLE_TO_CAMERA, self.threads)
            where = (part, origins[rows], directions[rows], times)
            judge.mark(outcomes, np.flatnonzero(~hits.is_hit), *where, has_second_eye=eyes is not None)
            self._count(collector, outcomes, np.arange(len(part)), hits)
            collector.add(hits, part, directions[rows], self.sync, self.labels)
            yield first + RAYS_IN_A_STEP, float(np.max(hits.distances, where=hits.is_hit, initial=0.0))

    def _returns(self, collector: Collector, light: Light, random: RayNoise) -> Iterator[tuple[int, float]]:
        """Collects the returns of beams of light."""
        rays = self.rays
        origins, directions = self.path.place(rays.origins, rays.directions, self.shares)
        axes = axis_across(rays.directions)
        _, across = self.path.place(axes, axes, self.shares)
        times = self.shares if self.moves else np.zeros(len(rays))
        caster = BeamCaster(light, random, self.sync, self.snapshot, VISIBLE_TO_CAMERA, self.threads)
        size = max(1, RAYS_IN_A_STEP // light.beam.rays)
        for first in range(0, len(rays), size):
            rows = slice(first, first + size)
            part = rays.part(rows)
            of_scan = collector.next_ray_id, self._eyes(rows)
            returns = caster.cast(Batch(part, origins[rows], directions[rows], across[rows], times[rows], *of_scan))
            self._count(collector, returns.outcomes, returns.beams, returns.hits)
            collector.add_returns(returns, part, self.sync, self.labels)
            yield first + size, float(np.max(returns.hits.distances, initial=0.0))

    def _count(self, collector: Collector, outcomes: Outcomes, ray_rows: npt.NDArray[np.int64], hits: Hits) -> None:
        """Counts the outcomes of a batch. ray_rows: of each hit, which of the rays it is of."""
        if self.is_mount is not None:
            rows = np.flatnonzero(hits.is_hit)
            mark_mount(outcomes, ray_rows[rows], self.is_mount[self.sync.instance_rows(hits.instance_ids[rows])])
        collector.count(outcomes)

    @property
    def moves(self) -> bool:
        """Whether anything moves in it."""
        return self.sync.record.motion.count > 0

    def _eyes(self, rows: slice) -> Float64Array | None:
        """(R, 3) where the second eye is, None if there is none."""
        baseline, shares = self.pattern.baseline, self.shares[rows]
        if not baseline:
            return None
        aside = np.broadcast_to([baseline, 0.0, 0.0], (len(shares), 3))
        return self.path.place(aside, aside, shares)[0]
