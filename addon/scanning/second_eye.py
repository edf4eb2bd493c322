"""Depth cameras of two eyes: a point counts if both see it. Knows no Blender."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import Hits, Snapshot

Float64Array = npt.NDArray[np.float64]

# Of the way to a point: what is no farther from it is the point's own surface.
ALMOST_THERE = 1.0 - 1e-5


def drop_hidden(
    hits: Hits, eyes: Float64Array, snapshot: Snapshot, mask: int, times: npt.ArrayLike, threads: int
) -> None:
    """Makes misses of hits that something hides from a second eye. eyes: (R, 3), where it is when each ray is cast."""
    ways = hits.positions - eyes
    how = {"mask": mask, "times": times, "threads": threads}
    is_hidden = snapshot.test_occlusions(eyes, ways, t_max=ALMOST_THERE, **how)
    hits.instance_ids[is_hidden & hits.is_hit] = -1
