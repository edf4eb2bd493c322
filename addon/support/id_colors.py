"""The color of an id: the same in points of scans and in label images. Does not depend on Blender."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

GOLDEN = 0.6180339887498949
SATURATIONS, VALUES = (0.55, 0.4, 0.65), (0.9, 0.75, 0.6)
NOTHING = 124 / 255  # the grey of ids below 0: no object, no material, no label


def id_colors(ids: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.float64]:
    """Returns (N, 3) sRGB, 0 to 1, of (N,) ids.

    Chooses hues by the golden ratio, so that consecutive ids differ strongly; brightness separates the others.
    """
    hue = np.where(ids < 0, 0, ids) * GOLDEN % 1.0
    saturation, value = np.array(SATURATIONS)[ids % 3], np.array(VALUES)[ids // 3 % 3]
    offsets = np.array((0.0, 2.0 / 3.0, 1.0 / 3.0))
    wheel = np.clip(np.abs((hue[:, None] + offsets) % 1.0 * 6.0 - 3.0) - 1.0, 0.0, 1.0)
    return np.where(ids[:, None] < 0, NOTHING, value[:, None] * (1.0 - saturation[:, None] * (1.0 - wheel)))
