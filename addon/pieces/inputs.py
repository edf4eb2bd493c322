"""What the bytes of pieces depend on, but for their frames, in a form that JSON has. Knows no Blender."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_BLOCK = 1 << 20
_LONGEST_VALUES = 100  # characters of a message


def checksum(path: Path) -> str:
    """SHA-256, in hexadecimal. Raises OSError."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


# Of files that inputs named before, by their paths: their stamps, and their checksums.
_known: dict[str, tuple[list[int], str]] = {}


def _input_checksum(path: Path) -> str:
    """Like `checksum`, but does not read a file again that is the same as before by its stamp."""
    status = path.stat()  # before it is read: what changes later has another stamp
    stamp = [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]
    known = _known.get(str(path))
    if known is None or known[0] != stamp:
        known = _known[str(path)] = (stamp, checksum(path))
    return known[1]


def known_checksums() -> dict[str, tuple[list[int], str]]:
    """Returns what `learn_checksums` takes in another process, maybe on another machine with the same folders."""
    return dict(_known)


def learn_checksums(known: dict[str, tuple[list[int], str]]) -> None:
    """Spares this process the reading of files that are here as they were where `known` was made."""
    _known.update({path: (stamp, digest) for path, (stamp, digest) in known.items()})


def inputs_of(files: Iterable[Path], **options: Any) -> dict[str, Any]:
    """files: the scene's own and those that it reads, by their contents; of caches of simulations nothing is asked.

    Files of one name in several folders are told together. The result is as a manifest gives it back.
    """
    sums: dict[str, list[str]] = {}
    for path in sorted(set(files)):
        if path.is_file():
            sums.setdefault(path.name, []).append(_input_checksum(path))
    found = {"files": {name: " ".join(each) for name, each in sums.items()}, **options}
    made: dict[str, Any] = json.loads(json.dumps(found, allow_nan=False))
    return made


def find_difference(inputs: dict[str, Any], others: dict[str, Any]) -> str | None:
    """Names the first of these inputs that `others` has not, and how it differs, as in "'steps' (3, not 2)".

    Returns:
        None if `others` has all of them.
    """
    name = next((name for name in inputs if name not in others or others[name] != inputs[name]), None)
    if name is None:
        return None
    files, other_files = inputs[name], others.get(name)
    if name == "files" and isinstance(other_files, dict):
        differing = sorted(each for each in {*files, *other_files} if files.get(each) != other_files.get(each))
        more = f" and {len(differing) - 1} more" if len(differing) > 1 else ""
        return f"'{name}' ({differing[0]}{more})"
    values = f"{json.dumps(other_files)}, not {json.dumps(files)}"
    return f"'{name}' ({values})" if len(values) < _LONGEST_VALUES else f"'{name}'"
