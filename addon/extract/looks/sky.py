"""The image of a Sky Texture node, round the scene, and its sun: light scattered once in a round atmosphere.

After Nishita et al., "Display of the Earth taking into account atmospheric scattering" (1993): along each line of
sight, the sunlight that air and dust scatter to the eye is summed up, dimmed on its way in and out. Blender's newer
model has multiple scattering, too. It grows with single scattering, and with the light of sun and sky on the ground
where air and dust in front of the ground scatter it. The shares were fitted to Cycles' images.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from .older_skies import paint_older_sky
from .values import tristimulus_curves, xyz_to_rgb

Floats = npt.NDArray[np.float64]

_WIDTH, _HEIGHT = 128, 64
_STEPS, _STEPS_TO_SUN = 32, 12
# Metres. The atmosphere ends where next to nothing is left of it.
_EARTH, _TOP = 6.36e6, 6.42e6
_AIR_HEIGHT, _DUST_HEIGHT = 8.0e3, 1.2e3
_WAVES = np.arange(400.0, 701.0, 30.0)  # nanometres
# Of a metre at sea level; the ozone's where there is most of it, at 25 km.
_AIR = 1.13e-6 * (_WAVES / 1e3) ** -4.05
_DUST, _DUST_LOSS, _DUST_FORWARD = 1.97e-5, 1.11, 0.76
_OZONE = np.interp(
    _WAVES, [400, 440, 480, 550, 600, 680, 720], [0.0, 0.085e-6, 0.5e-6, 1.88e-6, 2.6e-6, 0.65e-6, 0.2e-6]
)
# Sunlight above the air, by Planck's law for 5590 K. This, and what air and dust scatter, were fitted to what Cycles
# shows of light that was scattered once, by sun's heights, altitudes and densities.
_SUN = 2.8e17 * _WAVES**-5.0 / np.expm1(1.4388e7 / (_WAVES * 5590.0))
# Multiple scattering, by channels, relative to single scattering: a constant part, and one that grows with the air and
# dust in between; with these also grow shares of the sun's and of the sky's light on the ground; and the share of the
# dust in that model of Blender's.
_MORE, _MORE_IN_HAZE = np.array([0.86, 1.11, 1.3]), np.array([0.39, 0.093, 0.0])
_OF_SUN, _OF_SKY, _LESS_DUST = np.array([0.034, 0.0465, 0.031]), np.array([0.076, 0.081, 0.228]), 0.65
# Cycles' sun is darker towards its edge, and other amounts dim it than what lights the air: how bright the disc is, and
# how much of air, dust and ozone lies before it, where light is scattered once and more often.
_DISC = {False: (0.805, np.array([0.95, 1.0, 0.1])), True: (0.9125, np.array([1.1, 0.32, 1.1]))}
# How much brighter than that the air before the ground is, which lights it from nearby.
_ABOVE_GROUND = 1.35


@dataclass(frozen=True, slots=True)
class Sun:
    """elevation: above the horizon, and angle: across it, in radians. irradiance: of what faces it."""

    elevation: float
    irradiance: tuple[float, float, float]
    angle: float


@dataclass(frozen=True, slots=True, eq=False)
class Sky:
    """pixels: (H, W, 4) float32, equirectangular, with the sun over +Y. sun: None if it is not to be shown."""

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
    is_multiple = node.sky_type == "MULTIPLE_SCATTERING"
    return _make(node.sun_elevation, node.altitude, *densities, disc, is_multiple), node.sun_rotation


@lru_cache(maxsize=2)
def _make_older(model: str, elevation: float, turbidity: float, albedo: float) -> Sky:
    return Sky(paint_older_sky(model, elevation, turbidity, albedo), None)


@lru_cache(maxsize=8)
def _make(
    elevation: float,
    altitude: float,
    air: float,
    dust: float,
    ozone: float,
    disc: tuple[float, float] | None,
    is_multiple: bool,
) -> Sky:
    densities = np.array([air, dust * (_LESS_DUST if is_multiple else 1.0), ozone])
    eye = np.array([0.0, 0.0, _EARTH + min(max(altitude, 1.0), 59e3)])
    towards_sun = np.array([0.0, math.cos(elevation), math.sin(elevation)])
    latitudes = (np.arange(_HEIGHT) + 0.5 - _HEIGHT // 2) / _HEIGHT * math.pi
    above, below = latitudes[_HEIGHT // 2 :], latitudes[: _HEIGHT // 2]
    pixels = np.ones((_HEIGHT, _WIDTH, 4), np.float32)
    if is_multiple:  # below the horizon is the air before a dark ground
        pixels[:, :, :3] = _light_along(eye, latitudes, towards_sun, densities, is_multiple)
        pixels[: _HEIGHT // 2, :, :3] *= _ABOVE_GROUND
    else:  # the sky fades away
        rows = _light_along(eye, np.array([0.0, *above]), towards_sun, densities, is_multiple)
        fading = np.clip(1.0 + np.sin(below) * 2.5, 0.0, 1.0) ** 3
        pixels[_HEIGHT // 2 :, :, :3] = rows[1:]
        pixels[: _HEIGHT // 2, :, :3] = fading[:, None, None] * rows[0]
    if disc is None or elevation <= -disc[0]:
        return Sky(pixels, None)
    brightness, shares = _DISC[is_multiple]
    red, green, blue = (_sunlight(eye, towards_sun, densities * shares) * (brightness * disc[1])).tolist()
    return Sky(pixels, Sun(elevation, (red, green, blue), disc[0]))


def _sunlight(eye: Floats, towards_sun: Floats, densities: Floats) -> Floats:
    """(3,): of what faces the sun."""
    loss = _loss(_amounts(eye[None], towards_sun[None], _STEPS_TO_SUN * 4), densities)
    return np.maximum(_to_rgb(_SUN * np.exp(-loss)), 0.0)[0]


def _light_along(eye: Floats, latitudes: Floats, towards_sun: Floats, densities: Floats, is_multiple: bool) -> Floats:
    """(R, W, 3): rows of the image, at R latitudes."""
    # Left and right of the sun it is the same: one half is worked out.
    beside = (np.arange(_WIDTH // 2) + 0.5) / _WIDTH * 2.0 * math.pi
    flat, up = np.cos(latitudes)[:, None], np.sin(latitudes)[:, None] + 0.0 * beside
    ways = np.stack([flat * np.sin(beside), flat * np.cos(beside), up], axis=-1)
    light, depth = _scattered(eye, ways.reshape(-1, 3), towards_sun, densities, is_exact=is_multiple)
    half = np.maximum(_to_rgb(light), 0.0).reshape(*ways.shape)
    if is_multiple:
        hidden = 1.0 - np.exp(-_channel_means(depth)).reshape(*ways.shape)
        # Of the sky on the ground: each row's share, by its area and the cosine at which it comes.
        shares = np.where(latitudes > 0.0, np.sin(latitudes) * np.cos(latitudes), 0.0) * 2.0 * math.pi**2 / _HEIGHT
        of_sky = (half.mean(axis=1) * shares[:, None]).sum(axis=0)
        of_sun = _sunlight(eye, towards_sun, densities) * max(float(towards_sun[2]), 0.0)
        half = half * (_MORE + _MORE_IN_HAZE * hidden) + hidden * (_OF_SUN * of_sun + _OF_SKY * of_sky)
    # The image begins at -X and goes on over +Y, where the sun is, a quarter of the way.
    return np.roll(np.concatenate([half[:, ::-1], half], axis=1), -_WIDTH // 4, axis=1)


def _scattered(
    eye: Floats, ways: Floats, towards_sun: Floats, densities: Floats, *, is_exact: bool
) -> tuple[Floats, Floats]:
    """(N, waves): the light that comes from N directions, and the attenuation from end to end of each.

    is_exact: whether the light gained in a step is dimmed by half of it, the average, and steps are shorter
    nearby. Cycles' single scattering uses equal steps and dims by the whole step. Near the horizon, where steps are
    long, that takes a sixth of the blue at four degrees and two fifths at none.
    """
    lengths = _way_in_air(eye[None], ways)
    # Half of the samples in the nearest quarter: the air is densest there.
    shares = np.linspace(0.0, 1.0, _STEPS + 1) ** (2.0 if is_exact else 1.0)
    dimmed_by = 0.5 if is_exact else 1.0
    cosine = ways @ towards_sun
    air_phase = 3.0 / (16.0 * math.pi) * (1.0 + cosine**2)
    g = _DUST_FORWARD
    dust_phase = 3.0 / (8.0 * math.pi) * (1.0 - g * g) / (2.0 + g * g) * (1.0 + cosine**2)
    dust_phase /= (1.0 + g * g - 2.0 * g * cosine) ** 1.5
    light, amounts = np.zeros((len(ways), len(_WAVES))), np.zeros((len(ways), 3))
    for near, far in pairwise(shares):
        step = lengths * (far - near)
        places = eye + ways * (lengths * (near + far) / 2.0)[:, None]
        here = _density(np.linalg.norm(places, axis=1) - _EARTH)
        to_sun = _amounts(places, np.broadcast_to(towards_sun, places.shape), _STEPS_TO_SUN)
        dimmed = np.exp(-_loss(amounts + here * (dimmed_by * step)[:, None] + to_sun, densities))
        dimmed[~np.isfinite(dimmed)] = 0.0
        gained = (here[:, 0] * air_phase * densities[0])[:, None] * _AIR
        gained = gained + (here[:, 1] * dust_phase * densities[1])[:, None] * _DUST
        light += dimmed * gained * step[:, None]
        amounts += here * step[:, None]
    return light * _SUN, _loss(amounts, densities)


def _amounts(places: Floats, ways: Floats, steps: int) -> Floats:
    """(N, 3): metres of air, dust and ozone, as dense as each ever is, on each way out; infinite into the earth."""
    lengths = _way_out(places, ways)
    total = np.zeros((len(places), 3))
    shares = np.linspace(0.0, 1.0, steps + 1) ** 2.0
    for near, far in pairwise(shares):
        heights = np.linalg.norm(places + ways * (lengths * (near + far) / 2.0)[:, None], axis=1) - _EARTH
        total += _density(heights) * (lengths * (far - near))[:, None]
    middle = np.einsum("ij,ij->i", places, ways)
    nearest = np.einsum("ij,ij->i", places, places) - middle**2
    total[(middle < 0.0) & (nearest < _EARTH**2)] = np.inf
    return total


def _way_out(places: Floats, ways: Floats) -> Floats:
    middle = np.einsum("ij,ij->i", places, ways)
    return -middle + np.sqrt(np.maximum(middle**2 - np.einsum("ij,ij->i", places, places) + _TOP**2, 0.0))


def _way_in_air(places: Floats, ways: Floats) -> Floats:
    """Out of the air, or to the ground."""
    middle = np.einsum("ij,ij->i", places, ways)
    inside = middle**2 - np.einsum("ij,ij->i", places, places) + _EARTH**2
    to_ground = -middle - np.sqrt(np.maximum(inside, 0.0))
    return np.where((inside > 0.0) & (middle < 0.0), np.maximum(to_ground, 0.0), _way_out(places, ways))


def _density(heights: Floats) -> Floats:
    """(N, 3): of air, dust and ozone."""
    heights = np.maximum(heights, 0.0)
    ozone = np.maximum(1.0 - np.abs(heights - 25e3) / 15e3, 0.0)
    return np.stack([np.exp(-heights / _AIR_HEIGHT), np.exp(-heights / _DUST_HEIGHT), ozone], axis=1)


def _loss(amounts: Floats, densities: Floats) -> Floats:
    """(N, waves): the exponent of the transmittance for these amounts of each."""
    coefficients = np.stack([_AIR, np.full_like(_AIR, _DUST * _DUST_LOSS), _OZONE])
    return (amounts * densities) @ coefficients if np.isfinite(amounts).all() else _finite_loss(amounts, densities)


def _finite_loss(amounts: Floats, densities: Floats) -> Floats:
    is_blocked = ~np.isfinite(amounts).all(axis=1)
    loss = _loss(np.where(np.isfinite(amounts), amounts, 0.0), densities)
    loss[is_blocked] = np.inf
    return loss


def _to_rgb(spectrum: Floats) -> Floats:
    """(..., 3) of (..., waves)."""
    return xyz_to_rgb(spectrum @ tristimulus_curves(_WAVES).T)


def _channel_means(values: Floats) -> Floats:
    """(..., 3) of (..., waves): what red, green and blue light has on the average."""
    return np.stack([values[..., 7:].mean(-1), values[..., 4:6].mean(-1), values[..., 1:3].mean(-1)], axis=-1)
