"""Casts the rays of a stretch, batch after batch, and has what they meet collected. Knows no Blender."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..sync.records import VISIBLE_TO_CAMERA
from .collector import Collector
from .light.beam_rays import axis_across
from .light.beams import Batch, BeamCaster
from .light.model import Light
from .light.ray_noise import RayNoise
from .outcomes import MissJudge, Outcome, Outcomes, mark_mount
from .patterns import Float64Array, Pattern, Rays
from .poses import Path
from .second_eye import drop_hidden

if TYPE_CHECKING:
    from perfect_bvh import Hits, Snapshot

    from ..live.scene_sync import SceneSync
    from ..sync.label_columns import SceneLabel

# So many rays are cast in one go: a quarter of a million take a fraction of a second.
RAYS_IN_A_STEP = 1 << 18
FIELDS = ("instance_ids", "mesh_ids", "primitive_ids", "geometric_normals", "positions", "distances")


@dataclass(frozen=True, slots=True)
class TracedStretch:
    """What is traced, and from where. shares: (R,), of the stretch, when each ray is cast, 0 to 1.

    is_mount: (I,) bool, which instances of the record are of the mount; None if none is.
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
        """After each batch: how many rays were cast so far, and how far the farthest of its points is."""
        return self._hits(collector) if light is None else self._returns(collector, light, random)

    def _hits(self, collector: Collector) -> Iterator[tuple[int, float]]:
        """Of ideal rays."""
        rays, snapshot = self.rays, self.snapshot
        origins, directions = self.path.place(rays.origins, rays.directions, self.shares)
        for first in range(0, len(rays), RAYS_IN_A_STEP):
            rows = slice(first, first + RAYS_IN_A_STEP)
            times = self.shares[rows] if self._moves else 0.0
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
        """Of beams of light."""
        rays = self.rays
        origins, directions = self.path.place(rays.origins, rays.directions, self.shares)
        axes = axis_across(rays.directions)
        _, across = self.path.place(axes, axes, self.shares)
        times = self.shares if self._moves else np.zeros(len(rays))
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
    def _moves(self) -> bool:
        return self.sync.record.motion.count > 0

    def _eyes(self, rows: slice) -> Float64Array | None:
        """(R, 3) where the second eye is, None if there is none."""
        baseline, shares = self.pattern.baseline, self.shares[rows]
        if not baseline:
            return None
        aside = np.broadcast_to([baseline, 0.0, 0.0], (len(shares), 3))
        return self.path.place(aside, aside, shares)[0]
