"""One evaluated depsgraph through the moments of a shutter -> one `SceneRecord` with all that moves in it.

The frame is read, then each moment that anything asks for, once; and the frame once more when the scene is back there:
what its keys say counts then, and the next reading knows that nothing has happened since. What Blender has not
evaluated again at a moment is not read again, for which its changes are listened to meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from ..events.changes import listen, stop_listening
from ..sync.moments import MomentRecord
from ..sync.motion import add_motion
from ..sync.records import AttributeRequest, CameraRecord, SceneRecord
from .moment import read_moment
from .motion_settings import read_motion_settings
from .scene import ReadCache, read_scene
from .shutter import Shutter, place_of, places_of, stepping


def read_scene_in_time(
    depsgraph: Any,
    shutter: Shutter,
    attributes: AttributeRequest,
    cache: ReadCache,
    *,
    for_viewport: bool | None,
    camera: Any,
    size: tuple[int, int] | None,
    space: Any,
    progress: Callable[[float], object] | None = None,
) -> SceneRecord:
    """What `read_scene` reads, with the motion of all that moves within the shutter.

    progress: called with the share of the moments that were read; returning False raises `perfect_bvh.Cancelled`.
    """
    view = {"for_viewport": for_viewport, "size": size, "space": space}
    listener = _Listener()
    listen(listener)
    try:
        record = read_scene(depsgraph, attributes, camera=camera, cache=cache, in_time=True, **view)
        mover = _mover(depsgraph, camera)
        settings = read_motion_settings(record, mover, shutter.steps)
        here = place_of(depsgraph.scene)
        places = places_of(shutter, settings.times, here)
        away = {time: place for time, place in places.items() if place != here}
        if not away:
            return record
        moments: dict[Fraction, MomentRecord] = {}
        look_at = mover if camera is None else camera  # a marker at the frame may choose another camera
        with stepping(depsgraph, shutter) as go:
            for time, place in away.items():
                go(place)
                moments[time] = read_moment(depsgraph, attributes, camera=look_at, cache=cache, **view)
                _tell(progress, len(moments) / len(away))
        record = read_scene(depsgraph, attributes, camera=look_at, cache=cache, in_time=True, **view)
        settings = read_motion_settings(record, mover, shutter.steps).limited_to(places)
    finally:
        stop_listening(listener)
    own = MomentRecord(record.meshes, record.objects, record.instances, record.camera)
    return add_motion(record, {time: moments.get(time, own) for time in places}, settings)


class _Listener:
    """Of what is evaluated the log knows as long as anybody listens."""

    def on_change(self, what: str) -> None:
        """That the frame was changed is no news here."""

    def on_file_change(self) -> None:
        """The same."""


def _mover(depsgraph: Any, camera: Any) -> Any:
    """The original object whose motion the camera's is, None if it has none. camera: as `read_scene` takes it."""
    if isinstance(camera, CameraRecord):
        return None
    mover = depsgraph.scene.camera if camera is None or callable(camera) else camera
    return None if mover is None else mover.original


def _tell(progress: Callable[[float], object] | None, done: float) -> None:
    if progress is not None and progress(done) is False:
        import perfect_bvh

        raise perfect_bvh.Cancelled("the update was cancelled between two moments of the shutter")
