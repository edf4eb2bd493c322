"""The image of a Sky Texture node, round the scene, and its sun, by the rules of Cycles' two models of the air.

*Single Scattering*, after Nishita et al., "Display of the Earth taking into account atmospheric scattering" (1993):
along each line of sight, the sunlight that air and dust scatter to the eye is summed up, dimmed on its way in and out.
Below the horizon the light at the horizon fades away. *Multiple Scattering* is García Liñán's spectral sky
(https://fgarlin.com/posts/2024-12-06-spectral_sky), with four wavelengths and a fit for light that is scattered more
than once. Below the horizon is the air in front of a ground that reflects three tenths. Cycles shows both models from a
table; the rows and columns of the tables here are Cycles', so that their steps and shifts are the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from .older_skies import mirror_half, paint_older_sky, sky_latitudes
from .values import observer, xyz_to_rgb

Floats = npt.NDArray[np.float64]

# Of the table; the longitudes between which the light is interpolated, apart from its phase functions (with a shadow's
# edge, every one).
_WIDTH, _ROWS = 512, 256
_LONGITUDES = np.linspace(0.0, math.pi, 65)

# Single scattering: in metres, and for a metre at sea level; the ozone's where there is most of it, at 25 km.
_EARTH, _TOP, _STEPS = 6.36e6, 6.42e6, 32
_WAVES = np.arange(380.0, 781.0, 20.0)  # nanometres
_AIR = 1.13115e-6 * (_WAVES / 1e3) ** -4.0
_DUST, _DUST_LOSS, _DUST_FORWARD = 2e-5, 1.11, 0.76
_OZONE = np.array([0.325, 0.585, 1.977, 7.31, 20.08, 40.38, 63.55, 96.71, 154.8, 209.0, 246.1, 273.6, 215.1, 159.1])
_OZONE = 1e-8 * np.append(_OZONE, [112.4, 73.5, 46.45, 33.1, 22.5, 14.88, 16.83])
_LOSSES = np.stack([_AIR, np.full_like(_AIR, _DUST * _DUST_LOSS), _OZONE])
_SUN = 8.088e15 * _WAVES**-5.0 / np.expm1(1.4388e7 / (_WAVES * 5778.0))  # above the air, by Planck's law
_LENGTHS, _WEIGHTS = np.polynomial.laguerre.laggauss(8)
_LONGEST = 25.0  # of the way to the sun is only so much in the quadrature's unit

# Multiple scattering: in kilometres, at 630, 560, 490 and 430 nm; the ozone's and dust's for the densities below.
_PLANET, _AIR_THICKNESS, _MARCH = 6371.0, 100.0, 64
_AIR_4 = np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2])
_OZONE_4 = 334.5 * 3.78547397e20 * np.array([3.472e-25, 3.914e-25, 1.349e-25, 1.103e-26])
_DUST_SCATTERS_4 = 1.3681e20 * np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22])
_DUST_ABSORBS_4 = 1.3681e20 * np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23])
_DUST_FORWARD_4, _GROUND = 0.8, 0.3
_AGAIN_4 = 0.02 * np.array([0.217, 0.347, 0.594, 1.0])
_SUN_4 = np.array([1.679, 1.828, 1.986, 1.307])
_TO_XYZ_4 = np.array([[53.3869, 22.9813, 0.0], [43.9048, 71.3478, 0.1025], [1.6137, 18.423, 31.7429]])
_TO_XYZ_4 = np.concatenate([_TO_XYZ_4, [[20.7627, 2.3614, 110.48]]])


@dataclass(frozen=True, slots=True)
class Sun:
    """elevation: above the horizon, and angle: across it, in radians. irradiance: of what faces it."""

    elevation: float
    irradiance: tuple[float, float, float]
    angle: float


@dataclass(frozen=True, slots=True, eq=False)
class Sky:
    """pixels: (H, W, 4) float32, an image whose extension is "sky", with the sun over +Y. sun: None if not shown."""

    pixels: npt.NDArray[np.float32]
    sun: Sun | None


def read_sky(node: Any) -> tuple[Sky, float]:
    """Read a Sky Texture node of any Blender and model; returns also its rotation, from +Y to +X, in radians."""
    if node.sky_type in {"PREETHAM", "HOSEK_WILKIE"}:
        x, y, z = node.sun_direction
        elevation = math.atan2(z, math.hypot(x, y))
        return _make_older(node.sky_type, elevation, node.turbidity, node.ground_albedo), math.atan2(x, y)
    dust = node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density
    disc = (node.sun_size, node.sun_intensity) if node.sun_disc else None
    densities = (node.air_density, dust, node.ozone_density)
    return _make(node.sky_type, node.sun_elevation, node.altitude, densities, disc), node.sun_rotation


@lru_cache(maxsize=2)
def _make_older(model: str, elevation: float, turbidity: float, albedo: float) -> Sky:
    return Sky(paint_older_sky(model, elevation, turbidity, albedo), None)


@lru_cache(maxsize=8)
def _make(
    model: str,
    elevation: float,
    altitude: float,
    densities: tuple[float, float, float],
    disc: tuple[float, float] | None,
) -> Sky:
    is_multiple = model == "MULTIPLE_SCATTERING"
    if is_multiple:
        table = _scatter_often(elevation, altitude, densities)
    else:
        table = _scatter_once(elevation, altitude, densities, is_shifted=model != "NISHITA")
    sun = None if disc is None else _make_sun(elevation, altitude, densities, disc, is_multiple)
    return Sky(mirror_half(xyz_to_rgb(table)), sun)


def _make_sun(
    elevation: float, altitude: float, densities: tuple[float, ...], disc: tuple[float, float], is_multiple: bool
) -> Sun | None:
    """Sum up the disc above the planet's edge; it is darker towards its own edge, and changes from below upwards."""
    size, intensity = disc
    across, up = np.meshgrid(*[(np.arange(64) + 0.5) / 32.0 - 1.0] * 2)
    dip = math.acos(_PLANET / (_PLANET + max(altitude, 0.0) / 1e3))
    is_seen = (np.hypot(across, up) < 1.0) & (elevation + up * (size / 2.0) > -dip)
    if not is_seen.any():
        return None
    weights = np.where(is_seen, 0.4 + 0.6 * np.sqrt(np.maximum(1.0 - across**2 - up**2, 0.0)), 0.0)
    weights *= intensity / (np.hypot(across, up) < 1.0).sum()
    ends = (_sunlight_often if is_multiple else _sunlight_once)(
        np.array([elevation - size / 2.0, elevation + size / 2.0]), altitude, densities
    )
    share = float((weights * (1.0 + up) / 2.0).sum())
    light = xyz_to_rgb(ends[0] * (float(weights.sum()) - share) + ends[1] * share)
    red, green, blue = np.maximum(light, 0.0).tolist()
    return Sun(elevation, (red, green, blue), size)


def _directions(latitudes: Floats, longitudes: Floats) -> Floats:
    """(R, L, 3): with the sun at longitude 0, over +X."""
    flat, up = np.cos(latitudes)[:, None], np.sin(latitudes)[:, None]
    ways = [flat * np.cos(longitudes), flat * np.sin(longitudes), up + 0.0 * longitudes]
    return np.stack(ways, axis=-1)


def _spread(light: Floats, longitudes: Floats) -> Floats:
    """(R, C, 3) of (R, L, 3): interpolated from L longitudes between that of the sun and the opposite one."""
    last = light.shape[1] - 1
    places = np.clip(longitudes * (last / math.pi), 0.0, last)
    low = np.minimum(places.astype(int), last - 1)
    part = (places - low)[:, None]
    return light[:, low] * (1.0 - part) + light[:, low + 1] * part


# Single scattering ---------------------------------------------------------------------------------------------------


def _scatter_once(elevation: float, altitude: float, densities: tuple[float, ...], *, is_shifted: bool) -> Floats:
    """(rows, half of the columns, 3) XYZ, from the sun's longitude to the opposite one.

    is_shifted: whether the light below the horizon is half a row off, as from Blender 5.0 on.
    """
    half = _ROWS // 2
    latitudes = (np.arange(half) / half) ** 2 * (math.pi / 2.0)
    towards_sun = np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    air, dust = _light_once(_directions(latitudes, _LONGITUDES), towards_sun, _eye(altitude), np.array(densities))
    longitudes = np.arange(1, _WIDTH // 2 + 1) * (2.0 * math.pi / _WIDTH)
    cosine = (_directions(latitudes, longitudes) @ towards_sun)[..., None]
    g = _DUST_FORWARD
    air_phase = 3.0 / (16.0 * math.pi) * (1.0 + cosine**2)
    dust_phase = 3.0 / (8.0 * math.pi) * (1.0 - g * g) / (2.0 + g * g) * (1.0 + cosine**2)
    dust_phase /= (1.0 + g * g - 2.0 * g * cosine) ** 1.5
    above = _spread(air, longitudes) * air_phase + _spread(dust, longitudes) * dust_phase
    below = (1.0 - (np.arange(half) + (0.0 if is_shifted else 0.5)) / half) ** 2 * (math.pi / 2.0)
    fading = np.clip(1.0 - 2.5 * np.sin(below), 0.0, 1.0) ** 3
    return np.concatenate([fading[:, None, None] * above[0], above])


def _light_once(ways: Floats, towards_sun: Floats, eye: Floats, densities: Floats) -> tuple[Floats, Floats]:
    """(R, L, 3) XYZ that air and dust scatter, each without its phase function."""
    step = _way_out(np.broadcast_to(eye, ways.shape), ways)[..., None] / _STEPS
    amounts, scattered = np.zeros(ways.shape), np.zeros((2, *ways.shape[:2], len(_WAVES)))
    for number in range(_STEPS):
        places = eye + ways * step * (number + 0.5)
        gained = _density(places) * densities * step
        amounts += gained
        to_sun = _amounts(places, towards_sun) * densities
        middle = places @ towards_sun
        is_dark = (middle**2 >= (places**2).sum(axis=-1) - _EARTH**2) & (towards_sun[2] < 0.0)
        light = np.exp(-((amounts + to_sun) @ _LOSSES)) * ~is_dark[..., None]
        scattered += np.moveaxis(gained[..., :2], -1, 0)[..., None] * light
    air, dust = scattered * np.stack([_AIR, np.full_like(_AIR, _DUST)])[:, None, None] @ _spectrum_to_xyz()
    return air, dust


def _sunlight_once(elevations: Floats, altitude: float, densities: tuple[float, ...]) -> Floats:
    """(N, 3) XYZ of what faces the sun; ozone does not dim it."""
    if elevations.max() <= 0.0:
        return np.zeros((len(elevations), 3))
    clipped = np.maximum(elevations, 0.0)
    ways = np.stack([np.cos(clipped), 0.0 * clipped, np.sin(clipped)], axis=-1)
    amounts = np.stack([_amounts(_eye(altitude), way) for way in ways])
    found: Floats = np.exp(-((amounts * densities)[:, :2] @ _LOSSES[:2])) @ _spectrum_to_xyz()
    return found


def _spectrum_to_xyz() -> Floats:
    """(waves, 3): of shares of the sunlight."""
    matrix: Floats = observer()[::4] * (_SUN * (_WAVES[1] - _WAVES[0]))[:, None]
    return matrix


def _eye(altitude: float) -> Floats:
    return np.array([0.0, 0.0, _EARTH + min(max(altitude, 1.0), 59999.0)])


def _amounts(places: Floats, way: Floats) -> Floats:
    """(..., 3): metres of air, dust and ozone, as dense as each ever is, on the way out, by Gauss-Laguerre's rule."""
    length = _way_out(places, np.broadcast_to(way, places.shape))[..., None]
    total = np.zeros(places.shape)
    for place, weight in zip(_LENGTHS, _WEIGHTS * np.exp(_LENGTHS), strict=True):
        total += _density(places + way * length * (place / _LONGEST)) * weight
    return total * length / _LONGEST


def _way_out(places: Floats, ways: Floats) -> Floats:
    middle = (places * ways).sum(axis=-1)
    found: Floats = -middle + np.sqrt(middle**2 - (places**2).sum(axis=-1) + _TOP**2)
    return found


def _density(places: Floats) -> Floats:
    """(..., 3): of air, dust and ozone."""
    heights = np.linalg.norm(places, axis=-1) - _EARTH
    ozone = np.maximum(1.0 - np.abs(heights - 25e3) / 15e3, 0.0)
    return np.stack([np.exp(-heights / 8e3), np.exp(-heights / 1.2e3), ozone], axis=-1)


# Multiple scattering -------------------------------------------------------------------------------------------------


def _scatter_often(elevation: float, altitude: float, densities: tuple[float, ...]) -> Floats:
    """Return the table of the other model, like `_scatter_once`."""
    latitudes = sky_latitudes(_ROWS)
    towards_sun = np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    ways = _directions(latitudes, _LONGITUDES[::2])
    air, dust, again = _light_often(ways, towards_sun, _PLANET + _kilometres(altitude), densities) @ _TO_XYZ_4
    longitudes = (np.arange(_WIDTH // 2) + 0.5) * (2.0 * math.pi / _WIDTH)
    cosine = (_directions(latitudes, longitudes) @ towards_sun)[..., None]
    g = _DUST_FORWARD_4
    air_phase = 3.0 / (16.0 * math.pi) * (1.0 + cosine**2)
    dust_phase = (1.0 - g * g) / (4.0 * math.pi) / (1.0 + g * g - 2.0 * g * cosine) ** 1.5
    found: Floats = _spread(air, longitudes) * air_phase + _spread(dust, longitudes) * dust_phase
    return found + _spread(again, longitudes)


def _light_often(ways: Floats, towards_sun: Floats, eye: float, densities: tuple[float, ...]) -> Floats:
    """(3, R, L, 4): what air and dust scatter to the eye, without their phase functions, and what comes from more."""
    up = ways[..., 2]
    to_ground = (eye * up) ** 2 - eye**2 + _PLANET**2
    is_ground = (to_ground >= 0.0) & (up < 0.0)
    step = np.where(is_ground, -eye * up - np.sqrt(np.maximum(to_ground, 0.0)), _distance_out(eye, up)) / _MARCH
    through, found = np.ones((*up.shape, 4)), np.zeros((3, *up.shape, 4))
    for number in range(_MARCH):
        way = (number + 0.5) * step
        radius = np.sqrt(eye**2 + way**2 + 2.0 * eye * way * up)
        cosine = (ways @ towards_sun * way + eye * towards_sun[2]) / radius
        scattered_air, scattered_dust, loss = _coefficients(np.maximum(radius - _PLANET, 0.0), densities)
        passed = np.exp(-step[..., None] * loss)
        seen = through * (1.0 - passed) / np.maximum(loss, 1e-7) * _SUN_4
        direct = _look_up(cosine, radius, densities)
        found[0] += seen * scattered_air * direct
        found[1] += seen * scattered_dust * direct
        found[2] += seen * (scattered_air + scattered_dust) * _from_more(cosine, radius, densities)
        through *= passed
    return found


def _from_more(cosine: Floats, radius: Floats, densities: tuple[float, ...]) -> Floats:
    """(..., 4): a fit of what other places in the air send, and the sunlight that the ground reflects."""
    seen_ground = 2.0 * math.pi * (1.0 - np.sqrt(np.maximum(1.0 - (_PLANET / radius) ** 2, 0.0)))
    table = _transmittances(densities)
    rows, columns = _places(cosine, radius)
    from_ground = table[0, -1] / _between(table[:, -1], rows)
    reflected = (seen_ground * cosine)[..., None] * _between(table[0], columns) * from_ground
    again: Floats = _AGAIN_4 / (1.0 + 5.0 * np.exp(-17.92 * cosine))[..., None]
    return again + reflected * (_GROUND / (4.0 * math.pi**2))


def _sunlight_often(elevations: Floats, altitude: float, densities: tuple[float, ...]) -> Floats:
    """(N, 3) XYZ of what faces the sun."""
    passed = _transmit(np.sin(elevations), np.full(len(elevations), _kilometres(altitude)), densities)
    found: Floats = passed * _SUN_4 @ _TO_XYZ_4
    return found


def _kilometres(altitude: float) -> float:
    return min(max(altitude, 1.0), 99999.0) / 1e3


@lru_cache(maxsize=2)
def _transmittances(densities: tuple[float, ...]) -> Floats:
    """(64, 256, 4): from heights up to the end of the air towards the sun, by the cosine from the zenith."""
    cosines, heights = np.meshgrid(np.linspace(-1.0, 1.0, 256), np.linspace(0.0, _AIR_THICKNESS, 64))
    return _transmit(cosines, heights, densities)


def _transmit(cosines: Floats, heights: Floats, densities: tuple[float, ...]) -> Floats:
    """(..., 4): how much of the sunlight comes through the air, and the ground, as if it were air."""
    radius = _PLANET + heights
    step = _distance_out(radius, cosines) / _MARCH
    loss = np.zeros((*heights.shape, 4))
    for number in range(_MARCH):
        way = (number + 0.5) * step
        places = np.sqrt(radius**2 + way**2 + 2.0 * radius * way * cosines) - _PLANET
        loss += _coefficients(np.maximum(places, 0.0), densities)[2] * step[..., None]
    return np.exp(-loss)


def _distance_out(radius: Any, cosine: Floats) -> Floats:
    inside = (_PLANET + _AIR_THICKNESS) ** 2 - radius**2
    found: Floats = -radius * cosine + np.sqrt((radius * cosine) ** 2 + inside)
    return found


def _coefficients(heights: Floats, densities: tuple[float, ...]) -> tuple[Floats, Floats, Floats]:
    """(..., 4) each, of a kilometre: what air scatters, what dust scatters, and the loss by all."""
    air, dust, ozone = densities
    log_height = np.log(np.maximum(heights, 1e-4))
    of_ozone = ozone * np.exp(-((log_height - 3.22261) ** 2) * (1.0 / 0.18) - log_height)
    of_dust = (dust * np.exp(-heights / 0.73))[..., None]
    by_air = (air * np.exp(-0.07771971 * heights**1.16364243))[..., None] * _AIR_4
    by_dust = of_dust * _DUST_SCATTERS_4
    return by_air, by_dust, by_air + by_dust + of_dust * _DUST_ABSORBS_4 + of_ozone[..., None] * _OZONE_4


def _look_up(cosine: Floats, radius: Floats, densities: tuple[float, ...]) -> Floats:
    """(..., 4): `_transmittances`, interpolated."""
    rows, columns = _places(cosine, radius)
    table = _transmittances(densities)
    row = np.clip(rows.astype(int), 0, len(table) - 2)
    down = np.clip(rows - row, 0.0, 1.0)[..., None]
    flat, places = table.reshape(-1, 4), row * table.shape[1] + np.clip(columns, 0.0, table.shape[1] - 1.0)
    found: Floats = _between(flat, places) * (1.0 - down) + _between(flat, places + table.shape[1]) * down
    return found


def _places(cosine: Floats, radius: Floats) -> tuple[Floats, Floats]:
    """Rows and columns of `_transmittances`, with fractions."""
    return (radius - _PLANET) * (63.0 / _AIR_THICKNESS), (cosine + 1.0) * 127.5


def _between(rows: Floats, places: Floats) -> Floats:
    """(..., C): rows of an array, interpolated."""
    low = np.clip(places.astype(int), 0, len(rows) - 2)
    part = np.clip(places - low, 0.0, 1.0).reshape(*places.shape, *(1,) * (rows.ndim - 1))
    found: Floats = rows[low] * (1.0 - part) + rows[low + 1] * part
    return found
