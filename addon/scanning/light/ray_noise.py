"""Random numbers that belong to rays: of the seed, the ray's number and a channel alone. Knows no Blender.

Whatever is cast beside it, in whichever order, by however many workers: a ray has the same ones, and on every system
the same bits: nothing but whole numbers, sums, products, quotients and square roots is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh._arrays import check_count

Float64Array = npt.NDArray[np.float64]
UInt64Array = npt.NDArray[np.uint64]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_LN2 = 0.6931471805599453
_SQRT_HALF = 0.7071067811865476
# Wichura 1988, algorithm AS 241, PPND7: ratios of polynomials, lowest power first.
_CENTRAL = (
    (3.3871327179, 50.434271938, 159.29113202, 59.109374720),
    (1.0, 17.895169469, 78.757757664, 67.187563600),
)
_TAIL = ((1.4234372777, 2.7568153900, 1.3067284816, 0.17023821103), (1.0, 0.73700164250, 0.12021132975))
_FAR_TAIL = (
    (6.6579051150, 3.0812263860, 0.42868294337, 0.017337203997),
    (1.0, 0.24197894225, 0.012258202635),
)


@dataclass(frozen=True, slots=True)
class RayNoise:
    """seed: an integer, 0 to 2 ** 31 - 1."""

    seed: int = 0

    def __post_init__(self) -> None:
        check_count("scan", "seed", self.seed, 0)

    def uniform(self, ids: npt.NDArray[Any], channels: npt.ArrayLike) -> Float64Array:
        """(N,) float64 above 0 and below 1, of (N,) whole numbers, and a channel or (N,) of them."""
        start = _mixed(np.array([self.seed], np.uint64) + _GOLDEN)
        steps = np.atleast_1d(np.asarray(channels, np.uint64)) * _GOLDEN
        mixed = _mixed(_mixed(start + np.asarray(ids).astype(np.uint64)) + steps)
        return ((mixed >> np.uint64(12)).astype(np.float64) + 0.5) * 2.0**-52

    def normal(self, ids: npt.NDArray[Any], channels: npt.ArrayLike) -> Float64Array:
        """(N,) float64 of mean 0 and standard deviation 1, of the same."""
        return _normal_of(self.uniform(ids, channels))


def _mixed(values: UInt64Array) -> UInt64Array:
    """The finaliser of SplitMix64 (Steele, Lea and Flood 2014; its constants are Stafford's mix 13); wraps around."""
    values = (values ^ (values >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    values = (values ^ (values >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return values ^ (values >> np.uint64(31))


def _normal_of(shares: Float64Array) -> Float64Array:
    """What so large a share of a normal distribution is below; to seven digits."""
    aside = shares - 0.5
    middle = 0.180625 - aside * aside
    central = aside * _ratio(_CENTRAL, np.maximum(middle, 0.0))
    depth = np.sqrt(-_logarithm(np.minimum(shares, 1.0 - shares)))
    tail = np.where(depth <= 5.0, _ratio(_TAIL, depth - 1.6), _ratio(_FAR_TAIL, depth - 5.0))
    return np.where(np.abs(aside) <= 0.425, central, np.where(aside < 0.0, -tail, tail))


def _ratio(polynomials: tuple[tuple[float, ...], tuple[float, ...]], values: Float64Array) -> Float64Array:
    above, below = (_polynomial(each, values) for each in polynomials)
    return above / below


def _polynomial(factors: tuple[float, ...], values: Float64Array) -> Float64Array:
    found = np.full_like(values, factors[-1])
    for factor in factors[-2::-1]:
        found = found * values + factor
    return found


def _logarithm(values: Float64Array) -> Float64Array:
    """The natural one, by the series of the inverse hyperbolic tangent: libraries round the last digit as they like."""
    parts, exponents = np.frexp(values)
    is_low = parts < _SQRT_HALF
    parts, exponents = np.where(is_low, parts * 2.0, parts), exponents - is_low
    ratio = (parts - 1.0) / (parts + 1.0)
    series = _polynomial(tuple(1.0 / (2 * term + 1) for term in range(11)), ratio * ratio)
    return exponents * _LN2 + 2.0 * ratio * series
