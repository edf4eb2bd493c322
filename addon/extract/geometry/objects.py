"""Objects as rows of a table, as instances refer to them."""

from __future__ import annotations

from typing import Any

from ...sync.records import ObjectRecord


class ObjectTable:
    """Gives each different `ObjectRecord` a row, in the order they are met.

    An object has a second row where its instances differ in what the record holds: in the materials of a mesh
    that geometry nodes made, or because one instancer is a holdout and another is not.
    """

    def __init__(self) -> None:
        self._rows: dict[tuple[Any, ...], int] = {}
        self.records: list[ObjectRecord] = []
        self.originals: list[Any] = []  # of the records, for as long as this evaluation is read

    def row(self, obj: Any, material_slots: tuple[int, ...] = (), holdout: bool = False) -> int:
        """The row of an evaluated object."""
        original = obj.original
        uid = original.session_uid
        key = (uid, material_slots, holdout)
        row = self._rows.get(key)
        if row is None:
            row = self._rows[key] = len(self.records)
            self.originals.append(original)
            self.records.append(ObjectRecord(original.name, uid, obj.pass_index, material_slots, holdout))
        return row
