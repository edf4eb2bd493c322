"""What became of each ray of a scan: exactly one outcome per ray, so that the counts add up. Knows no Blender."""

from __future__ import annotations

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
    "hit the mount alone",
    "hit objects through glass or by mirrors",
    "came back too dark",
    "were lost to dropout",
    "hit what the second eye does not see",
    "were out of range",
    "hit nothing",
)


@dataclass(frozen=True, slots=True)
class RayCounts:
    """How many rays of a scan had which outcome. A ray has one outcome, the first below that fits.

    The rays of a sensor with light are its beams, however many rays stand for one and however many points it gives.

    on_mount: all points of the ray are on the mount (the sensor's object and its children). behind_glass: a point was
    reached through glass or alpha, or by a mirror. on_objects: any other ray with points. too_dark: the ray hit
    surfaces, and none returned enough light to be detected. dropped_out: the sensor's noise dropped what was detected.
    hidden: the second eye of a depth camera does not see what was hit. out_of_range: something is on the ray, but
    nearer or farther than the sensor measures. hit_nothing: nothing is on the ray. Of a beam without points whose rays
    hit nothing in range, its middle ray decides between the last three.
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
        """All rays."""
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
    """Tells why rays met nothing. mask: of what they see."""

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
        """Marks the rays at `rows`, which met nothing in range. origins, directions, times: of all rays."""
        at = np.broadcast_to(times, len(outcomes))[rows]
        is_in_way = self._test(origins[rows], directions[rows], 0.0, np.inf, at)
        outcomes[rows] = np.where(is_in_way, Outcome.OUT_OF_RANGE, Outcome.HIT_NOTHING)
        if has_second_eye:  # only that makes a miss of what is in range
            is_in_range = self._test(origins[rows], directions[rows], rays.t_min, rays.t_max, at)
            outcomes[rows[is_in_range]] = Outcome.HIDDEN

    def _test(
        self, origins: Float64Array, directions: Float64Array, t_min: float, t_max: float, times: npt.NDArray[Any]
    ) -> BoolArray:
        how = {"mask": self.mask, "times": times, "threads": self.threads}
        return np.asarray(self.snapshot.test_occlusions(origins, directions, t_min=t_min, t_max=t_max, **how))
