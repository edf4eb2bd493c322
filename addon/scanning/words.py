"""Words of messages about what people wrote: the nearest of the names that there are. Knows no Blender."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any


def nearest(name: str, names: Iterable[str]) -> str:
    """`(is it ...?)` with the name that is most like it, "" if none is."""
    found = difflib.get_close_matches(name, list(names), n=1, cutoff=0.5)
    return f" (is it {found[0]!r}?)" if found else ""


def listed(names: Iterable[str]) -> str:
    """All of them."""
    return ", ".join(names)


def shown(value: Any) -> str:
    """A value that may be long."""
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
