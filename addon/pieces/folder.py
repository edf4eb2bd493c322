"""Manifests of pieces: what counts as done, and what does not belong together. Knows no Blender.

Beside the files of each piece stands its manifest, written last: its frames, facts of it, the files' checksums, and the
inputs that it was made from. A piece counts as done if its manifest is there, names these inputs, and the files are
those that it tells of: what is damaged, or half there, is done again. Several processes may write one piece at once, as
happens where one was given up for dead: each file is replaced as a whole, and by the same bytes.
"""

from __future__ import annotations

import glob
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..support.files import find_remainders, replacing
from ..support.paths import reachable
from .inputs import checksum, find_difference
from .piece import Piece


class OtherInputsError(ValueError):
    """A folder holds pieces of other work."""


class PieceFolder:
    """Where pieces go. inputs: what they are made from. before: how names of manifests begin. what: in words."""

    def __init__(self, folder: Path, inputs: dict[str, Any], before: str, what: str) -> None:
        self.folder = folder
        self.inputs = inputs
        self._before = before
        self._what = what

    def prepare(self, pieces: Iterable[Piece], *others: str, resume: bool) -> None:
        """Before the work: `check`, then `clear`; unless it is to be resumed, `forget`. Raises what these do."""
        pieces = list(pieces)
        self.check(pieces)
        self.clear(pieces, *others)
        if not resume:
            self.forget(pieces)

    def check(self, pieces: Iterable[Piece]) -> None:
        """Raises OtherInputsError if the folder holds what these pieces cannot stand beside.

        That is a piece that was made from anything else, or one that shares frames with any of these.
        """
        wanted = {frame: piece.frames for piece in pieces for frame in piece.frames}
        for path in sorted(self.folder.glob(f"{glob.escape(self._before)}*.json")):
            found = _read(path)
            if found is None:
                continue  # no manifest, or a damaged one: its piece counts as not done
            frames = tuple(found["frames"])
            other = find_difference(self.inputs, found["inputs"])
            if any(wanted.get(frame, frames) != frames for frame in frames):
                other = "how the frames are divided"
            if other is not None:
                raise OtherInputsError(
                    f"{self.folder} holds pieces of another {self._what}: {path.name} differs in {other}; "
                    "choose another folder, or empty this one"
                )

    def forget(self, pieces: Iterable[Piece]) -> None:
        """From now on none of these counts as done. Raises OSError."""
        for piece in pieces:
            self._manifest(piece).unlink(missing_ok=True)

    def is_done(self, piece: Piece) -> bool:
        """Whether it is there, whole, from these inputs."""
        found = _read(self._manifest(piece))
        if found is None or found["inputs"] != self.inputs or tuple(found["frames"]) != piece.frames:
            return False
        return set(found["files"]) == set(piece.files) and all(
            _is_whole(self.path_of(name), found["files"][name]) for name in piece.files
        )

    def path_of(self, name: str) -> Path:
        """Where a file of a piece is."""
        return self.folder / name

    def finish(self, piece: Piece, **facts: Any) -> None:
        """Writes the manifest of a piece whose files are there. Raises OSError."""
        manifest = {
            "frames": list(piece.frames),
            "files": {name: checksum(reachable(self.path_of(name))) for name in piece.files},
            **facts,
            "inputs": self.inputs,
        }
        with replacing(self._manifest(piece)) as name:
            name.write_text(json.dumps(manifest, indent=1, allow_nan=False) + "\n", encoding="utf-8")

    def clear(self, pieces: Iterable[Piece], *others: str) -> None:
        """Removes what processes that were killed have left half-written. others: names of further files.

        Not while another process writes there. Raises OSError.
        """
        names = [name for piece in pieces for name in (*piece.files, self._manifest(piece).name)]
        for path in find_remainders(self.folder, (*names, *others)):
            path.unlink(missing_ok=True)

    def _manifest(self, piece: Piece) -> Path:
        return reachable(self.folder / f"{piece.stem}.json")


def _is_whole(path: Path, expected: object) -> bool:
    path = reachable(path)
    try:
        return path.is_file() and checksum(path) == expected
    except OSError:
        return False


def _read(path: Path) -> dict[str, Any] | None:
    """A manifest; None for what is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    kinds = {"inputs": dict, "files": dict, "frames": list}
    if not isinstance(found, dict) or not all(isinstance(found.get(name), kind) for name, kind in kinds.items()):
        return None
    return found if all(isinstance(frame, int) for frame in found["frames"]) else None
