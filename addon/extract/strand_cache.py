"""The strands of an evaluated particle system as arrays.

From Blender's own memory where that is proven right, else by `co_hair`, which costs a Python call a point.
Blender keeps a pointer to each strand, and a strand as a row of records of 60 bytes, the point first; hundreds of
strands lie one after another. Nothing promises that. Before a pointer is followed, the fields around it are compared
with what Blender's accessors say, on every read; the first strands that are read are compared with `co_hair`. Where
either fails, all are read by `co_hair` from then on.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ..sync.records import Float32Array, Int32Array
from .pointer_views import ArrayReader, view_of_memory

VERDICT = "strands"  # in `ArrayReader.verdicts`
_CHECKED_STRANDS = 3
# What two ways of multiplying the same float matrices and points may differ by, in parts of the largest number.
_ROUNDING = 1e-5

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
    """What one particle system shows as strands: the children, or the particles themselves where there are none.

    points: (S, K, 3) float32 in the object's space; shorter strands repeat their last point. first: the number that
    Blender has for the first of them, which goes through the particles and then the children. rounding: what points may
    differ by that are read in the other way.
    """

    points: Float32Array
    first: int
    rounding: float = 0.0


def read_strands(system: Any, obj: Any, reader: ArrayReader, for_render: bool) -> Strands:
    """Of an evaluated particle system of an evaluated object. for_render: whether the depsgraph is a render's."""
    first, count = _shown(system, for_render)
    if count == 0:
        return Strands(np.empty((0, 0, 3), np.float32), first)
    steps = _step_count(system, for_render)
    if reader.use_views and reader.verdicts.get(VERDICT, True):
        points = _read_memory(system, first, count, steps)
        if points is not None and len(points) and VERDICT not in reader.verdicts:
            reader.verdicts[VERDICT] = _agrees(points, first, system, obj)
        if points is not None and reader.verdicts.get(VERDICT, True):
            return _rounded(points, first, obj)
        reader.verdicts[VERDICT] = False
    points = _read_one_by_one(system, obj, range(first, first + count), steps)
    return _rounded(points, first, obj)


def _rounded(points: Float32Array, first: int, obj: Any) -> Strands:
    """Blender keeps places in the world, which single precision holds the worse the further away the object is."""
    inverse = np.linalg.inv(np.array(obj.matrix_world, np.float64))
    largest = float(np.abs(inverse[:3, 3]).max()) + float(max(points.max(initial=0.0), -points.min(initial=0.0)))
    return Strands(points, first, _ROUNDING * largest)


def _shown(system: Any, for_render: bool) -> tuple[int, int]:
    """The first strand that is shown, and how many are; viewports have a share of the children."""
    settings = system.settings
    particles, children = len(system.particles), len(system.child_particles)
    if not for_render:
        children = int(np.float32(children) * np.float32(settings.display_percentage) / np.float32(100.0))
    has_children = settings.child_type != "NONE" and children > 0
    return (particles, children) if has_children else (0, particles)


def _step_count(system: Any, for_render: bool) -> int:
    """Points of a strand."""
    settings = system.settings
    count = (1 << (settings.render_step if for_render else settings.display_step)) + 1
    return count + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)


def _read_memory(system: Any, first: int, count: int, step_count: int) -> Float32Array | None:
    """(S, K, 3) in the object's space; None if the memory is not laid out as expected. step_count: K."""
    head = view_of_memory(system.as_pointer(), (1,), _SYSTEM)[0]
    particles, children = system.particles, system.child_particles
    is_known = (
        bytes(head["name"]).split(b"\0")[0] == system.name.encode()
        and len(particles) > 0
        and (head["particles"], head["particle_count"]) == (particles[0].as_pointer(), len(particles))
        and head["child_count"] == len(children)
        and (len(children) == 0 or head["children"] == children[0].as_pointer())
    )
    if not is_known:
        return None
    kind = "path" if first == 0 else "child_path"
    paths, count = int(head[f"{kind}s"]), min(count, int(head[f"{kind}_count"]))
    if paths == 0 or count <= 0:
        return np.empty((0, step_count, 3), np.float32)
    pointers = view_of_memory(paths, (count,), np.dtype(np.int64))
    return _gather(pointers, head["to_object"].reshape(4, 4), step_count) if pointers.all() else None


def _gather(pointers: npt.NDArray[np.int64], matrix: Float32Array, step_count: int) -> Float32Array | None:
    """(S, K, 3): the points of strands that lie in memory one after another, in hundreds, mapped by the matrix.

    So many fit into a processor's cache; None if they do not lie as expected.
    """
    segment_count = int(view_of_memory(int(pointers[0]), (1,), _RECORD)["segments"][0])
    steps = np.diff(pointers)
    stride = int(np.median(steps)) if len(steps) else (max(segment_count, 1) + 1) * _RECORD.itemsize
    length, rest = divmod(stride, _RECORD.itemsize)
    if rest or length < 2:
        return None
    points = np.zeros((len(pointers), step_count, 3), np.float32)
    read = min(length, step_count)
    segments = np.empty(len(pointers), np.int32)
    begins = [0, *(np.flatnonzero(steps != stride) + 1).tolist(), len(pointers)]
    for begin, end in pairwise(begins):
        records = view_of_memory(int(pointers[begin]), (end - begin, length), _RECORD)
        placed = records["point"][:, :read].reshape(-1, 3) @ matrix[:3, :3]
        placed += matrix[3, :3]
        points[begin:end, :read] = placed.reshape(-1, read, 3)
        segments[begin:end] = records["segments"][:, 0]
    if segments.max() >= length:
        return None
    return _shortened(points, np.clip(segments, 0, step_count - 1))


def _shortened(points: Float32Array, segments: Int32Array) -> Float32Array:
    """With the last point of each strand instead of all beyond."""
    last = points.shape[1] - 1
    if (segments == last).all():
        return points
    steps = np.minimum(np.arange(last + 1), segments[:, None])
    return np.take_along_axis(points, steps[..., None], axis=1)


def _agrees(points: Float32Array, first: int, system: Any, obj: Any) -> bool:
    picked = sorted({*range(min(_CHECKED_STRANDS, len(points))), len(points) - 1})
    expected = _read_one_by_one(system, obj, [first + row for row in picked], points.shape[1])
    return bool((np.abs(points[picked] - expected) <= _rounded(expected, first, obj).rounding).all())


def _read_one_by_one(system: Any, obj: Any, numbers: range | list[int], step_count: int) -> Float32Array:
    """(S, K, 3) in the object's space, by Blender's accessor: in the world's, and zero beyond a strand's end."""
    in_world = np.array(
        [[system.co_hair(obj, particle_no=number, step=step) for step in range(step_count)] for number in numbers],
        np.float64,
    )
    is_beyond = (in_world == 0.0).all(axis=2)
    is_beyond[:, 0] = False
    segments = (step_count - 1 - np.argmin(is_beyond[:, ::-1], axis=1)).astype(np.int32)
    inverse = np.linalg.inv(np.array(obj.matrix_world, np.float64))
    points = (in_world @ inverse[:3, :3].T + inverse[:3, 3]).astype(np.float32)
    return _shortened(points, segments)
