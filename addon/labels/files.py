"""Labelled images as files of several formats, and the meaning of their numbers. Does not depend on Blender.

    save_labels(labels, folder, "labels_0001", ("png", "exr"))

npz  one file of everything
npy  a folder of the frame's name, a file for each array
png  16 bits of grey for each of depth, object instances, categories, materials and labels; for viewers a colored copy
     of all except depth, .colors.png
exr  one file of several layers, 32-bit floats and whole numbers

All formats but .npz have the meaning of their numbers in `STEM.json`, which is written last.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..support.files import data_library, prepare_folder, replacing
from ..support.id_colors import id_colors
from ..sync.lookup import LabelColumn
from .labels import ARRAYS, Labels

# Labels as an OpenEXR file of several layers, as Blender and compositors read them.
#
# Channels are named LAYER.PASS.CHANNEL, as Blender names its own. Depths, normals, positions, uvs, flow and numeric
# labels are 32-bit floats; ids are unsigned whole numbers of 32 bits. Compressed without loss (ZIP).


LAYER = "Labels"
MOST_EXACT = 1 << 24  # of whole numbers as floats
Channels = dict[str, npt.NDArray[Any]]


def check_exr() -> None:
    """Raises ImportError with what to install."""
    _openexr()


def _openexr() -> Any:
    return data_library("OpenEXR", "EXR files need OpenEXR")


def exr_channels(labels: Labels, plain: Mapping[str, str]) -> Channels:
    """(H, W) float32 or uint32, by the channels' names. plain: what labels are called.

    Positions are rounded to float32, as are labels with fractions.

    Raises:
        ValueError: For labels of whole numbers that floats do not hold.
    """
    images: Channels = {"Depth.Z": labels.depth}
    for name, values, axes in (
        ("Normal", labels.normals, "XYZ"),
        ("Position", labels.positions, "XYZ"),
        ("UV", labels.uvs, "UV"),
        ("Vector", labels.flow, "XYZW"),
    ):
        if values is not None:
            images |= {f"{name}.{axis}": values[..., place] for place, axis in enumerate(axes)}
    ids = {"Thing": labels.thing_ids, "Category": labels.category_ids, "Material": labels.material_ids}
    images |= {f"{name}.X": _exr_ids(values) for name, values in ids.items()}
    if len(labels.layer_depths) > 1:
        for number, (depth, things) in enumerate(zip(labels.layer_depths, labels.layer_ids, strict=True), start=1):
            images |= {f"Depth {number}.Z": depth, f"Thing {number}.X": _exr_ids(things)}
    images |= {f"label {plain[name]}.X": _exr_label(name, label) for name, label in labels.labels.items()}
    return {
        f"{LAYER}.{name}": np.ascontiguousarray(image, None if image.dtype == np.uint32 else np.float32)
        for name, image in images.items()
    }


def _exr_ids(values: npt.NDArray[np.int32]) -> npt.NDArray[np.uint32]:
    return (values + 1).astype(np.uint32)


def _exr_label(name: str, label: LabelColumn) -> npt.NDArray[Any]:
    if label.names is not None:
        return _exr_ids(label.values)
    if not label.table.is_whole:
        return label.values
    is_there = label.values != label.table.missing
    highest = int(np.abs(label.values.astype(np.int64)).max(where=is_there, initial=0))
    if highest > MOST_EXACT:
        raise ValueError(
            f"exr: label {name!r} goes up to {highest:,}, and 32-bit floats hold whole numbers to {MOST_EXACT:,}: "
            "choose npy or npz"
        )
    return np.where(is_there, label.values, np.nan)


def write_exr(path: Path, channels: Channels) -> None:
    """Writes channels, row 0 on top. Raises OSError, ImportError."""
    library = _openexr()
    header = {"type": library.scanlineimage, "compression": library.ZIP_COMPRESSION}
    try:
        library.File(header, dict(channels)).write(str(path))  # a copy: the library changes its argument
    except RuntimeError as error:
        raise OSError(" ".join(str(error).split())) from error


# Png -----------------------------------------------------------------------------------------------------------------
# Images of labels as PNG files of 16 bits of grey. Needs no library, and does not depend on Blender.
#
# Depth as in BOP and KITTI: whole steps of a scale, 0 where nothing was hit. Ids are rows and numbers + 1, 0 for
# nothing. Files contain no gamma or colour profile, so that readers return the numbers unchanged.


Uint16Array = npt.NDArray[np.uint16]
MOST = 65535
_UP, _MOST_BYTES = 2, 1 << 30  # the filter that subtracts the row above; of a chunk
NOTHING_IN_SIGHT = 1e9  # depths beyond are of rays that hit nothing


def grey_images(labels: Labels, depth_scale: float, plain: Mapping[str, str]) -> tuple[dict[str, Uint16Array], int]:
    """Images by their names, (H, W), and how many pixels of all depths are too far away for 16 bits.

    Args:
        depth_scale: World units a step.
        plain: What labels are called.

    Raises:
        ValueError: For ids above 65,534, and for labels below 0 or with fractions.
    """
    ids = {"things": labels.thing_ids, "categories": labels.category_ids, "materials": labels.material_ids}
    images = {name: _png_ids(name, values) for name, values in ids.items()}
    for name, label in labels.labels.items():
        images[f"label_{plain[name]}"] = _png_label(name, label)
    depths = {"depth": labels.depth}
    if len(labels.layer_depths) > 1:
        for number, (depth, things) in enumerate(zip(labels.layer_depths, labels.layer_ids, strict=True), start=1):
            depths[f"depth_layer_{number}"] = depth
            images[f"things_layer_{number}"] = _png_ids("things", things)
    too_far = 0
    for name, depth in depths.items():
        images[name], farther = grey_depth(depth, depth_scale)
        too_far += farther
    return images, too_far


def grey_depth(depth: npt.NDArray[np.float32], depth_scale: float) -> tuple[Uint16Array, int]:
    """Returns (H, W) depths in whole steps, 0 for nothing, and the number of pixels that are too far for 16 bits.

    Args:
        depth_scale: World units a step.
    """
    steps = np.maximum(np.rint(depth.astype(np.float64) / depth_scale), 1.0)
    is_there = depth < NOTHING_IN_SIGHT
    is_near = is_there & (steps <= MOST)
    return np.where(is_near, steps, 0.0).astype(np.uint16), int((is_there & ~is_near).sum())


def too_far_warning(name: str, depth_scale: float) -> str:
    """Returns the sentence for a file's depths that are too far."""
    return f"{name}: depth beyond {MOST * depth_scale:g} is written as 0; use a larger depth scale"


def _png_label(name: str, label: LabelColumn) -> Uint16Array:
    if not label.table.is_whole:
        raise ValueError(
            f"png: label {name!r} has fractions, or -1 as a value: choose exr, npy or npz, or omit the label"
        )
    is_there = label.values != label.table.missing
    lowest = int(label.values.min(where=is_there, initial=0))
    if lowest < 0:
        raise ValueError(f"png: label {name!r} has the value {lowest}, and 0 means no hit: choose exr, npy or npz")
    return _png_ids(f"label {name!r}", np.where(is_there, label.values, -1))


def _png_ids(name: str, values: npt.NDArray[np.int32]) -> Uint16Array:
    highest = int(values.max(initial=-1))
    if highest >= MOST:
        raise ValueError(
            f"png: numbers of {name} go up to {highest:,}, and 16 bits hold {MOST - 1:,}: choose exr, npy or npz"
        )
    return (values + 1).astype(np.uint16)


def color_files(stem: str, names: Iterable[str]) -> dict[str, str]:
    """Returns the names of the files that show ids in colors, by the images' names. No label's file has a dot there."""
    return {name: f"{stem}_{name}.colors.png" for name in names if not name.startswith("depth")}


def colored(image: Uint16Array) -> npt.NDArray[np.uint8]:
    """Returns (H, W, 3) sRGB of ids as PNG stores them."""
    palette = id_colors(np.arange(-1, int(image.max(initial=0))))
    return np.rint(255.0 * palette).astype(np.uint8)[image]


def write_png(path: Path, image: Uint16Array | npt.NDArray[np.uint8]) -> None:
    """Writes (H, W) grey or (H, W, 3) sRGB, row 0 on top; the same bytes for the same image. Raises OSError."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image, f">u{image.itemsize}").view(np.uint8).reshape(height, -1)
    lines = np.full((height, 1 + rows.shape[1]), _UP, np.uint8)
    lines[:, 1:] = np.diff(rows, axis=0, prepend=np.uint8(0))
    packed = zlib.compress(lines.tobytes(), 1)  # a frame has several images: speed over size
    color_type = 2 if image.ndim == 3 else 0
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8 * image.itemsize, color_type, 0, 0, 0))]
    chunks += [(b"IDAT", packed[at : at + _MOST_BYTES]) for at in range(0, len(packed), _MOST_BYTES)]
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, content in (*chunks, (b"IEND", b"")):
            file.write(struct.pack(">I", len(content)) + kind + content)
            file.write(struct.pack(">I", zlib.crc32(kind + content)))


# Files ---------------------------------------------------------------------------------------------------------------


FORMATS = ("npz", "npy", "png", "exr")
DEPTH_SCALE = 0.001  # world units a step of a PNG's depth: a millimetre where a unit is a metre
_NOT_IN_PNG = ("positions", "normals", "uvs", "flow", "masks that are hidden")


def file_names(
    stem: str, formats: Sequence[str], *, labels: Sequence[str] = (), layers: int = 1, flow: bool = False
) -> list[str]:
    """Returns the names of the files that `save_labels` will write for an image with these settings."""
    plain = [f"label_{name}" for name in plain_names(labels).values()] if set(formats) - {"npz"} else []
    arrays = [*ARRAYS, *(["flow"] if flow else []), *plain]
    of_layers = [f"{what}_layer_{number}" for number in range(1, layers + 1) for what in ("things", "depth")]
    images = ["things", "categories", "materials", *plain, "depth", *(of_layers if layers > 1 else [])]
    names = {
        "npz": [f"{stem}.npz"],
        "npy": [f"{stem}/{name}.npy" for name in arrays],
        "png": [f"{stem}_{name}.png" for name in images] + [*color_files(stem, images).values()],
        "exr": [f"{stem}.exr"],
    }
    manifest = [f"{stem}.json"] if set(formats) - {"npz"} else []
    return [name for kind in FORMATS if kind in formats for name in names[kind]] + manifest


class SavedLabels(NamedTuple):
    """paths: of all files, in the order of writing. warnings: what they lack of the labels, as sentences."""

    paths: tuple[Path, ...]
    warnings: tuple[str, ...]


def check_formats(formats: Sequence[str], labels: Iterable[str] = ()) -> None:
    """Raises ValueError for a format that there is not, ImportError with what to install for one that needs more.

    Args:
        labels: By their names; ValueError, too, if two would be files or layers of one name.
    """
    for name in formats:
        if name not in FORMATS:
            near = difflib.get_close_matches(name, FORMATS, n=1, cutoff=0.5)
            hint = f" (is it {near[0]!r}?)" if near else ""
            raise ValueError(f"formats must be some of {', '.join(FORMATS)}, got {name!r}{hint}")
    if "exr" in formats:
        check_exr()
    if set(formats) - {"npz"}:
        plain_names(labels)


def plain_names(labels: Iterable[str]) -> dict[str, str]:
    """Returns the labels' names for files and layers: all except letters, digits, `_` and `-` becomes `_`."""
    found: dict[str, str] = {}
    for name in labels:
        plain = re.sub(r"[^\w-]", "_", name)
        other = next((each for each in found if found[each].casefold() == plain.casefold()), None)
        if other is not None:
            raise ValueError(f"labels {other!r} and {name!r} would both be files and layers named {plain!r}")
        found[name] = plain
    return found


def save_labels(
    labels: Labels,
    folder: str | os.PathLike[str],
    stem: str,
    formats: Sequence[str] = ("npz",),
    *,
    frame: int | None = None,
    depth_scale: float = DEPTH_SCALE,
) -> SavedLabels:
    """Writes a labelled image; each file gets its name once it is complete.

    Args:
        folder: An existing folder.
        stem: Of the files' names.
        formats: Some of `FORMATS`.
        depth_scale: Of PNG, world units a step.
        frame: The frame's number, for readers of STEM.json. In PNG, and as ids in EXR, a row is its number + 1 and 0
            is nothing. In PNG, depths beyond the range of 16 bits are 0, too, with a warning.

    Raises:
        ValueError: For data that a format cannot hold, before any file is written, ImportError, OSError.
    """
    from perfect_bvh._checks import check_number

    folder = Path(folder)
    check_formats(formats, labels.labels)
    check_number("save_labels", "depth_scale", depth_scale, 0.0, above=True)
    plain = plain_names(labels.labels)
    images, too_far = grey_images(labels, depth_scale, plain) if "png" in formats else ({}, 0)
    channels = exr_channels(labels, plain) if "exr" in formats else {}
    warnings = (too_far_warning("PNG", depth_scale),) if too_far else ()
    made: list[Path] = []
    meaning: dict[str, Any] = {}
    manifest = folder / f"{stem}.json"
    has_manifest = bool(set(formats) - {"npz"})
    if "npz" in formats:
        made.append(labels.save(folder / f"{stem}.npz"))
    if "npy" in formats:
        meaning["npy"] = _save_npy(labels, folder / stem, plain, made)
    if "png" in formats:
        facts = {"depth_scale": depth_scale, "too_far": too_far, "left_out": _left_out(labels)}
        meaning["png"] = _save_png(images, folder, stem, made) | facts
    if "exr" in formats:
        meaning["exr"] = _save_exr(channels, folder / f"{stem}.exr", made)
    if has_manifest:
        with replacing(manifest) as name:
            name.write_text(_json(_described(labels, frame, warnings) | meaning), encoding="utf-8")
        made.append(manifest)
    return SavedLabels(tuple(made), warnings)


def _json(facts: dict[str, Any]) -> str:
    """A line for each fact: Python's own indentation is slow."""
    lines = [f"{json.dumps(name)}: {json.dumps(fact, allow_nan=False)}" for name, fact in facts.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _left_out(labels: Labels) -> list[str]:
    return [name for name in _NOT_IN_PNG if name != "flow" or labels.flow is not None]


def _described(labels: Labels, frame: int | None, warnings: tuple[str, ...]) -> dict[str, Any]:
    shares, visible = labels.visible_shares.tolist(), labels.visible
    masks = zip(visible.areas.tolist(), visible.boxes().tolist(), labels.amodal.areas.tolist(), shares, strict=True)
    facts = [
        {"area": area, "box": box, "amodal_area": amodal, "visible_share": share} for area, box, amodal, share in masks
    ]
    return {
        "frame": frame,
        "size": list(labels.size),
        "camera": dict(labels.camera),
        "things": [thing | fact for thing, fact in zip(labels.described_things(), facts, strict=True)],
        "categories": list(labels.categories),
        "material_names": list(labels.material_names),
        "labels": labels.described_labels(),
        "warnings": [*labels.warnings, *warnings],
    }


def _save_npy(labels: Labels, folder: Path, plain: dict[str, str], made: list[Path]) -> dict[str, Any]:
    prepare_folder(folder)
    files = {}
    for name, array in labels.arrays().items():
        label = name.removeprefix("label_")
        file = folder / f"{f'label_{plain[label]}' if label != name else name}.npy"
        with replacing(file) as place, place.open("wb") as stream:
            np.save(stream, array, allow_pickle=False)
        files[name] = f"{folder.name}/{file.name}"
        made.append(file)
    for file in set(folder.glob("[!.]*.npy")) - set(made):
        if file.stem in (*ARRAYS, "flow") or file.stem.startswith("label_"):  # of an image with more in it
            file.unlink(missing_ok=True)
    return {"files": files}


def _save_png(images: dict[str, Uint16Array], folder: Path, stem: str, made: list[Path]) -> dict[str, Any]:
    files, colors = {name: f"{stem}_{name}.png" for name in images}, color_files(stem, images)
    written = {files[name]: image for name, image in images.items()}
    for file, image in (*written.items(), *((colors[name], colored(images[name])) for name in colors)):
        with replacing(folder / file) as place:
            write_png(place, image)
        made.append(folder / file)
    return {
        "files": files,
        "colors": colors,
        "ids": "a pixel is 1 + a row of things, categories, material_names or a label's names, or 1 + its number; "
        "0 means no hit",
        "depth": "a pixel times depth_scale is the depth in world units; 0 means no hit or one beyond 65535 steps",
    }


def _save_exr(channels: Channels, file: Path, made: list[Path]) -> dict[str, Any]:
    with replacing(file) as place:
        write_exr(place, channels)
    made.append(file)
    return {
        "file": file.name,
        "channels": {name: str(image.dtype) for name, image in channels.items()},
        "ids": "whole numbers: 1 + a row of things, categories, material_names or a label's names; 0 means no hit. "
        "Labels that are numbers are floats, NaN where there is none",
        "depth": "world units, 1e10 without a hit",
    }
