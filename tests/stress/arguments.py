"""Any bytes as an argument of the engine: arrays of any type, shape, layout and value, and other objects."""

from __future__ import annotations

from typing import Any

import numpy as np

from .bytes import Bytes

DTYPES = ("f4", "f8", "f2", ">f4", ">f8", "i1", "u2", "i8", "?")
INTEGERS = ("i4", "i8", "u1", "f4")
STRANGE = ("U2", "S3", "complex64", "datetime64[s]", "O")
VALUES = (0.0, 1.0, -1.0, 0.25, 2.0, 3.0, -0.0, 1e-45, 1e-310, 3e38, 1e300, -1e19, np.inf, -np.inf, np.nan)
LAYOUTS = ("C", "F", "reversed", "strided", "read-only", "broadcast", "list")
Width = int | None


def array(source: Bytes, widths: tuple[Width, ...] = (3,), dtypes: tuple[str, ...] = DTYPES) -> Any:
    """An array whose last axis is one of the widths (None: any shape), or such a list of lists."""
    width = source.pick(widths)
    shape = tuple(source.take(5) for _ in range(source.take(4))) + (() if width is None else (width,))
    dtype = np.dtype(source.pick(dtypes))
    if dtype.kind in "OUScM":
        return np.zeros(shape, dtype)
    values = np.array([source.pick(VALUES) for _ in range(1 + source.take(8))])
    with np.errstate(all="ignore"):
        made = np.resize(values, shape)
        if dtype.kind in "iub":
            made = np.nan_to_num(made, posinf=2.0, neginf=-2.0).clip(0 if dtype.kind == "u" else -100, 100)
        return _lay_out(np.asarray(made, dtype), source.pick(LAYOUTS))  # asarray: a number would become a scalar


def _lay_out(made: np.ndarray, layout: str) -> Any:
    if layout == "F":
        return np.asfortranarray(made)
    if layout == "reversed" and made.ndim:
        return made[::-1]
    if layout == "strided" and made.ndim:
        return np.repeat(made, 2, axis=0)[::2]
    if layout == "read-only":
        made.flags.writeable = False
    if layout == "broadcast" and made.ndim > 1 and len(made):
        return np.broadcast_to(made[:1], made.shape)
    return made.tolist() if layout == "list" else made


def anything(source: Bytes, *widths: Width) -> Any:
    """Mostly an array of rows of three, or of the widths that are named."""
    kind = source.take(16)
    if kind < 11:
        return array(source, widths or (3,))
    if kind < 13:
        return array(source, (None, 0, 2, 4))
    return (None, "text", array(source, dtypes=STRANGE))[kind - 13]


def number(source: Bytes) -> Any:
    """A number, an array of numbers, or neither."""
    kind = source.take(8)
    if kind < 3:
        return source.pick(VALUES)
    if kind < 7:
        return array(source, ((None,), (1, 2))[kind % 2])
    return source.pick((None, "a"))


def mask(source: Bytes) -> Any:
    """Bits, too many bits, or an array of some."""
    if source.take(2):
        return array(source, (None,), INTEGERS)
    return source.pick((1, 0, -1, 3, 0xFFFFFFFF, 2**32, 2**33))


def cull(source: Bytes) -> Any:
    return source.pick(("none", "back", "front", "both", "", None))
