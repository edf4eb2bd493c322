"""Materials as rows of a table: name, index, viewport colour; and which rows an object's slots refer to."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
import numpy.typing as npt

from ...sync.look_records import MaterialRecord, MaterialVariants
from ...sync.not_shown import NotShown
from ...sync.records import NO_LAYERS, Float32Array, InstanceRecords, Int32Array, LayerRequest, ObjectRecord
from .images import ImageReader
from .lobes import LOBE_NUMBERS, Lobes
from .node_colors import Surface, read_surface
from .node_graph import Omissions
from .values import AskInstances, Pixels, Source, Value, constant, first_channel

# Of what has no material. From Blender 5.0 on Cycles takes it for a new Principled BSDF, before for a Diffuse BSDF.
PLAIN_REFLECTANCE = 0.04 if bpy.app.version >= (5, 0, 0) else 0.0


class MaterialReader:
    """Gives each material that is met a row, in the order they are met.

    override: the view layer's material override, which stands for every material of the scene.
    images: where what the materials are made of is wanted, too: takes the images that they show.
    """

    def __init__(self, override: Any = None, images: ImageReader | None = None) -> None:
        self._override = override
        self._images = images
        self._rows: dict[int, int] = {}
        self._layers: dict[tuple[int, ...], LayerRequest] = {}
        self.records: list[MaterialRecord] = []
        self.not_shown: list[NotShown] = []
        self._volumes: set[int] = set()  # rows of those that show nothing
        self._shining: set[int] = set()  # rows of those that emit light
        self.asking: dict[int, Any] = {}  # the evaluated materials whose nodes ask for the instance, by their rows
        self.asked: set[Source] = set()

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
        asked: set[Source] = set()
        surface = read_surface(material, self._images, omissions, asked=asked)
        if asked:
            self.asking[row] = material
            self.asked |= asked
        self.not_shown += omissions.rows(material)
        if surface.has_volume:
            self._volumes.add(row)
        record = _with_surface(record, surface, self._images)
        if any(record.emission):
            self._shining.add(row)
        return record

    def are_volumes(self, slots: tuple[int, ...]) -> bool:
        """Whether what has these materials shows nothing, for they have no surface."""
        return bool(self._volumes) and bool(slots) and self._volumes.issuperset(slots)

    def shine(self, slots: tuple[int, ...]) -> bool:
        """Whether one of these materials emits light, as far as they were read."""
        return not self._shining.isdisjoint(slots)

    def are_hair(self, slots: tuple[int, ...]) -> bool:
        """Whether one of these materials has a hair shader, as far as they were read."""
        return any(row >= 0 and self.records[row].hair is not None for row in slots)

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

    def layers(self, slots: tuple[int, ...]) -> LayerRequest:
        """What of a mesh the materials of these rows show."""
        if self._images is None:
            return NO_LAYERS
        layers = self._layers.get(slots)
        if layers is None:
            materials = [self.records[row] for row in set(slots) if row >= 0]
            images = {row for material in materials for row in material.images if row >= 0}
            uvs = frozenset(self._images.records[row].uv_map for row in images)
            colors = frozenset(material.tint for material in materials if material.tint is not None)
            layers = self._layers[slots] = LayerRequest(uvs, colors) if uvs or colors else NO_LAYERS
        return layers


WHITE = constant(1.0)
_LOBE_NUMBERS = (
    *("metallic", "roughness", "reflectance", "transmission", "translucency", "ior"),
    *("even_metal", "tinted_glass", "plain_refraction", "lossy_facets", "specular_tint"),
)


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0) if math.isfinite(value) else 0.0


def _with_surface(record: MaterialRecord, surface: Surface, images: ImageReader) -> MaterialRecord:
    color_image, alpha_image = _image_rows(surface, images)
    emitted = surface.emission
    return replace(
        record,
        base_color=_rgb(WHITE if surface.base.tint is not None and surface.base.is_guess else surface.base),
        emission=_rgb(WHITE if emitted.texture else emitted, surface.brightness),
        alpha=_share(float(surface.alpha.color[0])) if surface.alpha.texture is None else 1.0,
        **_lobe_fields(surface.lobes),
        holdout=_share(surface.holdout),
        color_image=color_image,
        alpha_image=alpha_image,
        tint=surface.base.tint,
        hair=surface.hair,
        emission_image=images.row(emitted) if emitted.texture else -1,
    )


def _lobe_fields(lobes: Lobes) -> dict[str, Any]:
    fields = {name: getattr(lobes, name) for name in _LOBE_NUMBERS}
    for name, tint in (
        ("metal", lobes.metal_tint),
        ("transmission", lobes.clear_tint),
        ("translucent", lobes.translucent_tint),
    ):
        fields[f"{name}_color"], fields[f"{name}_power"] = tint.color, tint.power
    return fields


def _image_rows(surface: Surface, images: ImageReader) -> tuple[int, int]:
    """Of the base colour and of alpha: the same where one texture has both."""
    base, alpha = surface.base, surface.alpha
    if base.texture is not None and base.texture == alpha.texture:
        row = images.row(base, alpha)
        return row, row
    return -1 if base.texture is None else images.row(base), -1 if alpha.texture is None else images.row(None, alpha)


def _rgb(value: Value, factor: float = 1.0) -> tuple[float, float, float]:
    red, green, blue = (max(channel * factor, 0.0) for channel in value.color[:3].tolist())
    return red, green, blue


# Variants ------------------------------------------------------------------------------------------------------------
# Materials that are not the same on each instance: their nodes worked out once for all instances, as arrays.


# Of a record, what may differ from instance to instance.
_FIELDS = ("base_color", "color_scale", "emission", "alpha", *LOBE_NUMBERS)


def read_variants(
    materials: Sequence[MaterialRecord],
    asking: dict[int, Any],
    objects: Sequence[ObjectRecord],
    instances: InstanceRecords,
    ask: AskInstances,
    images: ImageReader,
) -> MaterialVariants | None:
    """None if no instance shows a material that asks for it.

    asking: by their rows, the materials whose nodes do. ask: what a source gives for each of the instances.
    """
    parts = []
    for row, material in sorted(asking.items()):
        shown = _instances_of(row, objects, instances)
        if len(shown):
            columns = dict(_columns_of(material, materials[row], _narrowed(ask, shown), images))
            parts.append((row, shown, columns))
    if not parts:
        return None
    varying = [name for name in _FIELDS if any(name in columns for _, _, columns in parts)]
    return MaterialVariants(
        materials=np.repeat(*np.array([(row, len(shown)) for row, shown, _ in parts], np.int32).T),
        instances=np.concatenate([shown for _, shown, _ in parts]),
        columns={
            name: np.concatenate(
                [
                    columns[name] if name in columns else _repeated(getattr(materials[row], name), len(shown))
                    for row, shown, columns in parts
                ]
            )
            for name in varying
        },
    )


def _instances_of(material: int, objects: Sequence[ObjectRecord], instances: InstanceRecords) -> Int32Array:
    """Rows of the instances whose object has the material in a slot."""
    has_it = np.array([material in obj.material_slots for obj in objects], np.bool_)
    return np.flatnonzero(has_it[instances.object_indices]).astype(np.int32) if len(objects) else np.empty(0, np.int32)


def _narrowed(ask: AskInstances, rows: Int32Array) -> AskInstances:
    """Of these rows alone, and what stands in for them behind."""

    def ask_some(source: Source) -> Pixels:
        return np.concatenate([ask(source)[rows], source.stand_in[None]])

    return ask_some


def _columns_of(
    material: Any, record: MaterialRecord, ask: AskInstances, images: ImageReader
) -> Iterator[tuple[str, Float32Array]]:
    surface = read_surface(material, images, Omissions("material"), ask)  # they were named when it was read first
    yield from _color_columns(surface, record)
    for name in LOBE_NUMBERS:
        numbers = np.asarray(getattr(surface.lobes, name))
        if numbers.ndim:
            yield name, numbers[:-1].astype(np.float32)


def _color_columns(surface: Surface, record: MaterialRecord) -> Iterator[tuple[str, Float32Array]]:
    """Images stay what they are for what stands in for the instances, and are multiplied with the rest."""
    base, emission, alpha = surface.base.color, surface.emission.color, surface.alpha.color
    if base.ndim > 1:
        yield (
            ("base_color", _finite(base[:-1, :3]))
            if record.color_image < 0
            else ("color_scale", _finite(_scales(base[:, :3])))
        )
    if emission.ndim > 1:
        radiance = emission[:, :3] * np.float32(surface.brightness)
        has_image = record.emission_image >= 0
        yield "emission", _finite(_scales(radiance) * np.float32(record.emission) if has_image else radiance[:-1])
    if alpha.ndim > 1:
        shares = first_channel(alpha)
        yield "alpha", np.clip(_finite(shares[:-1] if record.alpha_image < 0 else _scales(shares)), 0.0, 1.0)


def _scales(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """(N, ...): how many times the last row the others are; 1 where that is zero."""
    last = values[-1]
    return np.where(last != 0.0, values[:-1] / np.where(last != 0.0, last, 1.0), 1.0)


def _finite(values: npt.NDArray[Any]) -> Float32Array:
    """Zero where it is none or below."""
    return np.where(np.isfinite(values), np.maximum(values, 0.0), 0.0).astype(np.float32)


def _repeated(value: Any, count: int) -> Float32Array:
    row = np.asarray(value, np.float32)
    return np.broadcast_to(row, (count, *row.shape))
