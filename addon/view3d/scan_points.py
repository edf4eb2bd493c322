"""The points of scans in their colours, drawn over 3D viewports that would not show these.

Solid shading draws point clouds in one colour, and this engine draws none yet. Each point is a disc of its size
in Blender, a radius nearer to the eye than its middle, so that it covers Blender's own drawing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy

from ..events.changes import FRAME_CHANGED, listen, stop_listening, watch_again
from ..extract.label_values import has_points
from ..scanning.point_data import may_have_points, read_points
from ..settings.scene_settings import ENGINE_NAME
from .drawing import make_batch
from .legend import DrawHandler

if TYPE_CHECKING:
    import gpu

    from ..scanning.point_data import Points

LEAST_SIZE = 2.0  # of a point, in pixels: smaller ones would be seen or not by chance

VERTEX_SOURCE = """
void main()
{
  vec3 to_eye = (eye.w > 0.5) ? normalize(eye.xyz - pos) : eye.xyz;
  gl_Position = matrix * vec4(pos + to_eye * radius * 1.02, 1.0);
  gl_PointSize = clamp(size * radius / gl_Position.w, least_size, 256.0);
  point_color = color;
}
"""
# Linear: drawings over viewports are encoded when they are written.
FRAGMENT_SOURCE = """
void main()
{
  vec2 place = gl_PointCoord * 2.0 - 1.0;
  float beyond = dot(place, place);
  if (beyond > 1.0) {
    discard;
  }
  float light = 0.6 + 0.4 * sqrt(1.0 - beyond);
  shown = vec4(point_color.rgb * light, 1.0);
}
"""


@dataclass(slots=True)
class _Kept:
    """The data read from a scan, and the batch that draws it."""

    points: Points
    batch: gpu.types.GPUBatch


class _Scans:
    """The drawing of each scan, by its data's session uid; read again where something may have changed.

    The list of scans is updated then, too: otherwise each redraw would have to check all objects.
    """

    def __init__(self) -> None:
        self._kept: dict[int, _Kept] = {}
        self._unsure: set[int] = set()
        self._found: dict[tuple[int, str], list[bpy.types.Object]] = {}  # by scene and view layer

    def on_change(self, what: str) -> None:
        """Notes a change of the data-blocks, or of anything else."""
        self._unsure |= self._kept.keys()
        if what != FRAME_CHANGED:  # changes by handlers are evaluated again
            self._found.clear()

    def on_file_change(self) -> None:
        self.forget()

    def forget(self) -> None:
        self._kept.clear()
        self._unsure.clear()
        self._found.clear()

    def objects_of(self, view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
        """Returns the objects that are scans, visible or not."""
        place = (view_layer.id_data.session_uid, view_layer.name)
        found = self._found.get(place)
        if found is None:
            found = self._found[place] = [obj for obj in view_layer.objects if has_points(obj)]
        return found

    def batch_of(self, obj: bpy.types.Object) -> gpu.types.GPUBatch:
        """Made again only if the points are others."""
        data: Any = obj.data
        uid = data.session_uid
        kept = self._kept.get(uid)
        if kept is None or uid in self._unsure:
            self._unsure.discard(uid)
            points = read_points(data)
            if kept is None or not kept.points.equals(points):
                columns = {"pos": points.positions, "radius": points.radii, "color": points.colors}
                kept = self._kept[uid] = _Kept(points, make_batch("POINTS", **columns))
        return kept.batch


_scans = _Scans()
_shader: Any = None


def shown_scans(context: bpy.types.Context) -> Iterator[bpy.types.Object]:
    """The scans whose points this viewport is to show, if Blender does not."""
    space: Any = context.space_data
    if not space.overlay.show_overlays or not may_have_points():
        return
    shading = space.shading.type
    if shading == "MATERIAL" or (shading == "RENDERED" and context.engine != ENGINE_NAME):
        return
    listen(_scans)
    watch_again()
    for obj in _scans.objects_of(context.view_layer):
        if has_points(obj) and obj.visible_get(view_layer=context.view_layer, viewport=space):
            yield obj


def _draw() -> None:
    context = bpy.context
    for obj in shown_scans(context):
        _draw_scan(context, obj)


def _draw_scan(context: bpy.types.Context, obj: bpy.types.Object) -> None:
    import gpu

    view: Any = context.region_data
    to_world = obj.matrix_world
    to_object = to_world.inverted_safe() @ view.view_matrix.inverted()
    eye = to_object.translation if view.is_perspective else to_object.to_3x3().col[2].normalized()
    height = view.window_matrix[1][1] * context.region.height
    shader = _point_shader()
    shader.bind()
    shader.uniform_float("matrix", view.perspective_matrix @ to_world)
    shader.uniform_float("eye", (*eye, 1.0 if view.is_perspective else 0.0))
    shader.uniform_float("size", height * to_world.median_scale)
    shader.uniform_float("least_size", LEAST_SIZE)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.program_point_size_set(True)
    try:
        _scans.batch_of(obj).draw(shader)
    finally:
        gpu.state.program_point_size_set(False)
        gpu.state.depth_test_set("NONE")


def _point_shader() -> Any:
    global _shader
    if _shader is None:
        import gpu

        between = gpu.types.GPUStageInterfaceInfo("perfect_bvh_scan_points")
        between.flat("VEC4", "point_color")
        info = gpu.types.GPUShaderCreateInfo()
        for kind, name in (("MAT4", "matrix"), ("VEC4", "eye"), ("FLOAT", "size"), ("FLOAT", "least_size")):
            info.push_constant(kind, name)
        for slot, (kind, name) in enumerate((("VEC3", "pos"), ("FLOAT", "radius"), ("VEC4", "color"))):
            info.vertex_in(slot, kind, name)
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "shown")
        info.vertex_source(VERTEX_SOURCE)
        info.fragment_source(FRAGMENT_SOURCE)
        _shader = gpu.shader.create_from_info(info)
    return _shader


_handler = DrawHandler(_draw, "POST_VIEW")


def register() -> None:
    """Draw over every 3D viewport from now on, where there is a scan."""
    _handler.add()


def unregister() -> None:
    """Stop drawing, and drop the data."""
    global _shader
    _handler.remove()
    _shader = None
    stop_listening(_scans)
    _scans.forget()
