"""Hashes of arrays and plain values, collected under names."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Items = dict[str, str]


class Recorder:
    """Items with one prefix: "engine/soup/default/" and what follows. Each name is used once."""

    def __init__(self, items: Items | None = None, prefix: str = "") -> None:
        self.items: Items = {} if items is None else items
        self._prefix = prefix

    def within(self, name: str) -> Recorder:
        """The same items, one level deeper."""
        return Recorder(self.items, f"{self._prefix}{name}/")

    def add(self, name: str, value: Any) -> None:
        """An array, by its type, shape and bits; anything else by its JSON."""
        full = self._prefix + name
        if full in self.items:
            raise ValueError(f"the item {full!r} is recorded twice")
        self.items[full] = digest(value)

    def add_all(self, values: Mapping[str, Any]) -> None:
        """Each value under its name."""
        for name, value in values.items():
            self.add(name, value)


def digest(value: Any) -> str:
    """The sha256 of an array (type, shape, bits; an array of objects as a list) or of a value that JSON takes."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        array: npt.NDArray[Any] = np.ascontiguousarray(value)
        content = f"{array.dtype.str}{array.shape}".encode() + array.tobytes()
    else:
        plain = value.tolist() if isinstance(value, np.ndarray) else value
        content = json.dumps(plain, sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()


def check_equal(what: str, first: Mapping[str, Any], second: Mapping[str, Any], names: Iterable[str]) -> None:
    """Raises AssertionError where two answers that must have the same bits do not."""
    for name in names:
        if digest(first[name]) != digest(second[name]):
            raise AssertionError(f"{what}: {name} differs")
