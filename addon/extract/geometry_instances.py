"""Instances made by geometry nodes, a whole instancer at a time: no Python object for each (Blender 4.5 and later).

Each instancer's geometry says what it shows and where, as arrays. Where that cannot tell everything that Blender's list
would (nested instances, collections, particles, other instancers, hidden originals), nothing is read this way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt
from perfect_bvh.bulk import place_instances

from ..sync.records import LARGEST_COORDINATE, Float32Array, Int32Array
from .groups import NOT_SHOWN, GroupTable
from .listing import Listing
from .pointer_views import MATRICES, REFERENCE_INDICES, ArrayReader

# Objects that are no surface and show nothing.
_SILENT_TYPES = frozenset({"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER"})
_INSTANCER_SWITCHES = ("show_instancer_for_viewport", "show_instancer_for_render")
_COMPONENTS = ("curves", "pointcloud", "volume", "grease_pencil")
_IS_SUPPORTED = hasattr(bpy.types.Object, "evaluated_geometry")
_UNUSED_LEVEL = 2**31 - 1  # Blender's filler in a persistent id

# How Blender numbers the instances of a group: plain objects not at all; others by the instance's id, after as many
# zeros as there are geometries between: an object has none, a mesh that is a reference's own geometry has one.
_PLAIN = -1


class _UnsupportedError(Exception):
    """Blender's list is needed after all."""


@dataclass(slots=True)
class _Shown:
    """What instances of one reference show: an object, or the mesh of a geometry.

    zeros: before the id, see above. matrices: (4, 4) float32, of the geometries between, from the outermost; empty if
    they change nothing. owner: keeps the geometry, which is known by address.
    """

    obj: Any
    mesh: Any
    zeros: int
    matrices: list[Float32Array]
    owner: Any


@dataclass(slots=True)
class _Instancer:
    """What an evaluated object shows beside itself; None for references to nothing. The geometry owns the points."""

    geometry: Any
    points: Any
    references: list[_Shown | None]


@dataclass(slots=True)
class _Block:
    """Consecutive instances of one instancer, or plain objects.

    parent, local: (4, 4) and (N, 4, 4) float32, the latter a view that is transposed; for plain objects parent is None.
    inner: rows, and the matrices that follow for them.
    """

    parent: Float32Array | None
    local: Float32Array
    group_ids: Int32Array
    ids: Int32Array
    inner: list[tuple[npt.NDArray[np.intp], list[Float32Array]]] = field(default_factory=list)


def list_geometry_instances(depsgraph: Any, groups: GroupTable, reader: ArrayReader) -> Listing | None:
    """What `list_instances` gives, or None, with nothing read, if only that can tell."""
    surveyed = survey(depsgraph)
    return None if surveyed is None else _Collector(groups, reader).collect(depsgraph, surveyed)


def survey(depsgraph: Any) -> list[tuple[Any, _Instancer | None]] | None:
    """Each evaluated object with what it shows beside itself; None if Blender's list is needed, or is as good."""
    if not _IS_SUPPORTED or not _may_have_node_instances():
        return None
    try:
        surveyed = [(obj, _survey(obj)) for obj in depsgraph.objects]
    except _UnsupportedError:
        return None
    return surveyed if any(instancer for _, instancer in surveyed) else None


def _may_have_node_instances() -> bool:
    """A quick answer for the many scenes that have none. An instancer that hides itself is not among the objects."""
    if not any(group.bl_idname == "GeometryNodeTree" for group in bpy.data.node_groups):
        return False
    shown = np.empty(len(bpy.data.objects), np.bool_)
    for switch in _INSTANCER_SWITCHES:
        bpy.data.objects.foreach_get(switch, shown)
        if not shown.all():
            return False
    return True


def _survey(obj: Any) -> _Instancer | None:
    """What an evaluated object shows beside itself, None for nothing. Raises _UnsupportedError."""
    if obj.is_instancer:
        raise _UnsupportedError
    if obj.type != "MESH":
        if obj.type not in _SILENT_TYPES:
            raise _UnsupportedError
        return None
    if len(obj.particle_systems):
        raise _UnsupportedError
    if not any(modifier.type == "NODES" for modifier in obj.modifiers):
        return None
    geometry = obj.evaluated_geometry()
    _refuse_components(geometry)
    points = geometry.instances_pointcloud()
    if points is None or not len(points.points):
        return None
    _check_points(obj, points)
    return _Instancer(geometry, points, [_resolve(reference) for reference in geometry.instance_references()])


def _check_points(obj: Any, points: Any) -> None:
    ids = points.attributes.get("id")
    if ids is not None and _has_repeated(ids.data):
        raise _UnsupportedError  # Blender gives the others numbers at random
    if any(slot.link == "OBJECT" for slot in obj.original.material_slots):
        raise _UnsupportedError  # how they combine with a mesh's own materials is Blender's secret


def _refuse_components(geometry: Any) -> None:
    """They would be instances as well."""
    if any(getattr(geometry, name) is not None for name in _COMPONENTS):
        raise _UnsupportedError


def _has_repeated(ids: Any) -> bool:
    values = np.empty(len(ids), np.int32)
    ids.foreach_get("value", values)
    return len(np.unique(values)) < len(values)


def _resolve(reference: Any, zeros: int = 0, matrices: tuple[Float32Array, ...] = ()) -> _Shown | None:
    """What a reference shows. Raises _UnsupportedError if that is more than one thing."""
    if not isinstance(reference, bpy.types.GeometrySet):
        _check_object(reference)
        return _Shown(reference, reference.data, zeros, list(matrices), None)
    _refuse_components(reference)
    points = reference.instances_pointcloud()
    mesh = reference.mesh
    if points is None:
        return None if mesh is None else _Shown(None, mesh, zeros + 1, list(matrices), reference)
    if mesh is not None or len(points.points) != 1 or "id" in points.attributes:
        raise _UnsupportedError
    # Object Info and Collection Info give a geometry that holds one instance.
    matrix = np.array(points.attributes["instance_transform"].data[0].value, np.float32)
    if not np.array_equal(matrix, np.eye(4)):
        matrices = (*matrices, matrix)
    return _resolve(reference.instance_references()[0], zeros + 1, matrices)


def _check_object(reference: Any) -> None:
    if not isinstance(reference, bpy.types.Object) or reference.type != "MESH" or not reference.is_evaluated:
        raise _UnsupportedError
    parent = reference.parent
    if parent is not None and parent.instance_type in {"VERTS", "FACES"}:
        raise _UnsupportedError  # such a parent hides it
    if _survey(reference) is not None:
        raise _UnsupportedError


class _Collector:
    """Turns what was surveyed into columns."""

    def __init__(self, groups: GroupTable, reader: ArrayReader) -> None:
        self._groups = groups
        self._reader = reader
        self._blocks: list[_Block] = []

    def collect(self, depsgraph: Any, surveyed: list[tuple[Any, _Instancer | None]]) -> Listing:
        matrices = np.empty((len(surveyed), 4, 4), np.float32)
        depsgraph.objects.foreach_get("matrix_world", matrices.reshape(-1))
        plain_from = 0
        plain: list[int] = []
        for row, (obj, instancer) in enumerate(surveyed):
            data = obj.data
            is_shown = data is not None
            plain.append(
                self._groups.add(obj, data, parent=None, is_own=True, numbering=_PLAIN) if is_shown else NOT_SHOWN
            )
            if instancer is not None:
                self._add_plain(matrices[plain_from : row + 1], plain)
                plain_from, plain = row + 1, []
                self._add_instances(obj, matrices[row].T, instancer)
        self._add_plain(matrices[plain_from:], plain)
        return self._join()

    def _add_plain(self, matrices: Float32Array, group_ids: list[int]) -> None:
        """Leaves out at once what shows nothing, which an instancer mostly does: the others need no copying later."""
        groups = np.array(group_ids, np.int32)
        shown = groups != NOT_SHOWN
        self._blocks.append(_Block(None, matrices[shown], groups[shown], np.zeros(shown.sum(), np.int32)))

    def _add_instances(self, obj: Any, matrix: Float32Array, instancer: _Instancer) -> None:
        attributes = instancer.points.attributes
        local = self._reader.view(attributes["instance_transform"].data, MATRICES).reshape(-1, 4, 4)
        references = self._reader.view(attributes[".reference_index"].data, REFERENCE_INDICES)
        own_ids = attributes.get("id")
        if own_ids is None:
            ids = np.arange(len(local), dtype=np.int32)
        else:
            ids = self._reader.read(own_ids.data, REFERENCE_INDICES)
        groups = np.full(len(instancer.references), NOT_SHOWN, np.int32)
        block = _Block(matrix, local, groups, ids)
        for index in _in_order_of_use(references, len(groups)):
            shown = instancer.references[index]
            if shown is None:
                continue
            groups[index] = self._add_shown(obj, shown)
            if shown.matrices:
                block.inner.append((np.flatnonzero(references == index), shown.matrices))
        block.group_ids = groups[references]
        self._blocks.append(block)

    def _add_shown(self, instancer: Any, shown: _Shown) -> int:
        obj = shown.obj or instancer
        is_own = shown.obj is not None
        return self._groups.add(obj, shown.mesh, parent=instancer, is_own=is_own, numbering=shown.zeros)

    def _join(self) -> Listing:
        counts = [len(block.local) for block in self._blocks]
        transforms = np.empty((sum(counts), 3, 4), np.float32)
        bad_rows = []
        first = 0
        for block, count in zip(self._blocks, counts, strict=True):
            placed = transforms[first : first + count]
            bad = place_instances(block.parent, block.local, placed, LARGEST_COORDINATE)
            for rows, matrices in block.inner:
                placed[rows] = _place_within(placed[rows], matrices)
            if block.inner:
                bad = np.flatnonzero(~(np.abs(placed) <= LARGEST_COORDINATE).all(axis=(1, 2)))
            bad_rows.append(bad + first)
            first += count
        return Listing(
            group_ids=np.concatenate([block.group_ids for block in self._blocks]),
            transforms=transforms,
            bad_rows=np.concatenate(bad_rows).astype(np.int32),
            ids=np.concatenate([block.ids for block in self._blocks]),
            expand_ids=self._expand_ids,
        )

    def _expand_ids(self, group_ids: Int32Array, ids: Int32Array) -> Int32Array:
        """(I, 8) persistent ids as Blender numbers them."""
        zeros = np.array([row[-1] for row in self._groups.rows], np.int8)[group_ids]
        expanded = np.full((len(ids), 8), _UNUSED_LEVEL, np.int32)
        for count in np.unique(zeros):
            rows = zeros == count
            if count == _PLAIN:
                expanded[rows] = 0
            else:
                expanded[rows, :count] = 0
                expanded[rows, count] = ids[rows]
        return expanded


def _place_within(outer: Float32Array, matrices: list[Float32Array]) -> Float32Array:
    """(N, 3, 4): outer maps times the matrices, one after the other, summed in Blender's order."""
    for m in matrices:
        x, y, z, w = (outer[:, :, column, None] for column in range(4))
        outer = (x * m[0] + y * m[1]) + (z * m[2] + w * m[3])
    return outer


def _in_order_of_use(references: npt.NDArray[np.int32], count: int) -> Iterator[int]:
    """The references that are used, in the order in which Blender's list would come to them."""
    if count == 1:
        return iter((0,))
    used, first = np.unique(references, return_index=True)
    return iter(int(reference) for reference in used[np.argsort(first)])
