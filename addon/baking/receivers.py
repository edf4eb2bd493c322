"""The points of objects from which rays start: on faces, in corners, at vertices, under the texels of an image.

A point lies on one triangle of the scene that rays are cast into. It is lifted off the plane of that triangle by a
bound of the rounding of double precision, so a ray that leaves on its side cannot hit the triangle, at any angle, and
everything else is where it is. Nothing of this is to be tuned.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ..sync.records import Float32Array, Float64Array, MeshRecord, SceneRecord
from .settings import NAME, BakeSettings

PLACE_SHARE = 0.05  # of a bake's work

IntArray = npt.NDArray[np.int64]
# Of points on triangles: the triangles' rows, barycentric coordinates, and the elements that they belong to.
Choice = tuple[IntArray, Float64Array, IntArray]

_ROUNDING = 2.0**-47  # 32 units in the last place: the maps to the world and back, and the plane, are off by fewer
_FLAT = 2.0**-40  # times the square of a triangle's extent: its normal would be rounding
_INSIDE = -1e-6  # barycentric: a centre on the diagonal of a quad is on both of its triangles
# Least barycentric coordinate of a point. Rays from an edge, as from the middle of a quad, would need exact arithmetic
# to tell on which side of it they pass; and in a corner it would be open which face they leave.
_INSET = 2.0**-6
_TRIANGLES_AT_ONCE = _TEXELS_AT_ONCE = 1 << 16  # between two of which a bake may be stopped
_MOST_NAMED = 5


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """P points, neighbours after each other, on triangles of one object.

    Attributes:
        positions: (P, 3) float64, world space, just off the triangle.
        normals: (P, 3) float64, unit, world space, to the side that rays leave on.
        elements: (P,) int64: the row of the value that it belongs to.
        ids: (P,) uint64: numbers for random streams, for any order and division of the points.
    """

    positions: Float64Array
    normals: Float64Array
    elements: IntArray
    ids: npt.NDArray[np.uint64]

    def __len__(self) -> int:
        return len(self.positions)

    def blocks(self, most: int) -> list[Points]:
        """Cuts them into blocks of at most `most`."""
        arrays = [getattr(self, each.name) for each in fields(self)]
        cuts = [slice(first, first + most) for first in range(0, len(self), most)]
        return [Points(*(array[rows] for array in arrays)) for rows in cuts]


@dataclass(frozen=True, slots=True, eq=False)
class Receiver:
    """One object, or one instance of it, in a synced scene.

    Attributes:
        name, session_uid: The object's.
        instance: Blender's persistent id of an instance, (8,); empty for the object itself. instancer: Whose it is.
        mesh: What the engine has of it. transform: (3, 4) float64, object to world.
        corners: (T, 3) int64, the face corner at each triangle's corners.
        uvs: (T, 3, 2) float32, or None if no image is asked for.
        count: How many values it gets. areas: (F,) float64, of the faces in the world.
    """

    name: str
    session_uid: int
    instance: tuple[int, ...]
    instancer: str
    mesh: MeshRecord
    transform: Float64Array
    corners: IntArray
    uvs: Float32Array | None
    count: int
    areas: Float64Array

    @property
    def who(self) -> tuple[Any, ...]:
        """The object and the instance, for comparisons."""
        return self.session_uid, self.instance, self.instancer


# Finding them --------------------------------------------------------------------------------------------------------


def find_receivers(
    record: SceneRecord, depsgraph: Any, objects: Iterable[Any], settings: BakeSettings, skip_missing: bool
) -> list[Receiver]:
    """Finds the chosen objects in the record of an evaluated depsgraph, and how their values belong to their meshes.

    Args:
        objects: Original `bpy.types.Object`s.
        skip_missing: Whether objects that the scene lacks are left out.

    Raises:
        ValueError: For an object that is no mesh, has no faces, is not in the scene, is flattened, or whose modifiers
            make other faces than its own mesh has: by its name.
    """
    uids = np.array([obj.session_uid for obj in record.objects], np.int64)[record.instances.object_indices]
    # Meshes that geometry nodes show as instances are the object's as well, but values have no place on them.
    is_own = [mesh.kind == "triangles" and mesh.key[0] != "made" for mesh in record.meshes]  # type: ignore[index]
    is_mesh = np.array(is_own, bool)[record.instances.mesh_indices]
    is_plain = record.instances.parent_indices < 0
    found = []
    for obj in objects:
        if obj.type != "MESH":
            what = f"is of type {obj.type}, not a mesh"
            raise _refusal(obj, f"{what}: leave it out, or convert it (Object > Convert > Mesh)")
        if obj.data.is_editmode:
            raise _refusal(obj, "is in Edit Mode: leave it first")
        if not len(obj.data.polygons) and not settings.evaluated:
            raise _refusal(obj, "has no faces: leave it out")
        rows = np.flatnonzero((uids == obj.session_uid) & is_mesh)
        shown = rows if settings.instances else rows[is_plain[rows]][:1]
        if not len(shown) and not skip_missing:
            only = " (instances show it: ask for them)" if len(rows) else ""
            why = f"it is hidden, in another view layer, empty, or not finite{only}"
            raise _refusal(obj, f"is not in the evaluated scene: {why}")
        for row in shown.tolist():
            instance = () if is_plain[row] else tuple(record.instances.persistent_ids[row].tolist())
            instancer = "" if is_plain[row] else record.objects[record.instances.parent_indices[row]].name
            mesh = record.meshes[record.instances.mesh_indices[row]]
            transform = record.instances.transforms[row].astype(np.float64)
            who = instance, instancer
            found.append(_receiver(obj, obj.evaluated_get(depsgraph).data, who, mesh, transform, settings))
    return found


def _refusal(obj: Any, why: str) -> ValueError:
    return ValueError(f"{NAME}: object {obj.name!r} {why}")


def _check_modifiers(obj: Any, mesh: Any) -> None:
    """Compares the faces of the evaluated mesh with those of the object's own."""
    if all(np.array_equal(own, made) for own, made in zip(_faces(obj.data), _faces(mesh), strict=True)):
        return
    names = ", ".join(repr(modifier.name) for modifier in obj.modifiers) or "its evaluation"
    faces = f"{len(obj.data.polygons):,} faces, but {len(mesh.polygons):,} or others after {names}"
    way_out = "apply or disable the modifier that makes faces, or bake texels, or tables with evaluated=True"
    raise _refusal(obj, f"has {faces}, so values have no place on its mesh: {way_out}")


def _faces(mesh: Any) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], int]:
    starts, vertices = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.loops), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.loops.foreach_get("vertex_index", vertices)
    return starts, vertices, len(mesh.vertices)


def _receiver(
    obj: Any,
    mesh: Any,
    who: tuple[tuple[int, ...], str],
    shown: MeshRecord,
    transform: Float64Array,
    settings: BakeSettings,
) -> Receiver:
    is_image = settings.domain == "TEXEL"
    if not is_image and not settings.evaluated:
        _check_modifiers(obj, mesh)
    if not np.isfinite(np.linalg.cond(transform[:, :3])):
        raise _refusal(obj, "is flattened by a scale of 0: give it another one")
    mesh.calc_loop_triangles()
    corners = np.empty((len(mesh.loop_triangles), 3), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners.reshape(-1))
    corners = corners if shown.triangle_ids is None else corners[shown.triangle_ids]
    uvs = None
    if is_image:
        name = settings.uv_map
        layer = mesh.uv_layers.active if name is None else mesh.uv_layers.get(name)
        if layer is None:
            raise _refusal(obj, f"has no UV map{'' if name is None else f' {name!r}'}: unwrap it, or bake faces")
        all_uvs = np.empty((len(mesh.loops), 2), np.float32)
        layer.uv.foreach_get("vector", all_uvs.reshape(-1))
        uvs = all_uvs[corners]
    counts = {"FACE": len(mesh.polygons), "CORNER": len(mesh.loops), "POINT": len(mesh.vertices)}
    places = shown.positions.astype(np.float64)[shown.triangles] @ transform[:, :3].T
    areas = np.bincount(shown.polygon_ids, _areas(places)[0], len(mesh.polygons))
    count = settings.image_size[0] * settings.image_size[1] if is_image else counts[settings.domain]
    return Receiver(obj.name, obj.session_uid, *who, shown, transform, corners.astype(np.int64), uvs, count, areas)


def name_flat_faces(receiver: Receiver) -> str | None:
    """Names the faces without an area, which have no normal and get no value; None if there is none."""
    flat = np.flatnonzero(~(receiver.areas > 0.0))
    if not len(flat):
        return None
    named = ", ".join(map(str, flat[:_MOST_NAMED].tolist())) + (", ..." if len(flat) > _MOST_NAMED else "")
    return f"{receiver.name}: {len(flat):,} faces without an area have no value: {named}"


# Points --------------------------------------------------------------------------------------------------------------


def place_points(
    receiver: Receiver, settings: BakeSettings, order: IntArray | None = None
) -> Generator[float, None, Points]:
    """Places the points of a receiver; yields from 0 to PLACE_SHARE. For thickness, rays leave on the inner side.

    Args:
        order: (P,) int64: the points in the order of another frame, its `Points.ids`; None for a curve through them.

    Raises:
        ValueError: If there are more or fewer points than at that frame.
    """
    mesh, linear, domain = receiver.mesh, receiver.transform[:, :3], settings.domain
    side = -1.0 if settings.kind == "THICKNESS" else 1.0
    taken = np.zeros(receiver.count if domain == "TEXEL" else 0, np.bool_)

    def choose(rows: slice, triangles: Float64Array) -> Iterable[Choice]:
        areas, is_solid = _areas(triangles @ linear.T)
        if domain == "FACE":
            return (_face_centres(triangles, areas, is_solid, mesh.polygon_ids[rows]),)
        if receiver.uvs is not None:
            return _texels(receiver.uvs[rows], is_solid, settings.image_size, taken)
        return (_corners(areas, is_solid, receiver.corners[rows]),)

    parts = []
    cuts = _cuts(mesh.polygon_ids)
    for first, last in pairwise(cuts):
        rows = slice(first, last)
        triangles = mesh.positions[mesh.triangles[rows]].astype(np.float64)
        for chosen, weights, elements in choose(rows, triangles):
            parts.append((*_lift(triangles[chosen], weights, receiver.transform, side), elements))
            yield 0.8 * PLACE_SHARE * last / max(cuts[-1], 1)
    positions, normals, elements = (np.concatenate(part) for part in zip(*parts, strict=True))
    rows = np.arange(len(positions))
    if domain == "TEXEL":  # in the order of the image
        taken_by = np.full(receiver.count, -1)
        taken_by[elements] = rows
        rows = taken_by[taken_by >= 0]
    if domain == "POINT":
        owners = np.zeros(int(receiver.corners.max(initial=0)) + 1, np.int64)
        owners[receiver.corners] = mesh.triangles
        elements = owners[elements]
    order = (yield from _curve_order(positions, rows)) if order is None else order
    if len(order) != len(positions):
        raise ValueError(f"{NAME}: the faces of object {receiver.name!r} change from frame to frame: bake one frame")
    yield PLACE_SHARE
    rows = rows[order]
    return Points(positions[rows], normals[rows], elements[rows], order.astype(np.uint64))


def _cuts(polygons: npt.NDArray[np.int32]) -> list[int]:
    """Where to cut triangles into portions that share no polygon, with both ends."""
    inner = polygons[_TRIANGLES_AT_ONCE::_TRIANGLES_AT_ONCE]
    return [0, *np.unique(np.searchsorted(polygons, inner)).tolist(), len(polygons)]


def _areas(triangles: Float64Array) -> tuple[Float64Array, npt.NDArray[np.bool_]]:
    """(T,) areas, 0 for triangles whose normal is not known; and which others there are."""
    sides = np.stack([triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]])
    areas = 0.5 * np.linalg.norm(np.cross(sides[0], sides[1]), axis=1)
    is_solid = areas > _FLAT * (sides * sides).sum(axis=(0, 2))
    return np.where(is_solid, areas, 0.0), is_solid


def _best(keys: IntArray, scores: Float64Array) -> IntArray:
    """Rows of the best score of each key, ascending by key; the first of equals."""
    keys = keys - (keys.min() if len(keys) else 0)
    best = np.full(int(keys.max(initial=-1)) + 1, -np.inf)
    np.maximum.at(best, keys, scores)
    rows = np.flatnonzero(scores == best[keys])[::-1]
    first = np.full(len(best), -1)
    first[keys[rows]] = rows
    return first[first >= 0]


def _face_centres(
    triangles: Float64Array, areas: Float64Array, is_solid: npt.NDArray[np.bool_], polygons: npt.NDArray[np.int32]
) -> Choice:
    """The centre of area of each face, if it is on one of its triangles; else the centre of its largest triangle."""
    solid = np.flatnonzero(is_solid)
    corners, faces, areas = triangles[solid], polygons[solid].astype(np.int64), areas[solid]
    numbers = faces - (faces[0] if len(faces) else 0)
    total = np.bincount(numbers, areas)
    middles = corners.mean(axis=1)
    with np.errstate(invalid="ignore"):
        centres = np.stack([np.bincount(numbers, areas * middles[:, axis]) / total for axis in range(3)], axis=1)
    weights = _barycentric(corners, centres[numbers])
    least = weights.min(axis=1, initial=np.inf)
    inside, largest = _best(numbers, least), _best(numbers, areas)
    is_inside = least[inside] >= _INSIDE
    chosen = np.where(is_inside, inside, largest)
    found = np.where(is_inside[:, None], np.maximum(weights[chosen], _INSET), 1.0)
    return solid[chosen], found / found.sum(axis=1, keepdims=True), faces[chosen]


def _barycentric(triangles: Float64Array, points: Float64Array) -> Float64Array:
    """(T, 3): of the points' projections to the planes."""
    first, second, to = (part - triangles[:, 0] for part in (triangles[:, 1], triangles[:, 2], points))
    normal = np.cross(first, second)
    size = (normal * normal).sum(axis=1)
    v = (np.cross(to, second) * normal).sum(axis=1) / size
    w = (np.cross(first, to) * normal).sum(axis=1) / size
    return np.stack([1.0 - v - w, v, w], axis=1)


def _corners(areas: Float64Array, is_solid: npt.NDArray[np.bool_], corners: IntArray) -> Choice:
    """Each face corner, in its largest triangle, a little inside: there a wall next to it shadows as it should."""
    solid = np.flatnonzero(is_solid)
    keys = corners[solid].reshape(-1)
    best = _best(keys, np.repeat(areas[solid], 3))
    weights = np.full((len(best), 3), _INSET)
    weights[np.arange(len(best)), best % 3] = 1.0 - 2.0 * _INSET
    return solid[best // 3], weights, keys[best]


def _texels(
    uvs: Float32Array, is_solid: npt.NDArray[np.bool_], size: tuple[int, int], taken: npt.NDArray[np.bool_]
) -> Iterator[Choice]:
    """Texels whose centre is in a triangle of the map, within 0 to 1, and that no other has taken; some at a time."""
    is_solid = is_solid & np.isfinite(uvs).all(axis=(1, 2))
    scaled = np.where(is_solid[:, None, None], uvs, 0.0) * size - 0.5  # texel centres are whole numbers
    low = np.maximum(np.ceil(scaled.min(axis=1)), 0).astype(np.int64)
    high = np.minimum(np.floor(scaled.max(axis=1)), np.array(size) - 1).astype(np.int64)
    spans = np.where(is_solid[:, None], np.maximum(high - low + 1, 0), 0)
    counts = spans.prod(axis=1)
    ends = np.cumsum(counts)
    total = int(counts.sum())
    for first in range(0, max(total, 1), _TEXELS_AT_ONCE):
        numbers = np.arange(first, min(first + _TEXELS_AT_ONCE, total))
        rows = np.searchsorted(ends, numbers, side="right")
        y, x = np.divmod(numbers - (ends - counts)[rows], spans[rows, 0])
        x, y = x + low[rows, 0], y + low[rows, 1]
        corners = np.zeros((len(rows), 3, 3))
        corners[:, :, :2] = scaled[rows]
        with np.errstate(invalid="ignore", divide="ignore"):
            weights = _barycentric(corners, np.stack([x, y, np.zeros(len(x))], axis=1))
        texels = y * size[0] + x
        inside = np.flatnonzero((weights.min(axis=1, initial=np.inf) >= 0.0) & ~taken[texels])
        chosen = inside[np.unique(texels[inside], return_index=True)[1]]  # the first triangle where several overlap
        taken[texels[chosen]] = True
        yield rows[chosen], weights[chosen], texels[chosen]


def _lift(
    triangles: Float64Array, weights: Float64Array, transform: Float64Array, side: float
) -> tuple[Float64Array, Float64Array]:
    """Returns positions and normals in the world of points on triangles in the object's space.

    A point goes off the plane by a bound of all rounding between here and the engine's test, which maps it back to the
    object's space: there the plane of a triangle of extent L and area A is known to L ** 3 / A units in the last place.
    """
    linear, origin = transform[:, :3], transform[:, 3]
    inverse = np.linalg.inv(linear)
    on = np.einsum("pk,pkc->pc", weights, triangles)
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normals = np.cross(first, second)
    sizes = np.linalg.norm(normals, axis=1)
    normals *= (side / sizes)[:, None]
    in_world = np.abs(triangles).max(axis=1) @ np.abs(linear).T + np.abs(origin)
    back = np.abs(inverse) @ (np.eye(3) + np.abs(linear) @ np.abs(inverse))
    rounding = (np.abs(normals) * (in_world @ back.T)).sum(axis=1)
    extent = np.abs(first).sum(axis=1) + np.abs(second).sum(axis=1)
    lifted = on + normals * (_ROUNDING * (rounding + extent**3 / sizes))[:, None]
    turned = normals @ inverse
    return lifted @ linear.T + origin, turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _curve_order(positions: Float64Array, rows: IntArray) -> Generator[float, None, IntArray]:
    """Returns the order of some rows along a curve that keeps neighbours together; yields as `place_points`."""
    codes = np.zeros(len(positions), np.uint32)  # of Morton
    low, high = (positions.min(axis=0), positions.max(axis=0)) if len(positions) else (0.0, np.zeros(3))
    scale = 1023.0 / max(float((high - low).max()), 1e-300)
    for first in range(0, len(positions), _TRIANGLES_AT_ONCE):
        some = slice(first, first + _TRIANGLES_AT_ONCE)
        cells = ((positions[some] - low) * scale).astype(np.uint32)
        for bit in range(10):
            for axis in range(3):
                codes[some] |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
        yield 0.9 * PLACE_SHARE
    codes = codes[rows]
    order = np.argsort(codes.astype(np.uint16), kind="stable")  # numpy is fast for 16 bits
    return np.asarray(order[np.argsort((codes >> 16).astype(np.uint16)[order], kind="stable")])
