"""From what the rays of beams met to echoes: merged, compared with what the sensor can detect, and chosen by its rules.

Knows no Blender.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..patterns import Float64Array
from .model import Detection

IntArray = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class Echoes:
    """E echoes, beam after beam, the nearest first.

    beams: (E,) rows of the batch's beams. ranges: (E,) float64, in world units, the mean of what is one echo, by
    energy. energies: (E,) float64, the reflectivity of what would return as much if it filled the beam. strongest: (E,)
    rows of the arrivals, which of them gave back the most. are_single: (E,) whether it alone is the echo.
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
    """One echo for each run of arrivals of a beam of which none is farther than `resolution` behind the one before.

    beams, ranges, energies: (A,) each; what has no energy is no part of any.
    """
    present = np.flatnonzero(energies > 0.0)
    order = present[np.argsort(beams[present], kind="stable")]  # beam after beam, as they have arrived
    order = _sorted_where_apart(order, beams, ranges, resolution)
    of_beam, at, energy = beams[order], ranges[order], energies[order]
    begins = np.ones(len(order), np.bool_)
    begins[1:] = (of_beam[1:] != of_beam[:-1]) | (at[1:] - at[:-1] > resolution)
    groups, firsts = np.cumsum(begins) - 1, np.flatnonzero(begins)
    # Sums by bincount go from the first to the last, whatever else is in the batch.
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
    """Of each group, the row of what has the most energy; of several the nearest. firsts: where the groups begin."""
    if not len(firsts):
        return firsts
    rows = np.flatnonzero(energy == np.maximum.reduceat(energy, firsts)[groups])
    if len(rows) > len(firsts):
        rows = rows[np.lexsort((at[rows], groups[rows]))]  # stable: equal ones stay in their order
    return rows[np.searchsorted(groups[rows], np.arange(len(firsts)))]


def are_detected(echoes: Echoes, detection: Detection) -> npt.NDArray[np.bool_]:
    """(E,) whether each returns as much as what has the least detectable reflectivity at its distance."""
    if not detection.distances:
        return np.ones(len(echoes), np.bool_)
    return echoes.energies >= np.interp(echoes.ranges, detection.distances, detection.reflectivities)


def choose(echoes: Echoes, rules: tuple[str, ...], most: int) -> npt.NDArray[np.int64]:
    """Rows of those that are kept, in their order: the rules take turns, each the best of what is left of each beam."""
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
    """What is smallest for the best."""
    return {"first": echoes.ranges, "strongest": -echoes.energies, "last": -echoes.ranges}[rule]


def numbered(beams: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """(E,) which echo of its beam each is, from 0, and of how many. beams: (E,), sorted."""
    _, firsts, inverse, counts = np.unique(beams, return_index=True, return_inverse=True, return_counts=True)
    return (np.arange(len(beams)) - firsts[inverse]).astype(np.int32), counts[inverse].astype(np.int32)
