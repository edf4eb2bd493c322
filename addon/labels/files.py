"""Labelled images as files of several formats, and beside them what their numbers mean. Knows no Blender.

    save_labels(labels, folder, "labels_0001", ("png", "exr"))

npz  one file of everything
npy  a folder of the frame's name, a file for each array
png  16 bits of grey for each of depth, things, categories, materials and labels
exr  one file of several layers, 32-bit floats and whole numbers

Of all but .npz the meaning stands in `STEM.json`, which is written last.
"""

from __future__ import annotations

import difflib
import json
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..support.files import prepare_folder, replacing
from .exr import Channels, check_exr, exr_channels, write_exr
from .labels import ARRAYS, Labels
from .png import MOST, Uint16Array, check_png, grey_images, write_grey

FORMATS = ("npz", "npy", "png", "exr")
DEPTH_SCALE = 0.001  # world units a step of a PNG's depth: a millimetre where a unit is a metre
_NOT_IN_PNG = ("positions", "normals", "uvs", "flow", "masks that are hidden")


def file_names(
    stem: str, formats: Sequence[str], *, labels: Sequence[str] = (), layers: int = 1, flow: bool = False
) -> list[str]:
    """What `save_labels` will write, into its folder, of an image that `label_image` is asked for in this way."""
    plain = [f"label_{name}" for name in plain_names(labels).values()] if set(formats) - {"npz"} else []
    arrays = [*ARRAYS, *(["flow"] if flow else []), *plain]
    of_layers = [f"{what}_layer_{number}" for number in range(1, layers + 1) for what in ("things", "depth")]
    images = ["things", "categories", "materials", *plain, "depth", *(of_layers if layers > 1 else [])]
    names = {
        "npz": [f"{stem}.npz"],
        "npy": [f"{stem}/{name}.npy" for name in arrays],
        "png": [f"{stem}_{name}.png" for name in images],
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

    labels: by their names; ValueError, too, if two would be files or layers of one name.
    """
    for name in formats:
        if name not in FORMATS:
            near = difflib.get_close_matches(name, FORMATS, n=1, cutoff=0.5)
            hint = f" (is it {near[0]!r}?)" if near else ""
            raise ValueError(f"formats must be some of {', '.join(FORMATS)}, got {name!r}{hint}")
    if "exr" in formats:
        check_exr()
    if "png" in formats:
        check_png()
    if set(formats) - {"npz"}:
        plain_names(labels)


def plain_names(labels: Iterable[str]) -> dict[str, str]:
    """What labels are called in names of files and layers: with `_` for what is no letter, digit, `_` or `-`."""
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
    """Writes what was labelled; each file takes its name once it is complete.

    folder: one that is there. stem: of the files' names. formats: some of `FORMATS`. depth_scale: of PNG, world units a
    step. frame: its number, for the one who reads STEM.json. In PNG, and as ids in EXR, a row is its number + 1 and 0
    is nothing; in PNG depths that 16 bits do not reach are 0, too, which is a warning. Raises ValueError for what a
    format cannot hold, before any file is written, ImportError, OSError.
    """
    folder = Path(folder)
    check_formats(formats, labels.labels)
    if not depth_scale > 0.0:
        raise ValueError(f"save_labels: depth_scale must be above 0, got {depth_scale}")
    plain = plain_names(labels.labels)
    images, too_far = grey_images(labels, depth_scale, plain) if "png" in formats else ({}, 0)
    channels = exr_channels(labels, plain) if "exr" in formats else {}
    far = f"PNG: depth beyond {MOST * depth_scale:g} is 0 there; a larger depth scale reaches it"
    warnings = (far,) if too_far else ()
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
    """A line for each fact: Python indents many things slowly."""
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
    files = {}
    for name, image in images.items():
        file = folder / f"{stem}_{name}.png"
        with replacing(file) as place:
            write_grey(place, image)
        files[name] = file.name
        made.append(file)
    return {
        "files": files,
        "ids": "a pixel is 1 + a row of things, categories, material_names or a label's names, or 1 + its number; "
        "0 is nothing",
        "depth": "a pixel times depth_scale is the depth in world units; 0 is nothing, or farther than 65535 of them",
    }


def _save_exr(channels: Channels, file: Path, made: list[Path]) -> dict[str, Any]:
    with replacing(file) as place:
        write_exr(place, channels)
    made.append(file)
    return {
        "file": file.name,
        "channels": {name: str(image.dtype) for name, image in channels.items()},
        "ids": "whole numbers: 1 + a row of things, categories, material_names or a label's names; 0 is nothing. "
        "Labels that are numbers are floats, NaN where there is none",
        "depth": "world units, 1e10 where there is nothing",
    }
