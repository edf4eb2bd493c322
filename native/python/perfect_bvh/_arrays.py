"""Checks and conversions of what callers pass, in one place, so that every message reads alike.

The native module takes C-contiguous arrays of the exact dtype only; where a copy is needed it is made here.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import numpy.typing as npt

_INT32 = np.iinfo(np.int32)
LARGEST_COUNT = 2**31 - 1


def check_count(function: str, name: str, value: object, least: int, most: int = LARGEST_COUNT) -> int:
    """An integer, least to most; numpy's are welcome, floats and bools are not, whatever their value."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        count = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ValueError(f"{function}: {name} must be an integer, got {value!r}") from None
    if not least <= count <= most:
        # Python refuses to write out integers of thousands of digits.
        got = str(count) if abs(count) < 10**40 else f"an integer of {count.bit_length()} bits"
        raise ValueError(f"{function}: {name} must be {least} to {most}, got {got}")
    return count


def check_id(function: str, name: str, value: object) -> int:
    """An integer that can be an id; whether there is such a mesh or instance is for the engine to say."""
    return check_count(function, name, value, int(_INT32.min), int(_INT32.max))


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
    """What vectors are handed over as: float32, or float64 if they came as float64, Python floats or wide integers."""
    return np.float32 if dtype == np.float32 or dtype.itemsize <= 2 else np.float64


def as_rows(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    """(V, 3) positions, float32 or float64; an empty sequence is (0, 3)."""
    array = as_array(function, name, value)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3), np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{function}: {name} must have shape (V, 3), got {array.shape}")
    return np.ascontiguousarray(array, dtype=vector_dtype(array.dtype))


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
    return np.ascontiguousarray(array, dtype=np.float32 if array.dtype == np.float32 else np.float64)


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
    """When a motion begins and ends, as two floats that float32 tells apart."""
    try:
        begin, end = (np.float32(number) for number in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise ValueError(f"{function}: time_range must be two numbers, begin and end, got {value!r}") from None
    if not (np.isfinite(begin) and np.isfinite(end) and end - begin >= 1e-6 and abs(begin) <= 1e6 and end <= 1e6):
        raise ValueError(f"{function}: time_range must rise by 1e-6 or more, within 1e6 of zero, got {value!r}")
    return float(begin), float(end)
