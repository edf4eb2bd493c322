"""The light that a surface returns, transmits and mirrors, by its shares and the angle. Does not depend on Blender.

A surface has the shares of the renderer (`perfect_bvh.MaterialTable`): metal, glass, translucent, and the rest, diffuse
under a dielectric reflection. Reflectivities are in parts of the light that white paper returns when it is hit
perpendicularly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from ..outcomes import listed, nearest, shown
from ..patterns import Float64Array
from .model import Beam, Detection, Light, Noise, Optics

# The least width of lobes: a mirror that is hit head on would send all light into a point.
LEAST_ALPHA = 0.01


@dataclass(frozen=True, slots=True)
class Surfaces:
    """N points on surfaces; all (N,) float64.

    alpha: the opacity. diffuse, metal, clear: shares of the opaque part. color, metal_color, clear_color: what
    these shares return, mirror at perpendicular incidence, and transmit, at the sensor's wavelength. coat: the
    reflectance of the dielectric over the diffuse share at perpendicular incidence. ior: of glass. mirrors: the share
    of the glass that mirrors at all. slant: the share of the metal that becomes white at grazing angles. roughness: 0
    to 1.
    """

    alpha: Float64Array
    diffuse: Float64Array
    metal: Float64Array
    clear: Float64Array
    color: Float64Array
    metal_color: Float64Array
    clear_color: Float64Array
    coat: Float64Array
    ior: Float64Array
    mirrors: Float64Array
    slant: Float64Array
    roughness: Float64Array

    def returned(self, cosines: Float64Array) -> Float64Array:
        """(N,) the reflectivity towards where the light comes from."""
        base = self.color * (1.0 - schlick(self.coat, cosines)) * cosines
        facing = ((1.0 - self.ior) / (1.0 + self.ior)) ** 2 * self.mirrors
        mirrored = self.diffuse * self.coat + self.metal * self.metal_color + self.clear * facing
        return self.alpha * (self.diffuse * base + mirrored * lobe_back(cosines, self.roughness))

    def passed(self, cosines: Float64Array, mirror_roughness: float) -> Float64Array:
        """Returns (N,) the share of light that goes straight on where glass is thin."""
        reflected = fresnel(self.ior, cosines) * self.mirrors
        clear = self.clear * (1.0 - reflected) * self.clear_color * self._is_smooth(mirror_roughness)
        return 1.0 - self.alpha + self.alpha * clear

    def refracted(self, cosines: Float64Array, ratios: Float64Array, mirror_roughness: float) -> Float64Array:
        """Returns (N,) the share of refracted light. ratios: the index of refraction beyond by that on this side."""
        reflected = fresnel(ratios, cosines)
        passing = np.where(reflected < 1.0, 1.0 - reflected * self.mirrors, 0.0)
        return self.alpha * self.clear * passing * self.clear_color * self._is_smooth(mirror_roughness)

    def mirrored(self, cosines: Float64Array, ratios: Float64Array, mirror_roughness: float) -> Float64Array:
        """Returns (N,) the share of mirrored light. ratios: as for `refracted`."""
        reflected = fresnel(ratios, cosines)
        clear = self.clear * np.where(reflected < 1.0, reflected * self.mirrors, 1.0)
        white = schlick(self.metal_color, cosines)
        metal = self.metal * (self.metal_color + self.slant * (white - self.metal_color))
        shares = metal + clear + self.diffuse * schlick(self.coat, cosines)
        return self.alpha * shares * self._is_smooth(mirror_roughness)

    def going_on(self, mirror_roughness: float) -> npt.NDArray[np.int64]:
        """Rows of those that may let any light through, or mirror it."""
        return np.flatnonzero((self.alpha < 1.0) | (self.roughness < mirror_roughness))

    def part(self, rows: npt.NDArray[Any]) -> Surfaces:
        """Some of them, copied."""
        return Surfaces(**{field.name: getattr(self, field.name).take(rows) for field in fields(self)})

    def put(self, rows: npt.NDArray[Any], others: Surfaces) -> None:
        """Overwrites `rows` with `others`."""
        for field in fields(self):
            getattr(self, field.name)[rows] = getattr(others, field.name)

    def _is_smooth(self, mirror_roughness: float) -> Float64Array:
        return (self.roughness < mirror_roughness).astype(np.float64)


def schlick(straight: Float64Array, cosines: Float64Array) -> Float64Array:
    """Returns the reflectance at an angle from that at perpendicular incidence: Schlick 1994. Black stays black."""
    away = 1.0 - cosines
    square = away * away
    return np.where(straight > 0.0, straight + (1.0 - straight) * (square * square * away), 0.0)


def fresnel(ratios: Float64Array, cosines: Float64Array) -> Float64Array:
    """Returns (N,) the reflectance of the border of two clear media for unpolarised light; 1 at total reflection.

    ratios: the index of refraction beyond by that on this side.
    """
    beyond = 1.0 - (1.0 - cosines * cosines) / (ratios * ratios)
    inner = np.sqrt(np.maximum(beyond, 0.0))
    upright = (cosines - ratios * inner) / np.maximum(cosines + ratios * inner, 1e-300)
    flat = (ratios * cosines - inner) / np.maximum(ratios * cosines + inner, 1e-300)
    return np.where(beyond > 0.0, np.minimum(0.5 * (upright * upright + flat * flat), 1.0), 1.0)


def lobe_back(cosines: Float64Array, roughness: Float64Array) -> Float64Array:
    """(N,) what facets that mirror all give back to where the light comes from.

    Those of Walter et al. 2007 (GGX) with the masking of Heitz 2014; pi times the BSDF times the cosine.
    """
    alpha = np.maximum(roughness * roughness, LEAST_ALPHA)
    square, wide = cosines * cosines, alpha * alpha
    peak = square * (wide - 1.0) + 1.0
    return wide / (4.0 * peak * peak * np.sqrt(square + wide * (1.0 - square)))


# Tables --------------------------------------------------------------------------------------------------------------
# The tables of a sensor's file that describe the physics of its beams: [beam], [light], [detection] and [noise].
#
# All tables and all their keys are optional; a file without any is of an ideal sensor.


TABLES: dict[str, type[Any]] = {"beam": Beam, "light": Optics, "detection": Detection, "noise": Noise}
NUMBER = (int, float)
LISTS: dict[str, Any] = {"keep": str, "spectrum": NUMBER, "distances": NUMBER, "reflectivities": NUMBER}
SWITCHES = {"refract", "calibrated"}


def read_light(values: Mapping[str, Any]) -> Light | None:
    """Returns the light of a sensor's tables; None if there are none. Raises ValueError for invalid contents."""
    made = {name: _table(name, values[name]) for name in TABLES if name in values}
    if not made:
        return None
    named = {"optics" if name == "light" else name: table for name, table in made.items()}
    return Light(**named)


def _table(table: str, values: Any) -> Any:
    if not isinstance(values, Mapping):
        raise ValueError(f"{table} must be a table, [{table}], got {shown(values)}")
    made = TABLES[table]
    known = [field.name for field in fields(made)]
    for name in values:
        if name not in known:
            raise ValueError(f"[{table}] has no {name!r}{nearest(name, known)}: {listed(known)}")
    return made(**{name: _value(table, name, value) for name, value in values.items()})


def _value(table: str, name: str, value: Any) -> Any:
    if name in LISTS:
        value = [value] if name == "keep" and isinstance(value, str) else value
        are_right = isinstance(value, list) and all(
            isinstance(each, LISTS[name]) and not isinstance(each, bool) for each in value
        )
        if not are_right:
            kind = "words" if name == "keep" else "numbers"
            raise ValueError(f"[{table}]: {name} must be a list of {kind}, got {shown(value)}")
        return tuple(value) if name == "keep" else tuple([_number(table, name, each) for each in value])
    if name in SWITCHES:
        return value  # its table checks it
    if isinstance(value, bool) or not isinstance(value, NUMBER):
        raise ValueError(f"[{table}]: {name} must be a number, got {shown(value)}")
    return value if isinstance(value, int) and abs(value) < 2**53 else _number(table, name, value)


def _number(table: str, name: str, value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"[{table}]: {name} must be a number of usual size, got {shown(value)}") from None
