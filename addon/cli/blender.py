"""Blender inside this process: loading a file, and rendering frames of it through the engine."""

from __future__ import annotations

import argparse
import importlib.util
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from ..settings.modes import find_mode
from .arguments import CommandError

if TYPE_CHECKING:
    import bpy


def open_scene(path: Path, arguments: argparse.Namespace) -> bpy.types.Scene:
    """The active scene of a .blend file, with the add-on registered. Errors: CommandError."""
    _require_modules()
    import bpy

    from .. import register

    register()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=arguments.autoexec)
    except RuntimeError as error:
        raise CommandError(f"{arguments.file}: Blender cannot open it ({_reason(error)})") from error
    saved_by, own = tuple(bpy.data.version[:2]), bpy.app.version[:2]
    if saved_by > own:
        sys.stderr.write(
            f"perfect-bvh: this file was saved by Blender {_dotted(saved_by)}, which is newer than this one, "
            f"{_dotted(own)}: some of it may be missing\n"
        )
    _check_libraries(arguments)
    if bpy.app.autoexec_fail:
        sys.stderr.write("perfect-bvh: scripts or drivers in this file were not run; --autoexec runs them\n")
    return bpy.context.scene


def _check_libraries(arguments: argparse.Namespace) -> None:
    """Says what of linked libraries is missing; a CommandError unless that is allowed."""
    from ..extract.label_values import find_missing_blocks, find_missing_libraries

    missing = find_missing_libraries()
    if missing and not arguments.allow_missing:
        raise CommandError(
            f"{arguments.file}: {'; '.join(row.text for row in missing)}. Put it back, or find it in Blender with "
            "File > External Data > Find Missing Files and save; --allow-missing continues without it"
        )
    for row in (*missing, *find_missing_blocks()):
        sys.stderr.write(f"perfect-bvh: {row}\n")


def _require_modules() -> None:
    if importlib.util.find_spec("bpy") is None:
        raise CommandError("Blender's module bpy is missing: pip install 'perfect-bvh[blender]'")
    try:
        from ..settings.preferences import native_error
    except ImportError as error:
        raise CommandError(f"Blender's module bpy cannot be loaded: {error}") from error
    error = native_error()
    if error is not None:
        raise CommandError(error)


def _dotted(version: Sequence[int]) -> str:
    return ".".join(map(str, version))


def _reason(error: RuntimeError) -> str:
    """Returns an operator's error in one line. Blender puts each report on a line, and some twice."""
    lines = (" ".join(line.removeprefix("Error:").split()) for line in str(error).splitlines())
    return " ".join(dict.fromkeys(line for line in lines if line))


def apply_settings(scene: bpy.types.Scene, arguments: argparse.Namespace) -> None:
    """Put the command line's choices into the loaded scene, which is never saved. Errors: CommandError."""
    from ..extract.camera import check_resolution

    render = scene.render
    render.engine = "PERFECT_BVH"
    # Only the engine's own image is wanted, of the active view layer, and with the depsgraph kept between frames.
    render.use_compositing = render.use_sequencer = render.use_freestyle = render.use_multiview = False
    render.use_persistent_data = True
    active = active_view_layer(scene)
    for view_layer in scene.view_layers:
        view_layer.use = view_layer == active
    if arguments.threads is not None:
        render.threads_mode, render.threads = "FIXED", min(arguments.threads, 1024)
    if getattr(arguments, "size", None) is not None:
        render.resolution_x, render.resolution_y = arguments.size
        render.resolution_percentage = 100
    try:
        check_resolution(scene)
    except ValueError as error:
        way_out = ", such as --size 960x540" if hasattr(arguments, "size") else ""
        raise CommandError(f"{error}{way_out}") from error
    if getattr(arguments, "mode", None) is not None:
        scene.perfect_bvh.mode = find_mode(arguments.mode).name.upper()
    _apply_sampling(scene.perfect_bvh, arguments)


def _apply_sampling(settings: bpy.types.bpy_struct, arguments: argparse.Namespace) -> None:
    """settings: the add-on's. Commands that make no images have no such choices."""
    chosen = {
        "samples": "samples",
        "denoise": "use_denoising",
        "time_limit": "time_limit",
        "noise_threshold": "noise_threshold",
        "seed": "seed",
        "audit": "audit",
    }
    for argument, name in chosen.items():
        value = getattr(arguments, argument, None)
        if value is not None:
            setattr(settings, name, value)
    if getattr(arguments, "noise_threshold", None) is not None:
        settings.use_noise_threshold = arguments.noise_threshold > 0.0


def active_view_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """The one that is rendered."""
    import bpy

    active = bpy.context.view_layer
    return active if active.name in scene.view_layers else scene.view_layers[0]


# Ctrl-C, and on Windows Ctrl-Break as well: the only one of the two that a program can send to another.
_INTERRUPTS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGBREAK") if hasattr(signal, name))


class StopRequest:
    """Set by the first Ctrl-C, or by who sets it.

    Polled instead of raised, for Blender swallows exceptions that handlers raise.
    """

    def __init__(self) -> None:
        self.is_set = False

    def _set(self, _signal: int, _frame: FrameType | None) -> None:
        self.is_set = True
        for number in _INTERRUPTS:
            signal.signal(number, signal.default_int_handler)  # a second one interrupts at any point


@contextmanager
def stop_on_interrupt() -> Iterator[StopRequest]:
    """Catch Ctrl-C while this is active."""
    request = StopRequest()
    try:
        before = [signal.signal(number, request._set) for number in _INTERRUPTS]
    except ValueError:  # not the main thread: the program that runs it there has its own ways to stop it
        yield request
        return
    try:
        yield request
    finally:
        for number, handler in zip(_INTERRUPTS, before, strict=True):
            signal.signal(number, handler)
