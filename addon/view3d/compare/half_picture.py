"""One half of a comparison as a picture: an object, shaded, and the boxes of one of its trees.

It is drawn at twice its size, so that its lines are smooth, and kept until some input changes.
If that would take long without a graphics card, it is drawn at its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
import numpy.typing as npt

from .. import drawing
from ..drawing import MOST_BOXES, BoxLines, box_lines, make_batch

if TYPE_CHECKING:
    import gpu
    from perfect_bvh import Snapshot, TreeBoxes

    from .compare_trees import Comparison, ShadedMesh, Side

Float64Array = npt.NDArray[np.float64]

LARGER = 2  # factor of the picture's size
LINE_WIDTH = 1.2  # in points
# Lines with a width take six times the vertices.
MOST_WIDE_BOXES = 20_000
MOST_SMOOTH_TRIANGLES = 200_000
FILLS = 0.88  # of a half, by the object, at first
LEAST_SCALE, LARGEST_SCALE = 0.05, 4.0
# Older viewports encode drawings, so a picture must be decoded when it is read, and is encoded when it is made.
IS_ENCODED = bpy.app.version < (5, 0, 0)
PICTURE_FORMAT = "SRGB8_A8" if IS_ENCODED else "RGBA8"


@dataclass(frozen=True, slots=True)
class Framing:
    """The region's view in a half: around (x, y), from -1 to 1, and its magnification."""

    x: float = 0.0
    y: float = 0.0
    scale: float = 1.0

    def matrix(self, region: tuple[float, float], size: tuple[float, float]) -> Float64Array:
        """(4, 4), to be applied after the projection of a region. region, size: pixels, of the region and a half."""
        made = np.eye(4)
        made[0, 0], made[1, 1] = self.scale * region[0] / size[0], self.scale * region[1] / size[1]
        made[0, 3], made[1, 3] = -self.x * made[0, 0], -self.y * made[1, 1]
        return made


def frame_box(
    comparison: Comparison, perspective: Any, region: tuple[float, float], size: tuple[float, float]
) -> Framing:
    """Frames the object in a half; like the view, if the object is not wholly before the eye."""
    lower, upper = comparison.bounds
    axes = np.stack([lower, upper]).T
    corners = np.stack([*(values.ravel() for values in np.meshgrid(*axes)), np.ones(8)], axis=1)
    seen = corners @ (np.array(perspective) @ comparison.shown.matrix).T
    if not np.isfinite(seen).all() or seen[:, 3].min() <= 0.0:
        return Framing()
    places = seen[:, :2] / seen[:, 3:]
    low, high = places.min(axis=0), places.max(axis=0)
    extents = np.maximum((high - low) / 2, 1e-6) * np.array(region)
    scale = float(np.clip(FILLS * (np.array(size) / extents).min(), LEAST_SCALE, LARGEST_SCALE))
    x, y = (low + high) / 2
    return Framing(float(x), float(y), scale)


def cut_of(snapshot: Snapshot, mesh: int, level: int, use_all: bool) -> TreeBoxes:
    """The boxes of a level and the leaves above it, which hold every triangle; or all boxes down to it."""
    if use_all:
        return snapshot.tree_boxes(mesh, last_level=level)
    return snapshot.tree_boxes(mesh, first_level=level, last_level=level, with_leaves_above=True)


class HalfPicture:
    """depth: of the deeper tree of the two, so that a level has one color in both.

    level: which is shown; count: boxes of it.
    """

    def __init__(self, comparison: Comparison, side: Side, depth: int) -> None:
        self.level = self.count = 0
        self._matrix = comparison.shown.matrix
        self._shaded = comparison.shaded
        self._side, self._depth = side, depth
        self._asked: tuple[Any, ...] = ()
        self._key: tuple[Any, ...] = ()
        self._object: gpu.types.GPUBatch | None = None
        self._boxes: gpu.types.GPUBatch | None = None
        self._has_width = False
        # No `GPUOffScreen`: making one lets go of the framebuffer that Blender draws into.
        self._texture: gpu.types.GPUTexture | None = None
        self._target: Any = None

    def draw(self, context: bpy.types.Context, rect: drawing.Rect, framing: Framing, settings: Any) -> None:
        """Draws into a part of the region that is being drawn."""
        from gpu_extras.presets import draw_texture_2d

        self._follow(settings)
        size = max(1, round(rect.right - rect.left)), max(1, round(rect.top - rect.bottom))
        region, view = context.region, context.region_data
        after = framing.matrix((region.width, region.height), size) @ np.array(view.window_matrix)
        before = np.array(view.view_matrix) @ self._matrix
        background = background_color()
        key = (size, after.tobytes(), before.tobytes(), self._asked, settings.use_in_front, background)
        if key != self._key or self._texture is None:
            self._key = key
            self._render(size, after, before, background, settings.use_in_front)
        draw_texture_2d(self._texture, (rect.left, rect.bottom), *size)

    def _follow(self, settings: Any) -> None:
        """Make the lines those that the settings ask for."""
        asked = (settings.level, settings.use_all_to_level, settings.color_by)
        if asked == self._asked:
            return
        self._asked = asked
        self.level = min(settings.level, self._side.depth)
        boxes = cut_of(self._side.snapshot, self._side.mesh, self.level, settings.use_all_to_level)
        self.count = len(boxes)
        self._has_width = self.count <= MOST_WIDE_BOXES
        lines = box_lines(replace(boxes.head(MOST_BOXES), depth=self._depth), settings.color_by)
        self._boxes = _wide_batch(lines) if self._has_width else _thin_batch(lines)

    def _render(
        self, size: tuple[int, int], after: Float64Array, before: Float64Array, background: Any, is_in_front: bool
    ) -> None:
        import gpu
        from mathutils import Matrix

        factor = LARGER if self._is_smooth else 1
        large = tuple(min(factor * length, gpu.capabilities.max_texture_size_get()) for length in size)
        if self._texture is None or (self._texture.width, self._texture.height) != large:
            self._texture = gpu.types.GPUTexture(large, format=PICTURE_FORMAT)
            depth = gpu.types.GPUTexture(large, format="DEPTH_COMPONENT32F")
            self._target = gpu.types.GPUFrameBuffer(depth_slot=depth, color_slots=(self._texture,))
        target = self._target
        with target.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            target.clear(color=_as_cleared(background), depth=1.0)
            gpu.matrix.load_matrix(Matrix(before.tolist()))
            gpu.matrix.load_projection_matrix(Matrix(after.tolist()))
            gpu.state.depth_test_set("LESS_EQUAL")
            gpu.state.depth_mask_set(True)
            self._draw_object()
            gpu.state.depth_mask_set(False)
            gpu.state.depth_test_set("NONE" if is_in_front else "LESS_EQUAL")
            gpu.state.blend_set("ALPHA")
            self._draw_boxes(large, factor)
            gpu.state.blend_set("NONE")
            gpu.state.depth_test_set("NONE")

    @property
    def _is_smooth(self) -> bool:
        triangles = 0 if self._shaded is None else len(self._shaded.triangles)
        return self._has_width and triangles <= MOST_SMOOTH_TRIANGLES

    def _draw_object(self) -> None:
        import gpu

        if self._shaded is None:
            return
        if self._object is None:
            self._object = _object_batch(self._shaded)
        self._object.draw(gpu.shader.from_builtin("SMOOTH_COLOR"))

    def _draw_boxes(self, size: tuple[int, ...], factor: int) -> None:
        import gpu

        if self._boxes is None:
            return
        if not self._has_width:
            self._boxes.draw(gpu.shader.from_builtin("FLAT_COLOR"))
            return
        shader = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR")
        shader.bind()
        shader.uniform_float("viewportSize", size)
        shader.uniform_float("lineWidth", factor * drawing.pixels(LINE_WIDTH))
        self._boxes.draw(shader)


def background_color() -> tuple[float, ...]:
    """Returns the background of the halves and around them, RGBA: the theme's 3D viewport."""
    return (*bpy.context.preferences.themes[0].view_3d.space.gradients.high_gradient, 1.0)


def _as_cleared(color: tuple[float, ...]) -> tuple[float, ...]:
    """Returns the clear value that shows a color of the theme: shaders convert theirs themselves."""
    from mathutils import Color

    return (*Color(color[:3]).from_srgb_to_scene_linear(), color[3]) if IS_ENCODED else color


def _object_batch(shaded: ShadedMesh) -> gpu.types.GPUBatch:
    return make_batch("TRIS", shaded.triangles, pos=shaded.positions, color=shaded.colors)


def _thin_batch(lines: BoxLines) -> gpu.types.GPUBatch:
    return make_batch("LINES", lines.lines, pos=lines.positions, color=lines.colors)


def _wide_batch(lines: BoxLines) -> gpu.types.GPUBatch:
    """Without indices, which the shader of wide lines does not take everywhere."""
    rows = lines.lines.ravel()
    return make_batch("LINES", pos=lines.positions[rows], color=lines.colors[rows])
