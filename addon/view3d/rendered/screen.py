"""A viewport's view of a picture: its camera, its position on the screen, its statistics."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ...image.plan import owners_of
from ...image.progressive import Canvas, Image, Place
from ...image.refinement import Refinement
from ...settings.modes import find_mode
from ...statistics.last_result import FrameStatistics, Source, remember

if TYPE_CHECKING:
    import gpu

    from ...extract.camera import Window
    from ...live.scene_sync import SceneSync
    from ...sync.records import CameraRecord

# The camera of a region of a 3D viewport, and the part of it that is traced.
#
# Modules that need the native engine are imported where they are used: without it the add-on must still register.


WHOLE: Window = (0.0, 1.0, 0.0, 1.0)


def camera_of(
    view: bpy.types.RegionView3D, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph
) -> tuple[CameraRecord | None, str | None]:
    """Returns a region's camera, None if nothing is visible through it; and why it is not as it should be."""
    from ...extract.camera import read_camera, read_frame, read_lens, read_region_view, spread_over_region

    scene = depsgraph.scene
    border = border_of(view, space, scene)
    camera = space.camera
    through_camera = view.view_perspective == "CAMERA" and camera is not None and camera.type == "CAMERA"
    if not through_camera:
        return read_region_view(view, border), None
    if camera.data.type != "PANO":
        record = read_region_view(view, border)
        # The pan and zoom of the view do not change the focus.
        return record and replace(record, lens=read_lens(camera.evaluated_get(depsgraph), record.matrix)), None
    record, complaint = read_camera(camera.evaluated_get(depsgraph), read_frame(scene))
    if record is None:
        # As Blender itself draws panoramas.
        return read_region_view(view, border), f"{complaint}. The view is shown in perspective"
    return spread_over_region(record, _camera_frame(view, camera, scene), border), None


def border_of(view: bpy.types.RegionView3D, space: bpy.types.SpaceView3D, scene: bpy.types.Scene) -> Window:
    """The part of the region to trace, as fractions: the render border of a camera view, or the viewport's own."""
    if view.view_perspective == "CAMERA":
        if not scene.render.use_border or space.camera is None or space.camera.type != "CAMERA":
            return WHOLE
        left, right, bottom, top = _camera_frame(view, space.camera, scene)
        border = scene.render
        return _clipped(
            left + border.border_min_x * (right - left),
            left + border.border_max_x * (right - left),
            bottom + border.border_min_y * (top - bottom),
            bottom + border.border_max_y * (top - bottom),
        )
    if not space.use_render_border:
        return WHOLE
    return _clipped(
        space.render_border_min_x, space.render_border_max_x, space.render_border_min_y, space.render_border_max_y
    )


def _clipped(left: float, right: float, bottom: float, top: float) -> Window:
    left, right, bottom, top = (min(max(edge, 0.0), 1.0) for edge in (left, right, bottom, top))
    return left, max(left, right), bottom, max(bottom, top)


def _camera_frame(view: bpy.types.RegionView3D, camera: bpy.types.Object, scene: bpy.types.Scene) -> Window:
    """Returns the camera's frame in a region that looks through it, as fractions."""
    corners = np.ones((4, 4))
    corners[:, :3] = [corner[:] for corner in camera.data.view_frame(scene=scene)]
    clip = corners @ np.array(view.window_matrix).T
    edges = clip[:, :2] / clip[:, 3:] * 0.5 + 0.5
    (left, bottom), (right, top) = edges.min(axis=0), edges.max(axis=0)
    return float(left), float(right), float(bottom), float(top)


# Screen image --------------------------------------------------------------------------------------------------------
# An image on its way to the screen: as textures in a region, in the colours that eyes get.


def picture_of(image: Image, mode: str) -> Image:
    """Returns the shown picture of an image: distances become greys, white nearby and black far away."""
    if not find_mode(mode).has_range:
        return image
    from perfect_bvh.render import depth_to_grey

    greys = depth_to_grey(image[..., 0])
    return np.stack([greys, greys, greys, image[..., 3]], axis=-1)


def texture_of(image: Image, mode: str) -> gpu.types.GPUTexture:
    """Returns the texture of an (H, W, 4) float32 image, row 0 on top."""
    import gpu

    image = picture_of(image, mode)
    height, width = image.shape[:2]
    flipped = np.ascontiguousarray(image[::-1], np.float32)  # a texture begins at the bottom
    buffer = gpu.types.Buffer("FLOAT", flipped.size, flipped.ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)


# Blender's own shader blurs a coarse image's pixels into each other, so that its noise becomes dots.
_VERTEX_SOURCE = "void main() { place = pos; gl_Position = matrix * vec4(corner + pos * size, 0.0, 1.0); }"
_FRAGMENT_SOURCE = "void main() { shown = texelFetch(image, ivec2(place * vec2(textureSize(image, 0))), 0); }"


@functools.cache
def _crisp_shader() -> gpu.types.GPUShader:
    import gpu

    between = gpu.types.GPUStageInterfaceInfo("perfect_bvh_crisp")
    between.smooth("VEC2", "place")
    info = gpu.types.GPUShaderCreateInfo()
    for kind, name in (("MAT4", "matrix"), ("VEC2", "corner"), ("VEC2", "size")):
        info.push_constant(kind, name)
    info.sampler(0, "FLOAT_2D", "image")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "shown")
    info.vertex_source(_VERTEX_SOURCE)
    info.fragment_source(_FRAGMENT_SOURCE)
    return gpu.shader.create_from_info(info)


def _draw_crisp(texture: gpu.types.GPUTexture, corner: tuple[float, float], size: tuple[float, float]) -> None:
    """Draws a texture's pixels as squares of one color. corner: the lower left one, in pixels of the region."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    shader = _crisp_shader()
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": ((0, 0), (1, 0), (0, 1), (1, 1))})
    shader.bind()
    shader.uniform_float("matrix", gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix())
    shader.uniform_float("corner", corner)
    shader.uniform_float("size", size)
    shader.uniform_sampler("image", texture)
    batch.draw(shader)


@dataclass(frozen=True, slots=True)
class ScreenPatch:
    """Some rows on the graphics card. number: of the change that it shows. shape: (rows, columns) of its pixels."""

    number: int
    shape: tuple[int, int]
    texture: gpu.types.GPUTexture


class ScreenImage:
    """A canvas as a region shows it. size: (width, height) of the image; it is stretched over the region."""

    def __init__(self) -> None:
        self.size = (1, 1)
        self.patches: dict[Place, ScreenPatch] = {}

    def fetch(self, canvas: Canvas, mode: str) -> None:
        """Fetches the new parts of a canvas, which must have some."""
        found = canvas.patches({place: patch.number for place, patch in self.patches.items()})
        before, self.patches, self.size = self.patches, {}, canvas.size
        for patch in found:
            if patch.pixels is None:
                self.patches[patch.place] = before[patch.place]
            else:
                texture = texture_of(patch.pixels, mode)
                self.patches[patch.place] = ScreenPatch(patch.number, patch.pixels.shape[:2], texture)


def draw_patches(
    engine: bpy.types.RenderEngine, scene: bpy.types.Scene, image: ScreenImage, region_size: tuple[int, int]
) -> None:
    """Draws each patch over its rows of the region. Blender applies the scene's view transform to them.

    region_size: (width, height) in pixels.
    """
    import gpu
    from gpu_extras.presets import draw_texture_2d

    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    wider, higher = (length / full for length, full in zip(region_size, image.size, strict=True))
    for place, patch in image.patches.items():
        rows, columns = (length * place.divisor for length in patch.shape)
        bottom = image.size[1] - place.rows[0] - rows
        corner, size = (0.0, bottom * higher), (columns * wider, rows * higher)
        if place.divisor > 1:
            _draw_crisp(patch.texture, corner, size)
        else:
            draw_texture_2d(patch.texture, corner, *size)
    engine.unbind_display_space_shader()
    gpu.state.blend_set("NONE")


# View statistics -----------------------------------------------------------------------------------------------------
# The cost of a view's image: the same figures as of a rendered frame, stored for the panels.


def remember_view(
    source: Source,
    sync: SceneSync,
    refinement: Refinement,
    scene: bpy.types.Scene,
    edits: int,
    *,
    has_own_mode: bool = False,
) -> None:
    """Stores for the panels the cost of an image of the scene in `sync`. edits: of the scene, when it was read."""
    remember(scene, view_statistics(source, sync, refinement, has_own_mode), edits)


def view_statistics(
    source: Source, sync: SceneSync, refinement: Refinement, has_own_mode: bool = False
) -> FrameStatistics:
    """Returns the statistics of a finished image of the scene in `sync`; the report is that of its last change."""
    assert sync.last_change is not None
    plan = refinement.view.plan
    return FrameStatistics(
        frame=sync.record.frame,
        size=plan.size,
        settings=plan.settings,
        report=sync.last_change,
        trace_milliseconds=refinement.seconds * 1e3,
        camera_rays=refinement.ray_count,
        samples=refinement.mean_samples,
        owners=owners_of(sync, refinement.costs or {}),
        source=source,
        has_own_mode=has_own_mode,
    )
