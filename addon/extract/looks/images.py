"""Images of materials and the world, as arrays: read once, and again when Blender's image has changed.

An image counts as unchanged if its file, its size and its settings are as before and it was not painted on. One
with unsaved strokes is read at every sync, as are movies and sequences: Blender does not report the next stroke or the
next frame. Of a sequence the file of the frame is read; of a movie Blender gives Python only the first frame.
"""

from __future__ import annotations

import ctypes
import operator
import os
import re
import tempfile
import threading
from collections.abc import Callable, Collection, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import bpy
import numpy as np
import numpy.typing as npt

from ...sync.look_records import Extension, ImageRecord, Interpolation, Pixels
from ...sync.not_shown import NotShown
from .values import Nodes, Source, Value

# The tiles of a UDIM image: one image for each unit square of a uv map.
#
# Blender shows Python the pixels of the first tile alone; the others are loaded from their files. Those of which the
# newest pixels are in no file (painted on, packed, generated) are written into files for a moment, where Blender can
# write copies (not in 4.2).


T = TypeVar("T")


def is_tiled(image: Any) -> bool:
    """Whether surfaces show its tiles; other images have none."""
    return bool(image.source == "TILED" and len(image.tiles))


def look_of_tiles(image: Any) -> tuple[Any, ...]:
    """Everything that says that the tiles' pixels are others, short of reading them."""
    if not is_tiled(image):
        return ()
    path = bpy.path.abspath(image.filepath, library=image.library)
    packed = tuple([sample_packed(packed) for packed in image.packed_files])
    return (
        packed,
        *((tile.number, _look_of_file(_path_of(path, tile.number)), _fill_of(tile)) for tile in image.tiles),
    )


def sample_packed(packed: Any) -> tuple[int, bytes]:
    """Read bytes that distinguish a packed file from others of its size: its end with checksums, and some others."""
    data = packed.data
    return len(data), data[-64:] + data[:: 1 + len(data) // 4096]


def _fill_of(tile: Any) -> tuple[Any, ...]:
    """The settings from which a tile without a file is generated."""
    if not getattr(tile, "is_generated_tile", True):  # Blender 4.2 does not say
        return ()
    size = tile.generated_width, tile.generated_height
    return (tile.generated_type, tuple(tile.generated_color), *size, tile.use_generated_float)


def read_tiles(image: Any, read: Callable[[Any], T | None], warn: Callable[[str], None]) -> dict[int, T]:
    """Return the results of `read` for each tile, by the tiles' numbers, in order. Missing tiles are reported.

    Each is read as a separate image, which is removed afterwards; the first as the image itself.
    """
    numbers = [tile.number for tile in image.tiles]
    found = {numbers[0]: read(image)}
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


def _read_tile(data: Any, image: Any, path: str, read: Callable[[Any], T | None]) -> T | None:
    try:
        tile = data.images.load(path)
    except RuntimeError:  # there is no such file
        return None
    # Bytes are returned unchanged. Settings are only changed where necessary: Blender reports each change, even of an
    # image that was removed.
    space = image.colorspace_settings.name
    if tile.is_float and tile.colorspace_settings.name != space:
        tile.colorspace_settings.name = space
    if tile.alpha_mode != image.alpha_mode:
        tile.alpha_mode = image.alpha_mode
    return read(tile)


@contextmanager
def _files_of(image: Any, warn: Callable[[str], None]) -> Iterator[str]:
    """Yield the path, with a token for the number, of files with the tiles' current pixels."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    # Blender 4.2 does not say which are generated, nor could it write them: they are warned of as missing files are.
    has_files = bool(image.filepath) and not any(getattr(tile, "is_generated_tile", False) for tile in image.tiles)
    if has_files and not image.is_dirty and not len(image.packed_files):
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = str(Path(folder) / "tile.<UDIM>")
        if not _save_copy(image, copy):
            warn(f"it has unsaved tiles; the tiles of {image.filepath!r} are used")
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


# Sequences -----------------------------------------------------------------------------------------------------------
# Which file a sequence shows in a frame, as Blender counts.


def sequence_number(user: Any, frame: int) -> int:
    """The number of the file that an image's user asks for in a frame of the scene."""
    if user.frame_duration == 0:
        return 0
    number = frame - user.frame_start + 1
    if user.use_cyclic:
        number = (number - 1) % user.frame_duration + 1
    return int(max(min(max(number, 0), user.frame_duration) + user.frame_offset, 0))


def sequence_path(image: Any, number: int) -> str:
    """The file of that number: the last digits of the name are replaced."""
    folder, name = os.path.split(bpy.path.abspath(image.filepath, library=image.library))
    stem, suffix = os.path.splitext(name)
    found = list(re.finditer(r"\d+", stem))
    start, end = found[-1].span() if found else (len(stem), len(stem))
    return os.path.join(folder, f"{stem[:start]}{number:0{end - start}d}{stem[end:]}{suffix}")


# Images --------------------------------------------------------------------------------------------------------------


Floats = npt.NDArray[np.float32]
Tiles = dict[int, Pixels]
Read = TypeVar("Read", Pixels, Tiles)

# Blender's own colour for an image that cannot be loaded.
_MISSING = np.array([[(255, 0, 255, 255)]], np.uint8)
_MOVING = {"MOVIE", "SEQUENCE"}
_LINEAR_SPACES = {"Non-Color", "Linear", "Linear Rec.709", "scene_linear", "Raw"}
# Previews have fewer pixels than that.
_MOST_PREVIEWED = 1024


@dataclass(slots=True)
class ImageCache:
    """The results of the last reading.

    held: by image and use: the image's properties, and the pixels. around: by the nodes of a
    world: their images, and the pixels of their colours in each direction.
    """

    held: dict[tuple[int, Hashable], tuple[tuple[Any, ...], Any]] = field(default_factory=dict)
    around: dict[Hashable, tuple[list[Pixels], Floats]] = field(default_factory=dict)

    def is_current(self) -> bool:
        """Whether reading the same images again would give the same."""
        if not self.held:
            return True
        import bpy

        images = {image.session_uid: image for image in bpy.data.images}
        looks = {(uid, look) for (uid, _), (look, _) in self.held.items()}  # of an image once
        return all(uid in images and _has_look(images[uid], look) for uid, look in looks)


class ImageReader:
    """Gives each image a row, in the order of first use. Afterwards the cache holds only those.

    for_preview: images are kept at a lower resolution, at most about 1024 pixels a side; of UDIM images only the first
    tile, and of sequences only the first file. Reading others creates temporary data-blocks, which a thread must not do
    while the user edits. frame: the scene's.
    """

    def __init__(self, cache: ImageCache, frame: int = 1, *, for_preview: bool = False) -> None:
        self._frame = frame
        self._before, self._around_before, self._for_preview = cache.held, cache.around, for_preview
        self.cache = ImageCache()
        self._rows: dict[tuple[Hashable, ...], int] = {}
        self.sources: Collection[Source] = ()  # what nodes ask of instances
        self.records: list[ImageRecord] = []
        self.not_shown: dict[NotShown, None] = {}  # in the order in which they are met

    def row(
        self, image: Any, extension: Extension = "repeat", interpolation: Interpolation = "linear", user: Any = None
    ) -> int:
        """Return the row of an image with this extension and interpolation.

        user: The image user that says which file of a sequence a node shows.
        """
        uid = image.original.session_uid
        number = self._number_of(image, user)
        place = (uid, extension, interpolation, number)
        row = self._rows.get(place)
        if row is None:
            row = self._rows[place] = len(self.records)
            tiles: Tiles = {}
            if self._shows_tiles(image):
                tiles = self._held(image, uid, "tiles", lambda: self._tiles(image, uid))
                pixels = next(iter(tiles.values()), _MISSING)
            elif number is not None:
                pixels = self._held(image, uid, number, lambda: self._of_sequence(image, number))
            else:
                pixels = self._held(image, uid, None, lambda: self._original(image, uid))
            is_linear = image.colorspace_settings.name in _LINEAR_SPACES
            self.records.append(ImageRecord(image.name, uid, pixels, extension, interpolation, tiles, is_linear))
        return row

    def around(self, nodes: Hashable, make: Callable[[], Floats]) -> Floats:
        """Return the colours of a world's nodes in each direction; computed again only if nodes or images changed."""
        shown = [record.pixels for record in self.records]
        images, pixels = self._around_before.get(nodes, ([], None))
        is_same = len(images) == len(shown) and all(map(operator.is_, images, shown))
        if pixels is None or not is_same:
            pixels = make()
        self.cache.around[nodes] = shown, pixels
        return pixels

    def has_alpha(self, image: Any, row: int) -> bool:
        """Whether some pixel of an image, which has this row, is not opaque."""
        if image.channels not in {2, 4}:
            return False
        pixels = self.records[row].pixels
        opaque = 255 if pixels.dtype == np.uint8 else 1.0
        uid = image.original.session_uid
        return bool(self._held(image, uid, "alpha", lambda: np.array([(pixels[..., 3] < opaque).any()])).all())

    def mean(self, nodes: Nodes, value: Value) -> tuple[float, ...]:
        """Estimate the mean of a value over the surfaces that show it."""
        if value.is_even:
            operand = value.operand
            return operand if isinstance(operand, tuple) else (float(operand),)  # type: ignore[arg-type]
        return nodes.mean(value.operand, self.arguments(), [source.stand_in for source in self.sources])

    def arguments(self) -> list[dict[str, Any]]:
        """The images as nodes take them; of a UDIM image its first tile."""
        return [
            {
                **{name: getattr(record, name) for name in ("pixels", "extension", "interpolation", "is_linear")},
                "tiles": [],
            }
            for record in self.records
        ]

    def _shows_tiles(self, image: Any) -> bool:
        return is_tiled(image) and not self._for_preview

    def _number_of(self, image: Any, user: Any) -> int | None:
        """Which file of a sequence is shown; None of other images, and where the image has its pixels itself."""
        if image.source == "MOVIE" and not self._for_preview:
            self._warn(image, "movies are unsupported; the first frame is used")
        if image.source != "SEQUENCE" or user is None or self._for_preview or image.packed_file is not None:
            return None
        return sequence_number(user, self._frame)

    def _of_sequence(self, image: Any, number: int) -> Pixels:
        path = sequence_path(image, number)
        with temporary_data() as data:
            pixels = _read_tile(data, image, path, _read_pixels)
        if pixels is None:
            self._warn(image, f"it could not be loaded from {path!r}; magenta is used")
            return _MISSING
        return pixels

    def _original(self, image: Any, uid: int) -> Pixels:
        """Read Blender's pixels, without storing them in the cache."""
        held = self.cache.held.get((uid, None)) or self._before.get((uid, None))
        if held is not None and held[1] is not _MISSING and _has_look(image, held[0]):
            return held[1]  # type: ignore[no-any-return]
        pixels = _read_pixels(image)
        if pixels is None:
            self._warn(image, f"it could not be loaded from {image.filepath!r}; magenta is used")
            return _MISSING
        if self._for_preview:
            step = -(-max(pixels.shape[:2]) // _MOST_PREVIEWED)
            return pixels if step == 1 else pixels[::step, ::step].copy()
        return pixels

    def _tiles(self, image: Any, uid: int) -> Tiles:
        """The same, by the numbers of those that could be loaded."""
        held = self.cache.held.get((uid, "tiles")) or self._before.get((uid, "tiles"))
        if held is not None and _has_look(image, held[0]):
            return held[1]  # type: ignore[no-any-return]
        return read_tiles(image, _read_pixels, lambda text: self._warn(image, text))

    def _warn(self, image: Any, text: str) -> None:
        self.not_shown[NotShown("image", image.name, image.original.session_uid, text)] = None

    def _held(self, image: Any, uid: int, key: Hashable, make: Callable[[], Read]) -> Read:
        held = self.cache.held.get((uid, key)) or self._before.get((uid, key))
        if held is None or not image.has_data or not _has_look(image, held[0]):
            pixels = make()  # loads the image, which changes its look
            held = _look_of(image), pixels
        self.cache.held[uid, key] = held
        return held[1]  # type: ignore[no-any-return]


def _has_look(image: Any, look: tuple[Any, ...]) -> bool:
    return not image.is_dirty and image.source not in _MOVING and _look_of(image) == look


def _look_of(image: Any) -> tuple[Any, ...]:
    """Everything that says that the pixels are others, short of reading them."""
    import bpy

    path = bpy.path.abspath(image.filepath, library=image.library)
    try:
        status = os.stat(path)
        file = (status.st_mtime_ns, status.st_size)
    except (OSError, ValueError):
        file = (0, 0)  # packed, generated or missing
    packed = sample_packed(image.packed_file) if image.packed_file is not None else None
    return (
        *(image.source, image.type, path, file, packed, tuple(image.size), image.is_float),
        *(image.colorspace_settings.name, image.alpha_mode, image.has_data),
        *(image.generated_type, tuple(image.generated_color)),
        *look_of_tiles(image),
    )


def _read_pixels(image: Any) -> Pixels | None:
    """(H, W, 4), row 0 at the bottom: uint8 if the image is of bytes, else scene-linear float32."""
    width, height = image.size
    if not width or not height:
        return None
    values = np.empty((height, width, 4), np.float32)
    if len(image.pixels) != values.size:  # of fewer channels than Blender lets Python write
        return None
    image.pixels.foreach_get(values.reshape(-1))
    if not image.is_float:
        return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    alpha = values[..., 3:]  # which colours are stored multiplied by
    np.divide(values[..., :3], alpha, out=values[..., :3], where=(alpha > 0.0) & (alpha < 1.0))
    return values
