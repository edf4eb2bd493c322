"""What an image shows of motion: Blender's own settings, and those that Cycles keeps in the file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from perfect_bvh import Camera, Shutter

# Where the shutter opens, in shares of the time that it is open, from the frame.
_OPENS = {"START": 0.0, "CENTER": -0.5, "END": -1.0}
# Of the curve that says how far it is open: places that are looked up.
_CURVE_SIZE = 65


@dataclass(frozen=True, slots=True)
class ShutterSettings:
    """What of a scene's motion an image shows.

    begin, end: the part of the animation that is looked at, in frames from the current one. blurs: whether what moves
    meanwhile is blurred; if not, it is seen in the middle. curve, rolling: as `perfect_bvh.Shutter` takes them.
    """

    begin: float
    end: float
    blurs: bool = True
    curve: tuple[float, ...] | None = None
    rolling: float | None = None

    def make_shutter(self, cameras: tuple[Camera, ...]) -> Shutter:
        """cameras: at evenly spaced moments from begin to end; empty if the camera stands still."""
        import perfect_bvh

        frame_time = min(max(-self.begin / (self.end - self.begin), 0.0), 1.0)
        return perfect_bvh.Shutter(self.curve, self.rolling, cameras, frame_time, self.blurs)


# From the frame before to the one after: what the Vector pass tells of, as in Cycles.
NEIGHBOURS = ShutterSettings(-1.0, 1.0, blurs=False)


def rolling_shutter_settings(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """What holds those of a rolling shutter; None where Cycles is disabled."""
    return getattr(scene, "cycles", None)


def object_motion_settings(owner: bpy.types.Object) -> bpy.types.bpy_struct | None:
    """What holds an object's own switches and steps; None where Cycles is disabled."""
    return getattr(owner, "cycles", None)


def has_motion_blur(view_layer: bpy.types.ViewLayer, scene: bpy.types.Scene) -> bool:
    """Whether what moves is to be blurred in renders; a layer may be without, and a shutter of no time shows none."""
    render = scene.render
    return bool(render.use_motion_blur and render.motion_blur_shutter > 0.0 and view_layer.use_motion_blur)


def read_motion_blur(scene: bpy.types.Scene) -> ShutterSettings:
    """Of a render of `scene` that is to be blurred."""
    render = scene.render
    opens = _OPENS[render.motion_blur_position] * render.motion_blur_shutter
    return ShutterSettings(
        opens, opens + render.motion_blur_shutter, curve=_read_curve(scene), rolling=_read_rolling(scene)
    )


def _read_curve(scene: bpy.types.Scene) -> tuple[float, ...] | None:
    """None where the shutter is fully open all the time, and where it never opens."""
    mapping = scene.render.motion_blur_shutter_curve
    mapping.initialize()
    curve = mapping.curves[0]
    heights = tuple(max(mapping.evaluate(curve, place / (_CURVE_SIZE - 1)), 0.0) for place in range(_CURVE_SIZE))
    return None if min(heights) == max(heights) else heights


def _read_rolling(scene: bpy.types.Scene) -> float | None:
    settings = rolling_shutter_settings(scene)
    if settings is None or settings.rolling_shutter_type == "NONE":
        return None
    return float(settings.rolling_shutter_duration)
