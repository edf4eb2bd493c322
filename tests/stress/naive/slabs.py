"""The slab test in its usual form: float32, one division a ray, and comparisons that a NaN fails."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def box_hits(
    lower: npt.ArrayLike, upper: npt.ArrayLike, origins: npt.ArrayLike, directions: npt.ArrayLike
) -> npt.NDArray[np.bool_]:
    """(R,) whether each ray (R, 3) meets its box (R, 3) or (3,)."""
    low, high, starts, ways = (np.asarray(values, np.float32) for values in (lower, upper, origins, directions))
    with np.errstate(all="ignore"):
        inverse = np.float32(1.0) / ways
        first, second = (low - starts) * inverse, (high - starts) * inverse
        near = np.minimum(first, second).max(axis=-1)
        far = np.maximum(first, second).min(axis=-1)
        return np.asarray((near <= far) & (far >= 0.0))
