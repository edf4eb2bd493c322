"""Evaluated hair curves and point clouds -> `MeshRecord`s, in bulk.

What they are to Cycles (5.0): the points of curves of any type are what hair goes through, cyclic or not, straight if
the first curve is a poly; where there is no attribute `radius`, curves have 0.005 and points 0.01.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import are_equal, copy_within

from ...sync.records import (
    LARGEST_COORDINATE,
    NO_LAYERS,
    CurveKind,
    Float32Array,
    Int32Array,
    LayerRequest,
    Layers,
    MeshKind,
    MeshRecord,
)
from ..pointer_views import CURVE_OFFSETS, POSITIONS, RADII, ArrayReader
from .meshes import Kept, read_round_colors, read_round_uv_maps

_Curves, _PointCloud = bpy.types.Curves, bpy.types.PointCloud  # looking them up is slow
_CURVE_RADIUS, _POINT_RADIUS = 0.005, 0.01
_POLY = 1  # of the attribute `curve_type`
_LEAST_POINTS = 2
NO_TRIANGLES = np.empty((0, 3), np.int32)
NO_POLYGONS = np.empty(0, np.int32)

Offsets = npt.NDArray[np.int64]


def kind_of(data: Any) -> MeshKind | None:
    """Returns the kind of an object's evaluated data for rays; None for unsupported data."""
    if isinstance(data, bpy.types.Mesh):
        return "triangles"
    if isinstance(data, _Curves):
        return "curves"
    return "points" if isinstance(data, _PointCloud) else None


def read_curves_or_points(
    data: Any,
    key: Hashable,
    name: str,
    layers: LayerRequest,
    reader: ArrayReader,
    last: MeshRecord | None = None,
) -> MeshRecord | None:
    """Reads evaluated `bpy.types.Curves` or `bpy.types.PointCloud`; None if there is nothing in them.

    If all were dropped, an empty record holds their number.

    layers: the uv maps and colours that its materials show.
    last: the last reading, whose arrays replace equal ones. Everything is copied. Curves or points with a
    number that is not finite are dropped, and curves of a single point.
    """
    is_curves = isinstance(data, _Curves)
    positions = _view(data, "position", POSITIONS, reader)
    if positions is None or not len(positions):
        return None
    radii = _view(data, "radius", RADII, reader)
    if radii is None or len(radii) != len(positions):
        radii = np.full(len(positions), _CURVE_RADIUS if is_curves else _POINT_RADIUS, np.float32)
    positions, are_places = _copied(positions, last and last.positions)
    radii, are_radii = _copied(radii, last and last.radii)
    if radii is not (last and last.radii) and radii.min() < 0.0:
        radii = np.maximum(radii, 0.0)  # not a number stays none
    usable = None if are_places and are_radii else _usable(positions, radii)
    offsets = _offsets_of(data, reader) if is_curves else None
    kept_points, kept, dropped = _kept(usable, offsets, len(positions))
    if kept_points is not None:
        positions, radii = positions[kept_points], radii[kept_points]
        if offsets is not None:
            offsets = np.concatenate([[0], np.cumsum(np.diff(offsets)[kept])])
    kind: MeshKind = "curves" if is_curves else "points"
    if not len(positions):
        return none_of(kind, key, name, dropped)
    uvs: dict[str, Float32Array] = {}
    colors: dict[str, Float32Array] = {}
    if layers is not NO_LAYERS:
        of = Kept(kept_points, kept)
        uvs = held_layers(read_round_uv_maps(data, layers, of), "uvs", last)
        colors = held_layers(read_round_colors(data, layers, of), "colors", last)
    return MeshRecord(
        key=key,
        name=name,
        positions=held(positions, last and last.positions),
        triangles=NO_TRIANGLES,
        polygon_ids=NO_POLYGONS,
        corner_uvs=uvs.pop("", None),
        corner_colors=colors.pop("", None),
        named_uvs=uvs,
        named_colors=colors,
        layers=layers,
        dropped_triangles=dropped,
        triangle_ids=kept,
        kind=kind,
        radii=held(radii, last and last.radii),
        curve_offsets=None if offsets is None else held(offsets, last and last.curve_offsets),
        curve_kind=_curve_kind(data) if is_curves else "poly",
    )


def none_of(kind: MeshKind, key: Hashable, name: str, dropped: int) -> MeshRecord | None:
    """Returns an empty record with the number of dropped ones, None for none."""
    if not dropped:
        return None
    nowhere = np.empty((0, 3), np.float32)
    return MeshRecord(key, name, nowhere, NO_TRIANGLES, NO_POLYGONS, dropped_triangles=dropped, kind=kind)


def _view(data: Any, name: str, kind: Any, reader: ArrayReader) -> Float32Array | None:
    """A point's attribute, None if there is none of that name and kind."""
    attribute = data.attributes.get(name)
    expected = "FLOAT_VECTOR" if kind is POSITIONS else "FLOAT"
    if attribute is None or attribute.domain != "POINT" or attribute.data_type != expected:
        return None
    values: Float32Array = reader.view(attribute.data, kind)
    return values


def _copied(values: Float32Array, last: Float32Array | None) -> tuple[Float32Array, bool]:
    """The last array if it is equal, else a copy; and whether all of its numbers are of use, as the last ones are."""
    if last is not None and are_equal(values, last):
        return last, True
    copy = np.empty(values.shape, np.float32)
    return copy, copy_within(values, copy, LARGEST_COORDINATE)


def _usable(positions: Float32Array, radii: Float32Array) -> npt.NDArray[np.bool_]:
    """(P,) bool: the points that have numbers of use."""
    usable = np.abs(radii) <= LARGEST_COORDINATE
    return np.asarray(usable & (np.abs(positions) <= LARGEST_COORDINATE).all(axis=1))


_Points = npt.NDArray[np.bool_]


def _kept(usable: _Points | None, offsets: Offsets | None, count: int) -> tuple[_Points | None, Int32Array | None, int]:
    """Which points are shown, which curves or points, None for all; and how many were dropped for their numbers.

    usable: None if all of the `count` points are. offsets: of curves, None for points.
    """
    if offsets is None:
        if usable is None or usable.all():
            return None, None, 0
        return usable, np.flatnonzero(usable).astype(np.int32), int((~usable).sum())
    counts = np.diff(offsets)
    is_long = counts >= _LEAST_POINTS
    good = is_long
    if usable is not None:
        good = is_long & np.logical_and.reduceat(usable, np.minimum(offsets[:-1], count - 1))
    if good.all():
        return None, None, 0
    return np.repeat(good, counts), np.flatnonzero(good).astype(np.int32), int((is_long & ~good).sum())


def _offsets_of(data: Any, reader: ArrayReader) -> Offsets:
    return np.asarray(reader.read(data.curve_offset_data, CURVE_OFFSETS), np.int64)


def _curve_kind(data: Any) -> CurveKind:
    attribute = data.attributes.get("curve_type")
    is_poly = attribute is not None and len(attribute.data) > 0 and attribute.data[0].value == _POLY
    return "poly" if is_poly else "catmull_rom"


def held_layers(found: Mapping[str, Float32Array], what: str, last: MeshRecord | None) -> dict[str, Float32Array]:
    """Returns layers by name, with the last arrays for equal ones. what: "uvs" or "colors"."""
    if last is None:
        return dict(found)
    old: Layers = {**getattr(last, f"named_{what}"), "": getattr(last, f"corner_{what}")}
    return {name: held(values, old.get(name)) for name, values in found.items()}


def held(values: npt.NDArray[Any], last: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """The last array if it is equal."""
    return last if last is not None and are_equal(values, last) else values
