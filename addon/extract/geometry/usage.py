"""A first guess at how a mesh will behave, from what its object carries; sync corrects it by what it sees."""

from __future__ import annotations

from typing import Any

from ...sync.plan import MeshUsage

_DEFORMING_MODIFIERS = frozenset(
    {
        "ARMATURE",
        "CLOTH",
        "HOOK",
        "LATTICE",
        "MESH_CACHE",
        "MESH_DEFORM",
        "OCEAN",
        "SOFT_BODY",
        "SURFACE_DEFORM",
        "WAVE",
    }
)
_CHANGING_MODIFIERS = frozenset({"BUILD", "EXPLODE", "FLUID", "MESH_SEQUENCE_CACHE"})
# What makes other triangles of other vertices, even where no setting of its own is animated.
_RETOPOLOGISING_MODIFIERS = frozenset({"BOOLEAN", "DECIMATE", "REMESH", "WELD"})
# Objects that are mostly grown by nodes, and what makes these move them. Nodes of meshes mostly move instances.
_GROWN_TYPES = frozenset({"CURVES", "POINTCLOUD"})
_TIMED_NODES = frozenset({"GeometryNodeInputSceneTime", "GeometryNodeSimulationOutput"})
# What can make other triangles, the likeliest first.
_REMAKING_MODIFIERS = (
    _CHANGING_MODIFIERS,
    _RETOPOLOGISING_MODIFIERS,
    frozenset({"NODES"}),
    frozenset(
        {
            *("ARRAY", "BEVEL", "EDGE_SPLIT", "MASK", "MIRROR", "MULTIRES", "PARTICLE_INSTANCE", "SCREW", "SKIN"),
            *("SOLIDIFY", "SUBSURF", "TRIANGULATE", "WIREFRAME"),
        }
    ),
)


def guess_usage(original: Any, timed: dict[int, bool] | None = None) -> MeshUsage:
    """What the meshes of an original object are likely to do from frame to frame, and why.

    timed: what is known of node trees by their uids, for one reading; it is filled.
    """
    guess = _guess_from_shape(original, {} if timed is None else timed) or _guess_from_motion(original)
    return guess or MeshUsage("static", "nothing animates it")


def find_remaker(original: Any) -> str:
    """The name of the modifier that is likely to blame where an original object's triangles change; "" for none."""
    modifiers = [(modifier.type, modifier.name) for modifier in original.modifiers]
    found = (name for kinds in _REMAKING_MODIFIERS for kind, name in modifiers if kind in kinds)
    return next(found, "")


def _guess_from_shape(original: Any, timed: dict[int, bool]) -> MeshUsage | None:
    modifiers = [(modifier.type, modifier.name) for modifier in original.modifiers]
    for kind, name in modifiers:
        if kind in _CHANGING_MODIFIERS:
            return MeshUsage("changing", f"its modifier {name!r} makes other triangles")
    if original.type == "META":
        return MeshUsage("changing", "metaballs are polygonized again wherever one of them moves")
    deforms = _why_deforming(original, modifiers, timed)
    if deforms is None:
        return None
    for kind, name in modifiers:
        if kind in _RETOPOLOGISING_MODIFIERS:
            return MeshUsage("changing", f"{deforms}, and its modifier {name!r} makes other triangles of that")
    return MeshUsage("deforming", deforms)


def _why_deforming(original: Any, modifiers: list[tuple[str, str]], timed: dict[int, bool]) -> str | None:
    for kind, name in modifiers:
        if kind in _DEFORMING_MODIFIERS:
            return f"its modifier {name!r} moves vertices"
    data = original.data
    shape_keys = getattr(data, "shape_keys", None)
    if shape_keys is not None and len(shape_keys.key_blocks) > 1:
        return "it has shape keys"
    if _is_animated(data):
        return "its data are animated"
    if any(kind == "NODES" for kind, _ in modifiers) and any(
        _is_animated(modifier.node_group) for modifier in original.modifiers if modifier.type == "NODES"
    ):
        return "its geometry nodes are animated"
    if original.type in _GROWN_TYPES and any(
        modifier.type == "NODES" and _goes_by_time(modifier.node_group, timed) for modifier in original.modifiers
    ):
        return "its geometry nodes go by the scene's time"
    return None


def _goes_by_time(tree: Any, timed: dict[int, bool]) -> bool:
    """Whether geometry nodes, or groups within them, read what the time is."""
    if tree is None:
        return False
    uid = tree.session_uid
    if uid not in timed:
        kinds = [(node.bl_idname, getattr(node, "node_tree", None)) for node in tree.nodes]
        timed[uid] = any(kind in _TIMED_NODES or _goes_by_time(within, timed) for kind, within in kinds)
    return timed[uid]


def _guess_from_motion(original: Any) -> MeshUsage | None:
    obj = original
    while obj is not None:
        whose = "it" if obj is original else f"its parent {obj.name!r}"
        if _is_animated(obj):
            return MeshUsage("rigid", f"{whose} is animated")
        if len(obj.constraints):
            return MeshUsage("rigid", f"{whose} has constraints")
        if obj.rigid_body is not None:
            return MeshUsage("rigid", f"{whose} is a rigid body")
        obj = obj.parent
    return None


def _is_animated(block: Any) -> bool:
    """Whether a data-block has an action, NLA tracks or drivers."""
    animation = getattr(block, "animation_data", None)
    if animation is None:
        return False
    return animation.action is not None or bool(len(animation.nla_tracks)) or bool(len(animation.drivers))
