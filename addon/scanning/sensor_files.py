"""Sensors as files that people write (TOML), and the ones that come with the add-on. Does not depend on Blender.

A file contains the kind of the sensor, and the arguments of that pattern by their names:

    kind = "spinning"  # or "rosette", "raster", "depth camera"
    elevations = { first = -15.0, last = 15.0, count = 16 }  # or the whole table, [-15.0, -13.0, ...]
    columns = 1800
    rate = 10.0

`title` and `source` are for readers. The tables [beam], [light], [detection] and [noise] describe the physics of its
beams, see `light/README.md`; without any of them it is an ideal sensor.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..settings.scan_choices import FOLDER, SUFFIX, read_sensor_file, sensor_names
from .light.model import Light
from .light.reflectance import TABLES, read_light
from .more_patterns import DepthCamera, Raster, Rosette
from .outcomes import listed, nearest, shown
from .patterns import Pattern, SpinningLidar

KINDS: dict[str, type[Any]] = {
    "spinning": SpinningLidar,
    "rosette": Rosette,
    "raster": Raster,
    "depth camera": DepthCamera,
}
WORDS = ("title", "source", "kind")
MOST_LINES = 100_000
LARGEST = 1e12  # of a number in a file; more than that is a mistake


@dataclass(frozen=True, slots=True)
class Sensor:
    """A pattern with a name. title: one line. source: the origin of its numbers. light: the physics of its beams."""

    name: str
    title: str
    source: str
    pattern: Pattern
    light: Light | None = None


def load_sensor(name: str | os.PathLike[str]) -> Sensor:
    """Loads one of `sensor_names()`, or a file: a path that ends in .toml.

    Raises:
        ValueError: For an unknown name, with the nearest one, and for invalid contents of a file; OSError if it cannot
            be read.
    """
    text = os.fspath(name)
    path = Path(text)
    if path.suffix.lower() != SUFFIX:
        if text not in sensor_names():
            raise ValueError(f"sensor: there is no {text!r}{nearest(text, sensor_names())}: {listed(sensor_names())}")
        path = FOLDER / f"{text}{SUFFIX}"
    values = read_sensor_file(path)
    try:
        return Sensor(path.stem, *_words(values), _pattern(values), read_light(values))
    except ValueError as error:
        raise ValueError(f"sensor: {path}: {error}") from error


def _words(values: dict[str, Any]) -> tuple[str, str]:
    for word in ("title", "source"):
        if not isinstance(values.get(word, ""), str):
            raise ValueError(f"{word} must be text, got {values[word]!r}")
    return values.get("title", ""), values.get("source", "")


def _pattern(values: dict[str, Any]) -> Pattern:
    kind = values.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        found = "" if kind is None else f", got {kind!r}{nearest(str(kind), KINDS)}"
        raise ValueError(f"kind must be one of {listed(KINDS)}{found}")
    made = KINDS[kind]
    known = {field.name: field for field in fields(made)}
    arguments = {}
    for name, value in values.items():
        if name in WORDS or name in TABLES:
            continue
        if name not in known:
            names = (*known, *TABLES)
            raise ValueError(f"a {kind} sensor has no {name!r}{nearest(name, names)}: {listed(names)}")
        arguments[name] = _number(kind, name, value)
    pattern: Pattern = made(**arguments)
    return pattern


def _number(kind: str, name: str, value: Any) -> Any:
    if name == "elevations" and isinstance(value, dict):
        ends = [value.get(name) for name in ("first", "last")]
        count = value.get("count")
        is_count = isinstance(count, int) and not isinstance(count, bool) and 1 <= count <= MOST_LINES
        if len(value) != 3 or not is_count or not all(map(_is_number, ends)):
            raise ValueError(f"elevations must be a list, or first, last and count, got {value}")
        return tuple(np.linspace(float(ends[0]), float(ends[1]), count).tolist())
    if name in ("elevations", "turns"):
        if not isinstance(value, list) or not all(_is_number(each) for each in value):
            raise ValueError(f"{name} of a {kind} sensor must be a list of numbers, got {value!r}")
        return tuple(float(each) for each in value)
    if not _is_number(value):
        raise ValueError(f"{name} of a {kind} sensor must be a number of usual size, got {shown(value)}")
    return value


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, (int, float)) and not isinstance(value, bool) and (abs(value) <= LARGEST or value == math.inf)
    )
