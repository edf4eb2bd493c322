"""Buttons that measure trees: *Bench*, and the comparison of two trees in a viewport."""

from __future__ import annotations

import tempfile
from collections.abc import Generator
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import bpy

from ..events.changes import edit_count
from ..settings.preferences import redraw_viewports
from ..settings.view_settings import REFITTED, choice_of, choice_of_builder
from ..support.files import prepare_folder
from .preview import show_in_editor
from .ticking import Checked, Ticking

# The Bench button: measures the scene for a bounded time and shows a table of the results in the panel.
#
# In a window it works in steps of a timer; longer work runs in the background. Esc ends it at any
# time, with the results so far. Without a window, or when a script calls it, it does the same in one go.
# If matplotlib can be imported, the Image Editor shows charts too.


IMAGE_NAME = "Perfect BVH Bench"


class PERFECT_BVH_OT_bench(Ticking, bpy.types.Operator):
    """Steps through the measurements in a timer."""

    bl_idname = "perfect_bvh.bench"
    bl_label = "Benchmark This Scene"
    bl_description = (
        "Measure each way to build and to update the BVHs of this scene: the time it takes, and the speed of rays. A "
        "table shows the results. If matplotlib is installed, the Image Editor also shows charts"
    )
    bl_options: ClassVar = {"REGISTER"}

    seconds: bpy.props.FloatProperty(
        name="Seconds", description="Approximate time limit", default=60.0, min=1.0, max=3600.0
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        description="Folder of the results and charts; empty: Blender's temporary folder",
        subtype="DIR_PATH",
    )

    for_viewport: bpy.props.BoolProperty(
        name="As in Viewports",
        description="Measure the objects and modifier levels of viewports instead of those of a render",
        default=False,
    )

    _bench: Any
    _steps: Generator[tuple[float, str], None, None]
    _place: Any  # a `SceneView`: Blender evaluates annotations, and the native engine may be missing
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
        from ..bench.measurements import SceneBench, subject_of

        self._forget_complaints()
        self._where = self._find_folder()
        try:
            prepare_folder(self._where)
        except OSError as problem:
            self._complain(problem)
            return False
        self._scene_uid = context.scene.session_uid
        from ..live.scene_view import SceneView

        self._place = SceneView("bench", context.scene, context.view_layer)
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
        """Makes a step; returns None at the end, and after a failure, with the reason reported."""
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
            self._tell(context, f"Measuring: {step[1]}. Esc stops and shows the results so far")
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
        if results.overview is not None and not _show(context, results.overview):
            self.report({"INFO"}, f'The charts are in the image "{IMAGE_NAME}": open an Image Editor to see them')
        for sentence in results.advice.values():
            self.report({"INFO"}, sentence)
        return {"FINISHED"}

    def _find_folder(self) -> Path:
        if self.folder.strip():
            return Path(bpy.path.abspath(self.folder))
        return Path(tempfile.mkdtemp(prefix="bench_", dir=bpy.app.tempdir))


class PERFECT_BVH_OT_compare_advised(bpy.types.Operator):
    """Sets the two trees of Compare as the last measurement advises."""

    bl_idname = "perfect_bvh.compare_advised"
    bl_label = "Set Compare to These Two"
    bl_description = "Set the panel Compare to the builder Automatic and the advised one"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..bench.results import last_results

        results = last_results(context.scene.session_uid)
        if results is None or results.better is None:
            self.report({"ERROR"}, "No builder is advised instead of Automatic: benchmark this scene first")
            return {"CANCELLED"}
        compare = context.scene.perfect_bvh.compare
        compare.left, compare.right = (choice_of_builder(name).identifier for name in ("auto", results.better))
        redraw_viewports(context)
        return {"FINISHED"}


def _show(context: bpy.types.Context, charts: Path) -> bool:
    """Loads the charts as an image; returns False if there is a window and no editor shows it."""
    image = bpy.data.images.get(IMAGE_NAME)
    if image is not None:
        bpy.data.images.remove(image)
    image = bpy.data.images.load(str(charts))
    image.name = IMAGE_NAME
    return bpy.app.background or show_in_editor(context, image)


# Compare -------------------------------------------------------------------------------------------------------------
# The Compare button: two trees of the active object side by side in the viewport that it was pressed in.
#
# In a window trees are built and measured in the background, and Esc cancels that. Without one, or when a script calls
# it, it does the same in one go, and reports the result.


SHAPES = ("MESH", "CURVE", "CURVES", "SURFACE", "FONT", "META", "POINTCLOUD", "VOLUME")


class PERFECT_BVH_OT_compare(Ticking, bpy.types.Operator):
    """Waits in a timer for the trees, which are built and measured in the background."""

    bl_idname = "perfect_bvh.compare"
    bl_label = "Compare"
    bl_description = (
        "Build two BVHs of the active object, and show them side by side. SAH is the expected cost of a ray: lower is "
        "better"
    )
    bl_options: ClassVar = {"REGISTER"}

    # Blender evaluates these annotations, and what they are of needs the native engine.
    _work: Any
    _space: int | None
    _edits: int

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        return find_complaint(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._finish(context) if self._begin(context) else {"CANCELLED"}

    # The parts -------------------------------------------------------------------------------------------------------

    def _begin(self, context: bpy.types.Context) -> bool:
        """False if there is nothing to compare, with the reason reported."""
        from ..support.background_work import BackgroundWork
        from ..view3d.compare.compare_trees import compare
        from ..view3d.reading import read_object

        scene, settings = context.scene, context.scene.perfect_bvh.compare
        choices = choice_of(settings.left), choice_of(settings.right)
        self._forget_complaints()
        self._space = find_space(context)
        context.evaluated_depsgraph_get()  # evaluates earlier edits, so that they do not count as later ones
        self._edits = edit_count(scene.session_uid)
        try:
            shown = read_object(context, context.object)
            is_refitted = any(choice.identifier == REFITTED for choice in choices)
            first = read_object(context, context.object, scene.frame_start) if is_refitted else None
        except ValueError as problem:
            self._complain(problem)
            return False
        self._work = BackgroundWork(
            partial(compare, shown, scene.frame_current, choices, first), lambda comparison: comparison
        )
        return True

    def _tick(self, context: bpy.types.Context) -> set[str] | None:
        if self._work.is_running:
            context.window_manager.progress_update(100 * self._work.share)
            self._tell(context, f"Comparing builders {self._work.share:.0%} | Esc: Cancel")
            return None
        self._end(context)
        return self._finish(context)

    def _stopped(self) -> str:
        return "Comparison canceled"

    def _finish(self, context: bpy.types.Context) -> set[str]:
        import perfect_bvh

        from ..view3d.compare import compare_view

        try:
            comparison = self._work.result()
        except (ValueError, perfect_bvh.EngineError, MemoryError) as problem:
            self._complain(problem)
            return {"CANCELLED"}
        if self._space is not None:
            compare_view.show(comparison, context.scene, self._space, self._edits)
        left, right = comparison.left, comparison.right
        self.report({"INFO"}, f"Cost of a ray (SAH): {left.label} {left.sah:,.1f}, {right.label} {right.sah:,.1f}")
        return {"FINISHED"}

    def _end(self, context: bpy.types.Context) -> None:
        self._work.stop()
        self._end_ticking(context)


class PERFECT_BVH_OT_end_comparison(Checked, bpy.types.Operator):
    """Shows the scene again."""

    bl_idname = "perfect_bvh.end_comparison"
    bl_label = "End Comparison"
    bl_description = "Show the scene again instead of the two BVHs"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def _find_complaint(cls, context: bpy.types.Context) -> str | None:
        from ..view3d.compare import compare_view

        return "No BVHs are compared" if compare_view.shown() is None else None

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ..view3d.compare import compare_view

        compare_view.hide()
        return {"FINISHED"}


def find_complaint(context: bpy.types.Context) -> str | None:
    """Why the tree of the active object cannot be looked into."""
    if context.object is None:
        return "Click an object first"
    if context.object.type not in SHAPES and context.object.instance_type == "NONE":
        return "The active object has no triangles that rays can hit"
    if context.mode != "OBJECT":
        return "Leave the mode of the active object first: its triangles are those of Object Mode"
    return None


def find_space(context: bpy.types.Context) -> int | None:
    """The address of the 3D viewport that a button was pressed in, or else of the largest; None if there is none.

    Areas come and go when they are maximized, their spaces stay.
    """
    area = context.area
    if area is None or area.type != "VIEW_3D":
        areas = [] if context.window is None else context.window.screen.areas
        viewports = [area for area in areas if area.type == "VIEW_3D"]
        area = max(viewports, key=lambda area: area.width * area.height, default=None)
    return None if area is None else area.spaces.active.as_pointer()


CLASSES = (PERFECT_BVH_OT_bench, PERFECT_BVH_OT_compare_advised, PERFECT_BVH_OT_compare, PERFECT_BVH_OT_end_comparison)
