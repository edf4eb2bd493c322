"""The instances of each object of an evaluated scene, read from its geometry (Blender 4.5 and later).

The geometry does not contain everything that Blender's list of instances has (nested instances, collections,
particles, other instancers, hidden originals). Objects with those are read from the list: see `listing.py`. So are
instancers that hide themselves, which the list alone names: as entries of their instances.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

import bpy
import numpy as np

from ...sync.plan import MeshUsage
from ...sync.records import Float32Array

# Objects that are no surface and show nothing.
SILENT_TYPES = frozenset({"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT", "LIGHT_PROBE", "SPEAKER"})
# Objects whose surface Blender lists as a separate instance.
_SURFACE_TYPES = frozenset({"CURVE", "FONT", "META", "SURFACE"})
_INSTANCER_SWITCHES = ("show_instancer_for_viewport", "show_instancer_for_render")
_COMPONENTS = ("curves", "pointcloud", "volume", "grease_pencil")
_HIDING_INSTANCERS = frozenset({"VERTS", "FACES"})  # they hide their children
_IS_SUPPORTED = hasattr(bpy.types.Object, "evaluated_geometry")


class _Listed(Enum):
    LISTED = "only Blender's list can tell"


LISTED: Final = _Listed.LISTED


@dataclass(slots=True)
class Shown:
    """The target of one instance reference: an object, or the mesh of a geometry.

    zeros: the number of zeros before the id in Blender's numbering of instances, one for each geometry between.
    matrices: (4, 4) float32, of the geometries between, from the outermost; empty if they change nothing.
    owner: keeps the geometry, which is identified by its address.
    """

    obj: Any
    mesh: Any
    zeros: int
    matrices: list[Float32Array]
    owner: Any


@dataclass(slots=True)
class Instancer:
    """The instances of an evaluated object; None for empty references. The geometry owns the points.

    points: None for a surface, which is shown once, at the object.
    """

    geometry: Any
    points: Any
    references: list[Shown | None]


class _UnsupportedError(Exception):
    """Blender's list is needed for this object after all."""


@dataclass(frozen=True, slots=True)
class Survey:
    """Each evaluated object with its instances, in the depsgraph's order.

    hidden: instancers that are not among them because they hide themselves, by the number of objects before them.
    """

    objects: list[tuple[Any, Instancer | _Listed | None]]
    hidden: dict[int, list[Any]]


def survey(depsgraph: Any) -> Survey | None:
    """Returns the instances of all evaluated objects; None if Blender's list is needed, or equally good."""
    if not _IS_SUPPORTED or not _may_have_node_instances():
        return None
    objects = list(depsgraph.objects)
    hidden = _find_hidden(depsgraph, objects)
    if hidden is None:
        return None
    surveyed = Survey([(obj, _survey_any(obj)) for obj in objects], hidden)
    is_worth_it = any(isinstance(found, Instancer) and found.points is not None for _, found in surveyed.objects)
    return surveyed if is_worth_it and not _are_shown_twice(surveyed) else None


def _find_hidden(depsgraph: Any, objects: list[Any]) -> dict[int, list[Any]] | None:
    """Returns `Survey.hidden`, some of which may show nothing; None if the depsgraph orders objects in another way."""
    everything = bpy.data.objects
    is_shown = np.empty((len(_INSTANCER_SWITCHES), len(everything)), np.bool_)
    for switch, column in zip(_INSTANCER_SWITCHES, is_shown, strict=True):
        everything.foreach_get(switch, column)
    if is_shown.all():
        return {}
    switched_off = {
        obj.session_uid for obj, is_on in zip(everything, is_shown.all(axis=0).tolist(), strict=True) if not is_on
    }
    uids = [obj.original.session_uid for obj in objects]
    hidden: dict[int, list[Any]] = {}
    row = 0
    for block in depsgraph.ids:
        if not isinstance(block, bpy.types.Object):
            continue
        uid = block.original.session_uid
        if row < len(uids) and uid == uids[row]:
            row += 1
        elif uid in switched_off:
            hidden.setdefault(row, []).append(block)
    return hidden if row == len(uids) else None


def _are_shown_twice(surveyed: Survey) -> bool:
    """Whether the list shows meshes that geometries give as well: they have one address here, and another one there."""
    told = {obj.original for obj, found in surveyed.objects if isinstance(found, Instancer)}
    waiting = [obj.original for obj, found in surveyed.objects if found is LISTED]
    waiting += [obj.original for hidden in surveyed.hidden.values() for obj in hidden]
    seen = set(waiting)
    while waiting:
        others = set(_may_show(waiting.pop())) - seen
        if not told.isdisjoint(others):
            return True
        seen |= others
        waiting += others
    return False


def _may_show(obj: Any) -> Iterator[Any]:
    """The objects that an object of Blender's data may show as instances."""
    settings = [system.settings for system in obj.particle_systems] if obj.type == "MESH" else []
    collections = [obj.instance_collection, *(one.instance_collection for one in settings)]
    shown = [one.instance_object for one in settings]
    for modifier in obj.modifiers:
        tree = modifier.node_group if modifier.type == "NODES" else None
        for block in () if tree is None else _used_by(tree):
            (shown if isinstance(block, bpy.types.Object) else collections).append(block)
        if tree is not None:  # the inputs of the nodes
            values = _given_to(modifier)
            shown += [value for value in values if isinstance(value, bpy.types.Object)]
            collections += [value for value in values if isinstance(value, bpy.types.Collection)]
    yield from (one for one in (*shown, *obj.children) if one is not None)
    for collection in collections:
        if collection is not None:
            yield from collection.all_objects


def _given_to(modifier: Any) -> list[Any]:
    """The values of a nodes modifier's inputs; before Blender 5.2 they are custom properties."""
    inputs = getattr(getattr(modifier, "properties", None), "inputs", None)
    if inputs is None:
        return [modifier[key] for key in modifier.keys()]  # noqa: SIM118
    sockets = [getattr(inputs, name, None) for name in inputs.bl_rna.properties.keys()]  # noqa: SIM118
    return [getattr(socket, "value", None) for socket in sockets]


def _used_by(tree: Any) -> Iterator[Any]:
    """The objects and collections that a node tree and those within it name."""
    for node in tree.nodes:
        within = getattr(node, "node_tree", None)
        if within is not None:
            yield from _used_by(within)
        for socket in node.inputs:
            value = getattr(socket, "default_value", None)
            if isinstance(value, bpy.types.Object | bpy.types.Collection):
                yield value


def _may_have_node_instances() -> bool:
    """A quick answer for the many scenes that have none."""
    return any(group.bl_idname == "GeometryNodeTree" for group in bpy.data.node_groups)


def _survey_any(obj: Any) -> Instancer | _Listed | None:
    try:
        return _survey(obj)
    except _UnsupportedError:
        return LISTED


def _survey(obj: Any) -> Instancer | None:
    """Returns the instances of an evaluated object, None for none. Raises _UnsupportedError."""
    _check_family(obj)
    if obj.type in _SURFACE_TYPES:
        return _survey_surface(obj)
    if obj.type != "MESH":
        if obj.type not in SILENT_TYPES and len(obj.modifiers):
            raise _UnsupportedError
        return None
    if len(obj.particle_systems):
        raise _UnsupportedError
    if not any(modifier.type == "NODES" for modifier in obj.modifiers):
        return None
    geometry = obj.evaluated_geometry()
    _refuse_components(geometry)
    points = geometry.instances_pointcloud()
    if points is None or not len(points.points):
        return None
    _check_points(obj, points)
    return Instancer(geometry, points, [_resolve(reference) for reference in geometry.instance_references()])


def _check_family(obj: Any) -> None:
    parent = obj.parent
    if obj.is_instancer or (parent is not None and parent.instance_type in _HIDING_INSTANCERS):
        raise _UnsupportedError


def _survey_surface(obj: Any) -> Instancer | None:
    geometry = obj.evaluated_geometry()
    if len(obj.particle_systems) or geometry.instances_pointcloud() is not None:
        raise _UnsupportedError
    mesh = geometry.mesh
    if mesh is None:
        return None
    _refuse_components(geometry)
    return Instancer(geometry, None, [Shown(None, mesh, 0, [], geometry)])


def _check_points(obj: Any, points: Any) -> None:
    ids = points.attributes.get("id")
    if ids is not None and _has_repeated(ids.data):
        raise _UnsupportedError  # Blender gives the others numbers at random
    if any(slot.link == "OBJECT" for slot in obj.original.material_slots):
        raise _UnsupportedError  # how they combine with a mesh's own materials is Blender's secret


def _refuse_components(geometry: Any) -> None:
    """They would be instances as well."""
    if any(getattr(geometry, name) is not None for name in _COMPONENTS):
        raise _UnsupportedError


def _has_repeated(ids: Any) -> bool:
    values = np.empty(len(ids), np.int32)
    ids.foreach_get("value", values)
    return len(np.unique(values)) < len(values)


def _resolve(reference: Any, zeros: int = 0, matrices: tuple[Float32Array, ...] = ()) -> Shown | None:
    """Returns the target of a reference. Raises _UnsupportedError if there is more than one."""
    if not isinstance(reference, bpy.types.GeometrySet):
        _check_object(reference)
        return Shown(reference, reference.data, zeros, list(matrices), None)
    _refuse_components(reference)
    points = reference.instances_pointcloud()
    mesh = reference.mesh
    if points is None:
        return None if mesh is None else Shown(None, mesh, zeros + 1, list(matrices), reference)
    if mesh is not None or len(points.points) != 1 or "id" in points.attributes:
        raise _UnsupportedError
    # Object Info and Collection Info give a geometry that holds one instance.
    matrix = np.array(points.attributes["instance_transform"].data[0].value, np.float32)
    if not np.array_equal(matrix, np.eye(4)):
        matrices = (*matrices, matrix)
    return _resolve(reference.instance_references()[0], zeros + 1, matrices)


def _check_object(reference: Any) -> None:
    if not isinstance(reference, bpy.types.Object) or reference.type != "MESH" or not reference.is_evaluated:
        raise _UnsupportedError
    if _survey(reference) is not None:
        raise _UnsupportedError


# Usage ---------------------------------------------------------------------------------------------------------------
# A first guess of a mesh's changes, from the data of its object; sync corrects it by observed changes.


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
# Modifiers that make other triangles when vertices move, even if none of their settings is animated.
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
    """Guesses the changes of an original object's meshes from frame to frame, and gives the reason.

    timed: known results for node trees by their uids, for one reading; it is filled.
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
        return MeshUsage("changing", "metaballs are polygonized again when any of them moves")
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
        return "its geometry nodes use the scene's time"
    return None


def _goes_by_time(tree: Any, timed: dict[int, bool]) -> bool:
    """Whether geometry nodes, or groups within them, read the current time."""
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
