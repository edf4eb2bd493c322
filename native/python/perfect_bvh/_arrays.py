"""Checks and conversions of what callers pass, in one place, so that every message reads alike.

The native module takes C-contiguous arrays of the exact dtype only; where a copy is needed it is made here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def _as_array(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{function}: {name} is not a regular array ({error})") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{function}: {name} must hold numbers, got dtype {array.dtype}")
    return array


def as_vectors(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    """(..., 3) as C-contiguous float32, or float64 if it came as float64, Python floats or wide integers."""
    array = _as_array(function, name, value)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{function}: {name} must have shape (..., 3), got {array.shape}")
    single = array.dtype in (np.float32, np.float16, np.bool_) or array.dtype.itemsize <= 2
    return np.ascontiguousarray(array, dtype=np.float32 if single else np.float64)


def as_rows(function: str, name: str, value: npt.ArrayLike) -> npt.NDArray[Any]:
    """(V, 3) positions, float32 or float64; an empty sequence is (0, 3)."""
    array = _as_array(function, name, value)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3), np.float32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{function}: {name} must have shape (V, 3), got {array.shape}")
    return as_vectors(function, name, array)


def as_triangles(function: str, value: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """(T, 3) int32."""
    array = _as_array(function, "triangles", value)
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3), np.int32)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{function}: triangles must have shape (T, 3), got {array.shape}")
    return as_integers(function, "triangles", array, np.int32)


def as_integers(function: str, name: str, value: npt.ArrayLike, dtype: type[np.integer[Any]]) -> npt.NDArray[Any]:
    """Any shape, converted to `dtype` only if no value is changed by that."""
    array = _as_array(function, name, value)
    if array.size == 0:
        return np.zeros(array.shape, dtype)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{function}: {name} must hold integers, got dtype {array.dtype}")
    limits = np.iinfo(dtype)
    if array.dtype != dtype and (int(array.min()) < limits.min or int(array.max()) > limits.max):
        raise ValueError(f"{function}: {name} has values outside {limits.min} to {limits.max}")
    return np.asarray(array, dtype=dtype, order="C")  # unlike ascontiguousarray this keeps scalars scalar


def as_transforms(function: str, value: npt.ArrayLike, count: int | None = None) -> npt.NDArray[Any]:
    """(I, 4, 4) or (I, 3, 4), object to world, as (I, 3, 4) float32 or float64. The last row of a (4, 4) is 0 0 0 1."""
    array = _as_array(function, "transforms", value)
    if array.ndim == 2:
        array = array[None]
    if array.ndim != 3 or array.shape[1:] not in ((4, 4), (3, 4)):
        raise ValueError(f"{function}: transforms must have shape (I, 4, 4) or (I, 3, 4), got {array.shape}")
    if array.shape[1] == 4 and not np.allclose(array[:, 3], (0.0, 0.0, 0.0, 1.0), rtol=0.0, atol=1e-6):
        raise ValueError(f"{function}: transforms must be affine, with 0 0 0 1 as their last row")
    if count is not None and len(array) != count:
        raise ValueError(f"{function}: transforms has {len(array)} rows but there are {count} instances")
    return np.ascontiguousarray(array[:, :3, :], dtype=np.float32 if array.dtype == np.float32 else np.float64)


def per_ray(
    function: str, name: str, value: npt.ArrayLike, shape: tuple[int, ...], dtype: type[np.generic]
) -> npt.NDArray[Any]:
    """A scalar as one value, or an array broadcast to one value a ray; flat."""
    if dtype is np.uint32:
        array = as_integers(function, name, value, np.uint32)
    else:
        array = _as_array(function, name, value).astype(dtype)
    if array.ndim == 0:
        return np.ascontiguousarray(array.reshape(1))
    try:
        return np.ascontiguousarray(np.broadcast_to(array, shape)).reshape(-1)
    except ValueError:
        raise ValueError(f"{function}: {name} of shape {array.shape} does not fit rays of shape {shape}") from None
