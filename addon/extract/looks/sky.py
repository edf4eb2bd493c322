"""What a Sky Texture node shows, as an image round the scene and a sun: light scattered once in a round atmosphere.

After Nishita et al., "Display of the Earth taking into account atmospheric scattering" (1993): along each way of sight
the sunlight that air and dust send to the eye is summed up, dimmed on its way in and out. What is scattered more often
is a share of that which was fitted to what Cycles shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from .color_math import tristimulus_curves, xyz_to_rgb

Floats = npt.NDArray[np.float64]

_WIDTH, _HEIGHT = 128, 64
_STEPS, _STEPS_TO_SUN = 32, 12
# Metres. The atmosphere ends where next to nothing is left of it.
_EARTH, _TOP = 6.36e6, 6.42e6
_AIR_HEIGHT, _DUST_HEIGHT = 8.0e3, 1.2e3
_WAVES = np.arange(400.0, 701.0, 30.0)  # nanometres
# Of a metre at sea level; the ozone's where there is most of it, at 25 km.
_AIR = 1.24e-6 * (_WAVES / 1e3) ** -4.0
_DUST, _DUST_LOSS, _DUST_FORWARD = 2.0e-5, 1.11, 0.76
_OZONE = np.interp(
    _WAVES, [400, 440, 480, 550, 600, 680, 720], [0.0, 0.085e-6, 0.5e-6, 1.88e-6, 2.6e-6, 0.65e-6, 0.2e-6]
)
# Sunlight above the air, by Planck's law for 5778 K; its scale is that of Cycles.
_SUN = 2.1e17 * _WAVES**-5.0 / np.expm1(1.4388e7 / (_WAVES * 5778.0))
# How much brighter the sky is for light that was scattered more often: at once, and where much air lies before it; and
# how much less dust that model of Blender's has.
_MORE, _MORE_IN_HAZE, _LESS_DUST = np.array([0.23, 0.5, 0.77]), np.array([0.37, 0.12, 0.25]), 0.5
# How bright Blender's older models are beside this one.
_OLDER_MODELS = {"PREETHAM": 0.17, "HOSEK_WILKIE": 0.026}


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
    """Of a Sky Texture node of any Blender and model; and how far it is turned, from +Y to +X, in radians."""
    older = _OLDER_MODELS.get(node.sky_type)
    if older is not None:
        x, y, z = node.sun_direction
        elevation, rotation = math.atan2(z, math.hypot(x, y)), math.atan2(x, y)
        return _make(elevation, 0.0, 1.0, node.turbidity / 2.2, 1.0, older, None, False), rotation
    dust = node.aerosol_density if hasattr(node, "aerosol_density") else node.dust_density
    disc = (node.sun_size, node.sun_intensity) if node.sun_disc else None
    densities = (node.air_density, dust, node.ozone_density)
    is_multiple = node.sky_type == "MULTIPLE_SCATTERING"
    return _make(node.sun_elevation, node.altitude, *densities, 1.0, disc, is_multiple), node.sun_rotation


@lru_cache(maxsize=8)
def _make(
    elevation: float,
    altitude: float,
    air: float,
    dust: float,
    ozone: float,
    scale: float,
    disc: tuple[float, float] | None,
    is_multiple: bool,
) -> Sky:
    densities = np.array([air, dust * (_LESS_DUST if is_multiple else 1.0), ozone])
    eye = np.array([0.0, 0.0, _EARTH + min(max(altitude, 1.0), 59e3)])
    towards_sun = np.array([0.0, math.cos(elevation), math.sin(elevation)])
    upper = _light_above(eye, towards_sun, densities, is_multiple) * scale
    # Below the horizon the sky fades away; the newer model sees the dark ground there at once, the oldest go on.
    below = np.sin((np.arange(_HEIGHT // 2) + 0.5 - _HEIGHT // 2) / _HEIGHT * math.pi)
    if scale != 1.0:
        fading = np.ones_like(below)
    elif is_multiple:
        fading = 0.025 * np.clip(1.0 + below * 1.7, 0.0, 1.0)
    else:
        fading = np.clip(1.0 + below * 2.5, 0.0, 1.0) ** 3
    pixels = np.ones((_HEIGHT, _WIDTH, 4), np.float32)
    pixels[_HEIGHT // 2 :, :, :3] = upper
    pixels[: _HEIGHT // 2, :, :3] = fading[:, None, None] * upper[0]
    if disc is None or elevation <= -disc[0]:
        return Sky(pixels, None)
    shining = _to_rgb(_SUN * np.exp(-_loss(_amounts(eye[None], towards_sun[None], _STEPS_TO_SUN * 4), densities)))[0]
    red, green, blue = (np.maximum(shining, 0.0) * disc[1]).tolist()
    return Sky(pixels, Sun(elevation, (red, green, blue), disc[0]))


def _light_above(eye: Floats, towards_sun: Floats, densities: Floats, is_multiple: bool) -> Floats:
    """(H / 2, W, 3): the image's upper half."""
    # Left and right of the sun it is the same: one half is worked out.
    beside = (np.arange(_WIDTH // 2) + 0.5) / _WIDTH * 2.0 * math.pi
    latitude = (np.arange(_HEIGHT // 2) + 0.5) / _HEIGHT * math.pi
    flat, up = np.cos(latitude)[:, None], np.sin(latitude)[:, None] + 0.0 * beside
    ways = np.stack([flat * np.sin(beside), flat * np.cos(beside), up], axis=-1)
    light, depth = _scattered(eye, ways.reshape(-1, 3), towards_sun, densities)
    half = np.maximum(_to_rgb(light), 0.0)
    if is_multiple:
        half *= 1.0 + _MORE + _MORE_IN_HAZE * (1.0 - np.exp(-_channel_means(depth)))
    half = half.reshape(_HEIGHT // 2, _WIDTH // 2, 3)
    # The image begins at -X and goes on over +Y, where the sun is, a quarter of the way.
    return np.roll(np.concatenate([half[:, ::-1], half], axis=1), -_WIDTH // 4, axis=1)


def _scattered(eye: Floats, ways: Floats, towards_sun: Floats, densities: Floats) -> tuple[Floats, Floats]:
    """(N, waves): the light that comes from N directions, and how much each is dimmed from end to end."""
    lengths = _way_out(eye[None], ways)
    # Half of the samples in the nearest tenth: the air is densest there.
    shares = np.linspace(0.0, 1.0, _STEPS + 1) ** 2.0
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
        dimmed = np.exp(-_loss(amounts + here * step[:, None] / 2.0 + to_sun, densities))
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


def _density(heights: Floats) -> Floats:
    """(N, 3): of air, dust and ozone."""
    heights = np.maximum(heights, 0.0)
    ozone = np.maximum(1.0 - np.abs(heights - 25e3) / 15e3, 0.0)
    return np.stack([np.exp(-heights / _AIR_HEIGHT), np.exp(-heights / _DUST_HEIGHT), ozone], axis=1)


def _loss(amounts: Floats, densities: Floats) -> Floats:
    """(N, waves): the exponent of what is left of light after so much of each."""
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
