"""One evaluated depsgraph through the time samples of a shutter -> one `SceneRecord` with all its motion.

The frame is read, then each needed time sample once; and the frame once more when the scene has returned to it: the
values of its keys count then, and the next reading knows that nothing has changed since. Data that Blender has not
evaluated again at a time sample is not read again; the log of evaluations records this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import bpy
import numpy as np
from perfect_bvh._checks import check_count

from ..events.asking import EvaluationLog
from ..events.changes import listen, stop_listening, watched_evaluations
from ..sync.moments import MomentRecord, MotionSettings
from ..sync.motion import add_motion
from ..sync.records import AttributeRequest, CameraRecord, InstanceRecords, MeshRecord, ObjectRecord, SceneRecord
from .camera import read_frame
from .geometry.geometry_instances import read_instances
from .geometry.groups import AdaptiveSubdivision, GroupTable
from .geometry.mesh_table import MeshTable
from .looks.materials import MaterialReader
from .read_again import read_again
from .scene import ReadCache, read_any_camera, read_scene, shared_reader
from .visibility import VisibilityReader, outside_viewports

# A shutter around a frame: at which frames its moments are, and going there and back.
#
# Blender evaluates one moment at a time. However the way through them ends, the scene is at the frame and subframe in
# the end where it was at first, with the camera that it had.


FrameSet = Callable[[int, float], object]
Place = tuple[int, float]  # a frame, and how far after it as float32 holds it, 0 to below 1

MOST_STEPS = 255
_FARTHEST = 1_048_574  # frames of Blender, from zero


@dataclass(frozen=True, slots=True)
class Shutter:
    """begin, end: in frames relative to the current one. steps: of objects without a setting; None: Cycles' default.

    frame_set: called with a frame and a subframe, makes Blender evaluate the depsgraph; None: the scene's own.
    """

    begin: float
    end: float
    steps: int | None = None
    frame_set: FrameSet | None = None

    def offset(self, time: Fraction) -> float:
        """Convert a time, 0 to 1, to frames from the current one."""
        return float(1 - time) * self.begin + float(time) * self.end


def as_shutter(function: str, shutter: Any, steps: Any, frame_set: FrameSet | None) -> Shutter | None:
    """Check a caller's arguments; None without a shutter. Raises ValueError for invalid ones."""
    if shutter is None:
        for name, value in (("steps", steps), ("frame_set", frame_set)):
            if value is not None:
                raise ValueError(f"{function}: {name} needs a shutter, got {value!r} without one")
        return None
    begin, end = _as_range(function, shutter)
    if frame_set is not None and not callable(frame_set):
        raise ValueError(f"{function}: frame_set must be a function of a frame and a subframe, got {frame_set!r}")
    if steps is not None:
        steps = check_count(function, "steps", steps, 2, MOST_STEPS)
    return Shutter(begin, end, steps, frame_set)


def _as_range(function: str, shutter: Any) -> tuple[float, float]:
    what = f"{function}: shutter must be two finite numbers of frames (begin, end) with begin < end"
    try:
        begin, end = (float(number) for number in shutter)
    except (TypeError, ValueError):
        raise ValueError(f"{what}, got {shutter!r}") from None
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        raise ValueError(f"{what}, got {shutter!r}")
    if max(abs(begin), abs(end)) > _FARTHEST:
        raise ValueError(
            f"{function}: shutter must lie within {_FARTHEST:,} frames of the current one, got {shutter!r}"
        )
    return begin, end


def place_of(scene: Any) -> Place:
    """Return the time of a scene. Before frame 0 Blender reports negative subframes, but does not accept them."""
    return _as_place(float(scene.frame_current) + float(scene.frame_subframe))


def _as_place(at: float) -> Place:
    frame = math.floor(at)
    subframe = float(np.float32(at - frame))
    return (frame + 1, 0.0) if subframe >= 1.0 else (frame, subframe)


def places_of(shutter: Shutter, times: Sequence[Fraction], here: Place) -> dict[Fraction, Place]:
    """Return the scene's time at each time sample. here: its time at the frame itself."""
    return {time: _as_place(here[0] + here[1] + shutter.offset(time)) for time in times}


@contextmanager
def stepping(depsgraph: Any, shutter: Shutter) -> Iterator[Callable[[Place], None]]:
    """Yield a function that goes to a time; at the end the scene's state is restored.

    depsgraph: the one that is read. Raises ValueError if the function did not evaluate it.
    """
    scene = depsgraph.scene.original
    here, camera = place_of(scene), scene.camera
    has_gone = False

    def go(place: Place) -> None:
        nonlocal has_gone
        has_gone = True
        _go(scene, shutter, place)
        found = place_of(depsgraph.scene_eval)
        if not _are_same(found, place):
            raise ValueError(
                f"update: frame_set must evaluate the depsgraph that is read at frame {sum(place):g}, got frame "
                f"{sum(found):g}: of a render it is its engine's frame_set, and no handler may change the frame"
            )

    try:
        yield go
    finally:
        if has_gone:
            _return(depsgraph, scene, shutter, here, camera)


def _return(depsgraph: Any, scene: Any, shutter: Shutter, here: Place, camera: Any) -> None:
    """Return to the previous frame; a second Ctrl-C during this does not leave it half-way."""
    try:
        _go_back(depsgraph, scene, shutter, here, camera)
    except KeyboardInterrupt:
        _go_back(depsgraph, scene, shutter, here, camera)
        raise


def _go_back(depsgraph: Any, scene: Any, shutter: Shutter, here: Place, camera: Any) -> None:
    _go(scene, shutter, here)
    if scene.camera != camera:  # markers chose another one, as they do whenever the frame changes
        scene.camera = camera
    if shutter.frame_set is None:
        depsgraph.update()  # of the camera that markers choose Blender knows when all else is evaluated


def _go(scene: Any, shutter: Shutter, place: Place) -> None:
    frame, subframe = place
    if shutter.frame_set is not None:
        shutter.frame_set(frame, subframe)
    else:
        scene.frame_set(frame, subframe=subframe)


def _are_same(first: Place, second: Place) -> bool:
    """Whether both are equal up to rounding: Blender evaluates both at the same float32 number."""
    rounding = max(1e-6, float(np.spacing(np.float32(abs(first[0]) + 1))))
    return abs((first[0] - second[0]) + (first[1] - second[1])) <= rounding


# Scene in time -------------------------------------------------------------------------------------------------------


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
    """Read the same as `read_scene`, with all motion within the shutter.

    progress: called with the share of the time samples that were read; returning False raises `perfect_bvh.Cancelled`.
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
    """Keeps the evaluation log recording."""

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

        raise perfect_bvh.Cancelled("the update was cancelled between two time samples of the shutter")


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
    """Read the positions in an evaluated depsgraph: meshes that are read again have no attributes.

    cache: of the frame's reading, with these attributes; it is not changed. The rest is as for `read_scene`.
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
    """Read the users' settings of motion blur: Cycles' own switches and steps, if Cycles is enabled.

    record: of a scene with its objects. camera: the original object, None if there is none or it cannot move.
    steps: of objects without a setting; None: Cycles' default.
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
    """Return an object's steps, 0 for no blur, and whether its shape may change. is_asked: whether count is no default.

    An object whose steps were never set has no setting of them.
    """
    cycles = obj.cycles
    if not cycles.use_motion_blur:
        return 0, False
    if not is_asked or cycles.is_property_set("motion_steps"):
        count = min(2 ** max(1, cycles.motion_steps) + 1, _MOST_STEPS)
    return count, bool(cycles.use_deform_motion)


# Simulations ---------------------------------------------------------------------------------------------------------
# Whether a frame depends on those before it: simulations must be played in order.


SIMULATED = frozenset({"CLOTH", "SOFT_BODY", "FLUID", "DYNAMIC_PAINT", "PARTICLE_SYSTEM"})


def has_simulations(scene: Any) -> bool:
    """Rigid bodies, cloth, soft bodies, fluids, dynamic paint, particles, simulation zones of nodes; baked or not."""
    if scene.rigidbody_world is not None and scene.rigidbody_world.enabled:
        return True
    if any(modifier.type in SIMULATED for obj in scene.objects for modifier in obj.modifiers):
        return True
    return any(node.bl_idname == "GeometryNodeSimulationOutput" for tree in bpy.data.node_groups for node in tree.nodes)
