"""Which UV maps and colours of an emitting mesh its particles can be asked for.

Blender tells them of the mesh as it was at the particles' modifier, and takes their number for granted: one that is
added only later is none of it, and asking for it is an access to memory that is not there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

# What leaves faces, UV maps and colours as they are.
_DEFORMING = frozenset(
    {
        *("ARMATURE", "CAST", "CLOTH", "COLLISION", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK"),
        *("LAPLACIANDEFORM", "LAPLACIANSMOOTH", "LATTICE", "MESH_DEFORM", "PARTICLE_SYSTEM", "SHRINKWRAP"),
        *("SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY", "SURFACE", "SURFACE_DEFORM", "WARP", "WAVE"),
    }
)
# What makes other faces, or other values, of the same UV maps and colours in the same order.
_KEEPING_LAYERS = _DEFORMING | {
    *("ARRAY", "BEVEL", "EDGE_SPLIT", "MASK", "MIRROR", "MULTIRES", "SOLIDIFY", "SUBSURF", "TRIANGULATE"),
    *("UV_PROJECT", "UV_WARP"),
}


def sees_final_mesh(obj: Any, modifier: Any, for_render: bool) -> bool:
    """Whether an evaluated object's mesh has the faces and layers that it had at the particles' modifier."""
    return all(kind in _DEFORMING for kind, is_later in _enabled(obj, modifier, for_render) if is_later)


def is_askable(obj: Any, modifier: Any, for_render: bool, layers: str, number: int) -> bool:
    """Whether a layer of the final mesh is sure to have been there at the particles' modifier, as the same number.

    layers: "uv_layers" or "vertex_colors".
    """
    if sees_final_mesh(obj, modifier, for_render):
        return True
    if any(kind not in _KEEPING_LAYERS for kind, is_later in _enabled(obj, modifier, for_render) if not is_later):
        return False
    final, original = getattr(obj.data, layers), getattr(obj.original.data, layers)
    return number < len(original) and bool(original[number].name == final[number].name)


def _enabled(obj: Any, modifier: Any, for_render: bool) -> Iterator[tuple[str, bool]]:
    """The kinds of the other modifiers, and whether they follow."""
    switch = "show_render" if for_render else "show_viewport"
    is_later = False
    for other in obj.modifiers:
        if other == modifier:
            is_later = True
        elif getattr(other, switch):
            yield other.type, is_later
