"""The roots of old particle hair, and the emitting mesh's attributes there: UV maps, vertex colours.

Blender keeps for each particle a face and four weights, which have no Python interface. They are read from its memory
and compared with `uv_on_emitter` for some strands on every read. If they differ, or if a modifier
changes the mesh after the particles, `uv_on_emitter` is called for each strand.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, Int32Array
from ..pointer_views import CORNER_TRIANGLES, CORNER_UVS, CORNER_VERTS, ArrayReader, view_of_memory

# Blender returns particles' UV maps and colours of the mesh as it was at their modifier, and does not check their
# number: asking for one that is only added later accesses memory that does not exist.
# These modifiers do not change faces, UV maps and colours.
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
_FLOAT = np.dtype(np.float32)
_PARTICLE = np.dtype(
    {
        "names": ["face", "final_face", "weights"],
        "formats": ["i4", "i4", (_FLOAT, 4)],
        "offsets": [152, 156, 160],
        "itemsize": 200,
    }
)
_CHILD = np.dtype(
    {
        "names": ["face", "parent", "weights"],
        "formats": ["i4", "i4", (_FLOAT, 4)],
        "offsets": [0, 4, 40],
        "itemsize": 64,
    }
)
_NOT_FOUND, _IS_CHILD = -1, -2  # of `final_face`
_CHECKED_STRANDS = 5
_ROUNDING = 1e-5
_CORNERS_OF_QUADS = 4
_QUAD, _TRIANGLE, _TRIANGLE_OF_MORE, _TURNED_QUAD = range(4)  # kinds of faces, of each of which some are compared

Int8Array = npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Roots:
    """The roots of strands numbered first, first + 1, ...; faces and weights: (S,) and (S, 4), None if unknown.

    corners: (F, 4) int32, the mesh's corners of each of Blender's old faces, which have 3, then -1, or 4.
    """

    system: Any
    modifier: Any
    first: int
    count: int
    corners: Int32Array
    faces: Int32Array | None
    weights: Float32Array | None

    def gather(self, values: npt.NDArray[Any]) -> Float32Array:
        """(S, width) float32 of (corners, width): zero for strands without a face."""
        assert self.faces is not None
        assert self.weights is not None
        corners = self.corners[self.faces]
        weights = np.where((corners >= 0) & (self.faces >= 0)[:, None], self.weights, 0.0)
        return np.einsum("sc,scw->sw", weights, values[corners], dtype=np.float32)

    def ask(self, accessor: str, number: int, rows: Iterable[int] | None = None) -> Float32Array | None:
        """Returns Blender's own values, of each strand or those in the rows; None if it does not have the layer.

        accessor: "uv_on_emitter", "mcol_on_emitter". The layer must be one that `is_askable`.
        """
        rows = range(self.count) if rows is None else rows
        try:
            return np.array([self.ask_one(accessor, number, row) for row in rows], np.float32)
        except RuntimeError:  # the mesh has no such layers, or no mesh was kept
            return None

    def ask_one(self, accessor: str, number: int, row: int) -> Any:
        """Returns Blender's own value for the strand in this row."""
        strand = self.first + row
        particles = self.system.particles
        particle = particles[min(strand, len(particles) - 1)]
        layer = {"uv_no" if accessor == "uv_on_emitter" else "vcol_no": number}
        return getattr(self.system, accessor)(self.modifier, particle=particle, particle_no=strand, **layer)


def find_roots(
    system: Any,
    modifier: Any,
    mesh: Any,
    first: int,
    count: int,
    reader: ArrayReader,
    maps: frozenset[int] = frozenset(),
    is_final: bool = True,
) -> Roots:
    """Finds the roots of an evaluated particle system that shows `count` strands from the number `first` on.

    maps: the numbers of the requested UV maps, which are compared; the first one if there are none. is_final:
    whether the particles were distributed on this mesh, without which faces are meaningless.
    """
    corners, kinds = _old_faces(mesh, reader)
    unknown = Roots(system, modifier, first, count, corners, None, None)
    if not is_final or not reader.use_views or not len(corners) or not len(mesh.uv_layers):
        return unknown
    found = _read(system, first, count)
    if found is None:
        return unknown
    faces, weights = found
    if len(faces) != count:
        return unknown
    if system.settings.emit_from == "VERT" and not (first and system.settings.child_type == "INTERPOLATED"):
        if (faces >= len(mesh.vertices)).any():
            return unknown
        faces = _faces_of_vertices(faces, corners, mesh, reader)
    if (faces >= len(corners)).any():
        return unknown
    roots = Roots(system, modifier, first, count, corners, np.maximum(faces, -1).astype(np.int32), weights)
    are_equal = all(_agrees(roots, number, kinds, mesh, reader) for number in sorted(maps or {0}))
    return roots if are_equal else unknown


def _read(system: Any, first: int, count: int) -> tuple[Int32Array, Float32Array] | None:
    particles = _view(system.particles, _PARTICLE)
    if particles is None:
        return None
    if first == 0:
        own, final = particles["face"][:count], particles["final_face"][:count]
        return np.where((final == _NOT_FOUND) | (final == _IS_CHILD), own, final), particles["weights"][:count]
    children = _view(system.child_particles, _CHILD)
    if children is None:
        return None
    children = children[:count]
    if system.settings.child_type == "INTERPOLATED":
        return children["face"], children["weights"]
    parents = children["parent"]
    if len(parents) and (parents.min() < 0 or parents.max() >= len(particles)):
        return None
    own, final = particles["face"][parents], particles["final_face"][parents]
    return np.where(final == _NOT_FOUND, own, final), particles["weights"][parents]


def _view(collection: Any, dtype: np.dtype[Any]) -> npt.NDArray[Any] | None:
    """Views a collection as an array; None if its elements are not as far apart as expected."""
    count = len(collection)
    if count == 0:
        return None
    begin = collection[0].as_pointer()
    if collection[count - 1].as_pointer() - begin != (count - 1) * dtype.itemsize:
        return None
    return view_of_memory(begin, (count,), dtype)


def _old_faces(mesh: Any, reader: ArrayReader) -> tuple[Int32Array, Int8Array]:
    """Corners (F, 4), kinds (F,) of the faces that particles count: triangles, quads, triangles of other polygons."""
    starts, sizes = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", sizes)
    is_large = sizes > _CORNERS_OF_QUADS
    counts = np.where(is_large, sizes - 2, 1)
    firsts = np.cumsum(counts) - counts
    faces = np.full((int(counts.sum()), 4), -1, np.int32)
    small = np.flatnonzero(~is_large)
    faces[firsts[small]] = starts[small, None] + np.arange(4)
    kinds = np.full(len(faces), _QUAD, np.int8)
    triangular = firsts[sizes < _CORNERS_OF_QUADS]
    faces[triangular, 3], kinds[triangular] = -1, _TRIANGLE
    if is_large.any():
        mesh.calc_loop_triangles()
        triangles = reader.view(mesh.loop_triangles, CORNER_TRIANGLES)
        owners = np.repeat(np.arange(len(sizes)), np.maximum(sizes - 2, 0))
        of_large = is_large[owners]
        rows = np.repeat(firsts[is_large], counts[is_large])
        rows += np.arange(len(rows)) - np.repeat(np.cumsum(counts[is_large]) - counts[is_large], counts[is_large])
        faces[rows, :3] = triangles[of_large]
        kinds[rows] = _TRIANGLE_OF_MORE
    return _turned(faces, kinds, mesh, reader)


def _turned(faces: Int32Array, kinds: Int8Array, mesh: Any, reader: ArrayReader) -> tuple[Int32Array, Int8Array]:
    """Rotates quads so that vertex 0 is neither third nor last: there it would mean that there is no fourth corner."""
    verts = reader.view(mesh.attributes[".corner_vert"].data, CORNER_VERTS)
    turned = (kinds == _QUAD) & (verts[faces[:, 2:]] == 0).any(axis=1)
    faces[turned] = faces[turned][:, [2, 3, 0, 1]]
    kinds[turned] = _TURNED_QUAD
    return faces, kinds


def _faces_of_vertices(vertices: Int32Array, corners: Int32Array, mesh: Any, reader: ArrayReader) -> Int32Array:
    """The first old face with each vertex, -1 for none; as in Blender, all triangles have vertex 0."""
    verts = reader.view(mesh.attributes[".corner_vert"].data, CORNER_VERTS)
    of_faces = np.where(corners >= 0, verts[corners], 0)
    first_faces = np.full(len(mesh.vertices) + 1, len(corners), np.int32)
    np.minimum.at(first_faces, of_faces, np.arange(len(corners), dtype=np.int32)[:, None])
    first_faces[first_faces == len(corners)] = -1
    first_faces[-1] = -1
    is_vertex = (vertices >= 0) & (vertices < len(mesh.vertices))
    return first_faces[np.where(is_vertex, vertices, len(mesh.vertices))]


def _agrees(roots: Roots, number: int, kinds: Int8Array, mesh: Any, reader: ArrayReader) -> bool:
    found = roots.gather(reader.view(mesh.uv_layers[number].uv, CORNER_UVS))
    evenly = np.linspace(0, roots.count - 1, min(_CHECKED_STRANDS, roots.count)).astype(int)
    _, of_each_kind = np.unique(kinds[roots.faces], return_index=True)
    rows = [*evenly.tolist(), *of_each_kind.tolist()]
    expected = roots.ask("uv_on_emitter", number, rows)
    if expected is None:
        return False
    largest = float(np.abs(expected[np.isfinite(expected)]).max(initial=1.0))
    return bool(np.isclose(found[rows], expected, rtol=0.0, atol=_ROUNDING * largest, equal_nan=True).all())


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
