"""The tables of a sensor's file that say what light does to its beams: [beam], [light], [detection] and [noise].

Knows no Blender. All of them, and all in them, may be missing; a file without any is of an ideal sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ..words import listed, nearest, shown
from .model import Beam, Detection, Light, Noise, Optics

TABLES: dict[str, type[Any]] = {"beam": Beam, "light": Optics, "detection": Detection, "noise": Noise}
NUMBER = (int, float)
LISTS: dict[str, Any] = {"keep": str, "spectrum": NUMBER, "distances": NUMBER, "reflectivities": NUMBER}
SWITCHES = {"refract", "calibrated"}


def read_light(values: Mapping[str, Any]) -> Light | None:
    """What the tables among the values say; None if there are none. Raises ValueError for what they should not say."""
    made = {name: _table(name, values[name]) for name in TABLES if name in values}
    if not made:
        return None
    named = {"optics" if name == "light" else name: table for name, table in made.items()}
    return Light(**named)


def _table(table: str, values: Any) -> Any:
    if not isinstance(values, Mapping):
        raise ValueError(f"{table} must be a table, [{table}], got {shown(values)}")
    made = TABLES[table]
    known = [field.name for field in fields(made)]
    for name in values:
        if name not in known:
            raise ValueError(f"[{table}] has no {name!r}{nearest(name, known)}: {listed(known)}")
    return made(**{name: _value(table, name, value) for name, value in values.items()})


def _value(table: str, name: str, value: Any) -> Any:
    if name in LISTS:
        value = [value] if name == "keep" and isinstance(value, str) else value
        are_right = isinstance(value, list) and all(
            isinstance(each, LISTS[name]) and not isinstance(each, bool) for each in value
        )
        if not are_right:
            kind = "words" if name == "keep" else "numbers"
            raise ValueError(f"[{table}]: {name} must be a list of {kind}, got {shown(value)}")
        return tuple(value) if name == "keep" else tuple([_number(table, name, each) for each in value])
    if name in SWITCHES:
        return value  # its table checks it
    if isinstance(value, bool) or not isinstance(value, NUMBER):
        raise ValueError(f"[{table}]: {name} must be a number, got {shown(value)}")
    return value if isinstance(value, int) and abs(value) < 2**53 else _number(table, name, value)


def _number(table: str, name: str, value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"[{table}]: {name} must be a number of usual size, got {shown(value)}") from None
