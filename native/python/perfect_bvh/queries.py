"""The queries of a committed scene. `Scene` and `Snapshot` have the same ones."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Batch, Progress, point_batch, ray_batch, share_of
from ._checks import LARGEST_COUNT, check_count, check_number
from .audit import AUDITED_FIELDS, audit_answers
from .closest_points import ClosestPoints, allocate_closest
from .hits import Hits, Out, allocate_columns, check_out, check_overlap, fields_of
from .ray_walk import RayWalk
from .report import SceneStatistics

Cull = Literal["none", "back"]

ALL_MASK = 0xFFFFFFFF


class Intersections(NamedTuple):
    """The result of `list_intersections`: `hits, ray_splits = ...`.

    Attributes:
        hits: One row a hit, ray after ray in C order.
        ray_splits: (R + 1,) int64: ray i's hits are the rows from ray_splits[i] to ray_splits[i + 1], nearest first.
    """

    hits: Hits
    ray_splits: npt.NDArray[np.int64]

    @property
    def ray_indices(self) -> npt.NDArray[np.int64]:
        """(hits,) int64: the index of each hit's ray in the flattened batch."""
        return np.repeat(np.arange(len(self.ray_splits) - 1), np.diff(self.ray_splits))


class Queries:
    """The queries, all of them safe to call from several threads at once.

    Shared arguments. All after the directions, or after the points, are keyword-only:

    origins, directions: (..., 3), broadcast against each other; float32 or float64. Directions need not be
        unit vectors: t is in multiples of their length.
    t_min, t_max: numbers or (...), float32: a hit counts if t_min <= t <= t_max, and t is finite as a float32.
    mask: 32 bits or (...): an instance is seen if its mask shares a bit with the ray's.
    cull: "back" passes through triangles seen from behind (clockwise).
    times: numbers or (...), float32, from 0, where the shutter opens, to 1, where it closes. Each ray, or point, meets
        the scene at its own time, see `Scene.set_mesh_motion` and `Scene.set_instance_motion`. Objects without motion
        are the same at all times.
    threads: the largest number of threads; 0 for all that the process may use.
    progress: called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

    Rays that are not finite, have no direction, an empty range or a time outside 0 to 1 are misses. Memory: the
    returned arrays and the given ones. Given arrays are read in place, including one vector for all rays and vectors
    with gaps between them (columns of a wider array). Other dtypes and partly broadcast arrays are copied, a million
    rays at a time.

    All raise ValueError for arrays of the wrong shape or kind, and on a `Scene` StaleSceneError if edits are pending.
    """

    __slots__ = ()
    _strategy = "auto"

    def _committed(self) -> _core.Snapshot:
        raise NotImplementedError

    def cast_rays(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        times: npt.ArrayLike = 0.0,
        fields: Iterable[str] | None = None,
        out: Out | None = None,
        audit: float = 0.0,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> Hits:
        """Finds the first surface that each ray hits. For the other arguments see `Queries`.

        Watertight: no ray passes between triangles that share an edge or a vertex. Whether a ray hits a triangle is
        exact, with two limits for float64: direction components below 2^-300 (5e-91) of the longest one count as zero,
        and origin components below 1e-90 count only after rounding. Directions shorter than 2^-1022 (2e-308) hit
        nothing. Instances that are scaled below 1e-40 are not exact: their coordinates have no digits left.

        Always returns `Hits` with one row a ray. Invalid rays are misses, counted in `invalid_count`. With `out` the
        result is a new `Hits` around the given arrays.

        Args:
            fields: Names of the fields to compute; None for the usual ones, see `Hits`. Other fields cost nothing: a
                million coherent rays take a third less time for ("t_hit", "primitive_ids") alone. The most expensive of
                the usual ones is geometric_normals, which reads the triangle's corners from memory.
            out: Arrays to write fields into and return, so that repeated calls use the same memory: a dict of arrays
                by field name, or the `Hits` of an earlier call, whose fields are then computed if `fields` is None.
                Each must be contiguous, of the field's dtype and shape (...) or (..., 2 or 3), and may not overlap
                another one or the rays.
            audit: The share of rays, 0 to 1, to check again in double precision and without any tree. The result is in
                `audit` of the answer. It costs about 5 ns for each checked ray and triangle of the scene. Rays that
                come near curves or points are not judged.
        """
        audit = check_number("cast_rays", "audit", audit, 0.0, 1.0)
        batch = ray_batch("cast_rays", origins, directions, t_min, t_max, mask, times, cull, threads)
        names = fields_of(fields, out)
        hidden = [name for name in AUDITED_FIELDS if audit > 0.0 and name not in names]
        columns = allocate_columns("cast_rays", (*names, *hidden), batch.shape, out, batch.arrays)
        snapshot, invalid, packed = self._committed(), 0, 0
        for piece in batch.pieces(share_of(progress, 0.0, 0.5) if audit > 0.0 else progress):
            part = {name: column[piece.index] for name, column in columns.items()}
            counts = snapshot.cast_rays((*piece.columns, cull), self._strategy, part, threads, piece.progress)
            invalid, packed = invalid + counts[0], packed + counts[1]
        audited = None
        if audit > 0.0:
            audited = audit_answers(snapshot, batch, cull, columns, audit, threads, share_of(progress, 0.5, 0.5))
            columns = {name: columns[name] for name in names}
        return Hits(columns, invalid, snapshot.generation, snapshot.scene_id, packed, audited)

    def test_occlusions(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        times: npt.ArrayLike = 0.0,
        out: npt.NDArray[np.bool_] | None = None,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Tests whether anything lies on each ray between t_min and t_max: (...) bool. Other arguments: see `Queries`.

        True exactly where `cast_rays` finds a hit, but faster.

        Args:
            out: An array to write into and return, so that repeated calls use the same memory: contiguous, bool, of
                the rays' shape (...). It may not overlap the rays.
        """
        name = "test_occlusions"
        batch = ray_batch(name, origins, directions, t_min, t_max, mask, times, cull, threads)
        if out is None:
            occluded = np.empty(batch.shape, np.bool_)
        else:
            occluded = check_out(name, "out", out, batch.shape, np.bool_)
            check_overlap(name, "out", occluded, batch.arrays)
        snapshot = self._committed()
        for piece in batch.pieces(progress):
            part = occluded[piece.index]
            snapshot.test_occlusions((*piece.columns, cull), self._strategy, part, threads, piece.progress)
        return occluded

    def count_intersections(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        times: npt.ArrayLike = 0.0,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> npt.NDArray[np.int32]:
        """Counts the triangles on each ray between t_min and t_max: (...) int32. Arguments: see `Queries`.

        Each triangle counts once; a ray through an edge meets each of the triangles at it. Invalid rays have 0.
        """
        batch = ray_batch("count_intersections", origins, directions, t_min, t_max, mask, times, cull, threads)
        counts = np.empty(batch.shape, np.int32)
        _count(self._committed(), batch, cull, counts, threads, progress)
        return counts

    def list_intersections(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        times: npt.ArrayLike = 0.0,
        fields: Iterable[str] | None = None,
        max_hits: int | None = None,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> Intersections:
        """Lists all surfaces on each ray between t_min and t_max, nearest first. For the other arguments see `Queries`.

        Returns `Intersections`: hits and ray_splits. Each triangle appears once a ray. A ray through an edge meets each
        of the triangles at it. A curve or point has a hit where the ray enters and one where it leaves. Surfaces inside
        the same curve's next segment have none; the first segment of a cyclic curve follows its last. At equal t the
        smallest (order, instance id, primitive) comes first, so a ray's first row is the answer of `cast_rays`. The
        rays are traced twice, first to count the hits: this needs no more memory than the result.

        Args:
            fields: Names of the fields to compute for each hit; None for the usual ones, see `Hits`. The fields that
                measure a ray's cost, nodes_visited and primitives_tested, are not available: they belong to no single
                hit.
            max_hits: The largest number of hits of each ray, the nearest ones; None for all.
        """
        name = "list_intersections"
        if max_hits is not None:
            max_hits = min(check_count(name, "max_hits", max_hits, 0, 2**63 - 1), LARGEST_COUNT)
        batch = ray_batch(name, origins, directions, t_min, t_max, mask, times, cull, threads)
        names = fields_of(fields)
        costs = [field for field in names if field in ("nodes_visited", "primitives_tested")]
        if costs:
            raise ValueError(
                f"{name}: fields has {costs[0]!r}, which belongs to rays, not to hits; request it from cast_rays"
            )
        allocate_columns(name, names, (0,), None)  # refuses wrong names before any work
        snapshot = self._committed()
        counts = np.empty(batch.shape, np.int32)
        _count(snapshot, batch, cull, counts, threads, share_of(progress, 0.0, 0.5))
        splits = np.zeros(batch.count + 1, np.int64)
        flat = counts.reshape(-1)
        np.cumsum(flat if max_hits is None else np.minimum(flat, max_hits, out=flat), out=splits[1:])
        del counts, flat
        columns = allocate_columns(name, names, (int(splits[-1]),), None)
        invalid = 0
        for piece in batch.pieces(share_of(progress, 0.5, 0.5)):
            first, last = splits[piece.rows.start], splits[piece.rows.stop]
            part = {field: column[first:last] for field, column in columns.items()}
            inner = splits[piece.rows.start : piece.rows.stop + 1]
            inner = inner if first == 0 else inner - first
            invalid += snapshot.list_intersections((*piece.columns, cull), inner, part, threads, piece.progress)
        return Intersections(Hits(columns, invalid, snapshot.generation, snapshot.scene_id), splits)

    def walk_ray(
        self,
        origin: npt.ArrayLike,
        direction: npt.ArrayLike,
        *,
        t_min: float = 0.0,
        t_max: float = np.inf,
        mask: int = ALL_MASK,
        cull: Cull = "none",
        time: float = 0.0,
        progress: Progress | None = None,
    ) -> RayWalk:
        """Records the path of one ray through the trees: each box and each triangle that it tests, in order.

        Returns `RayWalk`. It ends at the hit that `cast_rays` answers. Its numbers of nodes and triangles equal the
        ray's nodes_visited and primitives_tested. An invalid ray hits nothing. Each event takes some 300 bytes; a ray
        through a usual scene has some hundreds of events.

        Args:
            origin, direction: (3,), float32 or float64.
            time: Within the shutter, 0 to 1. For the other arguments see `Queries`.
        """
        batch = ray_batch("walk_ray", origin, direction, t_min, t_max, mask, time, cull, 0)
        if batch.shape != ():
            raise ValueError(f"walk_ray: origin and direction must have shape (3,), got rays of shape {batch.shape}")
        piece = next(batch.pieces(progress))
        return RayWalk(**self._committed().walk_ray((*piece.columns, cull), progress))

    def compute_closest_points(
        self,
        points: npt.ArrayLike,
        *,
        max_distance: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        times: npt.ArrayLike = 0.0,
        threads: int = 0,
        progress: Progress | None = None,
    ) -> ClosestPoints:
        """Finds the nearest point of the scene to each point, and its distance. For threads, progress see `Queries`.

        Returns `ClosestPoints`. Distances are in world space, in double, through any transform, sheared or scaled
        unevenly. Curves and points are solid: a point inside one is its own nearest point, at distance 0. At equal
        distance the smallest (order, instance id, primitive) wins. Nothing is found for points that are not finite,
        that have a negative distance, or that are so far away (1e150) that the square of the distance overflows.

        Args:
            points: (..., 3), float32 or float64.
            max_distance: A number or (...): nothing farther away is found. A smaller limit is faster.
            mask: 32 bits or (...): an instance is seen if its mask shares a bit with the point's.

        Raises:
            ValueError: For arrays of the wrong shape or kind, and on a `Scene` StaleSceneError if edits are pending.
        """
        batch = point_batch("compute_closest_points", points, max_distance, mask, times, threads)
        columns = allocate_closest(batch.shape)
        snapshot, invalid = self._committed(), 0
        for piece in batch.pieces(progress):
            part = {name: column[piece.index] for name, column in columns.items()}
            where, distances, masks, moments = piece.columns
            invalid += snapshot.compute_closest_points(where, distances, masks, moments, part, threads, piece.progress)
        return ClosestPoints(
            **columns, invalid_count=invalid, generation=snapshot.generation, scene_id=snapshot.scene_id
        )

    def statistics(
        self,
        detailed: bool = False,
        *,
        progress: Progress | None = None,
    ) -> SceneStatistics:
        """Returns sizes and quality of all trees, as `SceneStatistics`.

        Args:
            detailed: Also compute end-point overlap and leaf-count variability (Aila, Karras and Laine 2013). They take
                microseconds for each triangle. Binary trees that are no longer kept are rebuilt for them, with the same
                settings.
            progress: Called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

        Raises:
            StaleSceneError: (on a `Scene`) if edits are pending.
        """
        return SceneStatistics.from_core(_core.measure(self._committed(), bool(detailed), progress))


def _count(
    snapshot: _core.Snapshot,
    batch: Batch,
    cull: str,
    counts: npt.NDArray[np.int32],
    threads: int,
    progress: Progress | None,
) -> None:
    for piece in batch.pieces(progress):
        part = counts[piece.index]
        snapshot.count_intersections((*piece.columns, cull), part, threads, piece.progress)
