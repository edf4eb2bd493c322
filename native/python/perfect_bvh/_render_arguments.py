"""Checks of what callers give the renderer, and its conversion into what the native module takes.

Every message names the function, the argument, what was expected and what came.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .appearance import Appearance, MeshAppearance
from .camera import Camera

_LARGEST_SIZE = 65536
_LARGEST_COUNT = 2**31 - 1
_LARGEST_MASK = 2**32 - 1


def check_choice(function: str, name: str, value: object, choices: Sequence[str]) -> str:
    """One of a few names."""
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{function}: {name} must be one of {', '.join(choices)}; got {value!r}")
    return value


def check_count(function: str, name: str, value: object, least: int, most: int = _LARGEST_COUNT) -> int:
    """An integer, least to most."""
    try:
        count = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ValueError(f"{function}: {name} must be an integer, got {value!r}") from None
    if not least <= count <= most:
        raise ValueError(f"{function}: {name} must be {least} to {most}, got {count}")
    return count


def check_number(function: str, name: str, value: object, least: float, most: float) -> float:
    """A finite number, least to most."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ValueError(f"{function}: {name} must be a number, got {value!r}") from None
    if not least <= number <= most:
        raise ValueError(f"{function}: {name} must be {least:g} to {most:g}, got {number:g}")
    return number


def check_size(function: str, size: object) -> tuple[int, int]:
    """(width, height) in pixels."""
    if not isinstance(size, Sequence) or isinstance(size, str) or len(size) != 2:
        raise ValueError(f"{function}: size must be (width, height) in pixels, got {size!r}")
    width, height = (check_count(function, "size", number, 1, _LARGEST_SIZE) for number in size)
    return width, height


def check_color(function: str, name: str, color: object) -> tuple[float, float, float]:
    """(R, G, B), scene-linear."""
    values = np.asarray(color, dtype=np.float64) if isinstance(color, (Sequence, np.ndarray)) else np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all() or bool((values < 0.0).any()):
        raise ValueError(f"{function}: {name} must be three numbers (R, G, B) of 0 or more, got {color!r}")
    return float(values[0]), float(values[1]), float(values[2])


def camera_arguments(function: str, camera: object) -> dict[str, Any]:
    """A camera's fields; they were checked when it was made."""
    if not isinstance(camera, Camera):
        raise ValueError(f"{function}: camera must be a perfect_bvh.Camera, got {type(camera).__name__}")
    return {
        "matrix": camera.matrix,
        "window": tuple(map(float, camera.window)),
        "projection": camera.projection,
        "clip_start": float(camera.clip_start),
        "clip_end": float(camera.clip_end),
        "border": tuple(map(float, camera.border)),
    }


def appearance_arguments(function: str, appearance: object) -> dict[str, Any]:
    """An appearance's arrays, C-contiguous and of the dtypes that its records promise."""
    if not isinstance(appearance, Appearance):
        raise ValueError(f"{function}: appearance must be a perfect_bvh.Appearance, got {type(appearance).__name__}")
    table, materials = appearance.instances, appearance.materials

    def column(name: str, value: npt.ArrayLike, dtype: type[np.generic], *row: int) -> npt.NDArray[Any]:
        return _column(function, f"appearance.{name}", value, dtype, row)

    return {
        "material_colors": column("materials.colors", materials.colors, np.float32, 4),
        "material_indices": column("materials.indices", materials.indices, np.int32),
        "instance_ids": column("instances.ids", table.ids, np.int32),
        "slot_offsets": column("instances.slot_offsets", table.slot_offsets, np.int32),
        "slot_materials": column("instances.slot_materials", table.slot_materials, np.int32),
        "object_indices": column("instances.object_indices", table.object_indices, np.int32),
        "holdout": column("instances.holdout", table.holdout, np.bool_),
        "camera_mask": check_count(function, "appearance.camera_mask", appearance.camera_mask, 0, _LARGEST_MASK),
        "shadow_mask": check_count(function, "appearance.shadow_mask", appearance.shadow_mask, 0, _LARGEST_MASK),
        "film_transparent": bool(appearance.film_transparent),
        "meshes": {int(mesh): _mesh_arrays(function, mesh, value) for mesh, value in appearance.meshes.items()},
    }


def _mesh_arrays(function: str, mesh: int, value: MeshAppearance) -> dict[str, npt.NDArray[Any]]:
    arrays: dict[str, npt.NDArray[Any]] = {}
    name = f"appearance.meshes[{mesh}]"
    if value.material_slots is not None:
        arrays["material_slots"] = _column(function, f"{name}.material_slots", value.material_slots, np.int32, ())
    if value.corner_normals is not None:
        arrays["corner_normals"] = _column(function, f"{name}.corner_normals", value.corner_normals, np.float32, (3, 3))
    return arrays


def _column(
    function: str, name: str, value: npt.ArrayLike, dtype: type[np.generic], row: tuple[int, ...]
) -> npt.NDArray[Any]:
    """(N, *row); copied only where the dtype or the layout differs."""
    array = np.asarray(value)
    expected = "(N" + "".join(f", {length}" for length in row) + ("," if not row else "") + ")"
    if array.ndim != 1 + len(row) or array.shape[1:] != row:
        raise ValueError(f"{function}: {name} must have shape {expected}, got {array.shape}")
    if array.dtype != dtype and not np.can_cast(array.dtype, dtype, casting="same_kind"):
        raise ValueError(f"{function}: {name} must be {np.dtype(dtype).name}, got {array.dtype}")
    return np.ascontiguousarray(array, dtype=dtype)
