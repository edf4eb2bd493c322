"""The Bench button: measures the scene for a bounded time and shows a table of it in the panel.

In a window it works in steps of a timer; what takes longer than a step goes on beside Blender. Esc ends it at any time,
with what has been measured so far. Without a window, or when a script calls it, it does the same in one go. Where
matplotlib can be imported the Image Editor shows charts too.
"""

from __future__ import annotations

import tempfile
from collections.abc import Generator
from pathlib import Path
from typing import Any, ClassVar

import bpy

from ..live.scene_reference import SceneReference
from ..settings.editors import redraw_viewports
from ..support.files import prepare_folder
from .preview import show_in_editor
from .ticking import Ticking

IMAGE_NAME = "Perfect BVH Bench"


class PERFECT_BVH_OT_bench(Ticking, bpy.types.Operator):
    """Steps through the measurements in a timer."""

    bl_idname = "perfect_bvh.bench"
    bl_label = "Bench This Scene"
    bl_description = (
        "Measure what builders and policies cost and gain on this scene, and show it as a table. "
        "Where matplotlib is installed, the Image Editor shows charts of it too"
    )
    bl_options: ClassVar = {"REGISTER"}

    seconds: bpy.props.FloatProperty(
        name="Seconds", description="How long to measure at most, about", default=60.0, min=1.0, max=3600.0
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        description="Where the figures and the charts go; empty: Blender's temporary folder",
        subtype="DIR_PATH",
    )

    for_viewport: bpy.props.BoolProperty(
        name="As in Viewports",
        description="Measure the objects and modifier levels that viewports show, instead of a render's",
        default=False,
    )

    _bench: Any
    _steps: Generator[tuple[float, str], None, None]
    _place: SceneReference
    _scene_uid: int
    _frame: tuple[int, float, int]
    _where: Path

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._begin(context):
            return {"CANCELLED"}
        while self._step() is not None:
            pass
        return self._finish(context)

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        """False if nothing could be written, with the reason reported."""
        from ..bench.from_blender import subject_of
        from ..bench.measurements import SceneBench

        self._forget_complaints()
        self._where = self._find_folder()
        try:
            prepare_folder(self._where)
        except OSError as problem:
            self._complain(problem)
            return False
        self._scene_uid = context.scene.session_uid
        self._place = SceneReference("bench", context.scene, context.view_layer)
        camera = context.scene.camera
        self._frame = context.scene.frame_current, context.scene.frame_subframe, camera.session_uid if camera else 0
        try:
            self._bench = SceneBench(subject_of(context.scene, for_viewport=self.for_viewport), self.seconds)
        except ValueError as problem:
            self._complain(problem)
            return False
        self._steps = self._bench.steps()
        return True

    def _step(self) -> tuple[float, str] | None:
        """None at the end, and where it failed, with the reason reported."""
        import perfect_bvh

        try:
            return next(self._steps, None)
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return None

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        step = self._step()
        if step is not None:
            context.window_manager.progress_update(100 * step[0])
            self._tell(context, f"Measuring: {step[1]}. Esc ends it and shows what there is")
            return None
        return self._finish(context)

    def _stop(self, context: bpy.types.Context) -> set[str]:
        return self._finish(context)

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        self._end_ticking(context)
        self._place.set_frame_back(*self._frame)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        from ..bench.results import remember, write

        self._end(context)
        folder = self._where
        try:
            results = write(self._bench.figures, folder)
        except OSError as problem:
            self._complain(f"Cannot write into {folder}: {problem.strerror or problem}")
            return {"CANCELLED"}
        if not results.table:
            return {"CANCELLED"}
        remember(self._scene_uid, results)
        redraw_viewports(context)
        if results.overview is not None:
            _show(context, results.overview)
        for sentence in results.advice.values():
            self.report({"INFO"}, sentence)
        return {"FINISHED"}

    def _find_folder(self) -> Path:
        if self.folder.strip():
            return Path(bpy.path.abspath(self.folder))
        return Path(tempfile.mkdtemp(prefix="bench_", dir=bpy.app.tempdir))


def _show(context: bpy.types.Context, charts: Path) -> None:
    image = bpy.data.images.get(IMAGE_NAME)
    if image is not None:
        bpy.data.images.remove(image)
    image = bpy.data.images.load(str(charts))
    image.name = IMAGE_NAME
    if not bpy.app.background:
        show_in_editor(context, image)


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_OT_bench)


def unregister() -> None:
    from ..bench.results import forget

    bpy.utils.unregister_class(PERFECT_BVH_OT_bench)
    forget()
