"""The choice of the evaluated scene: a render's or the viewports'. One rule for all commands, buttons and functions.

Blender evaluates a scene separately for renders and for viewports: each has its objects, collections, modifier levels
and particles. Only render engines get a render's evaluation: Python cannot make a depsgraph, and those of
`evaluated_depsgraph_get()` are the viewports'. Therefore callers that read a render's scene pass a function. Our engine
calls it in `bpy.ops.render.render`, which then makes no image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import bpy
import numpy as np

from ..events.changes import pass_over
from ..extract.scene_in_time import FrameSet, has_simulations
from ..settings.scene_settings import ENGINE_NAME

T = TypeVar("T")

SLOT = "Perfect BVH"  # of Blender's Render Result: renders without an image leave the user's one alone
BUSY = "it is rendering something else: wait until that ends"
# Settings that turn off a render's side effects. The user's settings are restored afterwards.
SETTINGS: dict[str, Any] = {
    "use_compositing": False,
    "use_sequencer": False,
    "use_freestyle": False,
    "use_multiview": False,
    "use_persistent_data": True,
}


@dataclass(frozen=True, slots=True)
class SceneMoment:
    """An evaluated scene, which can be asked for other frames. Valid while the function that it was given to runs.

    depsgraph: evaluated. frame_set: evaluates it at a frame and a subframe; None for viewports: the scene's own.
    stand_in: the camera without which Blender renders nothing; None where the scene has one.
    """

    scene: bpy.types.Scene
    depsgraph: bpy.types.Depsgraph
    frame_set: FrameSet | None = None
    is_simulated: bool = False
    stand_in: bpy.types.Object | None = None

    @property
    def camera(self) -> bpy.types.Object | None:
        """The original object that the scene looks through at this moment: a marker may have chosen it."""
        camera = self.scene.camera
        return None if camera == self.stand_in else camera

    def go_to(self, frame: int, subframe: float = 0.0) -> None:
        """Evaluates another time, unless it is the current one: evaluating a frame again takes as long as before.

        Simulations are played by the scene itself; a render reads the results that the scene has kept.
        """
        if is_at(self.scene, frame, subframe):
            return
        if self.frame_set is None or self.is_simulated:
            self.scene.frame_set(frame, subframe=subframe)
        if self.frame_set is None:
            self.depsgraph.update()  # of the camera that markers choose Blender knows when all else is evaluated
            return
        camera = self.scene.camera
        pass_over(self.scene)  # viewports follow
        self.frame_set(frame, subframe)
        if self.scene.camera != camera:
            self.frame_set(frame, subframe)


def is_at(scene: bpy.types.Scene, frame: int, subframe: float) -> bool:
    """Whether that is the scene's moment, in float32 as Blender has it."""
    return bool((scene.frame_current, scene.frame_subframe) == (frame, np.float32(subframe)))


def go_to_frame(scene: bpy.types.Scene, number: int, for_viewport: bool = False) -> None:
    """Sets the frame that the next render shows; with `frame_set`'s evaluation only if scripts wait for it.

    for_viewport: whether the viewport's depsgraph is needed: because it is shown, or because of simulations, which only
    it plays. A render evaluates the frame in a separate depsgraph, so evaluating both would otherwise waste time.
    """
    if for_viewport or bpy.app.handlers.frame_change_pre or bpy.app.handlers.frame_change_post:
        scene.frame_set(number)
    else:
        scene.frame_current = number


class SceneView:
    """A scene and a view layer of it, read as a render sees it, or with `for_viewport` as viewports do.

    It is for work that continues while the user works in Blender. Between two steps an undo may replace all of
    Blender's data-blocks, and the user may delete the scene or show another one in the window. Therefore each step
    looks up the scene by properties that do not change.

    task: the name of the work, for messages.
    """

    def __init__(
        self, task: str, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, *, for_viewport: bool = False
    ) -> None:
        self._task = task
        self._uid, self._layer_name = scene.session_uid, view_layer.name
        self.for_viewport = for_viewport

    def find(self) -> bpy.types.Scene:
        """The scene. Raises ValueError if it or its view layer is gone."""
        scene = self._find()
        if scene is None:
            raise ValueError(f"{self._task}: the scene was removed during the {self._task}")
        if self._layer_name not in scene.view_layers:
            raise ValueError(f"{self._task}: the view layer {self._layer_name!r} was removed during the {self._task}")
        return scene

    def find_layer(self) -> bpy.types.ViewLayer:
        """The view layer. Raises ValueError like `find`."""
        return self.find().view_layers[self._layer_name]

    def depsgraph(self) -> bpy.types.Depsgraph:
        """Evaluated, as the scene is now. Raises ValueError like `find`."""
        with bpy.context.temp_override(scene=self.find(), view_layer=self.find_layer()):
            return bpy.context.evaluated_depsgraph_get()

    def set_frame_back(self, frame: int, subframe: float = 0.0, camera_uid: int = 0) -> None:
        """Restores the frame at the end, if the scene still exists and shows another one.

        camera_uid: the session uid of the scene's previous camera, 0 for none. Frames may have markers with cameras,
        and then visiting the frames has changed the camera.
        """
        scene = self._find()
        if scene is None or (scene.frame_current, scene.frame_subframe) == (frame, subframe):
            return
        scene.frame_set(frame, subframe=subframe)
        camera = next((obj for obj in scene.objects if obj.session_uid == camera_uid), None)
        if camera is not None and scene.camera != camera:
            scene.camera = camera

    def _find(self) -> bpy.types.Scene | None:
        return next((scene for scene in bpy.data.scenes if scene.session_uid == self._uid), None)

    def read(self, reading: Callable[[SceneMoment], T], frame: int | None = None, subframe: float = 0.0) -> T:
        """Returns what `reading` makes of the evaluated scene, at a frame or, by default, at the current one.

        A render's evaluation begins with all of the scene, unless `hold` is under way. Raises ValueError if the scene
        is gone, or if Blender refuses to render it.
        """
        scene = self.find()
        is_held = _held is not None and _held[0] == self._key
        if frame is not None and not is_held and not is_at(scene, frame, subframe):
            if self.for_viewport or has_simulations(scene):
                scene.frame_set(frame, subframe=subframe)
            else:  # the render evaluates it
                pass_over(scene, self.find_layer())
                scene.frame_current, scene.frame_subframe = frame, subframe

        def read_there(moment: SceneMoment) -> T:
            if frame is not None:
                moment.go_to(frame, subframe)
            return reading(moment)

        if self.for_viewport:
            return read_there(SceneMoment(scene, self.depsgraph()))
        return read_there(_held[1]) if _held is not None and is_held else self._visit(read_there)

    def hold(self, work: Callable[[], T]) -> T:
        """Returns the result of `work`. All readings in it share one evaluated scene, which goes from frame to frame.

        Blender's interface is blocked during this. Raises as `read` does.
        """
        if self.for_viewport or (_held is not None and _held[0] == self._key):
            return work()

        def work_there(moment: SceneMoment) -> T:
            global _held
            before, _held = _held, (self._key, moment)
            try:
                return work()
            finally:
                _held = before

        return self._visit(work_there)

    @property
    def _key(self) -> tuple[int, str]:
        return self._uid, self._layer_name

    def _visit(self, work: Callable[[SceneMoment], T]) -> T:
        """Calls `work` in a render of the scene."""
        global _visit
        scene = self.find()
        if bpy.app.is_job_running("RENDER"):  # F12, whose next frame would serve the reading
            raise self._refusal(scene, BUSY)
        visit = _Visit(self._key, work, has_simulations(scene))
        before, _visit = _visit, visit
        reason = BUSY
        try:
            with _without_image(scene, self.find_layer()) as visit.stand_in:
                bpy.ops.render.render(scene=scene.name, layer=self._layer_name)
        except RuntimeError as error:  # Blender's own: those of `work` are kept
            reason = " ".join(str(error).removeprefix("Error:").split())
        finally:
            _visit = before
        if visit.error is not None:
            raise visit.error
        if not visit.results:
            raise self._refusal(scene, reason)
        return visit.results[0]

    def _refusal(self, scene: bpy.types.Scene, reason: str) -> ValueError:
        return ValueError(f"{self._task}: Blender cannot read scene {scene.name!r} as a render does: {reason}")


class _Visit:
    """The work for the next render, and its result."""

    def __init__(self, key: tuple[int, str], work: Callable[[SceneMoment], Any], is_simulated: bool) -> None:
        self.key, self.work, self.is_simulated = key, work, is_simulated
        self.results: list[Any] = []
        self.error: BaseException | None = None
        self.stand_in: bpy.types.Object | None = None


_visit: _Visit | None = None
_held: tuple[tuple[int, str], SceneMoment] | None = None


def serve_visit(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> bool:
    """Serves the engine's `render`: returns whether the render was for a reading, which is then done."""
    visit = _visit
    scene = depsgraph.scene.original
    if visit is None or visit.key != (scene.session_uid, depsgraph.view_layer.name):
        return False
    try:
        moment = SceneMoment(scene, depsgraph, engine.frame_set, visit.is_simulated, visit.stand_in)
        visit.results.append(visit.work(moment))
    except BaseException as error:  # noqa: BLE001 - Blender would swallow it
        visit.error = error
    return True


def viewport_depsgraph(depsgraph: bpy.types.Depsgraph) -> bpy.types.Depsgraph:
    """Returns the viewports' depsgraph of the scene and view layer of a render."""
    return SceneView("render", depsgraph.scene.original, depsgraph.view_layer).depsgraph()


class PerfectBVHReader(bpy.types.RenderEngine):
    """The engine of scripts that have not registered the add-on; registered as long as a reading takes."""

    bl_idname = "PERFECT_BVH_READER"
    bl_label = "Perfect BVH Reader"

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Serve the reading."""
        serve_visit(self, depsgraph)


@contextmanager
def _without_image(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[bpy.types.Object | None]:
    """Makes Blender render with our engine only, into a separate slot; restores the user's settings.

    Yields the camera that replaces a missing one.
    """
    render, camera = scene.render, scene.camera
    has_engine = any(_is_own(kind) for kind in bpy.types.RenderEngine.__subclasses__())
    if not has_engine:
        bpy.utils.register_class(PerfectBVHReader)
    before = {name: getattr(render, name) for name in ("engine", *SETTINGS)}
    frame = scene.frame_current, scene.frame_subframe
    try:
        with _other_slot(), _any_camera(scene, layer) as stand_in:
            _assign(render, {"engine": ENGINE_NAME if has_engine else PerfectBVHReader.bl_idname, **SETTINGS})
            yield stand_in
    finally:
        _assign(render, before)
        if is_at(scene, *frame) and scene.camera != camera:
            scene.camera = camera  # a marker at the frame has chosen another
        if not has_engine:
            bpy.utils.unregister_class(PerfectBVHReader)


def _is_own(kind: Any) -> bool:
    """Whether an engine is that of this copy of the add-on, and known to Blender."""
    is_here = kind.__module__.startswith(f"{__package__.rpartition('.')[0]}.")
    return bool(is_here and kind.bl_idname == ENGINE_NAME and getattr(kind, "is_registered", False))


def _assign(render: bpy.types.RenderSettings, values: dict[str, Any]) -> None:
    """Assigns only different values: a new engine ends the Rendered viewports, and frees the data that renders keep."""
    for name, value in values.items():
        if getattr(render, name) != value and value != "":  # "": an engine that Blender does not know
            setattr(render, name, value)


@contextmanager
def _other_slot() -> Iterator[None]:
    image = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    if image is None:
        yield
        return
    slots, active = image.render_slots, image.render_slots.active_index
    if all(slot.name != SLOT for slot in slots):
        slots.new(name=SLOT)
    slots.active_index = next(index for index, slot in enumerate(slots) if slot.name == SLOT)
    try:
        yield
    finally:
        slots.active_index = active


@contextmanager
def _any_camera(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[bpy.types.Object | None]:
    """Provides a camera: Blender renders nothing without one, although reading does not depend on it."""
    if scene.camera is not None:
        yield None
        return
    pass_over(scene, layer)
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.camera = made
    try:
        yield made
    finally:
        if scene.camera == made:
            scene.camera = None
        bpy.data.cameras.remove(made.data)  # and the object with it
        pass_over(scene)
