"""Casts the beams of a sensor and returns its measurements: light's paths, echoes, and noise. Needs no Blender."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from perfect_bvh import Hits

from ..outcomes import MissJudge, Outcome, Outcomes
from ..patterns import Float64Array, Rays
from .model import (
    Detection,
    Light,
    RayNoise,
    are_lost,
    disc_places,
    measured_directions,
    measured_distances,
    spread_over_disc,
)
from .paths import Arrivals, Cast, follow_light, ways_of
from .surface_reader import SurfaceReader

if TYPE_CHECKING:
    from perfect_bvh import Snapshot

    from ...live.scene_sync import SceneSync

# Turns the hits of the beams' rays into echoes: merged, compared with the sensor's detection limit, chosen by rules.


IntArray = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Echoes:
    """E echoes, beam after beam, the nearest first.

    beams: (E,) rows of the batch's beams. ranges: (E,) float64, in world units, the mean of an echo's hits, weighted by
    energy. energies: (E,) float64, the reflectivity of a surface that would return as much if it filled the beam.
    strongest: (E,) rows of the arrivals that returned the most. are_single: (E,) whether the echo has only that one
    hit.
    """

    beams: npt.NDArray[np.int64]
    ranges: Float64Array
    energies: Float64Array
    strongest: npt.NDArray[np.int64]
    are_single: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.beams)

    def part(self, rows: IntArray) -> Echoes:
        """Some of them."""
        columns = (self.beams, self.ranges, self.energies, self.strongest, self.are_single)
        return Echoes(*(column[rows] for column in columns))


def merge(beams: IntArray, ranges: Float64Array, energies: Float64Array, resolution: float) -> Echoes:
    """Merges each run of a beam's arrivals, of which none is more than `resolution` behind the one before.

    beams, ranges, energies: (A,) each; arrivals without energy belong to no echo.
    """
    present = np.flatnonzero(energies > 0.0)
    order = present[np.argsort(beams[present], kind="stable")]  # beam after beam, as they have arrived
    order = _sorted_where_apart(order, beams, ranges, resolution)
    of_beam, at, energy = beams[order], ranges[order], energies[order]
    begins = np.ones(len(order), np.bool_)
    begins[1:] = (of_beam[1:] != of_beam[:-1]) | (at[1:] - at[:-1] > resolution)
    groups, firsts = np.cumsum(begins) - 1, np.flatnonzero(begins)
    # Sums by bincount go from the first to the last, independent of the rest of the batch.
    sums = np.bincount(groups, weights=energy, minlength=len(firsts))
    means = np.bincount(groups, weights=energy * at, minlength=len(firsts)) / sums
    are_single = np.bincount(groups, minlength=len(firsts)) == 1
    return Echoes(
        beams=of_beam[firsts].astype(np.int64),
        ranges=np.where(are_single, at[firsts], means),
        energies=sums,
        strongest=order[_strongest(energy, at, groups, firsts)],
        are_single=are_single,
    )


def _sorted_where_apart(order: IntArray, beams: IntArray, ranges: Float64Array, resolution: float) -> IntArray:
    """The arrivals of each beam that is more than one echo sorted by range; equal ones stay in their order.

    Most beams are one echo, and sorting takes longer than all else. order: beam after beam.
    """
    of_beam, at = beams[order], ranges[order]
    firsts = np.flatnonzero(np.diff(of_beam, prepend=-1))
    if not len(firsts):
        return order
    is_apart = np.maximum.reduceat(at, firsts) - np.minimum.reduceat(at, firsts) > resolution
    apart = np.flatnonzero(np.repeat(is_apart, np.diff(firsts, append=len(order))))
    order[apart] = order[apart][np.lexsort((at[apart], of_beam[apart]))]
    return order


def _strongest(energy: Float64Array, at: Float64Array, groups: IntArray, firsts: IntArray) -> IntArray:
    """Returns each group's row with the most energy; the nearest of equal ones. firsts: where the groups begin."""
    if not len(firsts):
        return firsts
    rows = np.flatnonzero(energy == np.maximum.reduceat(energy, firsts)[groups])
    if len(rows) > len(firsts):
        rows = rows[np.lexsort((at[rows], groups[rows]))]  # stable: equal ones stay in their order
    return rows[np.searchsorted(groups[rows], np.arange(len(firsts)))]


def are_detected(echoes: Echoes, detection: Detection) -> npt.NDArray[np.bool_]:
    """Returns (E,) whether each returns as much as the least detectable reflectivity at its distance."""
    if not detection.distances:
        return np.ones(len(echoes), np.bool_)
    return echoes.energies >= np.interp(echoes.ranges, detection.distances, detection.reflectivities)


def choose(echoes: Echoes, rules: tuple[str, ...], most: int) -> npt.NDArray[np.int64]:
    """Returns the rows of kept echoes, in order: the rules take turns, each the best of the rest of each beam."""
    left = np.arange(len(echoes))
    chosen = []
    for turn in range(most):
        if not len(left):
            break
        key = _key(echoes, rules[turn % len(rules)])[left]
        order = np.lexsort((key, echoes.beams[left]))
        of_beam = echoes.beams[left][order]
        is_best = np.ones(len(order), np.bool_)
        is_best[1:] = of_beam[1:] != of_beam[:-1]
        best = np.sort(order[is_best])
        chosen.append(left[best])
        left = np.delete(left, best)
    return np.sort(np.concatenate(chosen)) if chosen else left


def _key(echoes: Echoes, rule: str) -> Float64Array:
    """Returns the sort key; the smallest is the best."""
    return {"first": echoes.ranges, "strongest": -echoes.energies, "last": -echoes.ranges}[rule]


def numbered(beams: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """(E,) which echo of its beam each is, from 0, and of how many. beams: (E,), sorted."""
    _, firsts, inverse, counts = np.unique(beams, return_index=True, return_inverse=True, return_counts=True)
    return (np.arange(len(beams)) - firsts[inverse]).astype(np.int32), counts[inverse].astype(np.int32)


# Beams ---------------------------------------------------------------------------------------------------------------


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

    beams: (E,) rows of the batch. directions: (E, 3), of the rays that hit it. intensities: (E,) float32. return_ids,
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
    """Casts the beams of one interval of a scan."""

    def __init__(self, light: Light, random: RayNoise, sync: SceneSync, snapshot: Snapshot, mask: int, threads: int):
        self._light = light
        self._random = random
        self._snapshot = snapshot
        self._surfaces = SurfaceReader(sync, light.optics.spectrum)
        self._mask = mask
        self._threads = threads
        self._places = disc_places(light.beam.rays)

    def cast(self, batch: Batch) -> Returns:
        """Returns the sensor's measurements of a batch."""
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
        """Returns (B,) the outcome of each beam. echoes: those that are kept. lost: beams that lost one by dropout."""
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
        """Returns all hits of the rays of all beams, beam after beam, and bounce after bounce."""
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
        # A single hit on the beam's own line keeps its position, bit for bit.
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
