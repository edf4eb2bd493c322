"""A first guess at how a mesh will behave, from what its object carries; sync corrects it by what it sees."""

from __future__ import annotations

from typing import Any

from ..sync.records import Usage

_DEFORMING_MODIFIERS = frozenset(
    {
        "ARMATURE",
        "CLOTH",
        "HOOK",
        "LATTICE",
        "MESH_CACHE",
        "MESH_DEFORM",
        "SOFT_BODY",
        "SURFACE_DEFORM",
        "WAVE",
    }
)
_CHANGING_MODIFIERS = frozenset({"BUILD", "EXPLODE", "FLUID", "MESH_SEQUENCE_CACHE"})


def guess_usage(original: Any) -> Usage:
    """What the meshes of an original object are likely to do from frame to frame."""
    kinds = {modifier.type for modifier in original.modifiers}
    if kinds & _CHANGING_MODIFIERS or original.type == "META":
        return "changing"
    shape_keys = getattr(original.data, "shape_keys", None)
    has_shapes = shape_keys is not None and len(shape_keys.key_blocks) > 1
    return "deforming" if has_shapes or kinds & _DEFORMING_MODIFIERS else "static"
