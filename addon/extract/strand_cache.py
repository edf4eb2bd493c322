"""The strands of an evaluated particle system as arrays.

From Blender's own memory where that is proven right, else by `co_hair`, which costs a Python call a point.
Blender keeps a pointer to each strand, and a strand as a row of records of 60 bytes, the point first; hundreds of
strands lie one after another. Nothing promises that. Before a pointer is followed, the fields around it are compared
with what Blender's accessors say, on every read, and before points are read, the length of each strand; a system that
fails is read by `co_hair`. The first strands that are read are compared with it, those of particles and those of
children; where they differ, all of their kind are read by `co_hair` from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ..sync.records import Float32Array, Float64Array, Int32Array
from .pointer_views import ArrayReader, view_of_memory

# In `ArrayReader.verdicts`: of the strands of particles and of those of children.
VERDICT, CHILD_VERDICT = "strands", "child strands"
_CHECKED_STRANDS = 3
# What two ways of multiplying the same float matrices and points may differ by, in parts of the largest number.
_ROUNDING = 1e-5
_ELSEWHERE = 1e-3  # how far another object must place a point from the world's origin to tell it from none

_FLOAT = np.dtype(np.float32)
# A record of a strand: point, velocity, rotation, colour, time, and in the first one how many segments there are.
_RECORD = np.dtype(
    [
        ("point", _FLOAT, 3),
        ("between", _FLOAT, 11),
        ("segments", np.int32),
    ]
)
# The head of a particle system.
_SYSTEM = np.dtype(
    {
        "names": [
            *("particles", "children", "paths", "child_paths", "name", "to_object"),
            *("particle_count", "child_count", "path_count", "child_path_count"),
        ],
        "formats": [*("u8",) * 4, "S64", (_FLOAT, 16), *("i4",) * 4],
        "offsets": [24, 32, 56, 64, 168, 232, 320, 328, 332, 336],
        "itemsize": 344,
    }
)


@dataclass(frozen=True, slots=True)
class Strands:
    """The strands of one particle system: the children, or the particles themselves if there are none.

    points: (S, K, 3) float32 in the object's space; shorter strands repeat their last point. first: Blender's number
    of the first strand, which counts the particles and then the children. rounding: the possible difference of points
    that are read by the other method.
    """

    points: Float32Array
    first: int
    rounding: float = 0.0


def read_strands(
    system: Any, obj: Any, reader: ArrayReader, for_render: bool, others: Callable[[], Iterable[Any]] = tuple
) -> Strands:
    """Read an evaluated particle system of an evaluated object. for_render: whether the depsgraph is a render's.

    others: returns evaluated objects at other positions. Without them `co_hair` cannot distinguish a tip at the world's
    origin from a strand's end.
    """
    first, count = shown_strands(system, for_render)
    steps, space = step_count(system, for_render), Space.of(obj)
    if count == 0 or space is None:  # without space Blender has all strands in one place
        return Strands(np.zeros((count, steps, 3), np.float32), first)
    verdict = CHILD_VERDICT if first else VERDICT
    if reader.use_views and reader.verdicts.get(verdict, True):
        points = _read_memory(system, first, count, steps, space)
        if points is not None and verdict not in reader.verdicts:
            are_equal = _agrees(points, first, system, obj, space)
            if are_equal is not None:
                reader.verdicts[verdict] = are_equal
        if points is not None and (reader.verdicts.get(verdict) or _are_unmade(points, space)):
            return Strands(points, first, space.rounding(points))
    points = _read_one_by_one(system, obj, range(first, first + count), steps, space, others)
    return Strands(points, first, space.rounding(points))


@dataclass(frozen=True, slots=True)
class Space:
    """An object's space: from the world into it. inverse: (4, 4) float64."""

    inverse: Float64Array

    @classmethod
    def of(cls, obj: Any) -> Space | None:
        """Returns None if the object is scaled to nothing, or a number is not finite."""
        world = np.array(obj.matrix_world, np.float64)
        if not np.isfinite(world).all() or np.linalg.matrix_rank(world[:3, :3]) < 3:
            return None
        return cls(np.linalg.inv(world))

    def rounding(self, points: Float32Array) -> float:
        """Blender keeps places in the world, which single precision holds the worse the further away the object is."""
        largest = float(max(points.max(initial=0.0), -points.min(initial=0.0)))
        if not np.isfinite(largest):
            largest = float(np.abs(points, where=np.isfinite(points), out=np.zeros_like(points)).max(initial=0.0))
        return _ROUNDING * (float(np.abs(self.inverse[:3, 3]).max()) + largest)


def shown_strands(system: Any, for_render: bool) -> tuple[int, int]:
    """The first strand that is shown, and how many are; viewports have a share of the children."""
    settings = system.settings
    particles, children = len(system.particles), len(system.child_particles)
    if not for_render:
        children = int(np.float32(children) * np.float32(settings.display_percentage) / np.float32(100.0))
    has_children = settings.child_type != "NONE" and children > 0
    return (particles, children) if has_children else (0, particles)


def step_count(system: Any, for_render: bool) -> int:
    """Points of a strand."""
    settings = system.settings
    count = (1 << (settings.render_step if for_render else settings.display_step)) + 1
    return count + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)


def _read_memory(system: Any, first: int, count: int, steps: int, space: Space) -> Float32Array | None:
    """(S, K, 3) in the object's space; None if the memory is not laid out as expected. count: S; steps: K."""
    head = view_of_memory(system.as_pointer(), (1,), _SYSTEM)[0]
    particles, children = system.particles, system.child_particles
    is_known = (
        bytes(head["name"]).split(b"\0")[0] == _name_of(system)
        and len(particles) > 0
        and (head["particles"], head["particle_count"]) == (particles[0].as_pointer(), len(particles))
        and head["child_count"] == len(children)
        and (len(children) == 0 or head["children"] == children[0].as_pointer())
        and (first == 0 or head["path_count"] == len(particles))  # from which on `co_hair` numbers children
    )
    if not is_known:
        return None
    kind = "child_path" if first else "path"
    paths = int(head[f"{kind}s"])
    kept_count = min(count, int(head[f"{kind}_count"])) if paths else 0
    points = np.empty((count, steps, 3), np.float32)
    points[max(kept_count, 0) :] = space.inverse[:3, 3]  # what `co_hair` says of strands that Blender has not made
    if kept_count <= 0:
        return points
    pointers = view_of_memory(paths, (kept_count,), np.dtype(np.int64))
    if not pointers.all():
        return None
    return points if _gather(pointers, head["to_object"].reshape(4, 4), points[:kept_count]) else None


def _name_of(system: Any) -> bytes | None:
    """Returns a system's name, None for bytes that are no text, for which Blender returns nothing."""
    try:
        return str(system.name).encode(errors="surrogateescape")
    except UnicodeDecodeError:
        return None


def _are_unmade(points: Float32Array, space: Space) -> bool:
    return bool((points == space.inverse[:3, 3].astype(np.float32)).all())


def _gather(pointers: npt.NDArray[np.int64], matrix: Float32Array, points: Float32Array) -> bool:
    """Fill (S, K, 3) with points, mapped by the matrix, of strands that lie in memory one after another, in hundreds.

    A hundred fit into a processor's cache. Returns False if the layout is unexpected: no point is read before all
    strands are known to be no longer than their distance in memory, and than K.
    """
    steps = points.shape[1]
    segment_count = int(view_of_memory(int(pointers[0]), (1,), _RECORD)["segments"][0])
    if not -1 <= segment_count < steps:
        return False
    apart = np.diff(pointers)
    stride = int(np.median(apart)) if len(apart) else (max(segment_count, 0) + 1) * _RECORD.itemsize
    length, rest = divmod(stride, _RECORD.itemsize)
    if rest or not 1 <= length <= steps:
        return False
    begins = [0, *(np.flatnonzero(apart != stride) + 1).tolist(), len(pointers)]
    runs = [
        (slice(begin, end), view_of_memory(int(pointers[begin]), (end - begin, length), _RECORD))
        for begin, end in pairwise(begins)
    ]
    segments = np.concatenate([records["segments"][:, 0] for _, records in runs])
    if segments.min() < -1 or segments.max() >= length:
        return False
    for rows, records in runs:
        placed = records["point"].reshape(-1, 3) @ matrix[:3, :3]
        placed += matrix[3, :3]
        points[rows, :length] = placed.reshape(-1, length, 3)
        points[rows, length:] = 0.0
    if segments.min() < steps - 1:
        points[:] = _shortened(points, np.maximum(segments, 0))
    return True


def _shortened(points: Float32Array, segments: Int32Array) -> Float32Array:
    """Replaces points beyond the end of each strand by its last point."""
    last = points.shape[1] - 1
    if (segments == last).all():
        return points
    steps = np.minimum(np.arange(last + 1), segments[:, None])
    return np.take_along_axis(points, steps[..., None], axis=1)


def _agrees(points: Float32Array, first: int, system: Any, obj: Any, space: Space) -> bool | None:
    """Whether `co_hair` returns the same points of some strands; beyond a strand it returns its last, or the origin.

    None if it returns nothing at all.
    """
    picked = sorted({*range(min(_CHECKED_STRANDS, len(points))), len(points) - 1})
    in_world = _ask(system, obj, [first + row for row in picked], points.shape[1])
    are_told = _are_told(in_world)
    if not are_told.any():
        return None
    expected = _placed(in_world, ~are_told, space)
    found, rounding = points[picked], space.rounding(expected)
    as_origin = np.abs(found - space.inverse[:3, 3]).max(axis=2) <= rounding
    are_near = (np.abs(found - expected) <= rounding) | ~np.isfinite(found) & ~np.isfinite(expected)
    return bool((are_near.all(axis=2) | as_origin & ~are_told).all())


def _read_one_by_one(
    system: Any,
    obj: Any,
    numbers: Sequence[int],
    steps: int,
    space: Space,
    others: Callable[[], Iterable[Any]] = tuple,
) -> Float32Array:
    """(S, K, 3) in the object's space, by Blender's accessor: in the world's, and zero beyond a strand's end.

    others: see `read_strands`. What one of them makes no zero of is a point.
    """
    in_world = _ask(system, obj, numbers, steps)
    is_beyond = ~_are_told(in_world)
    is_beyond[:, 0] = False
    origin = space.inverse[:, 3]
    if is_beyond.any():
        matrices = ((other, np.array(other.matrix_world, np.float64)) for other in others())
        elsewhere = next((other for other, matrix in matrices if np.abs(matrix[:3] @ origin).max() > _ELSEWHERE), None)
        for row, step in np.argwhere(is_beyond).tolist() if elsewhere is not None else ():
            is_beyond[row, step] = not any(system.co_hair(elsewhere, particle_no=numbers[row], step=step))
    return _placed(in_world, is_beyond, space)


def _ask(system: Any, obj: Any, numbers: Sequence[int], steps: int) -> Float64Array:
    """(S, K, 3), in the world."""
    return np.array(
        [[system.co_hair(obj, particle_no=number, step=step) for step in range(steps)] for number in numbers],
        np.float64,
    )


def _are_told(in_world: Float64Array) -> npt.NDArray[np.bool_]:
    return np.asarray((in_world != 0.0).any(axis=2))


def _placed(in_world: Float64Array, is_beyond: npt.NDArray[np.bool_], space: Space) -> Float32Array:
    steps = in_world.shape[1]
    segments = (steps - 1 - np.argmin(is_beyond[:, ::-1], axis=1)).astype(np.int32)
    segments[is_beyond.all(axis=1)] = 0
    points = (in_world @ space.inverse[:3, :3].T + space.inverse[:3, 3]).astype(np.float32)
    return _shortened(points, segments)
