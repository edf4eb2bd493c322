"""One evaluated depsgraph through the moments of a shutter -> one `SceneRecord` with all that moves in it.

The frame is read, then each moment that anything asks for, once; and the frame once more when the scene is back there:
what its keys say counts then, and the next reading knows that nothing has happened since. What Blender has not
evaluated again at a moment is not read again, for which its changes are listened to meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from typing import Any

import bpy
import numpy as np

from ..events.changes import listen, stop_listening, watched_evaluations
from ..events.evaluation_log import EvaluationLog
from ..sync.moments import MomentRecord, MotionSettings
from ..sync.motion import add_motion
from ..sync.records import AttributeRequest, CameraRecord, InstanceRecords, MeshRecord, ObjectRecord, SceneRecord
from .camera import read_frame
from .geometry.groups import AdaptiveSubdivision, GroupTable
from .geometry.instances import read_instances
from .geometry.mesh_table import MeshTable
from .looks.materials import MaterialReader
from .read_again import read_again
from .scene import ReadCache, read_any_camera, read_scene, shared_reader
from .shutter import Shutter, place_of, places_of, stepping
from .visibility import VisibilityReader, outside_viewports

_DEFAULT_STEPS = 3  # of Cycles: one at either end of the shutter, one in its middle
_MOST_STEPS = 129  # of Cycles, beyond which it asks for no more

Things = tuple[tuple[MeshRecord, ...], tuple[ObjectRecord, ...], InstanceRecords]


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


def read_moment(
    depsgraph: Any,
    attributes: AttributeRequest,
    cache: ReadCache,
    *,
    for_viewport: bool | None,
    camera: Any,
    size: tuple[int, int] | None,
    space: Any,
) -> MomentRecord:
    """Where things are in an evaluated depsgraph: of a mesh that is read again no attribute is.

    cache: of the frame's reading, with these attributes; it stays as it is. The rest is as for `read_scene`.
    """
    if for_viewport is None:
        for_viewport = depsgraph.mode == "VIEWPORT"
    log = watched_evaluations(depsgraph)
    visibility = VisibilityReader(depsgraph, for_viewport, space)
    with outside_viewports() if for_viewport else nullcontext():
        parts = read_again(cache.plain, depsgraph, attributes, visibility, log, cache.images)
        if parts is not None:
            meshes, objects, instances = parts.meshes, parts.objects, parts.instances
        else:
            meshes, objects, instances = _read_things(depsgraph, attributes, visibility, cache, log)
    meshes = replace(cache.hair).shaped(meshes, depsgraph.scene)
    record, complaint = read_any_camera(depsgraph, camera, read_frame(depsgraph.scene_eval, size))
    return MomentRecord(meshes, objects, instances, record, complaint)


def _read_things(
    depsgraph: Any,
    attributes: AttributeRequest,
    visibility: VisibilityReader,
    cache: ReadCache,
    log: EvaluationLog | None,
) -> Things:
    meshes = MeshTable(depsgraph, attributes, shared_reader, cache.meshes, log, only_places=True)
    materials = MaterialReader(depsgraph.view_layer_eval.material_override)
    groups = GroupTable(meshes, materials, visibility, AdaptiveSubdivision(depsgraph))
    instances = read_instances(depsgraph, groups, shared_reader, replace(cache.instances))
    return tuple(meshes.records), tuple(groups.objects.records), instances


def read_motion_settings(record: SceneRecord, camera: Any, steps: int | None) -> MotionSettings:
    """Read what users ask of motion blur: by Cycles' own switches and steps, where Cycles is enabled.

    record: of a scene with its objects. camera: the original object, None if it is none or cannot move.
    steps: of what has no number of its own; None: Cycles' default.
    """
    count = _DEFAULT_STEPS if steps is None else steps
    if not hasattr(bpy.types.Object, "cycles"):
        objects = [(count, True)] * len(record.objects)
        of_camera = count
    else:
        originals = {obj.session_uid: obj for obj in bpy.data.objects}
        found = (originals.get(obj.session_uid) for obj in record.objects)
        objects = [(count, True) if obj is None else _of_object(obj, count, steps is not None) for obj in found]
        of_camera = 0 if camera is None else _of_object(camera, count, steps is not None)[0]
    return MotionSettings(
        steps=np.array([row[0] for row in objects], np.int32),
        deforms=np.array([row[1] for row in objects], np.bool_),
        camera_steps=0 if camera is None else of_camera,
        camera_name="" if camera is None else camera.name,
        camera_uid=0 if camera is None else camera.session_uid,
    )


def _of_object(obj: Any, count: int, is_asked: bool) -> tuple[int, bool]:
    """Its steps, 0 if it is not to be blurred, and whether its shape may change. is_asked: whether count is no default.

    Who never set the steps has said nothing of them.
    """
    cycles = obj.cycles
    if not cycles.use_motion_blur:
        return 0, False
    if not is_asked or cycles.is_property_set("motion_steps"):
        count = min(2 ** max(1, cycles.motion_steps) + 1, _MOST_STEPS)
    return count, bool(cycles.use_deform_motion)
