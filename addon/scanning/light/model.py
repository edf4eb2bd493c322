"""The physics of a sensor's beams, as numbers in a sensor's file; `README.md` in this folder states the rules.

Does not depend on Blender.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_count, check_number

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear Rec. 709
RULES = ("first", "strongest", "last")
MOST_RAYS_A_BEAM = 1024
MOST_RETURNS = 15  # LAS has no room for more
MOST_BOUNCES = 64


@dataclass(frozen=True, slots=True)
class Beam:
    """How wide a beam is, and what of it is kept.

    Attributes:
        divergence: Full angle of the beam's cone, in milliradians.
        rays: Number of rays that sample a beam, evenly over its disc.
        returns: Largest number of echoes kept per beam.
        keep: Rules that choose the echoes: "first", "strongest", "last". Several take turns.
        resolution: Echoes at most this far behind another one are merged with it, in world units.
    """

    divergence: float = 0.0
    rays: int = 1
    returns: int = 1
    keep: tuple[str, ...] = ("first",)
    resolution: float = 0.0

    def __post_init__(self) -> None:
        check_number("beam", "divergence", self.divergence, 0.0, 1000.0, below=True)
        check_count("beam", "rays", self.rays, 1, MOST_RAYS_A_BEAM)
        check_count("beam", "returns", self.returns, 1, MOST_RETURNS)
        if not self.keep or not set(self.keep) <= set(RULES) or len(set(self.keep)) < len(self.keep):
            raise ValueError(f"beam: keep must be some of {', '.join(RULES)}, each once, got {list(self.keep)}")
        check_number("beam", "resolution", self.resolution, 0.0)
        if self.rays > 1 and not self.resolution > 0.0:
            raise ValueError(
                "beam: several rays need a resolution above 0, the distance within which echoes are merged"
            )


@dataclass(frozen=True, slots=True)
class Optics:
    """The followed paths of light, and the meaning of intensities.

    Attributes:
        refract: Whether transparent surfaces bend rays. If not, they are thin, and rays go straight on.
        bounces: Largest number of surfaces that pass on or mirror a ray.
        mirror_roughness: Surfaces of less roughness are mirrors, or transparent.
        spectrum: Weights of red, green and blue at the sensor's wavelength. They are divided by their sum.
        reference: Distance at which a white surface that faces the sensor has the intensity 1, in world units.
        calibrated: Whether intensities are reflectivities, independent of the distance.
    """

    refract: bool = False
    bounces: int = 8
    mirror_roughness: float = 0.2
    spectrum: tuple[float, float, float] = LUMINANCE
    reference: float = 1.0
    calibrated: bool = False

    def __post_init__(self) -> None:
        for name in ("refract", "calibrated"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"light: {name} must be true or false, got {getattr(self, name)!r}")
        check_count("light", "bounces", self.bounces, 0, MOST_BOUNCES)
        check_number("light", "mirror_roughness", self.mirror_roughness, 0.0, 1.0, below=True)
        if len(self.spectrum) != 3 or not all(0.0 <= weight < math.inf for weight in self.spectrum):
            raise ValueError(f"light: spectrum must be three numbers of at least 0, got {list(self.spectrum)}")
        if not sum(self.spectrum) > 0.0:
            raise ValueError("light: spectrum must have a number above 0")
        check_number("light", "reference", self.reference, 0.0, above=True)


@dataclass(frozen=True, slots=True)
class Detection:
    """The least reflectivity that is detected at some distances; straight lines between them, and even beyond.

    Attributes:
        distances: Distances in world units, increasing.
        reflectivities: Least reflectivity that is detected at each distance. 1 is a white surface that fills the beam
            and faces the sensor. Without any, all light is detected.
    """

    distances: tuple[float, ...] = ()
    reflectivities: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distances) != len(self.reflectivities):
            counts = f"{len(self.distances)} and {len(self.reflectivities)}"
            raise ValueError(f"detection: distances and reflectivities must have the same length, got {counts}")
        if not all(0.0 <= each < math.inf for each in (*self.distances, *self.reflectivities)):
            raise ValueError("detection: distances and reflectivities must be finite numbers of at least 0")
        if not all(first < second for first, second in pairwise(self.distances)):
            raise ValueError(f"detection: distances must increase, got {list(self.distances)}")


@dataclass(frozen=True, slots=True)
class Noise:
    """Random and systematic errors.

    Attributes:
        range, range_square: Standard deviation of distances, in world units: range + range_square * distance ** 2.
        angle: Standard deviation of the reported direction along each of two axes, in milliradians.
        dropout: Share of the beams that return nothing.
        bias: Offset of all distances, in world units.
        line_bias: Standard deviation of the offset of each line, in world units.
    """

    range: float = 0.0
    range_square: float = 0.0
    angle: float = 0.0
    dropout: float = 0.0
    bias: float = 0.0
    line_bias: float = 0.0

    def __post_init__(self) -> None:
        for name in ("range", "range_square", "angle", "line_bias"):
            check_number("noise", name, getattr(self, name), 0.0)
        check_number("noise", "dropout", self.dropout, 0.0, 1.0)
        check_number("noise", "bias", self.bias)

    @property
    def moves_points(self) -> bool:
        """Whether points can be at other places than the rays' hits."""
        return any((self.range, self.range_square, self.angle, self.bias, self.line_bias))


@dataclass(frozen=True, slots=True)
class Light:
    """All settings of light: the tables [beam], [light], [detection] and [noise] of a sensor's file."""

    beam: Beam = field(default_factory=Beam)
    optics: Optics = field(default_factory=Optics)
    detection: Detection = field(default_factory=Detection)
    noise: Noise = field(default_factory=Noise)


# Beam rays -----------------------------------------------------------------------------------------------------------
# The rays that sample a beam: one at its middle, and others evenly over its disc.


# Vogel 1979: each seed of a sunflower is turned by so much of a turn from the one before.
GOLDEN_TURN = math.pi * (3.0 - math.sqrt(5.0))


def disc_places(count: int) -> Float64Array:
    """Returns (count, 2) points in the unit disc, the first at its middle; each samples the same share of it."""
    numbers = np.arange(count, dtype=np.float64)
    radii, angles = np.sqrt(numbers / max(count - 0.5, 1.0)), numbers * GOLDEN_TURN
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def axis_across(directions: Float64Array) -> Float64Array:
    """(R, 3) unit vectors at right angles to (R, 3) directions: Duff et al. 2017, without a branch."""
    x, y, z = unit(directions).T
    sign = np.where(z < 0.0, -1.0, 1.0)
    share = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * share, sign * x * y * share, -sign * x], axis=1)


def spread_over_disc(
    directions: Float64Array, across: Float64Array, places: Float64Array, divergence: float
) -> Float64Array:
    """(R * K, 3) directions, the K of each beam one after the other, as long as the beam's own.

    Args:
        across: (R, 3) unit vectors at right angles to the directions.
        places: (K, 2) of `disc_places`.
        divergence: The full angle, in milliradians. The first of each beam is its own direction, bit for bit.
    """
    if len(places) == 1:
        return directions
    lengths = length_of(directions)[:, None]
    ahead = directions / lengths
    other = np.cross(ahead, across)
    aside = math.tan(divergence * 5e-4) * places
    spread = ahead[:, None] + aside[:, :1] * across[:, None] + aside[:, 1:] * other[:, None]
    spread *= (lengths / np.sqrt(1.0 + (aside * aside).sum(axis=1)))[:, :, None]
    spread[:, 0] = directions
    return spread.reshape(-1, 3)


def dot(first: Float64Array, second: Float64Array) -> Float64Array:
    """Returns (N,) dot products of (N, 3) each, always summed in the same order."""
    return first[:, 0] * second[:, 0] + first[:, 1] * second[:, 1] + first[:, 2] * second[:, 2]


def length_of(vectors: Float64Array) -> Float64Array:
    """(N,) of (N, 3)."""
    return np.sqrt(dot(vectors, vectors))


def unit(vectors: Float64Array) -> Float64Array:
    """(N, 3), each as long as 1; those without a length, as normals at the tips of curves are, stay so."""
    return vectors / np.maximum(length_of(vectors), 1e-300)[:, None]


# Ray noise -----------------------------------------------------------------------------------------------------------
# Random numbers of rays: they depend only on the seed, the ray's number and a channel.
#
# A ray's numbers do not depend on other rays, their order or the number of workers. They have the same bits on every
# system: only whole numbers, sums, products, quotients and square roots are used.


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
    """Returns the quantile of the normal distribution for these shares; to seven digits."""
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


# Measuring -----------------------------------------------------------------------------------------------------------
# The measured positions of echoes: with each ray's noise, bias and dropout.


IntArray = npt.NDArray[Any]

# Channels of a ray's random numbers; distances have one for each return, from the last of these on.
DROPOUT, ACROSS, UP, DISTANCE = 0, 1, 2, 3
LINE = 1 << 32  # of lines, which are no rays


def are_lost(noise: Noise, random: RayNoise, ray_ids: IntArray) -> npt.NDArray[np.bool_]:
    """Returns (N,) whether each ray returns nothing, for any surface that it hit."""
    if noise.dropout <= 0.0:
        return np.zeros(len(ray_ids), np.bool_)
    return random.uniform(ray_ids, DROPOUT) < noise.dropout


def measured_distances(
    noise: Noise, random: RayNoise, distances: Float64Array, ray_ids: IntArray, return_ids: IntArray, ring_ids: IntArray
) -> Float64Array:
    """Returns (N,) the measured distances, at least 0."""
    found = distances + noise.bias
    if noise.range or noise.range_square:
        sigma = noise.range + noise.range_square * distances * distances
        found = found + sigma * random.normal(ray_ids, DISTANCE + return_ids.astype(np.uint64))
    if noise.line_bias:
        found = found + noise.line_bias * random.normal(ring_ids, LINE)
    return np.maximum(found, 0.0)


def measured_directions(
    noise: Noise, random: RayNoise, directions: Float64Array, across: Float64Array, ray_ids: IntArray
) -> Float64Array:
    """(N, 3) unit vectors: where the sensor says that rays went. across: (N, 3) unit, at right angles to them."""
    ahead = unit(directions)
    if noise.angle <= 0.0:
        return ahead
    sigma = noise.angle * 1e-3
    aside, up = (sigma * random.normal(ray_ids, channel)[:, None] for channel in (ACROSS, UP))
    return unit(ahead + aside * across + up * np.cross(ahead, across))
