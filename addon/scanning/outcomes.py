"""The outcome of each ray of a scan: exactly one per ray, so that the counts add up. Does not depend on Blender."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from perfect_bvh import Snapshot

    from .patterns import Float64Array, Rays


Outcomes = npt.NDArray[np.int8]
BoolArray = npt.NDArray[np.bool_]


class Outcome(IntEnum):
    """The fields of `RayCounts`, in their order."""

    ON_OBJECTS = 0
    ON_MOUNT = 1
    BEHIND_GLASS = 2
    TOO_DARK = 3
    DROPPED_OUT = 4
    HIDDEN = 5
    OUT_OF_RANGE = 6
    HIT_NOTHING = 7


WORDS = (
    "hit objects",
    "hit only the mount",
    "hit objects through glass or by mirrors",
    "returned too little light",
    "were lost to dropout",
    "hit surfaces hidden from the second eye",
    "were out of range",
    "hit nothing",
)


@dataclass(frozen=True, slots=True)
class RayCounts:
    """The number of rays of a scan with each outcome. A ray has one outcome, the first below that fits.

    The rays of a sensor with light are its beams, for any number of sampling rays and points of a beam.

    Attributes:
        on_mount: All points of the ray are on the mount (the sensor's object and its children).
        behind_glass: A point was reached through glass or alpha, or by a mirror.
        on_objects: Any other ray with points.
        too_dark: The ray hit surfaces, and none returned enough light to be detected.
        dropped_out: The sensor's noise dropped the detected light.
        hidden: The second eye of a depth camera does not see the hit.
        out_of_range: Something is on the ray, but nearer or farther than the sensor measures.
        hit_nothing: Nothing is on the ray. Of a beam without points whose rays hit nothing in range, its middle ray
            decides between the last three.
    """

    on_objects: int = 0
    on_mount: int = 0
    behind_glass: int = 0
    too_dark: int = 0
    dropped_out: int = 0
    hidden: int = 0
    out_of_range: int = 0
    hit_nothing: int = 0

    @classmethod
    def of(cls, outcomes: Outcomes) -> RayCounts:
        """Counts the outcomes, (R,), of rays."""
        return cls(*np.bincount(outcomes, minlength=len(Outcome)).tolist())

    @property
    def cast(self) -> int:
        """The number of all rays."""
        return sum(self.named.values())

    @property
    def with_points(self) -> int:
        """Rays that gave a point."""
        return self.on_objects + self.on_mount + self.behind_glass

    @property
    def named(self) -> dict[str, int]:
        """The counts by their names."""
        return asdict(self)

    def __add__(self, other: RayCounts) -> RayCounts:
        names = [field.name for field in fields(self)]
        return RayCounts(**{name: getattr(self, name) + getattr(other, name) for name in names})

    def __str__(self) -> str:
        parts = [f"{count:,} {words}" for count, words in zip(self.named.values(), WORDS, strict=True) if count]
        return f"{self.cast:,} rays: {', '.join(parts)}" if parts else "0 rays"


def mark_mount(outcomes: Outcomes, rays: npt.NDArray[Any], is_on_mount: BoolArray) -> None:
    """Marks the rays whose points are all on the mount. rays: (N,) of each point. is_on_mount: (N,) of each point."""
    sees_more = np.zeros(len(outcomes), np.bool_)
    sees_more[rays[~is_on_mount]] = True
    alone = rays[is_on_mount]
    outcomes[alone[~sees_more[alone]]] = Outcome.ON_MOUNT


@dataclass(frozen=True, slots=True)
class MissJudge:
    """Finds out why rays hit nothing. mask: the instances that they see."""

    snapshot: Snapshot
    mask: int
    threads: int

    def mark(
        self,
        outcomes: Outcomes,
        rows: npt.NDArray[np.intp],
        rays: Rays,
        origins: Float64Array,
        directions: Float64Array,
        times: npt.ArrayLike,
        *,
        has_second_eye: bool,
    ) -> None:
        """Marks the rays at `rows`, which hit nothing in range. origins, directions, times: of all rays."""
        at = np.broadcast_to(times, len(outcomes))[rows]
        is_in_way = self._test(origins[rows], directions[rows], 0.0, np.inf, at)
        outcomes[rows] = np.where(is_in_way, Outcome.OUT_OF_RANGE, Outcome.HIT_NOTHING)
        if has_second_eye:  # only a second eye turns hits in range into misses
            is_in_range = self._test(origins[rows], directions[rows], rays.t_min, rays.t_max, at)
            outcomes[rows[is_in_range]] = Outcome.HIDDEN

    def _test(
        self, origins: Float64Array, directions: Float64Array, t_min: float, t_max: float, times: npt.NDArray[Any]
    ) -> BoolArray:
        how = {"mask": self.mask, "times": times, "threads": self.threads}
        return np.asarray(self.snapshot.test_occlusions(origins, directions, t_min=t_min, t_max=t_max, **how))


# Complaints ----------------------------------------------------------------------------------------------------------
# Says in words why a scan is useless, and how to fix it.
#
# The sentences hold no counts, so that equal ones of several files of a scan merge.


# Of rays with points: if this share hit the mount alone, the scan is one of the mount.
ALMOST_ALL = 0.99
# Why rays that hit something gave no point, and what to do then. Rays that hit nothing are usual: the sky is free.
_REASONS = {
    "out_of_range": "most hits are nearer or farther than the sensor's range{range}. Move the sensor, or "
    "choose another",
    "too_dark": "most hits returned too little light to be detected. Move the sensor nearer, check the "
    "colors of materials, or leave out [detection] in the sensor's file",
    "dropped_out": "most hits were lost to the sensor's dropout. Lower dropout in [noise] of its file",
    "hidden": "most hits are hidden from the second eye. Move the sensor away from near objects",
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
    """Yields the problems of a sensor in metres in a scene of another unit. units: the scene's unit settings."""
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


# Words ---------------------------------------------------------------------------------------------------------------
# Messages about names that users wrote: the nearest of the existing names.


def nearest(name: str, names: Iterable[str]) -> str:
    """`(is it ...?)` with the name that is most like it, "" if none is."""
    found = difflib.get_close_matches(name, list(names), n=1, cutoff=0.5)
    return f" (is it {found[0]!r}?)" if found else ""


def listed(names: Iterable[str]) -> str:
    """All of them."""
    return ", ".join(names)


def shown(value: Any) -> str:
    """A value that may be long."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
