"""Baked values as colours of their meshes, which Blender's Solid shading shows, and what these mean."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

SUFFIX = " (color)"
MEANING = "perfect_bvh_baked"  # a custom property of meshes
# From least to most, in sRGB, of rising lightness: people with any kind of colour blindness can read it.
RAMP = np.array([(68, 1, 84), (65, 68, 135), (42, 120, 142), (34, 168, 132), (122, 209, 81), (253, 231, 37)]) / 255.0
NOTHING = (0.4, 0.4, 0.4)  # of values that are not finite
TYPES = {"FACE": "CORNER"}  # Blender shows colours of corners and vertices alone


@dataclass(frozen=True, slots=True)
class Meaning:
    """What colours mean. attribute: of the values. label: their quantity. least, most: at the ends of the ramp."""

    attribute: str
    label: str
    unit: str
    least: float
    most: float


def ramp_colors(values: npt.NDArray[Any], least: float, most: float) -> npt.NDArray[np.float32]:
    """Return (N, 4) sRGB of (N,) values."""
    numbers = np.asarray(values, np.float64)
    is_known = np.isfinite(numbers)
    shares = np.where(is_known, numbers - least, 0.0) / max(most - least, 1e-12) * (len(RAMP) - 1)
    colors = np.ones((len(numbers), 4), np.float32)
    for channel in range(3):
        mixed = np.interp(shares, np.arange(len(RAMP)), RAMP[:, channel])
        colors[:, channel] = np.where(is_known, mixed, NOTHING[channel])
    return colors


def check_colors(objects: Iterable[Any], attribute: str) -> None:
    """Raise ValueError for an object whose mesh cannot have the colours of an attribute."""
    for obj in objects:
        if attribute + SUFFIX in obj.vertex_groups:
            raise ValueError(f"{obj.name!r} has a vertex group {attribute + SUFFIX!r}: rename it")


def color_meshes(meshes: Sequence[Any], attribute: str, label: str, unit: str) -> Meaning:
    """Show an attribute of meshes as their colours, on one ramp for all, from 0 if no value is below; return it.

    meshes: `bpy.types.Mesh`es that have the attribute. Colours are another attribute, which becomes the active one.
    """
    columns = {mesh: read_values(mesh, attribute) for mesh in meshes}
    known = np.concatenate([values[np.isfinite(values)] for values in columns.values()] or [np.zeros(0)])
    least, most = min(float(known.min(initial=0.0)), 0.0), float(known.max(initial=0.0))
    meaning = Meaning(attribute, label, unit, least, most)
    for mesh, values in columns.items():
        domain = mesh.attributes[attribute].domain
        if domain == "FACE":
            values = np.repeat(values, _corner_counts(mesh))
        name, kind = attribute + SUFFIX, TYPES.get(domain, domain)
        colors = mesh.attributes.get(name)
        if colors is not None and (colors.domain, colors.data_type) != (kind, "BYTE_COLOR"):
            mesh.attributes.remove(colors)
            colors = None
        if colors is None:
            colors = mesh.color_attributes.new(name, "BYTE_COLOR", kind)
        colors.data.foreach_set("color_srgb", ramp_colors(values, least, most).ravel())
        mesh.color_attributes.active_color = mesh.color_attributes[name]
        mesh[MEANING] = json.dumps(_meanings(mesh) | {name: asdict(meaning)})
        mesh.update()
    return meaning


def meaning_of(mesh: Any) -> Meaning | None:
    """Return what the active colours of a mesh mean; None if they are not those of a bake, or its values are gone."""
    active = mesh.color_attributes.active_color
    known = None if active is None else _meanings(mesh).get(active.name)
    values = mesh.attributes.get(known["attribute"]) if known else None
    is_shown = values is not None and values.data_type == "FLOAT" and values.domain in ("FACE", "POINT", "CORNER")
    return Meaning(**known) if known and is_shown else None


def read_values(mesh: Any, attribute: str) -> npt.NDArray[np.float32]:
    """Read an attribute of numbers."""
    data = mesh.attributes[attribute].data
    values = np.empty(len(data), np.float32)
    data.foreach_get("value", values)
    return values


def value_at(mesh: Any, attribute: str, face: int) -> float:
    """Return the value of a face: of vertices and corners the mean."""
    found = mesh.attributes[attribute]
    polygon = mesh.polygons[face]
    rows = {"FACE": [face], "POINT": polygon.vertices, "CORNER": polygon.loop_indices}[found.domain]
    return float(np.mean([found.data[row].value for row in rows]))


def _meanings(mesh: Any) -> dict[str, Any]:
    """By names of colours; empty where another program has written something else."""
    try:
        found = json.loads(mesh.get(MEANING, "{}"))
    except (TypeError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _corner_counts(mesh: Any) -> npt.NDArray[np.int32]:
    counts = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", counts)
    return counts
