"""What scripts already call, with our rays behind it: `mathutils.bvhtree.BVHTree` and `Scene.ray_cast`.

All take arrays as well, and then answer in arrays.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import mathutils
import numpy as np
import numpy.typing as npt
from perfect_bvh import Scene

from .sync_cache import sync_of

Array = npt.NDArray[Any]
Answer = tuple[Any, Any, Any, Any]
NOTHING: Answer = (None, None, None, None)
LONGEST = float(np.finfo(np.float32).max)
_FROM, _ALL = np.zeros(1, np.float32), np.full(1, 0xFFFFFFFF, np.uint32)


class BVHTree:
    """`mathutils.bvhtree.BVHTree` with our rays and closest points: the same methods, arguments and answers.

    A script changes its import, `from perfect_bvh_addon import BVHTree`, and nothing else. `ray_cast` and
    `find_nearest` also take (n, 3) arrays and then return arrays: positions (n, 3) and normals (n, 3) float64, NaN
    where nothing is; indices (n,) int32, -1 there; distances (n,) float64, infinite there.

    Differences: no ray passes between two polygons. Where two are equally near, at an edge, the other one may be found.
    Polygons of five corners and more that are not flat may be split otherwise by `FromPolygons`. `overlap` and
    `find_nearest_range` are answered by Blender's own tree. `FromObject` has no `deform=False` and `cage=True`: use
    Blender's for these.
    """

    __slots__ = ("_epsilon", "_normals", "_polygons", "_positions", "_scene", "_snapshot", "_theirs", "_triangles")

    def __init__(self, positions: Array, triangles: Array, polygons: Array, normals: Array, epsilon: float) -> None:
        self._positions, self._triangles, self._epsilon = positions, triangles, epsilon
        self._polygons, self._normals = polygons, normals  # of each triangle
        self._theirs: Any = None
        self._scene = Scene()
        if len(triangles):
            self._scene.add_instance(self._scene.add_mesh(positions, triangles))
        self._scene.commit()
        self._snapshot = self._scene._committed()  # which the checks of arrays end in

    @classmethod
    def FromObject(  # noqa: N802
        cls,
        object: Any,  # noqa: A002
        depsgraph: Any,
        *,
        deform: bool = True,
        render: bool = False,
        cage: bool = False,
        epsilon: float = 0.0,
    ) -> BVHTree:
        """Make one of an object's evaluated mesh, in the object's space.

        Args:
            object: The `bpy.types.Object`.
            depsgraph: What evaluates it.
            deform, cage: True and False; see the class.
            render: Is not used, as in Blender.
            epsilon: For `overlap`.

        Raises:
            ValueError: If the object has no mesh, or for other values of `deform` and `cage`.
        """
        if not deform or cage:
            raise ValueError(
                "BVHTree.FromObject: deform must be True and cage False; use mathutils.bvhtree.BVHTree otherwise"
            )
        evaluated = object.evaluated_get(depsgraph)
        try:
            mesh = evaluated.to_mesh()
        except RuntimeError as problem:
            raise ValueError(f"BVHTree.FromObject: {object.name!r} has no mesh: {problem}") from problem
        try:
            mesh.calc_loop_triangles()
            positions = _read(mesh.vertices, "co", 3, np.float32)
            triangles = _read(mesh.loop_triangles, "vertices", 3, np.int32)
            polygons = _read(mesh.loop_triangles, "polygon_index", 1, np.int32)[:, 0]
        finally:
            evaluated.to_mesh_clear()
        return cls(positions, triangles, polygons, _normals_of(positions, triangles), epsilon)

    @classmethod
    def FromBMesh(cls, bmesh: Any, *, epsilon: float = 0.0) -> BVHTree:  # noqa: N802
        """Make one of a `bmesh.types.BMesh`, whose indices are updated.

        Args:
            bmesh: The mesh.
            epsilon: For `overlap`.
        """
        bmesh.verts.index_update()
        bmesh.faces.index_update()
        positions = np.array([vertex.co for vertex in bmesh.verts], np.float32).reshape(-1, 3)
        loops = bmesh.calc_loop_triangles()
        triangles = np.array([[loop.vert.index for loop in three] for three in loops], np.int32).reshape(-1, 3)
        polygons = np.array([three[0].face.index for three in loops], np.int32)
        normals = np.array([face.normal for face in bmesh.faces], np.float64).reshape(-1, 3)
        return cls(positions, triangles, polygons, normals[polygons], epsilon)

    @classmethod
    def FromPolygons(  # noqa: N802
        cls,
        vertices: npt.ArrayLike,
        polygons: Sequence[Sequence[int]] | npt.ArrayLike,
        *,
        all_triangles: bool = False,
        epsilon: float = 0.0,
    ) -> BVHTree:
        """Make one of vertices and polygons.

        Args:
            vertices: (V, 3) float.
            polygons: Rows of vertices of each polygon; with all_triangles (n, 3) int.
            all_triangles: Whether all polygons are triangles, which saves time.
            epsilon: For `overlap`.

        Raises:
            ValueError: For arrays of another shape, and rows that are no vertices.
        """
        vertices, polygons = _listed(vertices), _listed(polygons)
        positions = _rows_of_three("vertices", np.asarray(vertices, np.float32))
        if all_triangles:
            triangles: Array = _rows_of_three("polygons", np.asarray(polygons, np.int32))
            _check_corners(triangles, range(len(triangles)), len(positions))
            owners = np.arange(len(triangles), dtype=np.int32)
            return cls(positions, triangles, owners, _normals_of(positions, triangles), epsilon)
        rows: list[Array] = [np.empty((0, 3), np.int32)]
        owners_of: list[Array] = [np.empty(0, np.int32)]
        by_size: dict[int, list[int]] = {}
        for owner, polygon in enumerate(polygons):  # type: ignore[arg-type]
            by_size.setdefault(len(polygon), []).append(owner)
        normals = np.zeros((sum(map(len, by_size.values())), 3))
        for size, owners in by_size.items():
            corners = np.array([polygons[owner] for owner in owners], np.int64)  # type: ignore[index]
            _check_corners(corners, owners, len(positions))
            if size < 3:
                continue
            places = positions[corners].astype(np.float64)
            normals[owners] = _unit(np.cross(places, np.roll(places, -1, axis=1)).sum(axis=1))
            pieces = _split(places, normals[owners])
            rows.append(np.take_along_axis(corners[:, None, :], pieces, axis=2).reshape(-1, 3))
            owners_of.append(np.repeat(owners, pieces.shape[1]))
        triangles, polygon_of = np.concatenate(rows).astype(np.int32), np.concatenate(owners_of).astype(np.int32)
        return cls(positions, triangles, polygon_of, normals[polygon_of], epsilon)

    def ray_cast(
        self, origin: npt.ArrayLike, direction: npt.ArrayLike, distance: npt.ArrayLike = sys.float_info.max
    ) -> Answer:
        """Cast a ray, or many.

        Args:
            origin, direction: (3,) or (n, 3) float; directions of any length.
            distance: A number or (n,): nothing farther away is hit.

        Returns:
            (position, normal, index of the polygon, distance) as Blender's does, None where nothing is hit; for arrays
            see the class.
        """
        if np.ndim(origin) == np.ndim(direction) == np.ndim(distance) + 1 == 1:
            return self._cast_one(origin, direction, distance)
        origins, directions = np.broadcast_arrays(np.asarray(origin, float), np.asarray(direction, float))
        directions = _unit(directions)
        t_max = np.minimum(distance, LONGEST)
        hits = self._scene.cast_rays(
            origins, directions, t_max=t_max, fields=("positions", "distances", "primitive_ids")
        )
        return self._answer(hits.positions, hits.distances, hits.primitive_ids)

    def find_nearest(self, origin: npt.ArrayLike, distance: npt.ArrayLike = 1.84467e19) -> Answer:
        """Find the nearest polygon to a point, or to many.

        Args:
            origin: (3,) or (n, 3) float.
            distance: A number or (n,): nothing farther away is found.

        Returns:
            As `ray_cast`.
        """
        nearest = self._scene.compute_closest_points(np.asarray(origin, float), max_distance=distance)
        return self._answer(nearest.points, nearest.distances, nearest.primitive_ids)

    def find_nearest_range(self, origin: Sequence[float], distance: float = 1.84467e19) -> list[Answer]:
        """Find all polygons within a distance of a point, by Blender's own tree; see there."""
        found = self._blenders().find_nearest_range(origin, distance)
        return [
            (place, mathutils.Vector(self._normals[row]), int(self._polygons[row]), away)
            for place, _, row, away in found
        ]

    def overlap(self, other_tree: BVHTree) -> list[tuple[int, int]]:
        """Find the pairs of polygons of two trees that overlap, by Blender's own trees; see there."""
        if not isinstance(other_tree, BVHTree):
            raise TypeError(f"BVHTree.overlap: other_tree must be a perfect_bvh_addon.BVHTree, got {type(other_tree)}")
        rows = np.array(self._blenders().overlap(other_tree._blenders()), np.int64).reshape(-1, 2)
        pairs = np.stack([self._polygons[rows[:, 0]], other_tree._polygons[rows[:, 1]]], axis=-1)
        return [(int(one), int(other)) for one, other in np.unique(pairs, axis=0)]

    def _cast_one(self, origin: Any, direction: Any, distance: Any) -> Answer:
        """One ray, without what arrays need: loops call this by the thousand."""
        if len(origin) != 3 or len(direction) != 3:
            raise ValueError(
                f"BVHTree.ray_cast: origin and direction must have shape (3,) or (n, 3), got {len(origin)} and "
                f"{len(direction)} numbers"
            )
        rays = np.array((origin, direction), np.float64)
        x, y, z = rays[1].tolist()
        length = math.sqrt(x * x + y * y + z * z)  # as of many, to the last digit
        if length > 0.0:
            rays[1] /= length
        place, away, row = np.empty((1, 3)), np.empty(1), np.empty(1, np.int32)
        limits = _FROM, np.array((min(distance, LONGEST),), np.float32), _ALL, _FROM
        out = {"positions": place, "distances": away, "primitive_ids": row}
        self._snapshot.cast_rays((rays[:1], rays[1:], *limits, "none"), "stream", out, 1, None)
        return self._answer(place[0], away[0], row[0])

    def _blenders(self) -> Any:
        if self._theirs is None:
            from mathutils.bvhtree import BVHTree as Theirs

            self._theirs = Theirs.FromPolygons(
                self._positions.tolist(), self._triangles.tolist(), all_triangles=True, epsilon=self._epsilon
            )
        return self._theirs

    def _answer(self, places: Array, distances: Array, triangles: Array) -> Answer:
        if triangles.ndim == 0:
            row = int(triangles)
            if row < 0:
                return NOTHING
            normal = mathutils.Vector(self._normals[row])
            return mathutils.Vector(places), normal, int(self._polygons[row]), float(distances)
        is_found = triangles >= 0
        rows = np.where(is_found, triangles, 0)
        if not len(self._triangles):
            return np.full(places.shape, np.nan), np.full(places.shape, np.nan), triangles, distances
        normals = np.where(is_found[..., None], self._normals[rows], np.nan)
        indices = np.where(is_found, self._polygons[rows], -1).astype(np.int32)
        return np.where(is_found[..., None], places, np.nan), normals, indices, distances


def ray_cast(
    depsgraph: Any, origins: npt.ArrayLike, directions: npt.ArrayLike, distance: npt.ArrayLike = np.inf
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Casts rays into the scene of a depsgraph, as `Scene.ray_cast` casts one.

    Changes of the scene are read first, so no answer is older than the call.

    Differences: curves, hair and points are hit as well, with -1 as the polygon, and no ray passes between two
    polygons. Normals are perpendicular to the triangles of unevenly scaled objects, too, and turn with a negative
    scale; Blender's do neither.

    Args:
        depsgraph: The evaluated `bpy.types.Depsgraph`.
        origins, directions: (3,) or (..., 3) float, world space; directions of any length.
        distance: A number or (...): nothing farther away is hit.

    Returns:
        Whether each ray hits, (...) bool; where, (..., 3) float64; the triangle's normal there, (..., 3) float32; the
        polygon, (...) int32; the object, (...) of `bpy.types.Object`; and its matrix, (..., 4, 4) float64. A miss has
        zeros, -1, None and the identity.

    Raises:
        ValueError: For arrays of another shape.
    """
    import bpy

    origins, directions = np.broadcast_arrays(np.asarray(origins, float), np.asarray(directions, float))
    sync = sync_of(depsgraph)
    sync.update(depsgraph, expected_rays=origins.size // 3)
    fields = ("positions", "geometric_normals", "instance_ids", "mesh_ids", "primitive_ids")
    hits = sync.scene.cast_rays(origins, _unit(directions), t_max=distance, fields=fields)
    is_hit = hits.instance_ids >= 0
    rows = np.where(is_hit, sync.instance_rows(hits.instance_ids), 0)
    matrices = np.broadcast_to(np.eye(4), (*is_hit.shape, 4, 4)).copy()
    objects = np.full(is_hit.shape, None, object)
    if is_hit.any():
        matrices[..., :3, :] = np.where(
            is_hit[..., None, None], sync.record.instances.transforms[rows], matrices[..., :3, :]
        )
        by_uid = {found.session_uid: found for found in bpy.data.objects}
        uids, places = np.unique(sync.describe(hits.instance_ids).session_uids, return_inverse=True)
        named = np.array([by_uid.get(int(uid)) for uid in uids] + [None], object)
        objects = named[places.reshape(is_hit.shape)]
    return is_hit, hits.positions, hits.geometric_normals, sync.polygon_ids(hits), objects, matrices


def _split(places: Array, normals: Array) -> Array:
    """(P, K - 2, 3): which corners the triangles of P polygons with K corners each have. places: (P, K, 3).

    Quads as Blender's tree splits them: from corner 1 to 3, unless the polygon is hollow at one of the others.
    """
    count, size, _ = places.shape
    if size == 3:
        return np.tile(np.arange(3), (count, 1, 1))
    if size == 4:
        to_next, to_last = np.roll(places, -1, axis=1) - places, np.roll(places, 1, axis=1) - places
        turns = np.einsum("pki,pi->pk", np.cross(to_next, to_last), normals)
        is_hollow = (turns[:, [0, 2]] < 0.0).any(axis=1)
        usual, other = [(0, 1, 3), (1, 2, 3)], [(0, 1, 2), (0, 2, 3)]
        return np.where(is_hollow[:, None, None], np.array(other), np.array(usual))
    found = [mathutils.geometry.tessellate_polygon([[mathutils.Vector(at) for at in polygon]]) for polygon in places]
    pieces = np.zeros((count, size - 2, 3), np.int64)  # of a polygon with a loop in it there are fewer: mere points
    for row, triangles in enumerate(found):
        pieces[row, : len(triangles)] = triangles
    return pieces


def _listed(rows: Any) -> Any:
    """Returns what an iterator gives as a list, anything else as it is."""
    return rows if hasattr(rows, "__getitem__") else list(rows)


def _rows_of_three(name: str, rows: Array) -> Array:
    if rows.size == 0:
        return rows.reshape(0, 3)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"BVHTree.FromPolygons: {name} must have shape (n, 3), got {rows.shape}")
    return rows


def _check_corners(corners: Array, owners: Sequence[int], count: int) -> None:
    """Refuse polygons with vertices that do not exist. owners: the polygons' numbers."""
    bad = np.flatnonzero(((corners < 0) | (corners >= count)).any(axis=1))
    if len(bad):
        raise ValueError(
            f"BVHTree.FromPolygons: polygon {owners[bad[0]]} has vertices {corners[bad[0]].tolist()}, "
            f"but there are {count}"
        )


def _read(collection: Any, name: str, width: int, dtype: type[Any]) -> Array:
    found = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, found)
    return found.reshape(-1, width)


def _normals_of(positions: Array, triangles: Array) -> Array:
    a, b, c = (positions[triangles[:, i]].astype(np.float64) for i in range(3))
    return _unit(np.cross(b - a, c - a))


def _unit(vectors: Array) -> Array:
    """Returns unit vectors; vectors without a length are not changed."""
    if vectors.ndim == 0:
        return vectors  # whose shape is refused later
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)
