"""The Sky Texture's two oldest models, as images round the scene with the sun over +Y.

Preetham, Shirley and Smits, "A practical analytic model for daylight" (1999): luminance and chromaticities, each by
Perez' formula. Hosek and Wilkie, "An analytic model for full spectral sky-dome radiance" (2012): X, Y and Z, each by a
longer one, whose coefficients (`hosek_wilkie.npy`) were fitted to images of Cycles as tests/blender/fit_hosek_wilkie.py
does it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .values import xyz_to_rgb

Floats = npt.NDArray[np.float64]

_WIDTH, _HEIGHT = 512, 256
# Below this latitude a formula keeps its value there.
LOWEST_LATITUDE = 0.001
# More than half precision holds is where Preetham's formula divides by nearly nothing.
_BRIGHTEST = 65504.0
_KILOCANDELA = 0.06  # what Cycles makes of the unit of Preetham's luminance; measured

# Of Y, x and y: coefficients of Perez' formula by (turbidity, 1).
_PEREZ = np.array(
    [
        [(0.1787, -1.463), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.067, 0.3703)],
        [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
        [(-0.0167, -0.2608), (-0.095, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
    ]
)
# Of x and y at the zenith, by turbidity squared, turbidity and 1, and the sun's angle from the zenith cubed to 1.
_ZENITH = np.array(
    [
        [
            (0.00166, -0.00375, 0.00209, 0.0),
            (-0.02903, 0.06377, -0.03202, 0.00394),
            (0.11693, -0.21196, 0.06052, 0.25886),
        ],
        [(0.00275, -0.0061, 0.00317, 0.0), (-0.04214, 0.0897, -0.04153, 0.00516), (0.15346, -0.26756, 0.0667, 0.26688)],
    ]
)


def paint_older_sky(model: str, elevation: float, turbidity: float, albedo: float) -> npt.NDArray[np.float32]:
    """(H, W, 4): of the model "PREETHAM" or "HOSEK_WILKIE", with the sun at this elevation in radians."""
    latitudes = sky_latitudes(_HEIGHT)[:, None]
    # Left and right of the sun it is the same: one half is worked out, away from the sun.
    longitudes = (np.arange(_WIDTH // 2) + 0.5) / _WIDTH * 2.0 * math.pi
    if model == "HOSEK_WILKIE":
        elevation = max(elevation, 0.0)
    cosine = np.cos(latitudes) * np.cos(longitudes) * math.cos(elevation) + np.sin(latitudes) * math.sin(elevation)
    up = np.sin(np.maximum(latitudes, LOWEST_LATITUDE))
    shown = _preetham if model == "PREETHAM" else _hosek_wilkie
    with np.errstate(divide="ignore", invalid="ignore"):
        rgb = xyz_to_rgb(shown(up, np.clip(cosine, -1.0, 1.0), elevation, turbidity, albedo))
    return mirror_half(np.minimum(np.nan_to_num(rgb), _BRIGHTEST))


def sky_latitudes(rows: int) -> Floats:
    """(rows,) radians, of an image whose extension is "sky"."""
    share = (np.arange(rows) + 0.5) / (rows / 2) - 1.0
    latitudes: Floats = share * np.abs(share) * (math.pi / 2.0)
    return latitudes


def mirror_half(rgb: Floats) -> npt.NDArray[np.float32]:
    """(H, W, 4) of (H, W / 2, 3), from the sun's longitude to the opposite one; colours are at least 0."""
    half = np.maximum(rgb, 0.0)
    pixels = np.ones((len(half), 2 * half.shape[1], 4), np.float32)
    # The image begins at -X and goes on over +Y, where the sun is, a quarter of the way.
    pixels[..., :3] = np.roll(np.concatenate([half[:, ::-1], half], axis=1), -half.shape[1] // 2, axis=1)
    return pixels


def _preetham(up: Floats, cosine: Floats, elevation: float, turbidity: float, _: float) -> Floats:
    """(..., 3) XYZ of directions so high up and so near to the sun, both as cosines."""
    from_zenith = math.pi / 2.0 - elevation
    chi = (4.0 / 9.0 - turbidity / 120.0) * (math.pi - 2.0 * from_zenith)
    luminance = (4.0453 * turbidity - 4.971) * math.tan(chi) - 0.2155 * turbidity + 2.4192
    zenith = np.array([turbidity**2, turbidity, 1.0]) @ _ZENITH @ from_zenith ** np.arange(3.0, -1.0, -1.0)
    parts = []
    for value, (a, b, c, d, e) in zip((luminance * _KILOCANDELA, *zenith), _PEREZ @ (turbidity, 1.0), strict=True):
        spread, glow = np.array([a, b]), np.array([1.0, c, d, e, 0.0, 0.0, 0.0])
        at_zenith = _radiance(np.ones(()), np.array(math.sin(elevation)), spread, glow, 0.0)
        parts.append(value * _radiance(up, cosine, spread, glow, 0.0) / at_zenith)
    light, x, y = parts
    return np.stack([x / y * light, light, (1.0 - x - y) / y * light], axis=-1)


def _hosek_wilkie(up: Floats, cosine: Floats, elevation: float, turbidity: float, albedo: float) -> Floats:
    """Evaluate like `_preetham`: a quintic Bezier curve of the cubic root of the elevation, linear in the other two."""
    table = _read_table()
    low = min(int(turbidity), len(table) - 1)
    by_albedo = table[low - 1] + (table[low] - table[low - 1]) * (turbidity - low)
    points = by_albedo[0] + (by_albedo[1] - by_albedo[0]) * albedo
    place = (elevation / (math.pi / 2.0)) ** (1.0 / 3.0)
    weights = [math.comb(5, i) * place**i * (1.0 - place) ** (5 - i) for i in range(6)]
    sums = np.einsum("i,cik->ck", weights, points)
    return np.stack([_radiance(up, cosine, one[:2], one[2:9], 0.01) * one[9] for one in sums], axis=-1)


def _radiance(up: Floats, cosine: Floats, spread: Floats, glow: Floats, lift: float) -> Floats:
    """Return both models' radiance: its change from the horizon upwards, times that away from the sun."""
    even, sharp, narrowing, wide, round_sun, width, upwards = glow
    haze = (1.0 + cosine**2) / (1.0 + width**2 - 2.0 * width * cosine) ** 1.5 if round_sun else 0.0
    away = even + sharp * np.exp(narrowing * np.arccos(cosine)) + wide * cosine**2 + round_sun * haze
    return (1.0 + spread[0] * np.exp(spread[1] / (up + lift))) * (away + upwards * np.sqrt(up))


@lru_cache(maxsize=1)
def _read_table() -> Floats:
    """(10, 2, 3, 6, 10): by turbidity, albedo 0 and 1, and X, Y, Z: Bezier's points of nine coefficients, a factor."""
    return np.load(Path(__file__).with_name("hosek_wilkie.npy")).astype(np.float64)
