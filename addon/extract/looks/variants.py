"""Materials that are not the same on each instance: their nodes worked out once for all instances, as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import (
    Float32Array,
    InstanceRecords,
    Int32Array,
    MaterialRecord,
    MaterialVariants,
    ObjectRecord,
)
from .color_math import Pixels
from .images import ImageReader
from .lobes import LOBE_NUMBERS
from .node_colors import Surface, read_surface
from .shown_nodes import Omissions
from .values import AskInstances, Source, first_channel

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
