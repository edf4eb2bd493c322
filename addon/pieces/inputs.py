"""What the bytes of pieces depend on, but for their frames, in a form that JSON has. Knows no Blender."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_BLOCK = 1 << 20


def checksum(path: Path) -> str:
    """SHA-256, in hexadecimal. Raises OSError."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def inputs_of(files: Iterable[Path], **options: Any) -> dict[str, Any]:
    """files: the scene's own and those that it reads, by their contents; of caches of simulations nothing is asked.

    Files of one name in several folders are told together. The result is as a manifest gives it back.
    """
    sums: dict[str, list[str]] = {}
    for path in sorted(set(files)):
        if path.is_file():
            sums.setdefault(path.name, []).append(checksum(path))
    found = {"files": {name: " ".join(each) for name, each in sums.items()}, **options}
    made: dict[str, Any] = json.loads(json.dumps(found, allow_nan=False))
    return made


def find_difference(inputs: dict[str, Any], others: dict[str, Any]) -> str | None:
    """The name of the first input that is another one there; None if all of these are the same."""
    return next((name for name in inputs if name not in others or others[name] != inputs[name]), None)
