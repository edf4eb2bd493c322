"""The losses of usual methods and of this engine on motion within the shutter: counted, never timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from .loss import PER_MILLION, Loss
from .losses_of_answers import per_million
from .time_zoo import F32, F64, TIME_CASES, Motion, TimeCase, rays_at

RAYS = 2000
BAD_TIMES = (-1e-6, -1.0, 1.0 + 1e-6, 7.0, float("inf"), float("-inf"), float("nan"))
OFF = 1e-3  # of t

Found = F64  # t of each ray, infinite on a miss


@dataclass(frozen=True)
class Asked:
    """A case's rays, and the engine's answers, which the audit has judged."""

    motion: Motion
    origins: F64
    directions: F64
    times: F32
    t_hit: Found
    wrong: npt.NDArray[np.bool_]


def asked(motion: Motion) -> Asked:
    """The engine's answers to rays at all times."""
    origins, directions, times = rays_at(motion, RAYS)
    hits = motion.scene().cast_rays(origins, directions, times=times, audit=1.0)
    wrong = np.zeros(RAYS, np.bool_)
    assert hits.audit is not None and hits.audit.checked_count == RAYS
    wrong[hits.audit.wrong_rows] = True
    return Asked(motion, origins, directions, times, hits.t_hit.astype(np.float64), wrong)


def _loss(ask: Asked, naive: npt.NDArray[np.bool_]) -> Loss:
    return Loss(PER_MILLION, per_million(naive), per_million(ask.wrong))


def closest(corners: F64, origins: F64, directions: F64) -> Found:
    """T of each ray, whose own triangles are (R, T, 3, 3): the plain test in double precision."""
    first = corners[:, :, 0]
    one, two = corners[:, :, 1] - first, corners[:, :, 2] - first
    across = np.cross(directions[:, None], two)
    with np.errstate(all="ignore"):
        scale = 1.0 / (one * across).sum(-1)
        away = origins[:, None] - first
        u = (away * across).sum(-1) * scale
        turned = np.cross(away, one)
        v = (directions[:, None] * turned).sum(-1) * scale
        t = (two * turned).sum(-1) * scale
        inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= 0.0)
    found: Found = np.where(inside, t, np.inf).min(axis=1)
    return found


def unlike(found: Found, true: Found) -> npt.NDArray[np.bool_]:
    """Whether a hit is lost or invented, or is off."""
    with np.errstate(invalid="ignore"):
        off: npt.NDArray[np.bool_] = ~((np.isinf(found) & np.isinf(true)) | (np.abs(found - true) <= OFF * true))
    return off


# Losses of usual methods ---------------------------------------------------------------------------------------------


def _lost_by_boxes(ask: Asked, steps: tuple[float, ...]) -> npt.NDArray[np.bool_]:
    """Hits of rays that miss the box between those of the steps before and after."""
    known = np.array(steps)
    bounds = np.stack([_box_of(ask.motion.corners_at(time)) for time in steps])
    after = np.clip(np.searchsorted(known, ask.times, side="right"), 1, len(steps) - 1)
    share = ((ask.times - known[after - 1]) / (known[after] - known[after - 1]))[:, None, None]
    between = bounds[after - 1] * (1.0 - share) + bounds[after] * share
    with np.errstate(all="ignore"):
        planes = (between - ask.origins[:, None]) / ask.directions[:, None]
    near, far = planes.min(axis=1).max(axis=1), planes.max(axis=1).min(axis=1)
    rounding = 1e-9 * np.abs(far)
    lost: npt.NDArray[np.bool_] = np.isfinite(ask.t_hit) & ~(near <= far + rounding)
    return lost


def _box_of(corners: F64) -> F64:
    points = corners.reshape(-1, 3)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def boxes_between_steps(motion: Motion) -> Loss:
    """The world box of each step, and straight lines between them."""
    ask = asked(motion)
    return _loss(ask, _lost_by_boxes(ask, (0.0, 1.0)))


def _lerped(motion: Motion, times: F32) -> F64:
    """(R, 4, 4): matrices between those of the steps."""
    last = len(motion.path) - 1
    at = times.astype(np.float64) * last
    step = np.minimum(at.astype(int), last - 1)
    share = (at - step)[:, None, None]
    lerped: F64 = motion.path[step] * (1.0 - share) + motion.path[step + 1] * share
    return lerped


def matrices_between_matrices(motion: Motion) -> Loss:
    """Entry by entry."""
    ask = asked(motion)
    place = _lerped(motion, ask.times)
    points = motion.shapes[0].astype(np.float64)
    world = np.einsum("rij,vj->rvi", place[:, :3, :3], points) + place[:, None, :3, 3]
    return _loss(ask, unlike(closest(world[:, motion.triangles], ask.origins, ask.directions), ask.t_hit))


def unasked_inverse(motion: Motion) -> Loss:
    """Rays by the inverse in float32, even a NaN; a NaN fails every comparison and is taken for a hit at once."""
    ask = asked(motion)
    place = _lerped(motion, ask.times).astype(np.float32)
    with np.errstate(all="ignore"):
        scale = np.float32(1.0) / place[:, 0, 0]  # of an even scale
        origins = ask.origins.astype(np.float32) * scale[:, None]
        directions = ask.directions.astype(np.float32) * scale[:, None]
        box = _box_of(motion.shapes[0][motion.triangles].astype(np.float64)).astype(np.float32)
        planes = (box - origins[:, None]) / directions[:, None]
        near = np.minimum(planes[:, 0], planes[:, 1]).max(axis=1)
        far = np.maximum(planes[:, 0], planes[:, 1]).min(axis=1)
    misses = (near > far) | (far < 0.0)
    found = np.where(misses, np.inf, near.astype(np.float64))
    return _loss(ask, unlike(found, ask.t_hit))


def unchecked_step(motion: Motion) -> Loss:
    """Rays at invalid times: how many read a step that is not there; ours: how many hit anything."""
    origins, directions, _ = rays_at(motion, RAYS)
    times = np.resize(np.array(BAD_TIMES, np.float32), RAYS)
    with np.errstate(invalid="ignore"):
        at = np.nan_to_num(times * (len(motion.path) - 1), nan=-1.0)
    naive = (np.floor(at) < 0) | (np.floor(at) + (at > np.floor(at)) > len(motion.path) - 1)
    hits = motion.scene().cast_rays(origins, directions, times=times)
    if hits.invalid_count != RAYS:
        raise AssertionError(f"unchecked_step: {hits.invalid_count} of {RAYS} rays count as invalid")
    return Loss("read past the steps per million", per_million(naive), per_million(hits.is_hit))


# The rows ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class TimeMeasure:
    """A row of the table: its words, and the function that measures the two losses."""

    title: str
    method: str
    held: str
    take: Callable[[Motion], Loss]


TIME_MEASURES: dict[str, TimeMeasure] = {
    "sweeping_stick": TimeMeasure(
        "A stick that sweeps round",
        "boxes between the steps' boxes",
        "Boxes of the top level hold the whole arc from step to step, by a derived bound.",
        boxes_between_steps,
    ),
    "rising_slats": TimeMeasure(
        "Slats that rise and fall",
        "boxes of the first and last step",
        "A tree has boxes at every step; those between hold what they hold, bit for bit, flat ones as well.",
        boxes_between_steps,
    ),
    "fast_wheel": TimeMeasure(
        "A wheel at nine tenths of a turn",
        "matrices between matrices",
        "Rotations turn evenly between steps. More than half a turn from one to the next is the other way round to any "
        "method: Blender's renders look at three moments, and at more where *Steps* says so.",
        matrices_between_matrices,
    ),
    "scale_through_zero": TimeMeasure(
        "Scaled through zero",
        "rays by the inverse, whatever it is",
        "A step that flattens is refused by name; between steps an inverse that is not finite meets nothing.",
        unasked_inverse,
    ),
    "times_out_of_the_shutter": TimeMeasure(
        "Times out of the shutter",
        "a step's number without a check",
        "A ray with such a time misses, and is counted as invalid.",
        unchecked_step,
    ),
}


@cache
def measure_time(case: TimeCase) -> Loss:
    """The losses on a case; the same numbers in every run."""
    return TIME_MEASURES[case.name].take(case.make())


def time_row(case: TimeCase) -> dict[str, object]:
    """One case: its words and the losses on it, measured now."""
    told = TIME_MEASURES[case.name]
    words = {"name": case.name, "title": told.title, "breaks": case.breaks, "source": case.source}
    return {**words, "held": told.held, "method": told.method, **measure_time(case).as_json()}


def time_rows() -> list[dict[str, object]]:
    """Returns all rows, in the order of the zoo."""
    return [time_row(case) for case in TIME_CASES]
