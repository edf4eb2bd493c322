"""The colour and alpha that images have at places of uv maps: bilinear, as the renderer looks them up.

Values between those of bytes are sRGB, too, and are made linear afterwards.

Knows no Blender. In: an image's pixels and places; out: scene-linear colour and alpha.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from perfect_bvh.appearance import ImageTexture

from ..patterns import Float64Array

MISSING_TILE = (1.0, 0.0, 1.0, 1.0)  # magenta, as in Cycles
TILES_A_ROW = 10
FIRST_TILE = 1001


def look_up(image: ImageTexture, uvs: npt.NDArray[np.floating]) -> Float64Array:
    """(N, 4) float64 at (N, 2) places of a uv map; what is not finite counts as 0."""
    across, up = np.asarray(image.uv_transform, np.float64).reshape(2, 3)
    u, v = uvs.astype(np.float64).T
    places = np.stack([across[0] * u + across[1] * v + across[2], up[0] * u + up[1] * v + up[2]], axis=1)
    return _look_up_tiles(image, places) if image.tiles else _bilinear(image.pixels, image.extension, places)


def _look_up_tiles(image: ImageTexture, places: Float64Array) -> Float64Array:
    """As in Cycles what lies less than a unit to the left of all tiles, or below them, belongs to the first ones."""
    known = np.where(np.isfinite(places), places, -1.0)
    columns, rows = np.trunc(np.clip(known, -2.0, 1e6)).astype(np.int64).T
    is_inside = (known > -1.0).all(axis=1) & (columns < TILES_A_ROW)
    numbers = np.where(is_inside, FIRST_TILE + columns + TILES_A_ROW * rows, -1)
    found = np.tile(np.array(MISSING_TILE), (len(places), 1))
    for number, pixels in image.tiles.items():
        at = np.flatnonzero(numbers == number)
        if len(at):
            found[at] = _bilinear(pixels, image.extension, known[at] - np.stack([columns[at], rows[at]], axis=1))
    return found


def _bilinear(pixels: npt.NDArray[np.generic], extension: str, places: Float64Array) -> Float64Array:
    height, width = pixels.shape[:2]
    if not height or not width:
        return np.zeros((len(places), 4))
    x, y = (_in_pixels(places[:, axis], count, extension) for axis, count in ((0, width), (1, height)))
    left, below = np.floor(x), np.floor(y)
    columns, rows = left.astype(np.int64), below.astype(np.int64)

    def at(right: int, above: int) -> Float64Array:
        return _pixels_at(pixels, extension, columns + right, rows + above)

    aside, over = (x - left)[:, None], (y - below)[:, None]
    lower, upper = (at(0, above) + (at(1, above) - at(0, above)) * aside for above in (0, 1))
    found = lower + (upper - lower) * over
    return _linear(found / 255.0) if pixels.dtype == np.uint8 else found


def _linear(found: Float64Array) -> Float64Array:
    """Of sRGB (IEC 61966-2-1); alpha is as it was."""
    colors = found[:, :3]
    found[:, :3] = np.where(colors <= 0.04045, colors / 12.92, ((colors + 0.055) / 1.055) ** 2.4)
    return found


def _in_pixels(coordinates: Float64Array, count: int, extension: str) -> Float64Array:
    known = np.where(np.isfinite(coordinates), coordinates, 0.0)
    if extension == "repeat":
        known = known - np.floor(known)
    return np.clip(known, -2.0, 3.0) * count - 0.5


def _pixels_at(
    pixels: npt.NDArray[np.generic], extension: str, columns: npt.NDArray[np.int64], rows: npt.NDArray[np.int64]
) -> Float64Array:
    height, width = pixels.shape[:2]
    if extension == "repeat":
        inner = columns % width, rows % height
    else:
        inner = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    colors = pixels[inner[1], inner[0]].astype(np.float64)
    if extension == "clip":
        colors[(inner[0] != columns) | (inner[1] != rows)] = 0.0
    return colors
