"""Pixels on their way to an eye or a file: pictures through the scene's view transform, data past it.

Blender's own colour management does the work, so a file has the look, exposure and curves that the scene
says. Data modes (see `modes`) bypass them: a fixed view transform, no exposure and no dithering, which would make
one id into many colours. The same holds for files that Blender itself writes from a render of a data mode.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt

from ..settings.modes import Mode, mode_of_render
from ..settings.scene_settings import ENGINE_NAME
from ..support.files import is_extended, replacing

Image = npt.NDArray[np.float32]

# File format and colour depth by file name extension.
FILE_FORMATS = {
    ".png": ("PNG", "8"),
    ".jpg": ("JPEG", "8"),
    ".jpeg": ("JPEG", "8"),
    ".webp": ("WEBP", "8"),
    ".tif": ("TIFF", "8"),
    ".tiff": ("TIFF", "8"),
    ".exr": ("OPEN_EXR", "32"),
}
FORMATS_WITHOUT_ALPHA = {"JPEG"}
NEUTRAL_VIEW = {"look": "None", "exposure": 0.0, "gamma": 1.0, "use_curve_mapping": False, "use_white_balance": False}


@contextmanager
def _changed(owner: object, **values: object) -> Iterator[None]:
    """Set properties of a Blender struct and put the old values back; properties this Blender lacks are left out."""
    before = {name: getattr(owner, name) for name in values if hasattr(owner, name)}
    try:
        for name in before:
            setattr(owner, name, values[name])
        yield
    finally:
        for name, value in reversed(before.items()):
            setattr(owner, name, value)


@contextmanager
def fixed_output(scene: bpy.types.Scene, view_transform: str) -> Iterator[None]:
    """While this is active, files written from `scene` use `view_transform` on sRGB, without dithering.

    A scene that overrides its output's colours keeps its choice.
    """
    image_settings = scene.render.image_settings
    if image_settings.color_management != "FOLLOW_SCENE":
        yield
        return
    with _changed(image_settings, color_management="OVERRIDE"), _changed(scene.render, dither_intensity=0.0):
        view = image_settings.view_settings
        with (
            _changed(view, **NEUTRAL_VIEW),
            _changed(image_settings.display_settings, display_device="sRGB"),
            _changed(view, view_transform=view_transform),
        ):
            yield


@contextmanager
def _file_format(scene: bpy.types.Scene, suffix: str) -> Iterator[None]:
    file_format, color_depth = FILE_FORMATS[suffix.lower()]
    has_alpha = scene.render.film_transparent and file_format not in FORMATS_WITHOUT_ALPHA
    image_settings = scene.render.image_settings
    with (
        _changed(image_settings, media_type="IMAGE"),
        _changed(image_settings, file_format=file_format),
        _changed(image_settings, color_mode="RGBA" if has_alpha else "RGB", color_depth=color_depth),
    ):
        yield


@contextmanager
def _reachable_by_blender(name: Path) -> Iterator[Path]:
    """The file itself, or one that takes its place: of a name that is too long for Blender on Windows."""
    if not is_extended(name):
        yield name
        return
    with tempfile.TemporaryDirectory() as folder:
        near = Path(folder, f"image{name.suffix}")
        yield near
        shutil.copyfile(near, name)


def save_image(path: Path, pixels: Image, scene: bpy.types.Scene, mode: Mode) -> None:
    """Write an (H, W, 4) float32 scene-linear image, row 0 on top, with associated alpha.

    mode: decides how the values are shown; a file of bytes holds values between 0 and 1. The format follows the
    file name (`FILE_FORMATS`); OpenEXR keeps the values unchanged. An older file is replaced once the new one is
    complete. Errors: OSError if the file cannot be written.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Perfect BVH output", width, height, alpha=True, float_buffer=True)
    try:
        image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
        with ExitStack() as stack:
            stack.enter_context(_file_format(scene, path.suffix))
            if mode.view is not None:
                stack.enter_context(fixed_output(scene, mode.view))
            with replacing(path) as name, _reachable_by_blender(name) as reached:
                try:
                    image.save_render(str(reached), scene=scene)
                except RuntimeError as error:
                    raise OSError(" ".join(str(error).replace(str(reached), path.name).split())) from error
    finally:
        bpy.data.images.remove(image)


# Files that Blender writes itself: the output of data modes is fixed from the start of a render job to its end.
_fixed_jobs: dict[int, ExitStack] = {}


@bpy.app.handlers.persistent
def _begin_job(scene: bpy.types.Scene, *_: object) -> None:
    _end_job(scene)
    view_transform = mode_of_render(scene).view
    if scene.render.engine == ENGINE_NAME and view_transform is not None:
        stack = ExitStack()
        stack.enter_context(fixed_output(scene, view_transform))
        _fixed_jobs[scene.session_uid] = stack


@bpy.app.handlers.persistent
def _end_job(scene: bpy.types.Scene, *_: object) -> None:
    stack = _fixed_jobs.pop(scene.session_uid, None)
    if stack is not None:
        stack.close()


def _handler_lists() -> tuple[tuple[list, object], ...]:
    handlers = bpy.app.handlers
    return (
        (handlers.render_init, _begin_job),
        (handlers.render_complete, _end_job),
        (handlers.render_cancel, _end_job),
    )


def register() -> None:
    """Watch render jobs, so that the files of data modes hold data."""
    for handlers, handler in _handler_lists():
        handlers.append(handler)


def unregister() -> None:
    """Stop watching. Scripts may empty Blender's lists of handlers: missing ones are not removed."""
    for handlers, handler in _handler_lists():
        if handler in handlers:
            handlers.remove(handler)
