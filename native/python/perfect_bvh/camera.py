"""Cameras: the data that the renderer needs to turn a pixel into a ray."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from ._checks import check_choice, check_count, check_kind, check_number

Float64Array = npt.NDArray[np.float64]
Projection = Literal["perspective", "orthographic", "equirectangular"]
_MOST_BLADES = 1000


@dataclass(frozen=True, slots=True)
class Lens:
    """A thin lens: points at `focus_distance` are sharp, all others are blurred into the aperture's shape.

    A point at distance d spreads over a disk of radius `radius * abs(d / focus_distance - 1)` around itself, in world
    units, and covers its surroundings by that much. Only the mode "preview" uses lenses, and only for "combined". All
    other modes and passes show the view through the middle of the lens.

    Attributes:
        radius: Of the aperture, in world units: the focal length divided by twice the f-number. A polygon's corners lie
            at this distance from the middle.
        focus_distance: In world units, along the view axis; along the ray of a panorama.
        blades: Corners of the aperture, 3 or more; 0 for a circle.
        rotation: Of the corners about the view axis, in radians. At 0 an edge is on the right.
        ratio: Of an anamorphic lens: its aperture is narrower than high by this factor.
    """

    radius: float
    focus_distance: float
    blades: int = 0
    rotation: float = 0.0
    ratio: float = 1.0

    def __post_init__(self) -> None:
        for name in ("radius", "focus_distance", "ratio"):
            check_number("Lens", name, getattr(self, name), 0.0, above=True)
        check_number("Lens", "rotation", self.rotation)
        object.__setattr__(self, "blades", check_count("Lens", "blades", self.blades, 0))
        if self.blades != 0 and not 3 <= self.blades <= _MOST_BLADES:
            raise ValueError(f"Lens: blades must be 0 for a circle, or 3 to {_MOST_BLADES}; got {self.blades}")


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that looks along its own -Z with +Y up, as Blender's does.

    `window` contains sensor size, focal length, shift, sensor fit and pixel aspect, so the renderer has a single rule:
    pixel centres divide the window evenly.

    Attributes:
        matrix: (4, 4) float64, camera to world; any scale in it is removed, as Blender does.
        window: (left, right, bottom, top) of the whole frame: for a perspective camera, on the plane one unit in front
            of it (so tangents); for an orthographic one, in world units; for an equirectangular one, in radians:
            longitudes to the right of the view axis, latitudes above it.
        clip_start, clip_end: Distances along the view axis (not along the ray), in world units. A panorama has no such
            axis: its clip distances and its depth are distances from the camera.
        border: (left, right, bottom, top) as fractions of the frame, 0 to 1. Pixels outside it are not traced and stay
            zero; the image keeps the size of the whole frame.
        lens: None for a pinhole, through which everything is sharp.
    """

    matrix: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    window: tuple[float, float, float, float] = (-0.36, 0.36, -0.2025, 0.2025)
    projection: Projection = "perspective"
    clip_start: float = 0.1
    clip_end: float = 1000.0
    border: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 1.0)
    lens: Lens | None = None

    def __post_init__(self) -> None:
        matrix = np.ascontiguousarray(self.matrix, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError(f"Camera: matrix must be a finite (4, 4) array, got shape {matrix.shape}")
        object.__setattr__(self, "matrix", matrix)
        left, right, bottom, top = self.window
        if not (left < right and bottom < top and all(map(math.isfinite, self.window))):
            raise ValueError(f"Camera: window must be finite (left < right, bottom < top), got {self.window}")
        check_choice("Camera", "projection", self.projection, get_args(Projection))
        if not 0.0 <= self.clip_start < self.clip_end:
            raise ValueError(
                f"Camera: clip_start must be at least 0 and below clip_end, got {self.clip_start} and {self.clip_end}"
            )
        left, right, bottom, top = self.border
        if not (0.0 <= left <= right <= 1.0 and 0.0 <= bottom <= top <= 1.0):
            raise ValueError(f"Camera: border must be fractions (left <= right, bottom <= top), got {self.border}")

    def pixel_rays(self, size: tuple[int, int], rows: slice | None = None) -> tuple[Float64Array, Float64Array]:
        """Returns the rays through the centres of an image's pixels, as the renderer casts them for a pinhole camera.

        Args:
            size: (width, height) of the whole image.
            rows: Some of its rows, 0 on top; None for all.

        Returns:
            Origins and directions, (H, W, 3) float64 each, in the world. A direction's length along the view axis is 1,
            so that t is the depth; in a panorama its length is 1.

        Raises:
            ValueError: For a matrix with an axis of no length.
        """
        width, height = (check_count("pixel_rays", "size", length, 1) for length in size)
        first, end, step = (slice(None) if rows is None else rows).indices(height)
        lengths = np.linalg.norm(self.matrix[:3, :3], axis=0)
        if not lengths.all():
            raise ValueError("pixel_rays: an axis of the camera's matrix has no length; give it another scale than 0")
        axes = self.matrix[:3, :3] / lengths
        right, up, ahead = axes[:, 0], axes[:, 1], -axes[:, 2]
        left, top = self.window[0], self.window[3]
        x = (np.arange(width) + 0.5) * ((self.window[1] - left) / width)
        y = (np.arange(first, end, step) + 0.5) * ((top - self.window[2]) / height)
        shape = (len(y), width, 3)
        origin = self.matrix[:3, 3]
        if self.projection == "equirectangular":
            longitudes, latitudes = left + x, (top - y)[:, None, None]
            flat = np.sin(longitudes)[:, None] * right + np.cos(longitudes)[:, None] * ahead
            return np.broadcast_to(origin, shape), np.cos(latitudes) * flat + np.sin(latitudes) * up
        offsets = right * x[:, None] - up * y[:, None, None]
        corner = right * left + up * top
        if self.projection == "orthographic":
            return corner + origin + offsets, np.broadcast_to(ahead, shape)
        return np.broadcast_to(origin, shape), corner + ahead + offsets

    @classmethod
    def look_at(
        cls,
        position: npt.ArrayLike,
        target: npt.ArrayLike,
        *,
        up: npt.ArrayLike = (0.0, 0.0, 1.0),
        angle: float = math.radians(50.0),
        aspect: float = 16.0 / 9.0,
        clip_start: float = 0.1,
        clip_end: float = 1000.0,
    ) -> Camera:
        """Returns a perspective camera at `position` that looks at `target`.

        Args:
            angle: Horizontal field of view in radians.
            aspect: Width over height of the image.
        """
        eye = np.asarray(position, dtype=np.float64)
        backward = eye - np.asarray(target, dtype=np.float64)
        length = float(np.linalg.norm(backward))
        if not length > 0.0:
            raise ValueError("Camera.look_at: position and target must differ")
        backward /= length
        right = np.cross(np.asarray(up, dtype=np.float64), backward)
        if float(np.linalg.norm(right)) < 1e-9:  # looking straight along `up`: any right vector works
            right = np.cross((0.0, 1.0, 0.0) if abs(backward[1]) < 0.9 else (1.0, 0.0, 0.0), backward)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(backward, right), backward, eye
        half_width = math.tan(angle / 2.0)
        half_height = half_width / aspect
        return cls(
            matrix=matrix,
            window=(-half_width, half_width, -half_height, half_height),
            clip_start=clip_start,
            clip_end=clip_end,
        )


# Shutter -------------------------------------------------------------------------------------------------------------
# The camera's shutter: how an image shows motion while it is open.


Floats = npt.NDArray[np.float32]

# Size of the table that maps chances to times.
_TABLE_SIZE = 256
# The number of steps in which the area below a curve is integrated.
_STEPS = 16 * _TABLE_SIZE


@dataclass(frozen=True, slots=True)
class Shutter:
    """The time that the camera's shutter is open. Each sample of a pixel has its own time, so that motion is blurred.

    Times are those of queries: 0 where the shutter opens, 1 where it has closed. `Scene.set_instance_motion` and the
    other motion methods set how objects move in between. Only the mode "preview" blurs, and only in "combined" and a
    denoiser's guides. All other modes and passes show the middle, time 0.5. Lights do not move.

    Attributes:
        curve: How far the shutter is open, at two or more evenly spaced times from 0 to 1, linear in between; numbers
            of 0 or more, not all 0. None, the default: fully open all the time.
        rolling: The part of the time, 0 to 1, for which each row of pixels is exposed: the first row at the beginning,
            the last one at the end, as for sensors that are read row by row. None, the default: all rows at once.
        cameras: For a moving camera, two or more at evenly spaced times from 0 to 1. Between them rotations turn
            evenly, and positions and the edges of the window are interpolated linearly. Their lenses, clipping ranges
            and borders are ignored. Empty, the default: the camera does not move.
        frame_time: The time of the shapes that the appearance's corner normals belong to. From there, normals of meshes
            that change their shape follow each triangle.
        blurs: False: "combined" shows the middle, too; for the pass "vector" alone. True is the default.

    Raises:
        ValueError: For other values.
    """

    curve: tuple[float, ...] | None = None
    rolling: float | None = None
    cameras: tuple[Camera, ...] = ()
    frame_time: float = 0.5
    blurs: bool = True

    def __post_init__(self) -> None:
        if self.curve is not None:
            object.__setattr__(self, "curve", _checked_curve(self.curve))
        if self.rolling is not None:  # for all rows at once
            check_number("Shutter", "rolling", self.rolling, 0.0, 1.0)
        check_number("Shutter", "frame_time", self.frame_time, 0.0, 1.0)
        cameras = tuple(self.cameras)
        object.__setattr__(self, "cameras", cameras)
        for number, camera in enumerate(cameras):
            check_kind("Shutter", f"cameras[{number}]", camera, Camera)
        if len(cameras) == 1 or len({camera.projection for camera in cameras}) > 1:
            raise ValueError(
                "Shutter: cameras must be none, or two or more of one projection, got "
                + ", ".join(camera.projection for camera in cameras)
            )

    def times(self) -> Floats:
        """(N,) float32: the times below which the shutter has let in 0 to 1 of all light, evenly; empty if evenly."""
        if self.curve is None:
            return np.empty(0, np.float32)
        given = np.linspace(0.0, 1.0, len(self.curve))
        places = np.union1d(np.linspace(0.0, 1.0, _STEPS + 1), given)
        heights = np.interp(places, given, self.curve)
        light = np.concatenate([[0.0], np.cumsum((heights[1:] + heights[:-1]) * np.diff(places))])
        # While the shutter is closed no light is added: no sample gets such times, except one table step across each
        # gap.
        opens = int(np.flatnonzero(light > 0.0)[0]) - 1
        light, places = light[opens:], places[opens:]
        rises = np.concatenate([[True], np.diff(light) > 0.0])
        table = np.interp(np.linspace(0.0, light[-1], _TABLE_SIZE), light[rises], places[rises])
        times: Floats = table.astype(np.float32)
        return times


def _checked_curve(values: npt.ArrayLike) -> tuple[float, ...]:
    curve = np.asarray(values, np.float64)
    if curve.ndim != 1 or len(curve) < 2 or not np.isfinite(curve).all() or (curve < 0.0).any() or not curve.any():
        raise ValueError(
            "Shutter: curve must be two or more finite numbers, 0 or more and not all 0, or None for an even one; "
            f"got {values!r}"
        )
    return tuple((curve / curve.max()).tolist())


# Camera arguments ----------------------------------------------------------------------------------------------------
# Cameras and shutters as the native module takes them.


def camera_arguments(function: str, camera: Camera) -> dict[str, Any]:
    """Returns a camera's fields; they were checked when it was made."""
    check_kind(function, "camera", camera, Camera)
    return {
        "matrix": camera.matrix,
        "window": tuple(map(float, camera.window)),
        "projection": camera.projection,
        "clip_start": float(camera.clip_start),
        "clip_end": float(camera.clip_end),
        "border": tuple(map(float, camera.border)),
        "lens": None if camera.lens is None else asdict(camera.lens),
    }


def shutter_arguments(function: str, projection: str, shutter: Shutter | None) -> dict[str, Any] | None:
    """Returns a shutter's fields; they were checked when it was made."""
    if shutter is None:
        return None
    check_kind(function, "shutter", shutter, Shutter)
    for moved in shutter.cameras:
        if moved.projection != projection:
            raise ValueError(
                f"{function}: shutter.cameras must be {projection} like the camera, got {moved.projection}"
            )
    return {
        "times": shutter.times(),
        "rolling": shutter.rolling,
        "frame_time": shutter.frame_time,
        "blurs": bool(shutter.blurs),
        "cameras": [camera_arguments(function, moved) for moved in shutter.cameras],
    }
