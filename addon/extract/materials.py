"""Materials as rows of a table: name, index, viewport colour; and which rows an object's slots refer to."""

from __future__ import annotations

from typing import Any

from ..sync.records import MaterialRecord


class MaterialReader:
    """Gives each material that is met a row, in the order they are met.

    override: the view layer's material override, which stands for every material of the scene.
    """

    def __init__(self, override: Any = None) -> None:
        self._override = override
        self._rows: dict[int, int] = {}
        self.records: list[MaterialRecord] = []

    def row(self, material: Any) -> int:
        """The row of an evaluated or original `bpy.types.Material`, -1 for None."""
        if material is None:
            return -1
        pointer = material.as_pointer()  # stable within one evaluation, and never kept beyond it
        row = self._rows.get(pointer)
        if row is None:
            row = self._rows[pointer] = len(self.records)
            self.records.append(_read_material(material))
        return row

    def slots(self, obj: Any, data: Any) -> tuple[int, ...]:
        """Rows of an evaluated object's material slots, -1 for an empty slot; object-linked slots included.

        data: what it shows; its own, or a mesh that geometry nodes made for an object without object-linked slots.
        """
        if data == obj.data:
            materials = [slot.material for slot in obj.material_slots]
        else:
            materials = list(data.materials)
            materials += [None] * (len(obj.original.material_slots) - len(materials))
        if self._override is not None:
            return (self.row(self._override),) * max(1, len(materials))
        return tuple([self.row(material) for material in materials])


def _read_material(material: Any) -> MaterialRecord:
    red, green, blue, alpha = material.diffuse_color
    return MaterialRecord(
        name=material.name,
        session_uid=material.original.session_uid,
        pass_index=material.pass_index,
        color=(red, green, blue, alpha),
    )
