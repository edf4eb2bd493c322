"""Old particle hair as curves: strands of the particle systems that show paths, all those of one object in one mesh.

As in Cycles: radii by the settings' shape over the length of each strand, the slot of a material a system, UV maps and
vertex colours of the emitter at the root.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import LARGEST_COORDINATE, Float32Array, LayerRequest, MeshRecord
from ..pointer_views import CORNER_UVS, ArrayReader
from ..strand_cache import Strands, read_strands, shown_strands, step_count
from .curves_and_points import NO_POLYGONS, NO_TRIANGLES, held, held_layers, none_of
from .particle_roots import Roots, find_roots, is_askable, sees_final_mesh

_OF_RADII = ("radius_scale", "root_radius", "tip_radius", "shape", "use_close_tip")
_BLOCK = 2048  # strands that fit into a processor's cache
_EDITED = frozenset({"EDIT", "PARTICLE_EDIT"})  # modes in which Cycles shows no strands either


@dataclass(frozen=True, slots=True)
class ParticleHair:
    """An evaluated object's particle systems that show strands, with their modifiers; in addition to its mesh."""

    obj: Any
    systems: tuple[tuple[Any, Any], ...]
    for_render: bool

    @property
    def name(self) -> str:
        """The object's."""
        return str(self.obj.original.name)

    @property
    def is_edited(self) -> bool:
        """Whether it is being combed or its mesh edited."""
        return self.obj.original.mode in _EDITED

    def place(self) -> tuple[float, ...]:
        """Addresses, sizes and settings, of which not all are noticed by Blender's evaluation."""
        found: list[float] = []
        for _, system in self.systems:
            particles = system.particles
            found += [system.as_pointer(), particles[0].as_pointer() if len(particles) else 0, len(particles)]
            found += [len(system.child_particles), *(getattr(system.settings, name) for name in _OF_RADII)]
            found.append(system.settings.material)
            found += [*shown_strands(system, self.for_render), step_count(system, self.for_render)]
        return tuple(found)

    def as_pointer(self) -> int:
        """An address that no other data have."""
        return int(self.systems[0][1].as_pointer())


def particle_hair_of(obj: Any, for_render: bool) -> ParticleHair | None:
    """Return the strands of an evaluated object, None for none. for_render: whether the depsgraph is a render's."""
    if not len(obj.particle_systems):
        return None
    switch = "show_render" if for_render else "show_viewport"
    modifiers = [one for one in obj.modifiers if one.type == "PARTICLE_SYSTEM" and getattr(one, switch)]
    pairs = [(modifier, modifier.particle_system) for modifier in modifiers]
    systems = tuple([pair for pair in pairs if _is_strands(pair[1])])
    return ParticleHair(obj, systems, for_render) if systems else None


def has_strands(obj: Any) -> bool:
    """Whether an evaluated object has particle systems that may show strands."""
    systems = obj.particle_systems
    return len(systems) > 0 and any(_is_strands(system) for system in systems)


def _is_strands(system: Any) -> bool:
    """Whether a modifier's system shows strands; a modifier may have no system, and a system no settings."""
    settings = None if system is None else system.settings
    return settings is not None and bool(settings.type == "HAIR" and settings.render_type == "PATH")


@dataclass(frozen=True, slots=True)
class _Part:
    """The strands of one system, with their radii, (S, K), and lengths, (S,)."""

    system: Any
    modifier: Any
    strands: Strands
    radii: Float32Array
    lengths: Float32Array


def read_particle_hair(
    hair: ParticleHair,
    key: Hashable,
    name: str,
    layers: LayerRequest,
    reader: ArrayReader,
    last: MeshRecord | None = None,
    others: Callable[[], Iterable[Any]] = tuple,
) -> MeshRecord | None:
    """Reads strands as curves; None if there are none. Everything is copied.

    If all strands were dropped, an empty record holds their number.

    layers: the UV maps and colours that its materials show. last: the last reading, whose arrays replace
    equal ones. others: see `read_strands`. Strands with a number that is not finite are dropped, and those without a
    length are invisible.
    """
    parts = [_read_part(modifier, system, hair, reader, others) for modifier, system in hair.systems]
    parts = [part for part in parts if len(part.strands.points)]
    if not parts:
        return None
    are_good = [_are_good(part) for part in parts]
    kept = _Kept.of([good & (part.lengths > 0.0) for good, part in zip(are_good, parts, strict=True)])
    dropped = sum(int((~good).sum()) for good in are_good)
    if not len(kept.ids):
        return none_of("curves", key, name, dropped)
    uvs, tints = (
        {layer: kept.joined([array[:, None] for array in arrays]) for layer, arrays in found.items()}
        for found in _read_layers(hair, parts, layers, reader)
    )
    uvs, tints = held_layers(uvs, "uvs", last), held_layers(tints, "colors", last)
    counts = kept.joined([np.full(len(part.radii), part.radii.shape[1]) for part in parts])
    slots = [np.full(len(part.radii), part.system.settings.material - 1, np.int32) for part in parts]
    return MeshRecord(
        key=key,
        name=name,
        positions=held(kept.joined([part.strands.points for part in parts]), last and last.positions),
        triangles=NO_TRIANGLES,
        polygon_ids=NO_POLYGONS,
        material_slots=held(kept.joined(slots), last and last.material_slots),
        corner_uvs=uvs.pop("", None),
        corner_colors=tints.pop("", None),
        named_uvs=uvs,
        named_colors=tints,
        layers=layers,
        dropped_triangles=dropped,
        triangle_ids=None if kept.are_all else held(kept.ids, last and last.triangle_ids),
        kind="curves",
        radii=held(kept.joined([part.radii for part in parts]), last and last.radii),
        curve_offsets=held(np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), last and last.curve_offsets),
        curve_kind="catmull_rom",
        rounding=max(part.strands.rounding for part in parts),
    )


@dataclass(frozen=True, slots=True)
class _Kept:
    """Which strands of each part are shown. ids: their numbers among those of all parts, (N,) int32."""

    rows: list[npt.NDArray[np.intp]]
    ids: npt.NDArray[np.int32]
    are_all: bool

    @classmethod
    def of(cls, flags: list[npt.NDArray[np.bool_]]) -> _Kept:
        """flags: (S,) of each part."""
        together = np.concatenate(flags)
        ids = np.flatnonzero(together).astype(np.int32)
        return cls([np.flatnonzero(some) for some in flags], ids, bool(together.all()))

    def joined(self, arrays: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Joins the arrays of the parts, (S, ...) or (S, K, ...), for shown strands: point by point if K."""
        if not self.are_all:
            arrays = [array[some] for array, some in zip(arrays, self.rows, strict=True)]
        flat = [array.reshape(-1, *array.shape[2:]) if array.ndim > 1 else array for array in arrays]
        return flat[0] if len(flat) == 1 else np.concatenate(flat)


def _read_part(
    modifier: Any, system: Any, hair: ParticleHair, reader: ArrayReader, others: Callable[[], Iterable[Any]]
) -> _Part:
    strands = read_strands(system, hair.obj, reader, hair.for_render, others)
    along, lengths = _along(strands.points)
    return _Part(system, modifier, strands, _radii(along, system.settings), lengths)


def _radii(along: Float32Array, settings: Any) -> Float32Array:
    """(S, K) float32: from the root's to the tip's, over the length of each strand."""
    scale = np.float32(settings.radius_scale) * np.float32(0.5)
    root, tip = scale * np.float32(settings.root_radius), scale * np.float32(settings.tip_radius)
    if root == tip:
        radii = np.full(along.shape, root, np.float32)
    else:
        rest = 1.0 - along
        shape = float(settings.shape)
        if shape < 0.0:
            rest **= np.float32(1.0 + shape)
        elif shape > 0.0:
            rest **= np.float32(1.0 / (1.0 - shape)) if shape < 1.0 else np.float32(np.inf)
        radii = rest * (root - tip) + tip
    if settings.use_close_tip and radii.shape[1]:
        radii[:, -1] = 0.0
    return radii


def _along(points: Float32Array) -> tuple[Float32Array, Float32Array]:
    """(S, K) float32, 0 to 1: how far along its strand each point lies; and (S,), how long strands are."""
    along = np.zeros(points.shape[:2], np.float32)
    with np.errstate(invalid="ignore", over="ignore"):  # those with a number that is not finite are dropped
        for begin in range(0, len(points), _BLOCK):
            steps = np.diff(points[begin : begin + _BLOCK], axis=1)
            np.cumsum(np.sqrt(np.einsum("skx,skx->sk", steps, steps)), axis=1, out=along[begin : begin + _BLOCK, 1:])
        lengths = along[:, -1].copy()
        np.divide(along, lengths[:, None], out=along, where=(lengths > 0.0)[:, None])
    return np.clip(along, 0.0, 1.0, out=along), lengths


def _are_good(part: _Part) -> npt.NDArray[np.bool_]:
    """(S,) bool: all of its numbers are of use."""
    arrays = (part.strands.points, part.radii)
    if all(array.min() >= -LARGEST_COORDINATE and array.max() <= LARGEST_COORDINATE for array in arrays):
        return np.ones(len(part.radii), np.bool_)
    points, radii = arrays
    good = np.abs(points).max(axis=(1, 2)) <= LARGEST_COORDINATE
    return np.asarray(good & (np.abs(radii).max(axis=1) <= LARGEST_COORDINATE))


_Layers = dict[str, list[Float32Array]]


def _read_layers(
    hair: ParticleHair, parts: list[_Part], layers: LayerRequest, reader: ArrayReader
) -> tuple[_Layers, _Layers]:
    """The emitter's layers at the roots, by name: (S, 2) and (S, 3) of each part."""
    mesh = hair.obj.data
    maps = mesh.uv_layers
    uvs: _Layers = {}
    colors: _Layers = {}
    if not (layers.uvs or layers.colors):
        return uvs, colors
    names = {layer.name: number for number, layer in enumerate(maps)}
    active = next((number for number, layer in enumerate(maps) if layer.active_render), None)
    numbers = {name: names.get(name) if name else active for name in layers.uvs | layers.colors}
    asked = frozenset([number for number in numbers.values() if number is not None])
    roots = [_roots_of(part, hair, reader, asked) for part in parts]

    def at_roots(accessor: str, number: int) -> list[Float32Array] | None:
        layers = "uv_layers" if accessor == "uv_on_emitter" else "vertex_colors"
        if not all(is_askable(hair.obj, one.modifier, hair.for_render, layers, number) for one in roots):
            return None
        read = _uvs_at if accessor == "uv_on_emitter" else _colors_at
        found = [read(one, mesh, number, reader) for one in roots]
        known = [one for one in found if one is not None]
        return known if len(known) == len(found) else None

    for name in layers.uvs:
        number = numbers[name]
        found = None if number is None else at_roots("uv_on_emitter", number)
        if found is not None:
            uvs[name] = found
    byte_colors = {layer.name: number for number, layer in enumerate(mesh.vertex_colors)}
    for name in layers.colors:
        if name in names:  # a place has no third channel
            found = at_roots("uv_on_emitter", names[name])
            found = found and [np.pad(one, ((0, 0), (0, 1))) for one in found]
        else:
            found = at_roots("mcol_on_emitter", byte_colors[name]) if name in byte_colors else None
        if found is not None:
            colors[name] = found
    return uvs, colors


def _roots_of(part: _Part, hair: ParticleHair, reader: ArrayReader, maps: frozenset[int]) -> Roots:
    first, count = part.strands.first, len(part.strands.points)
    is_final = sees_final_mesh(hair.obj, part.modifier, hair.for_render)
    return find_roots(part.system, part.modifier, hair.obj.data, first, count, reader, maps, is_final)


def _uvs_at(roots: Roots, mesh: Any, number: int, reader: ArrayReader) -> Float32Array | None:
    if roots.faces is None:
        found = roots.ask("uv_on_emitter", number)
    else:
        found = roots.gather(reader.view(mesh.uv_layers[number].uv, CORNER_UVS))
    return None if found is None else np.nan_to_num(found, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)


def _colors_at(roots: Roots, mesh: Any, number: int, _: ArrayReader) -> Float32Array | None:
    """Scene-linear; mixed as Blender does, whose old colours are bytes."""
    if roots.faces is None:
        encoded = roots.ask("mcol_on_emitter", number)
        if encoded is None:
            return None
    else:
        attribute = mesh.attributes[mesh.vertex_colors[number].name]
        values = np.empty((len(attribute.data), 4), np.float32)
        attribute.data.foreach_get("color_srgb", values.reshape(-1))
        encoded = np.floor(roots.gather(np.rint(values[:, :3] * 255.0)) + 1e-3) / np.float32(255.0)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)
