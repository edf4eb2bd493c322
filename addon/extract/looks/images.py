"""Images that materials and the world show, as arrays: read once, and again when Blender's image is another.

An image is taken as unchanged if its file, its size and its settings are as before and it was not painted on. One
with unsaved strokes is read at every sync, as are movies and sequences: nothing tells when the next stroke came, or the
next frame. What nodes make of an image's pixels is worked out once, too.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from ...sync.not_shown import NotShown
from ...sync.records import ImageRecord
from .image_tiles import is_tiled, look_of_tiles, read_tiles
from .values import OWN_ALPHA, Value

Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]
Floats = npt.NDArray[np.float32]
Tiles = dict[int, Pixels]
Read = TypeVar("Read", Pixels, Tiles)

# Blender's own colour for an image that cannot be loaded.
_MISSING = np.array([[(255, 0, 255, 255)]], np.uint8)
_MOVING = {"MOVIE", "SEQUENCE"}
_LINEAR_SPACES = {"Non-Color", "Linear", "Linear Rec.709", "scene_linear", "Raw"}
# What nodes change is worked out for no more pixels a side, some rows at a time; a mean is taken of fewer.
_MOST_CHANGED, _ROWS, _SAMPLED = 2048, 64, 64
# Previews have fewer pixels than that.
_MOST_PREVIEWED = 1024


@dataclass(slots=True)
class ImageCache:
    """What was read last, by image and what was made of it: what it looked like from outside, and the pixels."""

    held: dict[tuple[int, Hashable], tuple[tuple[Any, ...], Any]] = field(default_factory=dict)

    def is_current(self) -> bool:
        """Whether reading the same images again would give the same."""
        if not self.held:
            return True
        import bpy

        images = {image.session_uid: image for image in bpy.data.images}
        return all(uid in images and _has_look(images[uid], look) for (uid, _), (look, _) in self.held.items())


class ImageReader:
    """Gives each image that is met a row, in the order they are met. The cache then holds those, and no others.

    for_preview: of an image only every so many pixels are kept, about 1024 a side at most, and of UDIM images the first
    tile alone: to read the others makes data-blocks for a moment, which a thread beside the user's edits must not.
    """

    def __init__(self, cache: ImageCache, *, for_preview: bool = False) -> None:
        self._before, self._for_preview = cache.held, for_preview
        self.cache = ImageCache()
        self._rows: dict[tuple[Hashable, ...], int] = {}
        self.records: list[ImageRecord] = []
        self.not_shown: dict[NotShown, None] = {}  # in the order in which they are met

    def row(self, color: Value | None, alpha: Value | None = None) -> int:
        """The row of an image with the colour of one value and the alpha of another; None for what is not looked at.

        Both have the same texture. Alpha may be the texture's own, which is what it is without a value.
        """
        given = [value for value in (color, alpha) if value is not None]
        texture = next(value.texture for value in given if value.texture is not None)
        uid = texture.image.original.session_uid
        key = (None if color is None else color.key, None if alpha is None or alpha.key == OWN_ALPHA else alpha.key)
        look_up = (texture.extension, texture.uv_transform, texture.uv_map)
        place = (uid, key, *look_up)
        row = self._rows.get(place)
        if row is None:
            row = self._rows[place] = len(self.records)
            image, tiles = texture.image, {}
            if self._shows_tiles(image):
                tiles = self._changed_tiles(image, uid, key, color, alpha)
                pixels = next(iter(tiles.values()), _MISSING)
            elif key == (None, None):
                pixels = self._held(image, uid, None, lambda: self._original(image, uid))
            else:
                pixels = self._held(image, uid, key, lambda: _change(self._original(image, uid), color, alpha))
            self.records.append(ImageRecord(image.name, uid, pixels, *look_up, tiles))
        return row

    def _shows_tiles(self, image: Any) -> bool:
        return is_tiled(image) and not self._for_preview

    def _changed_tiles(self, image: Any, uid: int, key: Hashable, color: Value | None, alpha: Value | None) -> Tiles:
        if key == (None, None):
            return self._held(image, uid, "tiles", lambda: self._tiles(image, uid))

        def change() -> Tiles:
            return {number: _change(pixels, color, alpha) for number, pixels in self._tiles(image, uid).items()}

        return self._held(image, uid, ("tiles", key), change)

    def mean(self, value: Value) -> Floats:
        """(4,): the mean of a value that has a texture."""
        assert value.texture is not None
        image = value.texture.image
        uid = image.original.session_uid

        def sample() -> Pixels:
            if not self._shows_tiles(image):
                return _sampled(self._original(image, uid))
            samples = [_sampled(pixels).reshape(-1, 1, 4) for pixels in self._tiles(image, uid).values()]
            return np.concatenate([_as_floats(pixels) for pixels in samples or [_MISSING]])

        sampled = _as_floats(self._held(image, uid, "sample", sample))
        return np.asarray(value.of(sampled).reshape(-1, 4).mean(axis=0), np.float32)

    def _original(self, image: Any, uid: int) -> Pixels:
        """As Blender has it, without a place in the cache."""
        held = self.cache.held.get((uid, None)) or self._before.get((uid, None))
        if held is not None and _has_look(image, held[0]):
            return held[1]  # type: ignore[no-any-return]
        pixels = _read_pixels(image)
        if pixels is None:
            self._warn(image, f"it could not be loaded from {image.filepath!r}; magenta is shown")
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


def _sampled(pixels: Pixels) -> Pixels:
    height, width = pixels.shape[:2]
    return pixels[:: -(-height // _SAMPLED), :: -(-width // _SAMPLED)].copy()


def _change(pixels: Pixels, color: Value | None, alpha: Value | None) -> Pixels:
    """What values make of an image; bytes of sRGB again if it was of such and nothing is too bright for them."""
    step = max(1, -(-max(pixels.shape[:2]) // _MOST_CHANGED))
    pixels = pixels[::step, ::step]
    made = np.empty(pixels.shape, np.float32)
    for first in range(0, len(pixels), _ROWS):
        part = _as_floats(pixels[first : first + _ROWS])
        target = made[first : first + _ROWS]
        target[...] = part
        if color is not None:
            target[..., :3] = color.of(part)[..., :3]
        if alpha is not None:
            target[..., 3] = alpha.of(part)[..., 0]
    np.nan_to_num(made, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    np.maximum(made, 0.0, out=made)
    if pixels.dtype != np.uint8 or made.max() > 1.0:
        return made
    rgb = made[..., :3]
    rgb[...] = np.where(rgb <= 0.0031308, rgb * 12.92, 1.055 * rgb ** (1 / 2.4) - 0.055)
    return np.rint(made * 255.0).astype(np.uint8)


def _as_floats(pixels: Pixels) -> Floats:
    """Scene-linear."""
    if pixels.dtype != np.uint8:
        return pixels  # type: ignore[return-value]
    floats = np.empty(pixels.shape, np.float32)
    floats[..., :3], floats[..., 3] = _LINEAR[pixels[..., :3]], pixels[..., 3] / 255.0
    return floats


_STEPS = np.arange(256) / 255.0
_LINEAR = np.where(_STEPS <= 0.04045, _STEPS / 12.92, ((_STEPS + 0.055) / 1.055) ** 2.4).astype(np.float32)


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
    packed = image.packed_file.size if image.packed_file is not None else 0
    return (
        *(image.source, image.type, path, file, packed, tuple(image.size), image.is_float),
        *(image.colorspace_settings.name, image.alpha_mode, image.has_data),
        *(image.generated_type, tuple(image.generated_color)),
        *look_of_tiles(image),
    )


def _read_pixels(image: Any, space: str | None = None) -> Pixels | None:
    """(H, W, 4), row 0 at the bottom: uint8 if the image is of sRGB bytes, else scene-linear float32.

    space: the name of the colour space of bytes, if it is not the image's own.
    """
    width, height = image.size
    if not width or not height:
        return None
    values = np.empty((height, width, 4), np.float32)
    if len(image.pixels) != values.size:  # of fewer channels than Blender lets Python write
        return None
    image.pixels.foreach_get(values.reshape(-1))
    if not image.is_float and (space or image.colorspace_settings.name) not in _LINEAR_SPACES:
        return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    if image.is_float:  # stored multiplied by alpha
        alpha = values[..., 3:]
        np.divide(values[..., :3], alpha, out=values[..., :3], where=(alpha > 0.0) & (alpha < 1.0))
    return values
