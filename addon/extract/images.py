"""Images that materials and the world show, as arrays: read once, and again when Blender's image is another.

An image is taken as unchanged if its file, its size and its settings are as before and nobody has painted on it. One
with unsaved strokes is read at every sync, as are movies and sequences: nothing tells when the next stroke came, or the
next frame.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ..sync.records import ImageRecord

Extension = Literal["repeat", "extend", "clip"]
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.float32]

# Blender's own colour for an image that cannot be loaded.
_MISSING = np.array([[(255, 0, 255, 255)]], np.uint8)
_EXTENSIONS: dict[str, Extension] = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "repeat"}
_MOVING = {"MOVIE", "SEQUENCE"}
_LINEAR_SPACES = {"Non-Color", "Linear", "Linear Rec.709", "scene_linear", "Raw"}


@dataclass(slots=True)
class ImageCache:
    """What was read last, by image: what it looked like from outside, and its pixels."""

    held: dict[int, tuple[tuple[Any, ...], Pixels]] = field(default_factory=dict)

    def is_current(self) -> bool:
        """Whether reading the same images again would give the same."""
        if not self.held:
            return True
        import bpy

        images = {image.session_uid: image for image in bpy.data.images}
        return all(uid in images and _has_look(images[uid], look) for uid, (look, _) in self.held.items())


class ImageReader:
    """Gives each image that is met a row, in the order they are met. The cache then holds those, and no others."""

    def __init__(self, cache: ImageCache) -> None:
        self._before = cache.held
        self.cache = ImageCache()
        self._rows: dict[tuple[int, str], int] = {}
        self.records: list[ImageRecord] = []
        self.warnings: list[str] = []

    def row(self, node: Any) -> int:
        """The row of the image of an evaluated image or environment texture node."""
        image, extension = node.image, _EXTENSIONS.get(getattr(node, "extension", "REPEAT"), "repeat")
        uid = image.original.session_uid
        row = self._rows.get((uid, extension))
        if row is None:
            row = self._rows[uid, extension] = len(self.records)
            self.records.append(ImageRecord(image.name, uid, self._pixels(image, uid), extension))
        return row

    def _pixels(self, image: Any, uid: int) -> Pixels:
        held = self.cache.held.get(uid) or self._before.get(uid)
        if held is None or not _has_look(image, held[0]):
            pixels = _read_pixels(image)
            if pixels is None:
                self.warnings.append(f"image {image.name!r} could not be loaded from {image.filepath!r}")
                pixels = _MISSING
            held = _look_of(image), pixels
        self.cache.held[uid] = held
        return held[1]


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
    )


def _read_pixels(image: Any) -> Pixels | None:
    """(H, W, 4), row 0 at the bottom: uint8 if the image is of sRGB bytes, else scene-linear float32."""
    width, height = image.size
    if not width or not height:
        return None
    values = np.empty(width * height * 4, np.float32)
    if len(image.pixels) != len(values):  # of fewer channels than Blender lets Python write
        return None
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, 4)
    if not image.is_float and image.colorspace_settings.name not in _LINEAR_SPACES:
        return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    if image.is_float:  # stored multiplied by alpha
        alpha = values[..., 3:]
        np.divide(values[..., :3], alpha, out=values[..., :3], where=(alpha > 0.0) & (alpha < 1.0))
    return values
