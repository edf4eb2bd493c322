"""The tiles of a UDIM image: one image for each unit square of a uv map.

Blender shows Python the pixels of the first tile alone; the others are loaded from their files. Those of which the
newest pixels are in no file (painted on, packed, generated) are written into files for a moment, where Blender can
write copies (not in 4.2).
"""

from __future__ import annotations

import ctypes
import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import bpy

T = TypeVar("T")


def is_tiled(image: Any) -> bool:
    """Whether surfaces show its tiles; other images have none."""
    return bool(image.source == "TILED" and len(image.tiles))


def look_of_tiles(image: Any) -> tuple[Any, ...]:
    """Everything that says that the tiles' pixels are others, short of reading them."""
    if not is_tiled(image):
        return ()
    path = bpy.path.abspath(image.filepath, library=image.library)
    packed = tuple([packed.size for packed in image.packed_files])
    return (
        packed,
        *((tile.number, _look_of_file(_path_of(path, tile.number)), _fill_of(tile)) for tile in image.tiles),
    )


def _fill_of(tile: Any) -> tuple[Any, ...]:
    """What a tile without a file is generated of."""
    if not getattr(tile, "is_generated_tile", True):  # Blender 4.2 does not say
        return ()
    size = tile.generated_width, tile.generated_height
    return (tile.generated_type, tuple(tile.generated_color), *size, tile.use_generated_float)


def read_tiles(image: Any, read: Callable[[Any, str], T | None], warn: Callable[[str], None]) -> dict[int, T]:
    """What `read` makes of each tile, by the tiles' numbers, in their order. What is missing is left out and named.

    read: takes an image and the name of the colour space that its bytes are of.
    Each is read as an image of its own, which is gone afterwards; the first as the image itself.
    """
    numbers = [tile.number for tile in image.tiles]
    found = {numbers[0]: read(image, image.colorspace_settings.name)}
    if len(numbers) > 1:
        with _files_of(image, warn) as path, temporary_data() as data:
            for number in numbers[1:]:
                found[number] = _read_tile(data, image, _path_of(path, number), read)
    for number in [number for number, pixels in found.items() if pixels is None]:
        warn(f"tile {number} could not be loaded from {image.filepath!r}")
    return {number: pixels for number, pixels in found.items() if pixels is not None}


@contextmanager
def temporary_data() -> Iterator[Any]:
    """A place for images that `bpy.data` does not list, gone afterwards.

    Blender (4.2 to 5.2) gives the object away without counting that it holds it, too, and lets go of it all the same:
    dropping it then would free what may have become another object's. So it is counted here.
    """
    with bpy.data.temp_data() as data:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(data))
        yield data


def _read_tile(data: Any, image: Any, path: str, read: Callable[[Any, str], T | None]) -> T | None:
    try:
        tile = data.images.load(path)
    except RuntimeError:  # there is no such file
        return None
    # Bytes are handed out as they are. Settings are left alone where they can be: Blender tells of changes, even of an
    # image that is gone.
    space = image.colorspace_settings.name
    if tile.is_float and tile.colorspace_settings.name != space:
        tile.colorspace_settings.name = space
    if tile.alpha_mode != image.alpha_mode:
        tile.alpha_mode = image.alpha_mode
    return read(tile, space)


@contextmanager
def _files_of(image: Any, warn: Callable[[str], None]) -> Iterator[str]:
    """The path, with a token for the number, of files with the tiles as they are now."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    # Blender 4.2 does not say which are generated, nor could it write them: they are warned of as missing files are.
    has_files = bool(image.filepath) and not any(getattr(tile, "is_generated_tile", False) for tile in image.tiles)
    if has_files and not image.is_dirty and not len(image.packed_files):
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = str(Path(folder) / "tile.<UDIM>")
        if not _save_copy(image, copy):
            warn(f"it has tiles that were not saved; shown are those of {image.filepath!r}")
            copy = path
        yield copy


def _save_copy(image: Any, path: str) -> bool:
    """Whether every tile could be written."""
    is_main = threading.current_thread() is threading.main_thread()  # a render in a window may not save anything
    if not is_main or "save_copy" not in bpy.types.Image.bl_rna.functions["save"].parameters:
        return False
    try:
        image.save(filepath=path, save_copy=True)
    except RuntimeError:  # no tile is filled yet
        return False
    return True


def _path_of(path: str, number: int) -> str:
    column, row = (number - 1001) % 10, (number - 1001) // 10
    return path.replace("<UDIM>", f"{number:04d}").replace("<UVTILE>", f"u{column + 1}_v{row + 1}")


def _look_of_file(path: str) -> tuple[int, int]:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size
