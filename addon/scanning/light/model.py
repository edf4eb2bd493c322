"""What light does to a sensor's beams, as numbers that a sensor's file says; `README.md` beside this states the rules.

Knows no Blender.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear Rec. 709
RULES = ("first", "strongest", "last")
MOST_RAYS_A_BEAM = 1024
MOST_RETURNS = 15  # LAS has no room for more
MOST_BOUNCES = 64


@dataclass(frozen=True, slots=True)
class Beam:
    """How wide a beam is, and what of it is kept.

    divergence: the full angle of its cone, in milliradians. rays: how many stand for it, evenly over its disc.
    returns: how many echoes of a beam are kept at most. keep: by which rules, of "first", "strongest" and "last"; they
    take turns. resolution: in world units: an echo that is no farther than that behind another is one with it.
    """

    divergence: float = 0.0
    rays: int = 1
    returns: int = 1
    keep: tuple[str, ...] = ("first",)
    resolution: float = 0.0

    def __post_init__(self) -> None:
        _check_number("beam", "divergence", self.divergence, 0.0, 1000.0)
        _check_count("beam", "rays", self.rays, 1, MOST_RAYS_A_BEAM)
        _check_count("beam", "returns", self.returns, 1, MOST_RETURNS)
        if not self.keep or not set(self.keep) <= set(RULES) or len(set(self.keep)) < len(self.keep):
            raise ValueError(f"beam: keep must be some of {', '.join(RULES)}, each once, got {list(self.keep)}")
        _check_number("beam", "resolution", self.resolution, 0.0, math.inf)
        if self.rays > 1 and not self.resolution > 0.0:
            raise ValueError("beam: several rays need a resolution above 0, within which their echoes are one")


@dataclass(frozen=True, slots=True)
class Optics:
    """What of light's ways is followed, and what intensities are.

    refract: whether what is clear bends rays; if not, it is taken for thin, and they go straight on.

    bounces: how many surfaces a ray may pass or be mirrored by. mirror_roughness: what is less rough is a mirror, or is
    seen through. spectrum: how much the red, green and blue of colours count at the sensor's wavelength; they are
    divided by their sum. reference: the distance, in world units, at which white, met straight on, has the intensity 1.
    calibrated: whether intensities are reflectivities, whatever the distance, instead.
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
        _check_count("light", "bounces", self.bounces, 0, MOST_BOUNCES)
        _check_number("light", "mirror_roughness", self.mirror_roughness, 0.0, 1.0)
        if len(self.spectrum) != 3 or not all(0.0 <= weight < math.inf for weight in self.spectrum):
            raise ValueError(f"light: spectrum must be three numbers of at least 0, got {list(self.spectrum)}")
        if not sum(self.spectrum) > 0.0:
            raise ValueError("light: spectrum must have a number above 0")
        if not 0.0 < self.reference < math.inf:
            raise ValueError(f"light: reference must be a distance above 0, got {self.reference}")


@dataclass(frozen=True, slots=True)
class Detection:
    """The least reflectivity that is detected at some distances; straight lines between them, and even beyond.

    distances: in world units, increasing. reflectivities: 1 for white that fills the beam and is met straight on.
    Without any, everything is detected that returns any light.
    """

    distances: tuple[float, ...] = ()
    reflectivities: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.distances) != len(self.reflectivities):
            counts = f"{len(self.distances)} and {len(self.reflectivities)}"
            raise ValueError(f"detection: distances and reflectivities must be as many of each, got {counts}")
        if not all(0.0 <= each < math.inf for each in (*self.distances, *self.reflectivities)):
            raise ValueError("detection: distances and reflectivities must be finite numbers of at least 0")
        if not all(first < second for first, second in pairwise(self.distances)):
            raise ValueError(f"detection: distances must increase, got {list(self.distances)}")


@dataclass(frozen=True, slots=True)
class Noise:
    """What is random, and what is off.

    range, range_square: standard deviation of distances, in world units: range + range_square * distance ** 2.

    angle: that of the direction that is reported, in milliradians, across each of two axes. dropout: the share of beams
    that return nothing. bias: added to all distances, in world units. line_bias: the standard deviation of what is
    added to all distances of a line.
    """

    range: float = 0.0
    range_square: float = 0.0
    angle: float = 0.0
    dropout: float = 0.0
    bias: float = 0.0
    line_bias: float = 0.0

    def __post_init__(self) -> None:
        for name in ("range", "range_square", "angle", "line_bias"):
            _check_number("noise", name, getattr(self, name), 0.0, math.inf)
        _check_number("noise", "dropout", self.dropout, 0.0, 1.0, includes_most=True)
        _check_number("noise", "bias", self.bias, -math.inf, math.inf)

    @property
    def moves_points(self) -> bool:
        """Whether points are anywhere but where rays met something."""
        return any((self.range, self.range_square, self.angle, self.bias, self.line_bias))


@dataclass(frozen=True, slots=True)
class Light:
    """All of it: the tables [beam], [light], [detection] and [noise] of a sensor's file."""

    beam: Beam = field(default_factory=Beam)
    optics: Optics = field(default_factory=Optics)
    detection: Detection = field(default_factory=Detection)
    noise: Noise = field(default_factory=Noise)


def _check_number(table: str, name: str, value: Any, least: float, most: float, *, includes_most: bool = False) -> None:
    is_number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    if is_number and least <= value and (value < most or (includes_most and value == most)) and math.isfinite(value):
        return
    if math.isinf(least):
        wanted = "a finite number"
    elif math.isinf(most):
        wanted = f"a finite number of at least {least:g}"
    else:
        wanted = f"a number from {least:g} to {'' if includes_most else 'below '}{most:g}"
    raise ValueError(f"{table}: {name} must be {wanted}, got {value!r}")


def _check_count(table: str, name: str, value: Any, least: int, most: int) -> None:
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or not least <= value <= most:
        raise ValueError(f"{table}: {name} must be a whole number from {least} to {most}, got {value!r}")
