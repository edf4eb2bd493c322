"""The sensors that the add-on brings, as the items of a menu; their numbers are what .blend files keep.

What else their files say is read by `scanning/sensor_files.py`.
"""

from __future__ import annotations

import tomllib
import zlib
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "scanning" / "sensors"
SMALL_WORDS = ("a", "and", "in", "of", "on", "or", "the", "to")  # in names of Blender's

Item = tuple[str, str, str, int]


def number_of(name: str) -> int:
    """Of a sensor in .blend files: of its name alone, so that it stays the same whatever other sensors there are."""
    return zlib.crc32(name.encode()) & 0x7FFF_FFFF


def sensor_items() -> list[Item]:
    """Identifier (the sensor's name), title, where its numbers are from, and number, in the order of the names."""
    items = []
    for path in sorted(FOLDER.glob("*.toml")):
        values = tomllib.loads(path.read_text(encoding="utf-8"))
        items.append((path.stem, _as_name(values["title"]), _capital(values["source"]), number_of(path.stem)))
    return items


def _as_name(title: str) -> str:
    return _capital(" ".join(word if word in SMALL_WORDS else _capital(word) for word in title.split()))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
