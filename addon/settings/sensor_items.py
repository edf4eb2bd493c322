"""Files of sensors, and those that the add-on brings as the items of a menu; their numbers are what .blend files keep.

What files say of rays is understood by `scanning/sensor_files.py`.
"""

from __future__ import annotations

import tomllib
import zlib
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "scanning" / "sensors"
SUFFIX = ".toml"
SMALL_WORDS = ("a", "and", "in", "of", "on", "or", "the", "to")  # in names of Blender's

Item = tuple[str, str, str, int]


def sensor_names() -> tuple[str, ...]:
    """Those that the add-on brings, in the order of their names."""
    return tuple(sorted(path.stem for path in FOLDER.glob(f"*{SUFFIX}")))


def read_sensor_file(path: Path) -> dict[str, Any]:
    """What a file says, by its words. Raises ValueError for what is no TOML, OSError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except ValueError as error:  # of TOML or of UTF-8
        raise ValueError(f"sensor: {path}: {error}") from error


def number_of(name: str) -> int:
    """Of a sensor in .blend files: of its name alone, so that it stays the same whatever other sensors there are."""
    return zlib.crc32(name.encode()) & 0x7FFF_FFFF


def sensor_items() -> list[Item]:
    """Identifier (the sensor's name), title, where its numbers are from, and number, in the order of the names."""
    items = []
    for name in sensor_names():
        values = read_sensor_file(FOLDER / f"{name}{SUFFIX}")
        items.append((name, _as_name(values["title"]), _capital(values["source"]), number_of(name)))
    return items


def _as_name(title: str) -> str:
    return _capital(" ".join(word if word in SMALL_WORDS else _capital(word) for word in title.split()))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
