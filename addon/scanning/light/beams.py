"""Casts the beams of a sensor and gives what it measures of them: light's ways, echoes, and noise. Knows no Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from perfect_bvh import Hits

from ..outcomes import MissJudge, Outcome, Outcomes
from ..patterns import Float64Array, Rays
from .beam_rays import disc_places, spread_over_disc
from .echoes import Echoes, are_detected, choose, merge, numbered
from .measuring import are_lost, measured_directions, measured_distances
from .model import Light
from .paths import Arrivals, Cast, follow_light, ways_of
from .ray_noise import RayNoise
from .surface_reader import SurfaceReader

if TYPE_CHECKING:
    from perfect_bvh import Snapshot

    from ...live.scene_sync import SceneSync

FOUND = ("instance_ids", "mesh_ids", "primitive_ids")


@dataclass(frozen=True, slots=True)
class Batch:
    """B beams.

    rays: of the pattern. origins, directions, across: (B, 3) in world space; across is at right angles to the
    directions, and turns with the sensor. times: (B,) of the queries. first_id: the number of the first one in the
    whole scan. eyes: (B, 3), of the second eye.
    """

    rays: Rays
    origins: Float64Array
    directions: Float64Array
    across: Float64Array
    times: Float64Array
    first_id: int
    eyes: Float64Array | None = None


@dataclass(frozen=True, slots=True)
class Returns:
    """E echoes that a sensor reports, beam after beam. hits: where they are, and what gave back the most of each.

    beams: (E,) rows of the batch. directions: (E, 3), in which that was met. intensities: (E,) float32. return_ids,
    return_counts: (E,) int32: which echo of its beam, from 0, and of how many. outcomes: (B,), of the batch's beams.
    """

    hits: Hits
    beams: npt.NDArray[np.int64]
    directions: Float64Array
    intensities: npt.NDArray[np.float32]
    return_ids: npt.NDArray[np.int32]
    return_counts: npt.NDArray[np.int32]
    outcomes: Outcomes


class BeamCaster:
    """Of one stretch of a scan."""

    def __init__(self, light: Light, random: RayNoise, sync: SceneSync, snapshot: Snapshot, mask: int, threads: int):
        self._light = light
        self._random = random
        self._snapshot = snapshot
        self._surfaces = SurfaceReader(sync, light.optics.spectrum)
        self._mask = mask
        self._threads = threads
        self._places = disc_places(light.beam.rays)

    def cast(self, batch: Batch) -> Returns:
        """What the sensor measures of a batch."""
        beam = self._light.beam
        arrivals = self._arrivals(batch)
        echoes = merge(arrivals.rows // beam.rays, arrivals.ranges, arrivals.energies / beam.rays, beam.resolution)
        is_lost = are_lost(self._light.noise, self._random, batch.first_id + echoes.beams)
        is_detected = are_detected(echoes, self._light.detection)
        lost = echoes.beams[is_detected & is_lost]
        echoes = echoes.part(np.flatnonzero(is_detected & ~is_lost))
        echoes = echoes.part(choose(echoes, beam.keep, beam.returns))
        return self._measured(batch, arrivals, echoes, self._outcomes(batch, arrivals, echoes, lost))

    def _outcomes(self, batch: Batch, arrivals: Arrivals, echoes: Echoes, lost: npt.NDArray[np.int64]) -> Outcomes:
        """(B,) of each beam, wherever its points are. echoes: that are kept. lost: beams that dropout took one from."""
        found = np.full(len(batch.directions), Outcome.HIT_NOTHING, np.int8)
        found[arrivals.rows // self._light.beam.rays] = Outcome.TOO_DARK
        missed = np.flatnonzero(found == Outcome.HIT_NOTHING)
        judge = MissJudge(self._snapshot, self._mask, self._threads)
        where = (batch.rays, batch.origins, batch.directions, batch.times)
        judge.mark(found, missed, *where, has_second_eye=batch.eyes is not None)
        found[lost] = Outcome.DROPPED_OUT
        found[echoes.beams] = Outcome.ON_OBJECTS
        found[echoes.beams[arrivals.bounces[echoes.strongest] > 0]] = Outcome.BEHIND_GLASS
        return found

    def _arrivals(self, batch: Batch) -> Arrivals:
        """All that the rays of all beams meet, those of a beam one after the other, a bounce after the other."""
        count = len(self._places)
        directions = spread_over_disc(batch.directions, batch.across, self._places, self._light.beam.divergence)
        ways, farthest = ways_of(_repeated(batch.origins, count), directions, batch.rays.t_min, batch.rays.t_max)
        cast = Cast(
            snapshot=self._snapshot,
            surfaces=self._surfaces,
            optics=self._light.optics,
            mask=self._mask,
            threads=self._threads,
            times=_repeated(batch.times, count),
            farthest=farthest,
            eyes=None if batch.eyes is None else _repeated(batch.eyes, count),
        )
        return Arrivals.joined(list(follow_light(cast, ways)))

    def _measured(self, batch: Batch, arrivals: Arrivals, echoes: Echoes, outcomes: Outcomes) -> Returns:
        noise, random, optics = self._light.noise, self._random, self._light.optics
        beams, strongest = echoes.beams, echoes.strongest
        return_ids, return_counts = numbered(beams)
        ray_ids = batch.first_id + beams
        distances = measured_distances(noise, random, echoes.ranges, ray_ids, return_ids, batch.rays.ring_ids[beams])
        ahead = measured_directions(noise, random, batch.directions[beams], batch.across[beams], ray_ids)
        # What is alone an echo, on the beam's own line, is where it was met, bit for bit.
        is_middle = arrivals.rows[strongest] % len(self._places) == 0
        is_exact = echoes.are_single & arrivals.are_straight[strongest] & is_middle
        positions = batch.origins[beams] + distances[:, None] * ahead
        if not noise.moves_points:
            positions = np.where(is_exact[:, None], arrivals.positions[strongest], positions)
        falloff = 1.0 if optics.calibrated else (optics.reference / np.maximum(echoes.ranges, 1e-12)) ** 2
        columns = {name: getattr(arrivals, name)[strongest] for name in FOUND}
        columns |= {
            "positions": positions,
            "distances": distances,
            "geometric_normals": arrivals.normals[strongest],
        }
        return Returns(
            hits=Hits(columns, 0, self._snapshot.generation, self._snapshot.scene_id),
            beams=beams,
            directions=arrivals.directions[strongest],
            intensities=(echoes.energies * falloff).astype(np.float32),
            return_ids=return_ids,
            return_counts=return_counts,
            outcomes=outcomes,
        )


def _repeated(values: npt.NDArray[Any], count: int) -> npt.NDArray[Any]:
    return values if count == 1 else np.repeat(values, count, axis=0)
