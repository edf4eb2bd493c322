"""Bulk reading of Blender's arrays: by address where a check has confirmed the layout, by `foreach_get` otherwise.

Blender keeps mesh attributes in plain C arrays, and `as_pointer()` of an element is its address. A view over
that memory costs microseconds where `foreach_get` costs a conversion per element. Blender does not guarantee the
layout, so it is checked: the distance between the first and the last element on every read, and the first values
of each kind of array against Blender's own accessors. A kind that fails is read by `foreach_get` from then on.

Views become invalid at the next evaluation of the depsgraph: data that outlives a read is copied.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

CHECKED_ELEMENTS = 3  # elements compared with Blender's accessors on the first read of a kind


@dataclass(frozen=True, slots=True)
class ArrayKind:
    """How one kind of Blender collection lies in memory.

    name: unique. width: values per element. dtype: of one value. attribute: what `foreach_get` calls it.
    element: reads one element through Blender's accessor, for the check.
    """

    name: str
    width: int
    dtype: np.dtype[Any]
    attribute: str
    element: Callable[[Any], Any]


class _Memory:
    """Read-only memory as numpy's array interface describes it; makes no ctypes type per length."""

    def __init__(self, address: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.__array_interface__ = {"version": 3, "data": (address, True), "shape": shape, "typestr": dtype.str}


def view_of_memory(address: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """View memory, read-only; the caller knows that it exists, and for how long."""
    # An array interface does not contain a dtype's fields.
    raw = np.asarray(_Memory(address, (*shape[:-1], shape[-1] * dtype.itemsize), np.dtype(np.uint8)))
    return raw.view(dtype)


@dataclass(slots=True)
class ArrayReader:
    """Copies Blender collections into arrays and remembers which kinds of them may be read by address.

    use_views: False reads everything by `foreach_get`, the slow and certain way.
    verdicts: kind name -> whether its layout was found as expected.
    """

    use_views: bool = True
    verdicts: dict[str, bool] = field(default_factory=dict)

    def read(self, collection: Any, kind: ArrayKind, count: int | None = None) -> npt.NDArray[Any]:
        """A copy of a whole collection: (N,) if the kind is one wide, else (N, width).

        count: N, if the caller knows it better than len(collection) does.
        """
        view = self.view(collection, kind, count)
        # What `foreach_get` filled is a copy already.
        return view if view.flags.writeable else view.copy()

    def view(self, collection: Any, kind: ArrayKind, count: int | None = None) -> npt.NDArray[Any]:
        """The same, to be used at once: it may be Blender's own memory, read-only, gone at the next evaluation."""
        if count is None:
            count = len(collection)
        if count == 0:  # [0] of an empty collection is an IndexError
            return np.empty(_shape(0, kind), kind.dtype)
        if self.use_views and self.verdicts.get(kind.name, True):
            view = self._checked_view(collection, kind, count)
            if view is not None:
                return view
        return _read_by_foreach_get(collection, kind, count)

    def _checked_view(self, collection: Any, kind: ArrayKind, count: int) -> npt.NDArray[Any] | None:
        first = collection[0].as_pointer()
        stride = kind.width * kind.dtype.itemsize
        if first == 0 or collection[count - 1].as_pointer() - first != (count - 1) * stride:
            self.verdicts[kind.name] = False
            return None
        view = np.asarray(_Memory(first, _shape(count, kind), kind.dtype))
        # One element says nothing about the stride: the verdict waits for a longer array.
        if kind.name not in self.verdicts:
            same = _agrees(view, collection, kind)
            if count > 1 or not same:
                self.verdicts[kind.name] = same
            return view if same else None
        return view


def _shape(count: int, kind: ArrayKind) -> tuple[int, ...]:
    return (count,) if kind.width == 1 else (count, kind.width)


def _agrees(view: npt.NDArray[Any], collection: Any, kind: ArrayKind) -> bool:
    picked = sorted({*range(min(CHECKED_ELEMENTS, len(view))), len(view) - 1})
    expected = np.array([kind.element(collection[index]) for index in picked], dtype=kind.dtype)
    return view[picked].tobytes() == expected.reshape(view[picked].shape).tobytes()


def _read_by_foreach_get(collection: Any, kind: ArrayKind, count: int) -> npt.NDArray[Any]:
    values = np.empty(count * kind.width, kind.dtype)
    collection.foreach_get(kind.attribute, values)
    return values.reshape(_shape(count, kind))


_FLOAT = np.dtype(np.float32)
_INT = np.dtype(np.int32)

POSITIONS = ArrayKind("positions", 3, _FLOAT, "vector", lambda item: item.vector)
CORNER_VERTS = ArrayKind("corner_verts", 1, _INT, "value", lambda item: item.value)
CORNER_TRIANGLES = ArrayKind("corner_triangles", 3, _INT, "loops", lambda item: item.loops)
TRIANGLE_POLYGONS = ArrayKind("triangle_polygons", 1, _INT, "value", lambda item: item.value)
CORNER_NORMALS = ArrayKind("corner_normals", 3, _FLOAT, "vector", lambda item: item.vector)
CORNER_UVS = ArrayKind("corner_uvs", 2, _FLOAT, "vector", lambda item: item.vector)
FACE_INTEGERS = ArrayKind("face_integers", 1, _INT, "value", lambda item: item.value)
MATRICES = ArrayKind(
    "matrices", 16, _FLOAT, "value", lambda item: [value for column in item.value.col for value in column]
)
RADII = ArrayKind("radii", 1, _FLOAT, "value", lambda item: item.value)
CURVE_OFFSETS = ArrayKind("curve_offsets", 1, _INT, "value", lambda item: item.value)
REFERENCE_INDICES = ArrayKind("reference_indices", 1, _INT, "value", lambda item: item.value)
