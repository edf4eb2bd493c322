"""Checks and conversions of the arrays that callers pass, in one place, so that every message reads alike.

The native module takes C-contiguous arrays of the exact dtype only; where a copy is needed it is made here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ._checks import check_choice, check_count


def as_array(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    """Any shape, numbers of any kind, not copied if it is an array."""
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{function}: {name} is not a regular array ({error})") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{function}: {name} must hold numbers, got dtype {array.dtype}")
    return array


def vector_dtype(dtype: np.dtype[Any]) -> type[np.generic]:
    """Returns the dtype for vectors: float32, or float64 if they came as float64, Python floats or wide integers."""
    return np.float32 if dtype == np.float32 or dtype.itemsize <= 2 else np.float64


def as_rows(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    """(V, 3) positions, float32 or float64; an empty sequence is (0, 3)."""
    array = as_array(function, name, value)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3), np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{function}: {name} must have shape (V, 3), got {array.shape}")
    return _as_contiguous(array, vector_dtype(array.dtype))


def as_triangles(function: str, value: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """(T, 3) int32."""
    array = as_array(function, "triangles", value)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3), np.int32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{function}: triangles must have shape (T, 3), got {array.shape}")
    return as_integers(function, "triangles", array, np.int32)


def check_integers(function: str, name: str, value: npt.ArrayLike, dtype: type[np.integer[Any]]) -> npt.NDArray[Any]:
    """Any shape, as it came, but certain to hold integers that `dtype` can hold."""
    array = as_array(function, name, value)
    if array.size == 0:
        return np.zeros(array.shape, dtype)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{function}: {name} must hold integers, got dtype {array.dtype}")
    limits = np.iinfo(dtype)
    lowest, highest = (0, 0) if array.dtype == dtype else (int(array.min()), int(array.max()))
    if lowest < limits.min or highest > limits.max:
        wrong = lowest if lowest < limits.min else highest
        raise ValueError(f"{function}: {name} has values outside {limits.min} to {limits.max}, got {wrong}")
    return array


def as_integers(function: str, name: str, value: npt.ArrayLike, dtype: type[np.integer[Any]]) -> npt.NDArray[Any]:
    """Any shape, converted to `dtype` only if no value is changed by that."""
    array = check_integers(function, name, value, dtype)
    return np.asarray(array, dtype=dtype, order="C")  # unlike ascontiguousarray this keeps scalars scalar


def as_transforms(function: str, value: npt.ArrayLike, count: int | None = None) -> npt.NDArray[Any]:
    """(I, 4, 4) or (I, 3, 4), object to world, as float32 or float64. The last row of a (4, 4) is 0 0 0 1."""
    array = as_array(function, "transforms", value)
    if array.ndim == 2:
        array = array[None]
    if array.ndim != 3 or array.shape[1:] not in ((4, 4), (3, 4)):
        raise ValueError(f"{function}: transforms must have shape (I, 4, 4) or (I, 3, 4), got {array.shape}")
    if array.shape[1] == 4 and not (np.abs(array[:, 3] - (0.0, 0.0, 0.0, 1.0)) <= 1e-6).all():
        wrong = array[np.abs(array[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=1).argmax(), 3].tolist()
        raise ValueError(f"{function}: transforms must be affine, with 0 0 0 1 as their last row, got {wrong}")
    if count is not None and len(array) != count:
        raise ValueError(f"{function}: transforms must have {count} rows, one an instance, got {len(array)}")
    return _as_contiguous(array, np.float32 if array.dtype == np.float32 else np.float64)


_MOST_STEPS = 255


def as_steps(function: str, name: str, value: npt.ArrayLike, width: int) -> tuple[int, npt.NDArray[Any]]:
    """How many steps, and the array with those one after another.

    width 3: (S, V, 3) positions, as rows. 4: (S, I, 4, 4) or (S, I, 3, 4) transforms, as (S * I, ...).
    """
    array = as_array(function, name, value)
    if width == 3:
        if array.ndim != 3 or array.shape[2] != 3:
            raise ValueError(f"{function}: {name} must have shape (S, V, 3), S steps, got {array.shape}")
        flat = array.reshape(-1, 3)
    else:
        if array.ndim != 4 or array.shape[2:] not in ((4, 4), (3, 4)):
            raise ValueError(f"{function}: {name} must have shape (S, I, 4, 4) or (S, I, 3, 4), got {array.shape}")
        flat = array.reshape(-1, *array.shape[2:])
    if not 1 <= len(array) <= _MOST_STEPS:
        raise ValueError(f"{function}: {name} must have 1 to {_MOST_STEPS} steps, got {len(array)}")
    return len(array), as_rows(function, name, flat) if width == 3 else flat


def as_time_range(function: str, value: object) -> tuple[float, float]:
    """Checks when a motion begins and ends: two floats that differ in float32, too."""
    try:
        with np.errstate(over="ignore"):  # as in _as_contiguous
            begin, end = (np.float32(number) for number in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise ValueError(f"{function}: time_range must be two numbers, begin and end, got {value!r}") from None
    if not (np.isfinite(begin) and np.isfinite(end) and end - begin >= 1e-6 and abs(begin) <= 1e6 and end <= 1e6):
        raise ValueError(f"{function}: time_range must rise by 1e-6 or more, within 1e6 of zero, got {value!r}")
    return float(begin), float(end)


# Batches -------------------------------------------------------------------------------------------------------------
# Rays and points as columns: checked once, then passed to the engine in chunks.
#
# The engine takes arrays of the exact dtype: numbers contiguous, vectors as rows at any distance from each other, and
# one vector for all rays. Such arrays are passed at once. Others (of another dtype, partly broadcast) are copied in
# chunks, so the copies are no larger than a chunk for any number of rays.


CULLS = ("none", "back")
PIECE_ROWS = 1 << 20

Progress = Callable[[float], object]
Columns = tuple[npt.NDArray[Any], ...]
Index = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Piece:
    """index: of the batch's shape. rows: the same in the flattened batch. columns: as the engine takes them."""

    index: Index
    rows: slice
    columns: Columns
    progress: Progress | None


@dataclass(frozen=True, slots=True)
class _Column:
    """One argument: values broadcast to one row a ray; `width` 3 for vectors, 0 for one number a ray.

    is_strided: whether the engine takes vectors with gaps between them, and one for all.
    """

    values: npt.NDArray[Any]
    dtype: type[np.generic]
    width: int
    is_strided: bool = False

    @property
    def is_shared(self) -> bool:
        """Whether there is one value for all rays."""
        return self.values.size == max(self.width, 1) and (self.is_strided or not self.width)

    def is_ready(self, shape: tuple[int, ...]) -> bool:
        """Whether the engine can take the array without conversion."""
        full = (*shape, self.width) if self.width else shape
        return self.is_shared or (self.values.shape == full and self._fits(self.values))

    def take(self, shape: tuple[int, ...], index: Index) -> npt.NDArray[Any]:
        """Returns the engine's input: (rows, width), (rows,), or a single row for all rays."""
        if self.is_shared:
            part = _as_contiguous(self.values, self.dtype)
        else:
            full = (*shape, self.width) if self.width else shape
            part = np.broadcast_to(self.values, full)[index]
            part = part if self._fits(part) else _as_contiguous(part, self.dtype)
        return part.reshape(-1, self.width) if self.width else part.reshape(-1)

    def _fits(self, part: npt.NDArray[Any]) -> bool:
        """Whether the engine can read this part in place; it has a row for each ray."""
        if part.dtype != self.dtype or not part.flags.aligned:
            return False
        return part.flags.c_contiguous or (self.is_strided and _are_rows(part))


def _as_contiguous(values: npt.NDArray[Any], dtype: type[np.generic]) -> npt.NDArray[Any]:
    """The values as a C-contiguous, aligned array of that dtype; themselves if they are one."""
    if values.dtype == dtype and values.flags.aligned:
        return np.ascontiguousarray(values)
    with np.errstate(over="ignore", invalid="ignore"):  # values that the dtype cannot hold become infinite
        return np.array(values, dtype=dtype, order="C")


def _are_rows(vectors: npt.NDArray[Any]) -> bool:
    """Whether (..., 3) vectors lie at one distance from each other, their numbers side by side."""
    *shape, _ = vectors.shape
    *strides, last = vectors.strides
    axes = [(size, stride) for size, stride in zip(shape, strides, strict=True) if size != 1]
    if last != vectors.itemsize or any(stride % last for _, stride in axes):
        return False
    return all(outer == size * inner for (_, outer), (size, inner) in itertools.pairwise(axes))


class Batch:
    """The checked arguments of a query: rays or points in any shape, one row each."""

    __slots__ = ("_columns", "shape")

    def __init__(self, shape: tuple[int, ...], columns: tuple[_Column, ...]) -> None:
        self.shape = shape
        self._columns = columns

    @property
    def count(self) -> int:
        """How many rays or points."""
        return math.prod(self.shape)

    @property
    def arrays(self) -> Columns:
        """The arrays that the query reads while it writes."""
        return tuple(column.values for column in self._columns)

    def gather(self, rows: npt.NDArray[np.int64]) -> Columns:
        """The columns of some rows of the flattened batch, contiguous; of a shared value a single row."""
        index = np.unravel_index(rows, self.shape) if self.shape else (...,)
        return tuple(column.take(self.shape, index) for column in self._columns)

    def pieces(self, progress: Progress | None) -> Iterator[Piece]:
        """Yields the batch in order, as one chunk if nothing has to be copied."""
        is_ready = all(column.is_ready(self.shape) for column in self._columns)
        done, count = 0, self.count
        for index, rows in _split(self.shape, max(count, 1) if is_ready else PIECE_ROWS):
            columns = tuple(column.take(self.shape, index) for column in self._columns)
            share = progress if rows == count else share_of(progress, done / count, rows / count)
            yield Piece(index, slice(done, done + rows), columns, share)
            done += rows


def _split(shape: tuple[int, ...], limit: int) -> Iterator[tuple[Index, int]]:
    """Indices, in C order, of parts of at most `limit` rows, and how many each has."""
    count = math.prod(shape)
    if count <= limit:
        yield (...,), count  # not (): an index of no axes takes a number out of an array of none
        return
    inner = math.prod(shape[1:])
    if inner <= limit:
        step = limit // inner
        for start in range(0, shape[0], step):
            stop = min(start + step, shape[0])
            yield (slice(start, stop), ...), (stop - start) * inner
        return
    for row in range(shape[0]):
        yield from (((row, *index), rows) for index, rows in _split(shape[1:], limit))


def share_of(progress: Progress | None, start: float, share: float) -> Progress | None:
    """Returns the progress callable for a part of a longer call."""
    return None if progress is None else lambda fraction: progress(start + share * fraction)


def _vectors(function: str, name: str, value: npt.ArrayLike) -> _Column:
    array = as_array(function, name, value)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{function}: {name} must have shape (..., 3), got {array.shape}")
    return _Column(array, vector_dtype(array.dtype), 3, is_strided=True)


def _numbers(
    function: str, name: str, value: npt.ArrayLike, shape: tuple[int, ...], dtype: type[np.generic]
) -> _Column:
    array = check_integers(function, name, value, np.uint32) if dtype is np.uint32 else as_array(function, name, value)
    try:
        if array.ndim:
            np.broadcast_to(array, shape)
    except ValueError:
        rows = "points" if function == "compute_closest_points" else "rays"
        raise ValueError(
            f"{function}: {name} must be a number or one for each, got shape {array.shape} for {rows} of shape {shape}"
        ) from None
    return _Column(array, dtype, 0)


def ray_batch(
    function: str,
    origins: npt.ArrayLike,
    directions: npt.ArrayLike,
    t_min: npt.ArrayLike,
    t_max: npt.ArrayLike,
    mask: npt.ArrayLike,
    times: npt.ArrayLike,
    cull: str,
    threads: int,
) -> Batch:
    """Columns origins, directions, t_min, t_max, masks, times."""
    check_choice(function, "cull", cull, CULLS)
    check_count(function, "threads", threads, 0)
    first = _vectors(function, "origins", origins)
    second = _vectors(function, "directions", directions)
    try:
        shape = np.broadcast_shapes(first.values.shape, second.values.shape)[:-1]
    except ValueError:
        raise ValueError(
            f"{function}: origins and directions must have shapes that broadcast to one, got {first.values.shape} "
            f"and {second.values.shape}, which do not fit together"
        ) from None
    return Batch(
        shape,
        (
            first,
            second,
            _numbers(function, "t_min", t_min, shape, np.float32),
            _numbers(function, "t_max", t_max, shape, np.float32),
            _numbers(function, "mask", mask, shape, np.uint32),
            _numbers(function, "times", times, shape, np.float32),
        ),
    )


def point_batch(
    function: str,
    points: npt.ArrayLike,
    max_distance: npt.ArrayLike,
    mask: npt.ArrayLike,
    times: npt.ArrayLike,
    threads: int,
) -> Batch:
    """Columns points (float64), max_distances, masks, times."""
    check_count(function, "threads", threads, 0)
    given = _vectors(function, "points", points)
    shape = given.values.shape[:-1]
    return Batch(
        shape,
        (
            _Column(given.values, np.float64, 3),
            _numbers(function, "max_distance", max_distance, shape, np.float64),
            _numbers(function, "mask", mask, shape, np.uint32),
            _numbers(function, "times", times, shape, np.float32),
        ),
    )
