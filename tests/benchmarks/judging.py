"""How many of a peer's answers are wrong, by the tests' double-precision oracle, on a sample of the rays.

Wrong is what tests/oracles/brute_force.py says: hit or miss differs, or t by more than a derived bound, for rays that
pass every edge by more than rounding the ray can move them. Only triangles whose box the ray comes near are looked at
closely: all others are surely missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from benchmarks.meshes import BenchMesh
from benchmarks.peers import Peer
from benchmarks.rays import Rays
from oracles.brute_force import ULP, WorldTriangles, judge, judge_occlusions


@dataclass(frozen=True)
class Wrong:
    """Of `judged` rays `wrong` were answered wrongly; for `doubtful` the oracle allows several answers."""

    judged: int
    wrong: int
    doubtful: int

    @property
    def per_million(self) -> float:
        return 1e6 * self.wrong / self.judged if self.judged else 0.0

    def as_json(self) -> dict[str, float]:
        return {**asdict(self), "per_million": self.per_million}


class Judge:
    """Knows the triangles of one mesh."""

    def __init__(self, mesh: BenchMesh) -> None:
        self._world = WorldTriangles.of([(0, mesh.positions, mesh.triangles, np.eye(4), 0xFFFFFFFF)])
        self._lower = self._world.corners.min(axis=1)
        self._upper = self._world.corners.max(axis=1)

    def count_wrong(self, rays: Rays, peers: Sequence[Peer], sample: int) -> dict[str, Wrong]:
        """The same sample, evenly spread over the rays, for every peer."""
        rows = np.unique(np.linspace(0, len(rays) - 1, min(sample, len(rays))).astype(np.intp))
        picked = rays.pick(rows)
        totals = np.zeros((len(peers), 2), np.int64)
        if rays.is_any_hit:
            occluded = np.array([peer.occluded(picked) for peer in peers])
        else:
            answers = [peer.answers(picked) for peer in peers]
            t, ids = np.array([a.t for a in answers]), np.array([a.primitive_ids for a in answers])
        for row in range(len(rows)):
            near = self._near(picked.origins[row], picked.directions[row])
            columns = [np.tile(each[row], (len(peers), 1)) for each in (picked.origins, picked.directions)]
            if rays.is_any_hit:
                verdict = judge_occlusions(near, *columns, occluded[:, row], t_max=rays.t_max)
            else:
                found = ids[:, row]
                instances = np.where(found >= 0, 0, -1)
                verdict = judge(near, *columns, t[:, row], instances, found, t_max=rays.t_max)
            totals += np.stack([verdict.wrong, verdict.doubtful], axis=1)
        return {
            peer.name: Wrong(len(rows), int(wrong), int(doubtful))
            for peer, (wrong, doubtful) in zip(peers, totals, strict=True)
        }

    def _near(self, origin: npt.NDArray[np.float32], direction: npt.NDArray[np.float32]) -> WorldTriangles:
        """The triangles whose box, grown by more than the oracle's margin, the ray's line meets."""
        start, along = origin.astype(np.float64), direction.astype(np.float64)
        margin = 16.0 * ULP * (self._world.scale + np.abs(start).max())[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (self._lower - margin - start) / along, (self._upper + margin - start) / along
        # A direction without a part along an axis: 0/0 is on the box's side, and stays; others are infinite.
        enter = np.fmax.reduce(np.fmin(first, second), axis=1)
        leave = np.fmin.reduce(np.fmax(first, second), axis=1)
        rows = np.flatnonzero((enter <= leave) & (leave >= 0.0))
        world = self._world
        parts = (world.corners, world.instance_ids, world.primitive_ids, world.masks, world.scale)
        return WorldTriangles(*(part[rows] for part in parts))
