"""Materials as rows of a table: name, index, viewport colour; and which rows an object's slots refer to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from perfect_bvh.nodes import NodeProgram, Operand, Output, ProgramTooLargeError

from ...sync.look_records import FinishRecord, MaterialRecord
from ...sync.not_shown import NotShown
from ...sync.records import NO_LAYERS, Float32Array, LayerRequest
from .finishes import FINISH_SLOTS, NO_FINISH
from .images import ImageReader
from .node_colors import ReadSurface, read_surface
from .node_graph import Omissions
from .values import AskInstances, Source, Value

# Of surfaces without a material. From Blender 5.0 on Cycles shows a new Principled BSDF there, before a Diffuse BSDF.
PLAIN_REFLECTANCE = 0.04 if bpy.app.version >= (5, 0, 0) else 0.0


class MaterialReader:
    """Gives each material a row, in the order of first use.

    override: the view layer's material override, which replaces every material of the scene.
    images: given if shading is requested: receives the images of the materials.
    """

    def __init__(self, override: Any = None, images: ImageReader | None = None) -> None:
        self._override = override
        self._images = images
        self.sources: dict[Source, int] = {}  # what nodes ask of instances, by their rows among the instances' values
        self.follow_objects = False  # whether materials depend on where other objects are
        if images is not None:
            images.sources = self.sources
        self._rows: dict[int, int] = {}
        self._layers: dict[tuple[int, ...], LayerRequest] = {}
        self.records: list[MaterialRecord] = []
        self.not_shown: list[NotShown] = []
        self._volumes: set[int] = set()  # rows of those that show nothing
        self._shining: set[int] = set()  # rows of those that emit light

    def row(self, material: Any) -> int:
        """The row of an evaluated or original `bpy.types.Material`, -1 for None."""
        if material is None:
            return -1
        pointer = material.as_pointer()  # stable within one evaluation, and never kept beyond it
        row = self._rows.get(pointer)
        if row is None:
            row = self._rows[pointer] = len(self.records)
            self.records.append(self._read(material, row))
        return row

    def _read(self, material: Any, row: int) -> MaterialRecord:
        red, green, blue, alpha = material.diffuse_color
        record = MaterialRecord(
            name=material.name,
            session_uid=material.original.session_uid,
            pass_index=material.pass_index,
            color=(red, green, blue, alpha),
        )
        if self._images is None:
            return record
        omissions = Omissions("material")
        try:
            read = read_surface(material, self._images, omissions, self.sources)
            record = _with_surface(record, read)
        except ProgramTooLargeError:
            omissions.note_too_large("its viewport color is used")
            record = replace(record, base_color=(red, green, blue))
        else:
            self.follow_objects = self.follow_objects or read.values.follows_objects
            if read.surface.has_volume:
                self._volumes.add(row)
            if any(record.emission):
                self._shining.add(row)
        self.not_shown += omissions.rows(material)
        return record

    def are_volumes(self, slots: tuple[int, ...]) -> bool:
        """Whether objects with these materials are invisible because they have no surface."""
        return bool(self._volumes) and bool(slots) and self._volumes.issuperset(slots)

    def shine(self, slots: tuple[int, ...]) -> bool:
        """Whether one of these materials emits light, as far as they were read."""
        return not self._shining.isdisjoint(slots)

    def are_hair(self, slots: tuple[int, ...]) -> bool:
        """Whether one of these materials has a hair shader, as far as they were read."""
        return any(row >= 0 and self.records[row].hair is not None for row in slots)

    def slots(self, obj: Any, data: Any) -> tuple[int, ...]:
        """Return rows of an evaluated object's material slots, -1 for an empty slot; object-linked slots included.

        data: its own data, or a mesh that geometry nodes made for an object without object-linked slots.
        """
        if data == obj.data:
            materials = [slot.material for slot in obj.material_slots]
        else:
            materials = list(data.materials)
            materials += [None] * (len(obj.original.material_slots) - len(materials))
        if self._override is not None:
            return (self.row(self._override),) * max(1, len(materials))
        return tuple([self.row(material) for material in materials])

    def layers(self, slots: tuple[int, ...]) -> LayerRequest:
        """Return the layers of a mesh that the materials of these rows use."""
        if self._images is None:
            return NO_LAYERS
        layers = self._layers.get(slots)
        if layers is None:
            programs = [self.records[row].program for row in set(slots) if row >= 0]
            names = {kind: _layer_names(programs, kind) for kind in ("uvs", "colors", "tangents")}
            asks = any(program is not None and program.asks("GENERATED") for program in programs)
            wanted = LayerRequest(names["uvs"], names["colors"], names["tangents"], asks)
            layers = self._layers[slots] = NO_LAYERS if wanted == NO_LAYERS else wanted
        return layers


def _layer_names(programs: Sequence[NodeProgram | None], kind: str) -> frozenset[str]:
    return frozenset().union(*(program.layer_names(kind) for program in programs if program is not None))


def instance_values(sources: dict[Source, int], ask: AskInstances) -> Float32Array | None:
    """(I, K, 4): each instance's K values that nodes read; None if they read none."""
    return np.stack([ask(source) for source in sources], axis=1) if sources else None


# Properties of which a record has one number or colour, by the lobes' names, if no program sets them.
_LOBE_SLOTS = {
    "metallic": "METALLIC",
    "roughness": "ROUGHNESS",
    "reflectance": "REFLECTANCE",
    "transmission": "TRANSMISSION",
    "translucency": "TRANSLUCENCY",
    "ior": "IOR",
    "specular_tint": "SPECULAR_TINT",
}
_FIXED_LOBES = ("even_metal", "tinted_glass", "plain_refraction", "lossy_facets")
# Colours of lobes that follow from the base colour unless they are said, with the power of it that they are.
_TINTS = (("metal", "METAL", 1.0), ("transmission", "TINT", 0.5), ("translucent", "TRANSLUCENT", 0.0))


def _with_surface(record: MaterialRecord, read: ReadSurface) -> MaterialRecord:
    """Return the record with the properties that are the same all over the surface, and a program for the rest."""
    surface, values = read.surface, read.values
    lobes, slots = surface.lobes, dict[str, Operand]()

    def color(slot: str, operand: Operand) -> tuple[float, float, float]:
        if isinstance(operand, Output):
            slots[slot] = operand
        red, green, blue = (max(channel, 0.0) for channel in _finite(values.overall(Value(operand))))
        return red, green, blue

    def number(slot: str, operand: Operand) -> float:
        if isinstance(operand, Output):
            slots[slot] = operand
        return _finite(values.overall(Value(operand)))[0]

    fields: dict[str, Any] = {
        "base_color": color("COLOR", surface.base),
        "emission": color("EMISSION", surface.emission),
        "alpha": _share(number("ALPHA", surface.alpha)),
        "holdout": _share(surface.holdout),
        "hair": surface.hair,
        **{name: number(slot, getattr(lobes, name)) for name, slot in _LOBE_SLOTS.items() if name != "specular_tint"},
        "specular_tint": color("SPECULAR_TINT", lobes.specular_tint),
        **{name: getattr(lobes, name) for name in _FIXED_LOBES},
    }
    for (name, slot, power), operand in zip(_TINTS, (lobes.metal, lobes.tint, lobes.translucent), strict=True):
        if operand is None or (isinstance(operand, Output) and operand == surface.base):  # follows from the base colour
            fields[f"{name}_color"], fields[f"{name}_power"] = (1.0, 1.0, 1.0), power if operand is None else 1.0
        else:
            fields[f"{name}_color"], fields[f"{name}_power"] = color(slot, operand), 0.0
    if lobes.finish != NO_FINISH or any(surface.absorption):
        finish = lobes.finish
        found: dict[str, Any] = {
            name: (color if isinstance(getattr(FinishRecord(), name), tuple) else number)(slot, getattr(finish, name))
            for name, slot in FINISH_SLOTS.items()
        }
        fields["finish"] = FinishRecord(
            sheen_cover=finish.sheen_cover, distribution=finish.distribution, absorption=surface.absorption, **found
        )
        slots.update({} if finish.tangent is None else {"TANGENT": finish.tangent})
        slots.update({} if finish.coat_normal is None else {"COAT_NORMAL": finish.coat_normal})
    if surface.normal is not None:
        slots["NORMAL"] = surface.normal
    program = values.nodes.program(**slots) if slots else None
    return replace(record, program=program, **fields)


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _finite(channels: tuple[float, ...]) -> tuple[float, ...]:
    return tuple([channel if math.isfinite(channel) else 0.0 for channel in channels])
