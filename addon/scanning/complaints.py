"""Says in words why a scan is of no use, and what to do about it. Knows no Blender.

The sentences hold no counts, so that those of several pieces of a scan are one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from .outcomes import RayCounts

# Of rays with points: if so many hit the mount alone, the scan is one of the mount.
ALMOST_ALL = 0.99
# What most rays of a scan without points did, and what to do then.
_REASONS = {
    "hit_nothing": "hit nothing. Look whether objects around the sensor are visible to cameras, and where the sensor "
    "points",
    "out_of_range": "have something on them, but nearer or farther than the sensor measures{range}. Move the sensor, or "
    "choose another one",
    "too_dark": "hit something, but too little light came back to be detected. Move the sensor nearer, or look at the "
    "materials' colors; a sensor without [detection] detects everything",
    "dropped_out": "were lost to the sensor's dropout. Lower dropout in its [noise]",
    "hidden": "hit what the second eye does not see. Move the sensor away from what is near",
}


def complaints_of(counts: RayCounts, mount: str, nearest: float, farthest: float) -> Iterator[str]:
    """Sentences on a scan that has no use; none for most. mount: its name. nearest, farthest: the sensor's range."""
    if not counts.cast:
        return
    if not counts.with_points:
        reason = max(_REASONS, key=lambda name: counts.named[name])
        limits = "" if math.isinf(farthest) else f" ({nearest:g} to {farthest:g} scene units)"
        yield f"No ray gave a point. Most {_REASONS[reason].format(range=limits)}"
    elif counts.on_mount >= ALMOST_ALL * counts.with_points:
        all_of = "All" if counts.on_mount == counts.with_points else "Almost all"
        yield (
            f"{all_of} points are on the mount, {mount!r} and its children: leave it out with Exclude Mount "
            "(--exclude-mount, exclude_mount=True)"
        )


def unit_complaint(scale: float, farthest: float) -> str | None:
    """What is wrong with a sensor in metres in a scene of another unit; None if a unit is a metre."""
    if math.isclose(scale, 1.0, rel_tol=1e-3):
        return None
    reach = "" if math.isinf(farthest) else f": its range of {farthest:g} units is {farthest * scale:.3g} m here"
    return (
        f"The scene's Unit Scale is {scale:g}, but the sensor takes a scene unit for a metre{reach}. Scale the scene by "
        f"{scale:g} and set Unit Scale to 1, or describe the sensor in the scene's units in a file of your own"
    )
