"""What the scene's settings make of hair: flat or round, bent or straight, as Cycles (5.0) shows it.

Cycles' own settings decide, or where the Cycles add-on is off those of EEVEE. Hair whose first curve is a poly is round
and straight, whatever the scene asks for. Ribbons have one piece more from one point to the next than two to the power
of `subdivisions`, which is of ribbons alone: what is round Cycles bends, and this engine divides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...sync.records import CurveKind, CurveShape, MeshRecord

_ROUND_PIECES = 8  # a fixed number, so that a tree can follow curves that bend
_RIBBON_PIECES = 5  # of Cycles' default


@dataclass(frozen=True, slots=True)
class HairShape:
    """Of hair that is no poly. Read from a scene; straight: from point to point."""

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
            return cls("ribbon", 2**cycles.subdivisions + 1, False)
        return cls("round", _ROUND_PIECES, cycles.shape == "THICK_LINEAR")


def shaped(meshes: tuple[MeshRecord, ...], scene: Any) -> tuple[MeshRecord, ...]:
    """The same, with what hair is. scene: the original one, as scripts that set Cycles' properties evaluate nothing."""
    if all(mesh.kind != "curves" for mesh in meshes):
        return meshes
    hair = HairShape.of(scene)
    kind: CurveKind = "poly" if hair.straight else "catmull_rom"
    return tuple(
        replace(mesh, curve_kind=kind, curve_shape=hair.shape, curve_pieces=hair.pieces)
        if mesh.kind == "curves" and mesh.curve_kind != "poly"
        else mesh
        for mesh in meshes
    )
