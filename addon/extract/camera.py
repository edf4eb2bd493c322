"""Blender's camera settings -> one view window, by the rules that Blender's own projection follows."""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..sync.records import CameraRecord, Float64Array, LensRecord

Window = tuple[float, float, float, float]

# Of f-numbers and distances, so that nothing is divided by zero.
SMALLEST_SETTING = 1e-5

_PROJECTIONS = {"PERSP": "perspective", "ORTHO": "orthographic", "PANO": "equirectangular"}


@dataclass(frozen=True, slots=True)
class Frame:
    """The image that a camera fills: pixels and their shape, and the part of it to trace.

    border: (left, right, bottom, top) as fractions of the frame.
    """

    width: int
    height: int
    aspect_x: float = 1.0
    aspect_y: float = 1.0
    border: Window = (0.0, 1.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Eye:
    """One eye of a stereo camera. matrix: (4, 4), to world. shift_x: instead of the camera's own."""

    matrix: Float64Array
    shift_x: float


def read_frame(scene: Any, size: tuple[int, int] | Frame | None = None) -> Frame:
    """Reads the frame of a scene's render settings.

    size: (width, height) in pixels instead of the scene's own, or a frame that was read before, which is returned.

    Raises ValueError for a size that is none.
    """
    if isinstance(size, Frame):
        return size
    render = scene.render
    size = _resolution(render) if size is None else _checked(size)
    border = (0.0, 1.0, 0.0, 1.0)
    if render.use_border:
        border = (render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y)
    return Frame(max(1, size[0]), max(1, size[1]), render.pixel_aspect_x, render.pixel_aspect_y, border)


def check_resolution(scene: Any) -> None:
    """Raises ValueError where the scene's percentage leaves no pixel, of which Blender makes no image."""
    render, size = scene.render, _resolution(scene.render)
    if min(size) < 1:
        raise ValueError(
            f"scene {scene.name!r}: {render.resolution_x} x {render.resolution_y} pixels at "
            f"{render.resolution_percentage} % are {size[0]} x {size[1]}, which is no image; choose a larger resolution"
        )


def _resolution(render: Any) -> tuple[int, int]:
    """Integer arithmetic, as Blender's: 1081 pixels at 50 % are 540."""
    percentage = render.resolution_percentage
    return render.resolution_x * percentage // 100, render.resolution_y * percentage // 100


def _checked(size: Any) -> tuple[int, int]:
    try:
        width, height = (operator.index(side) for side in size)
    except (TypeError, ValueError):
        width = height = 0
    if min(width, height) < 1:
        raise ValueError(f"size must be (width, height), two integers of 1 or more, got {size!r}")
    return width, height


def has_camera(scene: Any) -> bool:
    """Whether a scene has a camera, or a marker that chooses one."""
    return scene.camera is not None or any(marker.camera for marker in scene.timeline_markers)


def is_cropped(scene: Any) -> bool:
    """Whether an image holds the render region alone."""
    return bool(scene.render.use_border and scene.render.use_crop_to_border)


def border_pixels(border: Window, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Returns (left, right, bottom, top) of a border in fractions, in pixels from the lower left, as Blender rounds."""
    width, height = np.float32(size[0]), np.float32(size[1])
    left, right, bottom, top = (np.float32(edge) for edge in border)
    return int(left * width), int(right * width), int(bottom * height), int(top * height)


def image_window(scene: Any, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Returns the part of a frame that an image of a scene holds, as `border_pixels` has it: all, unless it is cropped.

    Raises ValueError if that is no pixel.
    """
    if not is_cropped(scene):
        return 0, size[0], 0, size[1]
    left, right, bottom, top = border_pixels(read_frame(scene, size).border, size)
    if left >= right or bottom >= top:
        raise ValueError(
            f"the render region of scene {scene.name!r} holds no pixel of {size[0]} x {size[1]}; draw a larger one, or "
            "turn off Crop to Render Region"
        )
    return left, right, bottom, top


def read_camera(camera: Any, frame: Frame, eye: Eye | None = None) -> tuple[CameraRecord | None, str | None]:
    """Reads an evaluated camera object. Returns the record, or None and a sentence that says why not."""
    if camera is None:
        return None, None
    if camera.type != "CAMERA":
        return None, f"The active camera {camera.name!r} is a {camera.type.lower()} object: its view cannot be read"
    data = camera.data
    complaint = _find_complaint(data)
    if complaint is not None:
        return None, f"Camera {camera.name!r} {complaint}"
    matrix = without_scale(np.array(camera.matrix_world, dtype=np.float64) if eye is None else eye.matrix)
    if matrix is None:
        return None, f"Camera {camera.name!r} has no usable matrix: an axis is scaled to zero or not finite"
    shift_x = data.shift_x if eye is None else eye.shift_x
    record = CameraRecord(
        matrix=matrix,
        window=_panorama_window(data, shift_x) if data.type == "PANO" else _view_window(data, frame, shift_x),
        projection=_PROJECTIONS[data.type],
        clip_start=data.clip_start,
        clip_end=data.clip_end,
        border=frame.border,
        lens=read_lens(camera, matrix),
    )
    return record, None


def read_lens(camera: Any, matrix: Float64Array) -> LensRecord | None:
    """Read the lens of an evaluated camera object; None if everything is sharp. matrix: (4, 4), the camera's pose."""
    data = camera.data
    dof = data.dof
    if not dof.use_dof:
        return None
    # Focal lengths are in millimetres; an orthographic camera has none, and counts as one of a metre.
    focal_length = 1.0 if data.type == "ORTHO" else data.lens * 1e-3
    return LensRecord(
        radius=focal_length / (2.0 * max(dof.aperture_fstop, SMALLEST_SETTING)),
        focus_distance=max(_focus_distance(dof, matrix), SMALLEST_SETTING),
        blades=dof.aperture_blades if dof.aperture_blades >= 3 else 0,
        rotation=dof.aperture_rotation,
        ratio=dof.aperture_ratio,
    )


def _focus_distance(dof: Any, matrix: Float64Array) -> float:
    """Along the view axis, to the object or bone in focus if there is one."""
    focus = dof.focus_object
    if focus is None:
        return float(dof.focus_distance)
    place = focus.matrix_world
    bone = focus.pose.bones.get(dof.focus_subtarget) if focus.pose is not None else None
    if bone is not None:
        place = place @ bone.matrix
    return abs(float(np.dot(matrix[:3, 2], matrix[:3, 3] - np.array(place.translation, np.float64))))


def panorama_settings(data: Any) -> Any:
    """Returns the owner of a camera's panorama settings: itself since Blender 5.0, earlier Cycles' data, or None."""
    return data if hasattr(data, "panorama_type") else getattr(data, "cycles", None)


def _find_complaint(data: Any) -> str | None:
    """Why a camera of these settings cannot be rendered, as a sentence without its subject."""
    if data.type not in _PROJECTIONS:
        return f"is of type {data.type.title()}: only perspective, orthographic and panoramic ones can be rendered"
    if data.type == "PANO":
        settings = panorama_settings(data)
        if settings is None:
            return "is panoramic: this Blender keeps its settings in Cycles, which is disabled in the preferences"
        if settings.panorama_type != "EQUIRECTANGULAR":
            kind = settings.panorama_type.replace("_", " ").title()
            return f"cannot be a {kind} panorama: choose Equirectangular as its Panorama Type"
        if not (settings.longitude_min < settings.longitude_max and settings.latitude_min < settings.latitude_max):
            return "sees nothing: the minimum longitude and latitude must be below the maximum"
    if not data.clip_start < data.clip_end:
        return f"clips everything: its start {data.clip_start:g} is not below its end"
    return None


def _panorama_window(data: Any, shift_x: float) -> Window:
    """(left, right, bottom, top) in radians; the shift counts in widths and heights of the frame, as in Cycles."""
    settings = panorama_settings(data)
    left, right, bottom, top = (
        getattr(settings, name) for name in ("longitude_min", "longitude_max", "latitude_min", "latitude_max")
    )
    x, y = shift_x * (right - left), data.shift_y * (top - bottom)
    return left + x, right + x, bottom + y, top + y


def _view_window(data: Any, frame: Frame, shift_x: float) -> Window:
    """(left, right, bottom, top): tangents for a perspective camera, world units for an orthographic one."""
    aspect = frame.aspect_y / frame.aspect_x  # height of a pixel in pixel widths
    width, height = float(frame.width), float(frame.height) * aspect
    is_horizontal = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and width >= height)
    # With AUTO the sensor's width is meant even where it lies along the height of the image.
    sensor = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    extent = sensor / data.lens if data.type == "PERSP" else data.ortho_scale
    fitted = width if is_horizontal else height
    scale = extent / fitted
    middle_x, middle_y = shift_x * fitted, data.shift_y * fitted
    return (
        (middle_x - width / 2) * scale,
        (middle_x + width / 2) * scale,
        (middle_y - height / 2) * scale,
        (middle_y + height / 2) * scale,
    )


def read_region_view(view: Any, border: Window = (0.0, 1.0, 0.0, 1.0)) -> CameraRecord | None:
    """The camera of a 3D viewport, from its `RegionView3D`: free views and camera views with zoom and offset alike."""
    projection = np.array(view.window_matrix, dtype=np.float64)
    matrix = without_scale(np.linalg.inv(np.array(view.view_matrix, dtype=np.float64)))
    return None if matrix is None else camera_from_projection(matrix, projection, border)


def spread_over_region(camera: CameraRecord, frame: Window, border: Window) -> CameraRecord:
    """A panorama as a viewport shows it that looks through its camera.

    frame: where the camera's picture lies in the region, (left, right, bottom, top) as fractions of it, and border: the
    part of the region to trace. Nothing is seen outside the picture.
    """
    left, right, bottom, top = frame
    west, east, south, north = camera.window
    across, up = (east - west) / (right - left), (north - south) / (top - bottom)
    low_x, high_x, low_y, high_y = border
    return replace(
        camera,
        window=(west - left * across, west + (1 - left) * across, south - bottom * up, south + (1 - bottom) * up),
        border=(
            max(left, low_x),
            max(left, low_x, min(right, high_x)),
            max(bottom, low_y),
            max(bottom, low_y, min(top, high_y)),
        ),
    )


def camera_from_projection(matrix: Float64Array, projection: Float64Array, border: Window) -> CameraRecord:
    """A camera from its matrix (camera to world) and an OpenGL projection matrix (4, 4)."""
    p = projection
    is_perspective = bool(p[3, 3] == 0.0)
    if is_perspective:
        left, right = (p[0, 2] - 1.0) / p[0, 0], (p[0, 2] + 1.0) / p[0, 0]
        bottom, top = (p[1, 2] - 1.0) / p[1, 1], (p[1, 2] + 1.0) / p[1, 1]
        # Blender's matrix is of float32, to which an end ten million times as far away as the start is at infinity.
        clip_start, clip_end = p[2, 3] / (p[2, 2] - 1.0), p[2, 3] / (p[2, 2] + 1.0) if p[2, 2] < -1.0 else np.inf
    else:
        left, right = (-1.0 - p[0, 3]) / p[0, 0], (1.0 - p[0, 3]) / p[0, 0]
        bottom, top = (-1.0 - p[1, 3]) / p[1, 1], (1.0 - p[1, 3]) / p[1, 1]
        clip_start, clip_end = (1.0 + p[2, 3]) / p[2, 2], (p[2, 3] - 1.0) / p[2, 2]
    if not is_perspective and clip_start < 0.0:
        # An orthographic viewport also shows objects behind its plane: step back to its clip start.
        matrix = matrix.copy()
        matrix[:3, 3] -= matrix[:3, 2] * clip_start
        clip_start, clip_end = 0.0, clip_end - clip_start
    return CameraRecord(
        matrix=matrix,
        window=(float(left), float(right), float(bottom), float(top)),
        projection="perspective" if is_perspective else "orthographic",
        clip_start=float(clip_start),
        clip_end=float(clip_end),
        border=border,
    )


def without_scale(matrix: Float64Array) -> Float64Array | None:
    """The matrix with axes of length one, as Blender treats cameras; None if an axis has no direction."""
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.isfinite(matrix).all() or not (lengths > 0.0).all():
        return None
    unscaled = matrix.copy()
    unscaled[:3, :3] /= lengths
    return unscaled
