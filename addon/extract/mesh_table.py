"""The distinct meshes of one evaluation: each is read once, whoever shows it, and gets a key that lasts.

Evaluated meshes have new addresses and new session uids at every evaluation, so neither can be a key. What
lasts is the object or mesh data-block that a mesh came from:

- ("mesh", uid of the data-block): shown as it is, by any number of objects;
- ("object", uid of the object): what an object's modifiers, or its curve, text or metaball, made;
- ("made", uid of the object, digest of the triangles): what geometry nodes made and show as instances. The
  digest leaves the positions out, so that such a mesh is still the same one when it deforms.

A last number tells apart what would otherwise be equal.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..sync.records import AttributeRequest, MeshRecord
from .meshes import read_mesh
from .pointer_views import ArrayReader
from .usage import guess_usage

NO_MESH = -1


class MeshTable:
    """Reads meshes on first sight and hands out their rows; pointers are only used within one evaluation."""

    def __init__(self, depsgraph: Any, attributes: AttributeRequest, reader: ArrayReader) -> None:
        self._depsgraph = depsgraph
        self._attributes = attributes
        self._reader = reader
        self._rows: dict[int, int] = {}
        self._keys: set[Hashable] = set()
        self._twins = _TwinFinder()
        self.records: list[MeshRecord] = []
        self.warnings: list[str] = []

    def row(self, obj: Any, mesh: Any, is_own: bool) -> int:
        """The row of an evaluated mesh, or NO_MESH if it has no faces.

        obj: the evaluated object, or the depsgraph's temporary, that shows the mesh. is_own: whether it is the
        object's own mesh and not one that geometry nodes made beside it.
        """
        pointer = mesh.as_pointer()
        row = self._rows.get(pointer)
        if row is None:
            row = self._rows[pointer] = self._read(obj.original, mesh, is_own)
        return row

    def _read(self, original: Any, mesh: Any, is_own: bool) -> int:
        if mesh.is_editmode:  # its arrays are stale until they are written out of the edit mesh
            evaluated = original.evaluated_get(self._depsgraph)
            record = read_mesh(evaluated.to_mesh(), None, original.name, self._attributes, self._reader)
            evaluated.to_mesh_clear()
        else:
            record = read_mesh(mesh, None, mesh.name, self._attributes, self._reader)
        if record is None:
            return NO_MESH
        if record.dropped_triangles:
            self.warnings.append(
                f"{original.name}: {record.dropped_triangles} triangles with a vertex that is not finite or beyond "
                "1e18 were left out"
            )
        twin = self._twins.find(original.data, record, self.records)
        if twin is None:
            key = self._lasting_key(original, record, is_own)
            self.records.append(replace(record, key=key, usage=guess_usage(original)))
            twin = len(self.records) - 1
        return twin

    def _lasting_key(self, original: Any, record: MeshRecord, is_own: bool) -> Hashable:
        uid = original.session_uid
        if original.type != "MESH":
            # Curves and their like show even their own mesh as an instance; it comes before any other.
            is_own = ("object", uid, 0) not in self._keys
        key: tuple[Any, ...]
        if not is_own:
            key = ("made", uid, hashlib.blake2b(record.triangles.data, digest_size=12).digest())
        elif original.type == "MESH" and not len(original.modifiers):
            key = ("mesh", original.data.session_uid)
        else:
            key = ("object", uid)
        number = 0
        while (*key, number) in self._keys:
            number += 1
        self._keys.add((*key, number))
        return (*key, number)


class _TwinFinder:
    """Finds meshes that were evaluated once an object although they are equal.

    Linked text and curves are, and linked meshes under equal modifiers. They become one mesh again.
    """

    def __init__(self) -> None:
        self._candidates: dict[Hashable, list[int]] = {}
        self._checksums: dict[int, int] = {}

    def find(self, data: Any, record: MeshRecord, records: list[MeshRecord]) -> int | None:
        """The row of an equal mesh from the same data-block; if there is none, record will be records' next."""
        if data is None or data.users < 2:
            return None
        likeness = (data.session_uid, len(record.positions), len(record.triangles))
        candidates = self._candidates.setdefault(likeness, [])
        if candidates:  # checksums are for telling many copies apart: the first needs none
            checksum = zlib.crc32(record.positions.data)
            for row in candidates:
                if self._checksum(row, records) == checksum and _have_equal_content(records[row], record):
                    return row
        candidates.append(len(records))
        return None

    def _checksum(self, row: int, records: list[MeshRecord]) -> int:
        checksum = self._checksums.get(row)
        if checksum is None:
            checksum = self._checksums[row] = zlib.crc32(records[row].positions.data)
        return checksum


def _have_equal_content(first: MeshRecord, second: MeshRecord) -> bool:
    return all(
        _are_equal(getattr(first, name), getattr(second, name))
        for name in (
            "positions",
            "triangles",
            "polygon_ids",
            "material_slots",
            "corner_normals",
            "corner_uvs",
            "triangle_ids",
        )
    )


def _are_equal(first: npt.NDArray[Any] | None, second: npt.NDArray[Any] | None) -> bool:
    if first is None or second is None:
        return first is second
    return np.array_equal(first, second)
