"""Cycles' images as files, so that tests wait for Cycles once: `nox -s cycles_images` writes tests/cycles_images.

An image is found by the digest of the scene that it was made of (`scene_digest`), so no other scene's can be taken for
it, by any test in any order. A scene without a recording is rendered. pytest's summary says how many were. Outside
pytest, and without Blender's release that recorded them, everything is rendered. `pytest --live-cycles` renders
everything, and reports whether Cycles still makes the recorded images.
"""

from __future__ import annotations

import io
import lzma
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt

Planes = dict[str, npt.NDArray[np.float32]]
Mode = Literal["recall", "record", "live"]
SUFFIX = ".npz.xz"
# Values are kept as bytes: the first byte of all values, then the second, and so on. So they compress better.
Packed = npt.NDArray[np.uint8]


class Recordings:
    """The recordings of one session of tests, a file for each test file.

    mode: "recall" renders scenes without a recording, "record" renders everything and writes it in the end, "live"
    renders everything and compares it with the recordings.
    """

    def __init__(self, folder: Path, mode: Mode) -> None:
        self.mode = mode
        self.current: str | None = None  # the current test file: its path within tests/, no suffix
        self._folder = folder
        self._files: dict[str, dict[str, Packed]] = {}
        self._counts: Counter[str] = Counter()

    def planes(self, digest: str, names: Sequence[str], is_half: bool, render: Callable[[], Planes]) -> Planes:
        """The planes `names` of the scene with this digest; is_half: rendered values may be rounded to 11 bits."""
        if self.current is None:
            return render()
        kept = self._kept(self.current)
        keys = [f"{digest}/{'half' if is_half else 'whole'}/{name}" for name in names]
        if self.mode == "recall" and all(key in kept for key in keys):
            self._counts["recalled"] += 1
            return {name: unpack(kept[key]) for name, key in zip(names, keys, strict=True)}
        self._counts["rendered"] += 1
        made = render()
        packed = {key: pack(made[name], is_half) for name, key in zip(names, keys, strict=True)}
        for key, plane in packed.items():
            if key in kept and not is_alike(unpack(kept[key]), unpack(plane)):
                raise AssertionError(
                    f"{self.current}: two images of Cycles differ whose scenes have one digest, {key}: "
                    "scene_digest passes over what makes the difference; let it take that in"
                )
        if self.mode == "record":
            kept |= packed
        return {name: unpack(packed[key]) for name, key in zip(names, keys, strict=True)}

    def take_counts(self) -> Counter[str]:
        """How many images were "rendered" and "recalled" since the last call."""
        counts, self._counts = self._counts, Counter()
        return counts

    def write(self, failed: Collection[str | None] = ()) -> None:
        """Replace the files of those tests that have run; those that have `failed` keep their recordings."""
        for name, kept in self._files.items():
            if name in failed:
                continue
            path = self._path(name)
            if not kept:
                path.unlink(missing_ok=True)
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            data = io.BytesIO()
            np.savez(data, **{key: kept[key] for key in sorted(kept)})
            path.write_bytes(lzma.compress(data.getvalue(), preset=9 | lzma.PRESET_EXTREME))

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}{SUFFIX}"

    def _kept(self, name: str) -> dict[str, Packed]:
        if name not in self._files:
            path = self._path(name)
            self._files[name] = {}
            if self.mode != "record" and path.is_file():
                with np.load(io.BytesIO(lzma.decompress(path.read_bytes()))) as data:
                    self._files[name] = dict(data)
        return self._files[name]


active: Recordings | None = None  # set by pytest's hooks alone


def is_alike(plane: npt.NDArray[np.float32], other: npt.NDArray[np.float32]) -> bool:
    """Whether Cycles may have made both of one scene: processors round differently, which few pixels show."""
    close = plane.shape == other.shape and np.isclose(plane, other, rtol=0.01, atol=1e-4, equal_nan=True)
    return bool(np.mean(close) > 0.98)


def pack(plane: npt.NDArray[np.float32], is_half: bool) -> Packed:
    """(N, H, W) of an (H, W) image: N bytes of each value; is_half: rounded to half precision where that suffices.

    N gives the type: 1 for whole numbers below 256, 2 for half, 4 for single precision.
    """
    kept: npt.NDArray[np.generic] = plane
    if plane.min() >= 0.0 and plane.max() <= 255.0 and not (plane % 1.0).any():
        kept = plane.astype(np.uint8)
    elif is_half and np.abs(plane).max() <= np.finfo(np.float16).max:
        kept = plane.astype(np.float16)
    parts = np.ascontiguousarray(kept).view(np.uint8).reshape(*plane.shape, kept.dtype.itemsize)
    return np.ascontiguousarray(np.moveaxis(parts, -1, 0))


def unpack(packed: Packed) -> npt.NDArray[np.float32]:
    """The (H, W) image that `pack` made it of, rounded where it rounded."""
    kind = {1: np.uint8, 2: np.float16, 4: np.float32}[len(packed)]
    return np.ascontiguousarray(np.moveaxis(packed, 0, -1)).view(kind)[..., 0].astype(np.float32)
