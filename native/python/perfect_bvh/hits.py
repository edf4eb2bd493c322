"""The answers to a batch of rays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .audit import Audit

DEFAULT_FIELDS: tuple[str, ...] = (
    "t_hit",
    "instance_ids",
    "mesh_ids",
    "primitive_ids",
    "primitive_uvs",
    "geometric_normals",
)

# name -> (dtype, values a ray)
FIELD_TYPES: dict[str, tuple[type[np.generic], int]] = {
    "t_hit": (np.float32, 1),
    "instance_ids": (np.int32, 1),
    "mesh_ids": (np.int32, 1),
    "primitive_ids": (np.int32, 1),
    "primitive_uvs": (np.float32, 2),
    "geometric_normals": (np.float32, 3),
    "positions": (np.float64, 3),
    "distances": (np.float64, 1),
    "front_face": (np.bool_, 1),
    "nodes_visited": (np.int32, 1),
    "primitives_tested": (np.int32, 1),
}


@dataclass(frozen=True, slots=True)
class Hits:
    """One row a ray, in the shape of the rays; from `list_intersections` one row a hit.

    Fields that were not asked for raise AttributeError.

    t_hit (...) float32: in multiples of the direction's length; inf on a miss. It is within two units in the last place
        of the intersection with the triangle's plane, for triangles of any size and rays at any angle to that plane. An
        exception are rays that begin closer to the plane than 2^-28 of the largest coordinate: their error is about
        2^-53 of that coordinate, divided by the angle between ray and plane. For a sliver divide the 2^-28 by the sine
        of the triangle's smallest angle. For curves and points it is the intersection with the true surface.
    instance_ids, mesh_ids, primitive_ids (...) int32: -1 on a miss. primitive_ids are rows of the mesh's triangles,
        or numbers of its curves or points.
    primitive_uvs (..., 2) float32: the point (1 - u - v) v0 + u v1 + v v2; zero on a miss. For a curve u runs from 0 at
        its first point to 1 at its last, evenly over its segments, and v is 0. For a point both are 0.
    geometric_normals (..., 3) float32: world space, unit length, by the triangle's winding; zero on a miss. For curves
        and points outward from the true surface, for ribbons as `add_curves` says; zero at a tip of radius 0.
    positions (..., 3) float64: world space, the intersection with the triangle's plane, in double; zero on a miss. For
        triangles that are seen edge-on or are extremely thin, the point of primitive_uvs: double cannot represent a
        better one. For curves and points the point on the true surface.
    distances (...) float64: world units; inf on a miss.
    front_face (...) bool: the ray hit the side from which the corners run counter-clockwise in world space, or came
        into a curve or point from outside.
    nodes_visited, primitives_tested (...) int32: boxes and triangles tested for this ray.
    invalid_count: rays that can hit nothing because they are not finite, have no direction or an empty range.
    packet_ray_count: rays that were traced in packets of 64 consecutive, coherent rays.
    generation, scene_id: of the snapshot that answered, see `Snapshot`; ids are valid for that snapshot.
    audit: the result of checking a share of the answers; None if no audit was requested.
    """

    columns: dict[str, npt.NDArray[Any]]
    invalid_count: int
    generation: int
    scene_id: int
    packet_ray_count: int = 0
    audit: Audit | None = None

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        if name in FIELD_TYPES:
            try:
                return self.columns[name]
            except KeyError:
                raise AttributeError(f"hits have no {name}: request it with fields=({name!r}, ...)") from None
        if name == "is_hit":  # which failed, for want of any field to tell it by
            raise AttributeError("hits have no is_hit: it needs t_hit or an id, as with fields=('primitive_ids', ...)")
        raise AttributeError(f"hits have no field {name!r}; there are {', '.join(FIELD_TYPES)}")

    @property
    def is_hit(self) -> npt.NDArray[np.bool_]:
        """(...) bool: whether the ray hit anything. Needs t_hit or one of the ids."""
        for name in ("instance_ids", "mesh_ids", "primitive_ids"):
            if name in self.columns:
                return np.asarray(self.columns[name] >= 0)
        return np.asarray(np.isfinite(self.t_hit))


# Result arrays that callers may provide.
Out = Hits | Mapping[str, npt.NDArray[Any]]


def fields_of(fields: Iterable[str] | None, out: Out | None = None) -> tuple[str, ...]:
    """Returns the names of the fields to compute; None: those of `out` if it is a `Hits`, else the usual ones."""
    if fields is None:
        return tuple(out.columns) if isinstance(out, Hits) else DEFAULT_FIELDS
    return (fields,) if isinstance(fields, str) else tuple(fields)


def allocate_columns(
    function: str,
    fields: tuple[str, ...],
    shape: tuple[int, ...],
    out: Out | None,
    rays: Iterable[npt.NDArray[Any]] = (),
) -> dict[str, npt.NDArray[Any]]:
    """Returns the result arrays, the caller's own from `out`. rays: the arrays that the query reads while it writes."""
    for name in fields:
        if name not in FIELD_TYPES:
            raise ValueError(f"{function}: unknown field {name!r}; there are {', '.join(FIELD_TYPES)}")
    if not isinstance(out, (Hits, Mapping, type(None))):
        raise ValueError(f"{function}: out must be a dict of arrays by the fields' names or a Hits, got {_kind(out)}")
    given = {} if out is None else out.columns if isinstance(out, Hits) else out
    for name in given:
        if name not in fields:
            raise ValueError(f"{function}: out has {name!r}, which is not among the fields {', '.join(fields)}")
    columns: dict[str, npt.NDArray[Any]] = {}
    for name in fields:
        dtype, width = FIELD_TYPES[name]
        wanted = shape if width == 1 else (*shape, width)
        if name in given:
            check_out(function, f"out[{name!r}]", given[name], wanted, dtype)
        columns[name] = given[name] if name in given else np.empty(wanted, dtype)
    inputs, written = tuple(rays), [name for name in fields if name in given]
    for index, name in enumerate(written):
        others = (*inputs, *(given[other] for other in written[:index]))
        check_overlap(function, f"out[{name!r}]", given[name], others)
    return columns


def check_out(
    function: str, name: str, given: object, wanted: tuple[int, ...], dtype: type[np.generic]
) -> npt.NDArray[Any]:
    """Returns an array that can be written into without conversion."""
    expected = f"{function}: {name} must be a writable C-contiguous {np.dtype(dtype).name} array of shape {wanted}"
    if not isinstance(given, np.ndarray):
        raise ValueError(f"{expected}, got {_kind(given)}")
    flags = given.flags
    faults = ["one that is read-only"] if not flags.writeable else []
    faults += ["one that is not contiguous"] if not flags.c_contiguous else []
    faults += ["one that is not aligned"] if not flags.aligned else []
    if given.shape != wanted or given.dtype != dtype or faults:
        raise ValueError(f"{expected}, got {', '.join([f'{given.dtype} of shape {given.shape}', *faults])}")
    return given


def check_overlap(function: str, name: str, given: npt.NDArray[Any], others: Iterable[npt.NDArray[Any]]) -> None:
    """Rejects overlapping arrays: threads write rows in any order, so an array with two uses would hold a mixture."""
    if any(np.may_share_memory(given, other) for other in others):  # by their bounds
        raise ValueError(f"{function}: {name} shares memory with the rays or with another array of out")


def _kind(given: object) -> str:
    return type(given).__name__
