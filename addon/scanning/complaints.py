"""Says in words why a scan is of no use, and what to do about it. Knows no Blender.

The sentences hold no counts, so that those of several files of a scan are one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from .outcomes import RayCounts

# Of rays with points: if this share hit the mount alone, the scan is one of the mount.
ALMOST_ALL = 0.99
# Why rays that hit something gave no point, and what to do then. Rays that hit nothing are usual: the sky is free.
_REASONS = {
    "out_of_range": "what they hit is mostly nearer or farther than the sensor measures{range}. Move the sensor, or "
    "choose another",
    "too_dark": "what they hit mostly returned too little light to be detected. Move the sensor nearer, check the "
    "colors of materials, or leave out [detection] in the sensor's file",
    "dropped_out": "what they hit was mostly lost to the sensor's dropout. Lower dropout in [noise] of its file",
    "hidden": "what they hit is mostly hidden from the second eye. Move the sensor away from what is near",
}
_NOTHING = "they hit nothing. Check where the sensor points, and that objects around it are visible to cameras"


def complaints_of(counts: RayCounts, limits: tuple[float, float]) -> Iterator[str]:
    """Yields why a scan is of no use; nothing for most. limits: the sensor's range, in scene units."""
    if not counts.cast:
        return
    if not counts.with_points:
        reason = max(_REASONS, key=lambda name: counts.named[name])
        limit = "" if math.isinf(limits[1]) else f" ({limits[0]:g} to {limits[1]:g} scene units)"
        why = _REASONS[reason].format(range=limit) if counts.named[reason] else _NOTHING
        yield f"No ray of the scan, or of one of its files, gave a point: {why}"
    elif counts.on_mount >= ALMOST_ALL * counts.with_points:
        yield (
            "All points of the scan, or of one of its files, or almost all, are on the sensor's own object and its "
            "children: leave these out with --exclude-mount (exclude_mount=True, or Mount in the panel)"
        )


def mount_left_out(name: str) -> str:
    """Says that the default left the mount out. name: of the sensor's object."""
    return (
        f"{name!r} and its children are invisible to the sensor, as the sensor is inside of that mesh; "
        "--no-exclude-mount (exclude_mount=False, or Mount in the panel) has them scanned"
    )


def unit_complaints(units: Any, farthest: float) -> Iterator[str]:
    """Yields what is wrong with a sensor in metres in a scene of another unit. units: the scene's unit settings."""
    scale = units.scale_length
    if units.system == "NONE" or math.isclose(scale, 1.0, rel_tol=1e-3):
        return
    reach = (
        "" if math.isinf(farthest) else f": it measures up to {farthest:g} units, which are {farthest * scale:.3g} m"
    )
    yield (
        f"The scene's Unit Scale is {scale:g}, but the sensor takes a scene unit for a metre{reach}. Scale the scene "
        f"by {scale:g} and set Unit Scale to 1, or write a sensor's file in the scene's units"
    )
