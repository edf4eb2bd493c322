"""The shape of hair by the scene's settings: flat or round, bent or straight, as Cycles (5.0) shows it.

Cycles' own settings decide, or those of EEVEE if the Cycles add-on is off. Hair whose first curve is a poly is round
and straight, for any settings of the scene. Ribbons have between two points one segment more than two to the power
of `subdivisions`, which applies only to ribbons: Cycles bends round hair, and this engine divides it. More than
`MOST_SUBDIVISIONS` are not used for that, as each segment is held in memory.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...sync.records import CurveKind, CurveShape, MeshRecord

MOST_SUBDIVISIONS = 6
_ROUND_PIECES = 8  # a fixed number, so that a tree can follow curves that bend
_RIBBON_PIECES = 5  # of Cycles' default


@dataclass(frozen=True, slots=True)
class HairShape:
    """The shape of hair that is no poly. Read from a scene; straight: from point to point."""

    shape: CurveShape
    pieces: int
    straight: bool

    @classmethod
    def of(cls, scene: Any) -> HairShape:
        cycles = getattr(scene, "cycles_curves", None)
        if cycles is None:
            is_round = scene.render.hair_type == "CYLINDER"
            return cls("round", _ROUND_PIECES, False) if is_round else cls("ribbon", _RIBBON_PIECES, False)
        if cycles.shape == "RIBBONS":
            return cls("ribbon", 2 ** min(cycles.subdivisions, MOST_SUBDIVISIONS) + 1, False)
        return cls("round", _ROUND_PIECES, cycles.shape == "THICK_LINEAR")


@dataclass(slots=True)
class ShapedHair:
    """The shapes of the last reading's hair: the same mesh record becomes the same shaped record again."""

    _hair: HairShape | None = None
    _read: tuple[MeshRecord, ...] = ()
    _made: tuple[MeshRecord, ...] = ()

    def shaped(self, meshes: tuple[MeshRecord, ...], scene: Any) -> tuple[MeshRecord, ...]:
        """The same, with what hair is. scene: the original one, as Cycles' properties evaluate nothing."""
        if all(mesh.kind != "curves" for mesh in meshes):
            self._hair, self._read, self._made = None, (), ()
            return meshes
        hair = HairShape.of(scene)
        known = {}
        if hair == self._hair:
            known = {id(read): made for read, made in zip(self._read, self._made, strict=True)}
        made = tuple([known.get(id(mesh)) or _shaped(mesh, hair) for mesh in meshes])
        self._hair, self._read, self._made = hair, meshes, made
        return made


def _shaped(mesh: MeshRecord, hair: HairShape) -> MeshRecord:
    if mesh.kind != "curves" or mesh.curve_kind == "poly":
        return mesh
    kind: CurveKind = "poly" if hair.straight else "catmull_rom"
    return replace(mesh, curve_kind=kind, curve_shape=hair.shape, curve_pieces=hair.pieces)
