"""The camera's shutter: how an image shows what moves while it is open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .camera import Camera

Floats = npt.NDArray[np.float32]

# Of the table by which chances become times.
_TABLE_SIZE = 256
# Of the steps in which the area below a curve is added up.
_STEPS = 16 * _TABLE_SIZE


@dataclass(frozen=True, slots=True)
class Shutter:
    """While the shutter is open each sample of a pixel has a time of its own, so that what moves is blurred.

    Times are those of queries: 0 where the shutter opens, 1 where it has closed; how things move meanwhile is set by
    `Scene.set_instance_motion` and its like. Only the mode "preview" blurs, and only in "combined" and a denoiser's
    guides: all other modes and passes show the middle, time 0.5. Lights stand still.

    curve: how far it is open, at two or more evenly spaced times from 0 to 1, straight in between; numbers of 0 or
        more, not all 0. None, the default: fully all the time.
    rolling: the part of the time, 0 to 1, for which each row of pixels is seen; the first row at the beginning, the
        last one at the end, as by sensors that are read row by row. None, the default: all rows at once.
    cameras: two or more at evenly spaced times from 0 to 1, if the camera moves: between them it turns evenly and goes
        in a straight line, and so do the edges of its window. Their lenses, clipping ranges and borders are not looked
        at. Empty, the default: it stands still.
    frame_time: when shapes are those that the appearance's corner normals are of. Normals of meshes that change their
        shape are carried along with each triangle from there.
    blurs: False: "combined" shows the middle, too; for the pass "vector" alone. True is the default.

    Raises ValueError for other values.
    """

    curve: tuple[float, ...] | None = None
    rolling: float | None = None
    cameras: tuple[Camera, ...] = ()
    frame_time: float = 0.5
    blurs: bool = True

    def __post_init__(self) -> None:
        if self.curve is not None:
            object.__setattr__(self, "curve", _checked_curve(self.curve))
        if self.rolling is not None and not 0.0 <= self.rolling <= 1.0:
            raise ValueError(f"Shutter: rolling must be 0 to 1, or None for all rows at once, got {self.rolling}")
        if not 0.0 <= self.frame_time <= 1.0:
            raise ValueError(f"Shutter: frame_time must be 0 to 1, got {self.frame_time}")
        cameras = tuple(self.cameras)
        object.__setattr__(self, "cameras", cameras)
        for camera in cameras:
            if not isinstance(camera, Camera):
                raise ValueError(f"Shutter: cameras must be perfect_bvh.Camera, got {type(camera).__name__}")
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
        # Where it is shut nothing is added: such times are no one's, but for one step of the table across each gap.
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
