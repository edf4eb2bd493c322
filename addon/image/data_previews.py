"""Blender's previews of materials, lights and worlds: small images of separate stages.

Blender makes them on threads while the user edits, several at once, again and again while a value is dragged. So
nothing is shared with renders: each preview reads its stage, builds its trees and drops them, and reports nothing. Only
the images that the last one has read are kept until the add-on is disabled, large ones at a lower resolution
(`ImageReader`): a preview takes them while it reads, and another one at the same time reads its own. Of UDIM images
previews show the first tile alone.

Blender must not remove an engine while it makes previews with it, nor wait for them while it blocks Python, which they
need to end. It does both when an add-on is disabled. Therefore they are ended before.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ..extract.looks.images import ImageCache
    from .plan import RenderPlan

# Limits of the waits before previews are disabled: for previews that are being made, and for those that Blender has
# begun without calling the engine yet.
ENDING_SECONDS, BEGINNING_SECONDS = 10.0, 0.5


class Gate:
    """Lets previews in until it is closed. All methods are for any thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0
        self._seen_at = 0.0
        self.is_open = True

    @contextmanager
    def passing(self) -> Iterator[bool]:
        """While a preview is made; whether it may be."""
        with self._changed:
            self._count += 1
        try:
            yield self.is_open
        finally:
            with self._changed:
                self._count -= 1
                self._seen_at = time.monotonic()
                self._changed.notify_all()

    def close(self, are_coming: Callable[[], bool]) -> None:
        """Let no more in, and wait for those that are inside. are_coming: whether Blender may have begun others."""
        with self._changed:
            self.is_open = False
            self._changed.wait_for(lambda: self._count == 0, ENDING_SECONDS)
        begun = time.monotonic()
        while are_coming():
            with self._changed:
                left = max(begun, self._seen_at) + BEGINNING_SECONDS - time.monotonic()
                if left <= 0.0 and self._count == 0:
                    return
                if time.monotonic() - begun > ENDING_SECONDS:
                    return
                self._changed.wait(max(left, 0.01))

    def open(self) -> None:
        """Let them in again."""
        self.is_open = True


_gate = Gate()
_kept: list[ImageCache] = []  # at most one


def render_preview(
    depsgraph: bpy.types.Depsgraph, plan: RenderPlan, is_cancelled: Callable[[], bool]
) -> npt.NDArray[np.float32] | None:
    """Return (H, W, 4) float32 scene-linear, row 0 on top; None if there should be none.

    is_cancelled: asked at intervals. Raises ValueError for a stage without a camera, and the engine's errors.
    """
    import perfect_bvh

    with _gate.passing() as is_allowed:
        if not is_allowed:
            return None
        try:
            return _render(depsgraph, plan, lambda _: _gate.is_open and not is_cancelled())
        except (perfect_bvh.Cancelled, ReferenceError):  # the latter if an image was deleted in the meantime
            return None


def _render(
    depsgraph: bpy.types.Depsgraph, plan: RenderPlan, progress: Callable[[float], bool]
) -> npt.NDArray[np.float32]:
    from perfect_bvh import Cancelled, Scene, render_progressively

    from ..extract.scene import ReadCache, read_scene
    from ..sync.appearance import as_camera, make_appearance
    from ..sync.state import SceneState

    cache = ReadCache()
    if kept := _take():
        cache.images = kept
    record = read_scene(depsgraph, plan.attributes, for_viewport=False, cache=cache, for_preview=True)
    _kept[:] = [cache.images]
    if record.camera is None:
        raise ValueError("the preview's stage has no camera that can be rendered")
    if not progress(0.0):
        raise Cancelled("the preview was cancelled")
    state = SceneState(Scene)
    state.update(record, expected_rays=plan.expected_rays, progress=progress)
    image = np.zeros((0, 0, 4), np.float32)
    for _, passes in render_progressively(
        state.scene,
        as_camera(record.camera),
        mode=plan.settings.mode,
        size=plan.size,
        samples=plan.samples,
        appearance=make_appearance(record, state.instance_ids, state.mesh_ids),
        time_limit=plan.settings.time_limit,
        progress=progress,
        **plan.options,
    ):
        image = passes["combined"]
        if not progress(1.0):
            raise Cancelled("the preview was cancelled")
    return image


def _take() -> ImageCache | None:
    try:
        return _kept.pop()
    except IndexError:  # another preview has them
        return None


def _is_job_there() -> bool:
    """Whether Blender has a preview job; it notices a job's end only when it continues."""
    return bool(bpy.app.is_job_running("RENDER_PREVIEW"))


def register() -> None:
    _gate.open()


def unregister() -> None:
    """Before the engine is."""
    _gate.close(_is_job_there)
    _kept.clear()
