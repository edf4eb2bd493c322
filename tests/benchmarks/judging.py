"""How many of a peer's answers are wrong, by the tests' double-precision oracle, on a sample of the rays.

Wrong means, as in tests/oracles/brute_force.py: hit or miss differs, or t by more than a derived bound, for rays that
pass every edge by more than rounding the ray can move them. Only triangles whose box the ray comes near are looked at
closely: all others are surely missed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from benchmarks.meshes import BenchMesh
from benchmarks.peers import Answers
from benchmarks.rays import Rays
from oracles.brute_force import ROUNDING_OF_FLOATS, ULP, WorldTriangles, judge, judge_occlusions


@dataclass(frozen=True)
class Wrong:
    """Of `judged` rays `wrong` were answered wrongly; for `ambiguous` the oracle allows several answers."""

    judged: int
    wrong: int
    ambiguous: int

    @property
    def per_million(self) -> float:
        return 1e6 * self.wrong / self.judged if self.judged else 0.0

    def as_json(self) -> dict[str, float]:
        return {**asdict(self), "per_million": self.per_million}


def pick_sample(rays: Rays, count: int) -> Rays:
    """About this number of rays, spread evenly in blocks of 64 neighbours, as packets of rays need them."""
    if count >= len(rays):
        return rays
    block = min(64, count)
    starts = np.linspace(0, len(rays) - block, count // block).astype(np.intp)
    return rays.pick(np.unique(starts[:, None] + np.arange(block)))


class Judge:
    """Knows the triangles of one mesh in many places. transforms: (I, 4, 4), of instances 0, 1, ..."""

    def __init__(self, mesh: BenchMesh, transforms: npt.NDArray[np.float64] | None = None) -> None:
        self._mesh = mesh
        self._transforms = np.eye(4)[None] if transforms is None else transforms
        box = np.stack([mesh.positions.min(axis=0), mesh.positions.max(axis=0)]).astype(np.float64)
        corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        turns, places = self._transforms[:, :3, :3], self._transforms[:, None, :3, 3]
        placed = np.einsum("cj,nij->nci", corners, turns) + places
        self._boxes = _Boxes(placed.min(axis=1), placed.max(axis=1), np.abs(placed).max(axis=(1, 2)))
        self._part = lru_cache(maxsize=256)(self._make_part)

    def count_wrong(self, rays: Rays, answers: Mapping[str, Answers]) -> dict[str, Wrong]:
        """Counts the wrong answers of each peer to the same rays."""
        columns = list(answers.values())
        t, instances, ids = (
            np.array([getattr(each, name) for each in columns]) for name in ("t", "instance_ids", "primitive_ids")
        )
        totals = np.zeros((len(columns), 2), np.int64)
        for row in range(len(rays)):
            near = self._near(rays.origins[row], rays.directions[row])
            same = [np.tile(each[row], (len(columns), 1)) for each in (rays.origins, rays.directions)]
            if rays.is_any_hit:
                verdict = judge_occlusions(near, *same, ids[:, row] >= 0, t_max=rays.t_max)
            else:
                verdict = judge(near, *same, t[:, row], instances[:, row], ids[:, row], t_max=rays.t_max)
            totals += np.stack([verdict.wrong, verdict.ambiguous], axis=1)
        counts = zip(answers, totals, strict=True)
        return {name: Wrong(len(rays), int(wrong), int(ambiguous)) for name, (wrong, ambiguous) in counts}

    def _make_part(self, instance: int) -> tuple[WorldTriangles, _Boxes]:
        """One instance's triangles, and their boxes."""
        mesh, transform = self._mesh, self._transforms[instance]
        parts = [(instance, mesh.positions, mesh.triangles, transform, 0xFFFFFFFF)]
        world = WorldTriangles.of(parts, ROUNDING_OF_FLOATS)
        return world, _Boxes(world.corners.min(axis=1), world.corners.max(axis=1), world.scale)

    def _near(self, origin: npt.NDArray[np.float32], direction: npt.NDArray[np.float32]) -> WorldTriangles:
        """The triangles whose box, grown by more than the oracle's margin, the ray meets."""
        start, along = origin.astype(np.float64), direction.astype(np.float64)
        parts = []
        for instance in self._boxes.met(start, along):
            world, boxes = self._part(int(instance))
            rows = boxes.met(start, along)
            columns = (world.corners, world.instance_ids, world.primitive_ids, world.masks, world.scale)
            parts.append([column[rows] for column in columns])
        if not parts:
            return WorldTriangles.of([])
        return WorldTriangles(*(np.concatenate(columns) for columns in zip(*parts, strict=True)), ROUNDING_OF_FLOATS)


@dataclass(frozen=True)
class _Boxes:
    """lower, upper: (B, 3). scale: (B,), the largest coordinate that rounding was relative to."""

    lower: npt.NDArray[np.float64]
    upper: npt.NDArray[np.float64]
    scale: npt.NDArray[np.float64]

    def met(self, start: npt.NDArray[np.float64], along: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
        """Rows of the boxes that a ray meets, or passes closer by than the oracle's margin."""
        margin = 16.0 * ULP * (self.scale + np.abs(start).max())[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (self.lower - margin - start) / along, (self.upper + margin - start) / along
        # Without a part along an axis: 0/0 is on the box's side, and counts for nothing; others are infinite.
        enter = np.fmax.reduce(np.fmin(first, second), axis=1)
        leave = np.fmin.reduce(np.fmax(first, second), axis=1)
        return np.flatnonzero((enter <= leave) & (leave >= 0.0))
