"""Rays for `trimesh`: replaces a mesh's own intersector; the rest of a script stays the same.

    from perfect_bvh.trimesh import RayMeshIntersector

    mesh.ray = RayMeshIntersector(mesh)

Needs the package `trimesh`: pip install 'perfect-bvh[trimesh]'.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from .hits import Hits
from .scene import Scene

try:
    from trimesh.ray.ray_util import contains_points
except ImportError as problem:
    raise ImportError("perfect_bvh.trimesh needs the package trimesh: pip install 'perfect-bvh[trimesh]'") from problem

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Bounds:
    """The bounds of a mesh.

    In the scene the mesh is stretched to reach from 0 to 1 along each axis. Its outermost faces, at which rays often
    begin, are then exact in float32.
    """

    low: Floats = field(default_factory=lambda: np.zeros(3))
    size: Floats = field(default_factory=lambda: np.ones(3))

    @staticmethod
    def of(vertices: Floats) -> _Bounds:
        low = vertices.min(axis=0)
        size = vertices.max(axis=0) - low
        return _Bounds(low, np.where(size > 0.0, size, 1.0))

    def bring_in(self, points: Floats) -> Floats:
        """Maps points into the scene."""
        brought = points - self.low
        brought /= self.size  # a product would not be 1 at the other end
        return brought

    def bring_rays(self, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Maps rays into the scene; t stays the same."""
        return self.bring_in(origins), directions * (1.0 / self.size)


class RayMeshIntersector:
    """Rays at one mesh: the methods, arguments and returned values of trimesh's own intersectors.

    No ray passes between two triangles, and all surfaces on a ray are found, however close they are. The mesh is read
    again when it has changed. Vertices are stored as float32 within the mesh's bounds. Hits are exact for these; they
    are up to 6e-8 of the bounds away from the true ones. Faces on the bounds are exact.

    Args:
        geometry: The `trimesh.Trimesh`.
        scale_to_box: As trimesh's intersector by Embree takes it; ours needs no scaling.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._forget()

    def intersects_id(
        self,
        ray_origins: npt.ArrayLike,
        ray_directions: npt.ArrayLike,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[Ints, Ints] | tuple[Ints, Ints, Floats]:
        """Find which triangles rays hit.

        Where a ray passes through an edge or a vertex it meets one triangle, not each of those there.

        Args:
            ray_origins, ray_directions: (n, 3) float; directions of any length.
            multiple_hits: All hits of each ray, the nearest first; otherwise the first alone.
            max_hits: The largest number of hits of each ray; None for all.
            return_locations: Whether the hits' positions are returned as well.

        Returns:
            The hits' rows in `mesh.faces`, (m,) int64; their rays, (m,) int64; and, if requested, their positions,
            (m, 3) float64. Sorted by rays.

        Raises:
            ValueError: For arrays of another shape.
        """
        origins, directions = self._rays("intersects_id", ray_origins, ray_directions)
        fields = ["primitive_ids", *(["positions"] if return_locations else [])]
        scene, bounds = self._scene()
        origins, directions = bounds.bring_rays(origins, directions)
        if multiple_hits:
            found = scene.list_intersections(origins, directions, fields=[*fields, "t_hit", "front_face"])
            hits, rays = found.hits, found.ray_indices
            kept = self._is_new_place(rays, hits)
            if max_hits is not None:
                kept &= _places_before(rays, kept) < max_hits
        else:
            hits, rays = scene.cast_rays(origins, directions, fields=fields), np.arange(len(origins))
            kept = hits.primitive_ids >= 0
        triangles = hits.primitive_ids[kept].astype(np.int64)
        if return_locations:
            return triangles, rays[kept], hits.positions[kept] * bounds.size + bounds.low
        return triangles, rays[kept]

    def intersects_location(
        self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, multiple_hits: bool = True, **keywords: Any
    ) -> tuple[Floats, Ints, Ints]:
        """Find where rays hit the mesh; the arguments are those of `intersects_id`.

        Returns:
            The positions of the hits, (m, 3) float64; their rays, (m,) int64; their rows in `mesh.faces`, (m,) int64.
        """
        triangles, rays, places = self.intersects_id(  # type: ignore[misc]
            ray_origins, ray_directions, multiple_hits=multiple_hits, return_locations=True, **keywords
        )
        return places, rays, triangles

    def intersects_first(self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike) -> Ints:
        """Find the first triangle that each ray hits.

        Args:
            ray_origins, ray_directions: (n, 3) float.

        Returns:
            Rows in `mesh.faces`, (n,) int64; -1 where a ray hits nothing.

        Raises:
            ValueError: For arrays of another shape.
        """
        origins, directions = self._rays("intersects_first", ray_origins, ray_directions)
        scene, bounds = self._scene()
        hits = scene.cast_rays(*bounds.bring_rays(origins, directions), fields=["primitive_ids"])
        return hits.primitive_ids.astype(np.int64)

    def intersects_any(
        self, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike, **_: Any
    ) -> npt.NDArray[np.bool_]:
        """Find which rays hit the mesh.

        Args:
            ray_origins, ray_directions: (n, 3) float.

        Returns:
            (n,) bool.

        Raises:
            ValueError: For arrays of another shape.
        """
        origins, directions = self._rays("intersects_any", ray_origins, ray_directions)
        scene, bounds = self._scene()
        return scene.test_occlusions(*bounds.bring_rays(origins, directions))

    def contains_points(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Find which points are inside the mesh, by trimesh's own rule: it counts the hits of rays in both directions.

        Args:
            points: (n, 3) float. The answer for points on the surface is undefined.

        Returns:
            (n,) bool, only meaningful for a watertight mesh.
        """
        inside: npt.NDArray[np.bool_] = contains_points(self, points)
        return inside

    def __getstate__(self) -> dict[str, Any]:
        return {"mesh": self.mesh, "_scale_to_box": self._scale_to_box}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._forget()

    def __copy__(self) -> RayMeshIntersector:
        return RayMeshIntersector(self.mesh, self._scale_to_box)

    def __deepcopy__(self, _: Any) -> RayMeshIntersector:
        return self.__copy__()

    def _forget(self) -> None:
        self._read: tuple[int, Scene, _Bounds] | None = None

    def _scene(self) -> tuple[Scene, _Bounds]:
        """The current mesh, mapped into its bounds."""
        version = hash(self.mesh)
        if self._read is None or self._read[0] != version:
            scene, bounds, faces = Scene(), _Bounds(), np.asarray(self.mesh.faces)
            if len(faces):
                bounds = _Bounds.of(np.asarray(self.mesh.vertices, np.float64))
                vertices = bounds.bring_in(np.asarray(self.mesh.vertices))
                scene.add_instance(scene.add_mesh(vertices, faces))
            scene.commit()
            self._read = version, scene, bounds
        return self._read[1:]

    def _is_new_place(self, rays: Ints, hits: Hits) -> npt.NDArray[np.bool_]:
        """Whether a hit is the first at its position: at an edge or vertex each triangle that meets there has a hit.

        Such hits have the same t, share a corner and face the ray from the same side. Where a ray leaves one part of a
        mesh and enters a touching part, there are two positions: their sides differ.
        """
        vertices, faces = np.asarray(self.mesh.vertices), np.asarray(self.mesh.faces)
        is_new = np.ones(len(rays), np.bool_)
        for side in (False, True):
            rows = np.flatnonzero(hits.front_face == side)
            before, after = rows[:-1], rows[1:]
            is_near = hits.t_hit[after] <= np.nextafter(hits.t_hit[before], np.float32(np.inf))
            is_near &= rays[after] == rays[before]
            before, after = before[is_near], after[is_near]
            one, other = (vertices[faces[hits.primitive_ids[hit]]] for hit in (before, after))
            is_new[after] = ~(one[:, :, None] == other[:, None, :]).all(axis=3).any(axis=(1, 2))
        return is_new

    def _rays(self, function: str, ray_origins: npt.ArrayLike, ray_directions: npt.ArrayLike) -> tuple[Floats, Floats]:
        origins, directions = np.asarray(ray_origins, np.float64), np.asarray(ray_directions, np.float64)
        if origins.ndim != 2 or origins.shape[1] != 3 or origins.shape != directions.shape:
            raise ValueError(
                f"{function}: ray_origins and ray_directions must both have shape (n, 3), "
                f"got {origins.shape} and {directions.shape}"
            )
        return origins, directions


def _places_before(rays: Ints, is_new: npt.NDArray[np.bool_]) -> Ints:
    """Returns, for each hit, the number of earlier positions on its ray."""
    counts: Ints = np.cumsum(is_new) - is_new
    starts = np.flatnonzero(np.diff(rays, prepend=-1))
    return counts - np.repeat(counts[starts], np.diff(starts, append=len(rays)))
