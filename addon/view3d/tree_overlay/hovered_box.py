"""The box under the mouse: it is drawn with all its contents, and described next to the mouse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...statistics.words import primitive_of
from ..drawing import CORNERS, EDGES, make_batch, pixels
from .tree_lines import TreeLines, describe_box

if TYPE_CHECKING:
    import gpu

    from ...live.scene_sync import SceneSync

LINE_COLOR = (1.0, 1.0, 1.0, 1.0)
LINE_WIDTH = 2.5  # points
FILL_COLOR = (1.0, 0.6, 0.1, 0.35)
# More cannot be distinguished, and would delay the mouse.
MOST_TRIANGLES = 50_000


@dataclass(frozen=True, slots=True, eq=False)
class HoveredBox:
    """A box of a tree, as it was when its lines had a number.

    mesh: the engine's number, None for the top level. matrix: (4, 4) from the boxes' space to the world, None for the
    world's own.
    """

    tree: TreeLines
    number: int
    row: int
    mesh: int | None
    matrix: Any

    @property
    def key(self) -> tuple[int, int, int]:
        """Equal for the same box of the same boxes."""
        return id(self.tree), self.number, self.row

    def lines(self, sync: SceneSync) -> list[str]:
        """Describe the box."""
        boxes = self.tree.boxes
        assert boxes is not None
        if self.mesh is not None:
            rows = np.flatnonzero(sync.mesh_ids == self.mesh)
            kind = sync.record.meshes[int(rows[0])].kind if len(rows) else "triangles"
            return describe_box(boxes, self.row, holds=primitive_of(kind))
        held = boxes.primitives_of(self.row)
        name = str(sync.describe(held).names[0]) if len(held) == 1 else ""
        return describe_box(boxes, self.row, holds="instance", name=name)


def box_under(
    context: bpy.types.Context, place: tuple[int, int], trees: list[tuple[TreeLines, int | None, Any]]
) -> HoveredBox | None:
    """The box of the first of some trees that has one under a place of the region. Each is drawn with its matrix."""
    from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

    at = place[0] + 0.5, place[1] + 0.5
    origin = np.array(region_2d_to_origin_3d(context.region, context.region_data, at), np.float64)
    direction = np.array(region_2d_to_vector_3d(context.region, context.region_data, at), np.float64)
    for tree, mesh, matrix in trees:
        start, way = origin, direction
        if matrix is not None:
            if abs(np.linalg.det(matrix)) < 1e-30:
                continue  # it is flat, and has no inside
            inverse = np.linalg.inv(matrix)
            start, way = inverse[:3, :3] @ origin + inverse[:3, 3], inverse[:3, :3] @ direction
        row = tree.pick(start, way)
        if row is not None:
            return HoveredBox(tree, tree.number, row, mesh, matrix)
    return None


class HoveredPicture:
    """The lines of the box and its triangles on the graphics card, made again for another box only."""

    def __init__(self) -> None:
        self._of: tuple[int, int, int] | None = None
        self._edges: gpu.types.GPUBatch | None = None
        self._triangles: gpu.types.GPUBatch | None = None

    def draw(self, box: HoveredBox, sync: SceneSync) -> None:
        """Draws in the 3D viewport that is being drawn, in world space."""
        import gpu
        from mathutils import Matrix

        if self._of != box.key:
            self._of, self._edges, self._triangles = box.key, _edges_of(box), _triangles_of(box, sync)
        with gpu.matrix.push_pop():
            if box.matrix is not None:
                gpu.matrix.multiply_matrix(Matrix(box.matrix.tolist()))
            if self._triangles is not None:
                _fill(self._triangles)
            shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
            shader.bind()
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            shader.uniform_float("lineWidth", pixels(LINE_WIDTH))
            shader.uniform_float("color", LINE_COLOR)
            assert self._edges is not None
            self._edges.draw(shader)


def _fill(batch: gpu.types.GPUBatch) -> None:
    import gpu

    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", FILL_COLOR)
    batch.draw(shader)


def _edges_of(box: HoveredBox) -> gpu.types.GPUBatch:
    import gpu
    from gpu_extras.batch import batch_for_shader

    assert box.tree.boxes is not None
    bounds = box.tree.boxes.boxes[box.row]
    corners = [tuple(bounds[side, axis] for axis, side in enumerate(corner)) for corner in CORNERS.tolist()]
    ends = [corners[end] for edge in EDGES.tolist() for end in edge]
    return batch_for_shader(gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR"), "LINES", {"pos": ends})


def _triangles_of(box: HoveredBox, sync: SceneSync) -> gpu.types.GPUBatch | None:
    """Returns the triangles; None for the top level, whose boxes hold objects."""
    if box.mesh is None:
        return None
    corners = corners_of(box, sync)
    if not len(corners):
        return None
    return make_batch("TRIS", pos=corners)


def corners_of(box: HoveredBox, sync: SceneSync) -> Any:
    """(3T, 3) float32: the corners of the triangles in a box of a mesh's tree, the first where they are many."""
    rows = np.flatnonzero(sync.mesh_ids == box.mesh)
    if not len(rows) or box.tree.boxes is None:
        return np.empty((0, 3), np.float32)
    mesh = sync.record.meshes[int(rows[0])]
    if mesh.kind != "triangles":
        return np.empty((0, 3), np.float32)
    held = box.tree.boxes.primitives_of(box.row)[:MOST_TRIANGLES]
    return np.ascontiguousarray(mesh.positions[mesh.triangles[held]].reshape(-1, 3), np.float32)
