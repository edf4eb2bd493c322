"""Everything that the depsgraph shows -> columns of instances.

Matrices and persistent ids come in bulk. Which object and which mesh an instance shows does not, so one lean
loop asks that; all that depends on it is looked up once per different (mesh, object, instancer).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ..sync.records import LARGEST_COORDINATE, InstanceRecords, Int32Array
from .materials import MaterialReader
from .mesh_table import NO_MESH, MeshTable
from .objects import ObjectTable
from .visibility import VisibilityReader

_Mesh = bpy.types.Mesh  # looking it up is slow
_NOT_SHOWN = -1
_NO_PARENT = -1
# Data that renderers show and that has no triangles; everything else without a mesh is silently no surface.
_UNREADABLE_TYPES = {
    "CURVES": "hair curves are not triangles",
    "POINTCLOUD": "a point cloud has no triangles",
    "VOLUME": "a volume has no triangles",
    "GREASEPENCIL": "grease pencil strokes are not triangles",
}


@dataclass(slots=True)
class InstanceReader:
    """Reads the instances of one evaluated depsgraph; fills the tables it is given."""

    depsgraph: Any
    meshes: MeshTable
    materials: MaterialReader
    visibility: VisibilityReader
    objects: ObjectTable = field(default_factory=ObjectTable)
    warnings: list[str] = field(default_factory=list)
    _groups: list[tuple[int, int, int, int]] = field(default_factory=list)  # mesh, object, parent, mask
    _warned: set[int] = field(default_factory=set)

    def read(self) -> InstanceRecords:
        """All visible instances that have triangles, in the depsgraph's own order."""
        instances = self.depsgraph.object_instances
        group_ids = self._assign_groups(instances)
        count = len(group_ids)
        matrices = np.empty((count, 4, 4), np.float32)
        persistent_ids = np.empty((count, 8), np.int32)
        instances.foreach_get("matrix_world", matrices.reshape(-1))
        instances.foreach_get("persistent_id", persistent_ids.reshape(-1))

        finite = (np.abs(matrices) <= LARGEST_COORDINATE).all(axis=(1, 2))  # NaN is not
        shown = group_ids != _NOT_SHOWN
        self._warn_of_bad_matrices(group_ids[shown & ~finite])
        shown &= finite
        groups = np.array(self._groups, np.int64).reshape(-1, 4)[group_ids[shown]]
        return InstanceRecords(
            mesh_indices=groups[:, 0].astype(np.int32),
            object_indices=groups[:, 1].astype(np.int32),
            parent_indices=groups[:, 2].astype(np.int32),
            transforms=matrices[shown].transpose(0, 2, 1).astype(np.float64, order="C"),  # Blender's are column-major
            masks=groups[:, 3].astype(np.uint32),
            persistent_ids=persistent_ids[shown],
        )

    def _assign_groups(self, instances: Any) -> Int32Array:
        """(N,) int32: each listed instance's row of _groups, or _NOT_SHOWN.

        Nothing of an instance may be kept: the object of a duplicate is one temporary that is overwritten. Its mesh,
        the object it is a duplicate of, and its instancer do last for the loop; they are compared by address, and
        as dictionary keys at half the cost of asking for their addresses.
        """
        known: dict[Any, int] = {}
        group_ids: list[int] = []
        for instance in instances:
            source = instance.instance_object
            obj = instance.object
            data = obj.data
            if data is None or not instance.show_self:
                group_ids.append(_NOT_SHOWN)
                continue
            token = obj if source is None else (data, source, instance.parent)
            group = known.get(token)
            if group is None:
                group = known[token] = self._add_group(instance, obj, data, source)
            group_ids.append(group)
        return np.array(group_ids, np.int32)

    def _add_group(self, instance: Any, obj: Any, data: Any, source: Any) -> int:
        parent = None if source is None else instance.parent
        if self.visibility.is_hidden(obj, parent):
            return _NOT_SHOWN
        mask = self.visibility.mask(obj, parent)
        if mask == 0:
            return _NOT_SHOWN
        self._warn_of_unreadable(obj, data, instance.show_particles)
        if not isinstance(data, _Mesh):
            return _NOT_SHOWN
        mesh_row = self.meshes.row(obj, data, is_own=source is None or source.data == data)
        if mesh_row == NO_MESH:
            return _NOT_SHOWN
        object_row = self.objects.row(obj, self.materials.slots(obj), self.visibility.is_holdout(obj, parent))
        parent_row = _NO_PARENT if parent is None else self.objects.row(parent)
        self._groups.append((mesh_row, object_row, parent_row, mask))
        return len(self._groups) - 1

    def _warn_of_unreadable(self, obj: Any, data: Any, shows_particles: bool) -> None:
        reason = None
        if not isinstance(data, _Mesh):
            reason = _UNREADABLE_TYPES.get(obj.type)
        elif shows_particles and any(map(_is_strands, obj.particle_systems)):
            reason = "particle hair is not triangles"
        if reason is not None and obj.original.session_uid not in self._warned:
            self._warned.add(obj.original.session_uid)
            self.warnings.append(f"{obj.original.name}: {reason}; left out")

    def _warn_of_bad_matrices(self, group_ids: npt.NDArray[Any]) -> None:
        for group in np.unique(group_ids):
            name = self.objects.records[self._groups[group][1]].name
            count = int(np.count_nonzero(group_ids == group))
            self.warnings.append(
                f"{name}: {count} instances with a matrix that is not finite or beyond 1e18 were left out"
            )


def _is_strands(system: Any) -> bool:
    return system.settings.type == "HAIR" and system.settings.render_type == "PATH"
