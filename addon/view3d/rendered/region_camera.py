"""What a region of a 3D viewport looks through, and the part of it that is traced.

What needs the native engine is imported where it is used: without it the add-on must still register.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np

if TYPE_CHECKING:
    from ...extract.camera import Window
    from ...sync.records import CameraRecord

WHOLE: Window = (0.0, 1.0, 0.0, 1.0)


def camera_of(
    view: bpy.types.RegionView3D, space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph
) -> tuple[CameraRecord | None, str | None]:
    """What a region looks through, None if nothing can be seen through it; and why that is not what it should be."""
    from ...extract.camera import read_camera, read_frame, read_lens, read_region_view, spread_over_region

    scene = depsgraph.scene
    border = border_of(view, space, scene)
    camera = space.camera
    through_camera = view.view_perspective == "CAMERA" and camera is not None and camera.type == "CAMERA"
    if not through_camera:
        return read_region_view(view, border), None
    if camera.data.type != "PANO":
        record = read_region_view(view, border)
        # What Blender moves or zooms the view by does not change what is in focus.
        return record and replace(record, lens=read_lens(camera.evaluated_get(depsgraph), record.matrix)), None
    record, complaint = read_camera(camera.evaluated_get(depsgraph), read_frame(scene))
    if record is None:
        # As Blender itself draws panoramas.
        return read_region_view(view, border), f"{complaint}. It is shown in perspective"
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
    """Where a camera's frame lies in a region that looks through it, as fractions."""
    corners = np.ones((4, 4))
    corners[:, :3] = [corner[:] for corner in camera.data.view_frame(scene=scene)]
    clip = corners @ np.array(view.window_matrix).T
    edges = clip[:, :2] / clip[:, 3:] * 0.5 + 0.5
    (left, bottom), (right, top) = edges.min(axis=0), edges.max(axis=0)
    return float(left), float(right), float(bottom), float(top)
