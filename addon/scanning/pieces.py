"""A long scan as files of some frames each, which are recognised when it is run again. Knows no Blender.

Beside each piece stands its manifest, written last: the frames, rays and points in it, the file's checksum, and the
inputs that it was made from. A piece counts as done if its manifest is there, names these inputs, and the file is the
one that it tells of: what is damaged, or half there, is done again.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..support.files import replacing
from .formats import save_cloud
from .patterns import Pattern
from .point_cloud import PointCloud

_BLOCK = 1 << 20


class OtherInputsError(ValueError):
    """A folder holds pieces of another scan."""


@dataclass(frozen=True, slots=True)
class Piece:
    """frames: (first, last). stem: of its files' names."""

    frames: tuple[int, int]
    stem: str


def pieces_of(frames: Sequence[int], size: int) -> list[Piece]:
    """Runs of frames that follow each other, of at most so many each, in the order of the frames."""
    runs: list[list[int]] = []
    for frame in sorted(set(frames)):
        if not runs or frame != runs[-1][-1] + 1 or len(runs[-1]) == size:
            runs.append([])
        runs[-1].append(frame)
    return [Piece((run[0], run[-1]), f"points_{run[0]:04d}-{run[-1]:04d}") for run in runs]


def checksum(path: Path) -> str:
    """SHA-256, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def inputs_of(files: Iterable[Path], pattern: Pattern, **others: Any) -> dict[str, Any]:
    """What the bytes of pieces depend on, but for their frames, as JSON has it.

    files: the scene's own and those that it reads, by their contents. Caches of simulations are not among them.
    """
    values = {
        name: list(value) if isinstance(value, tuple) else None if value == math.inf else value
        for name, value in asdict(pattern).items()  # type: ignore[call-overload]
    }
    sums = {path.name: checksum(path) for path in sorted(set(files)) if path.is_file()}
    return {"files": sums, "sensor": {"kind": type(pattern).__name__, **values}, **others}


class PieceFolder:
    """Where pieces go. inputs: of this scan. suffix: of the format."""

    def __init__(self, folder: Path, inputs: dict[str, Any], suffix: str) -> None:
        self._folder = folder
        self._inputs = inputs
        self._suffix = suffix

    def check(self, pieces: Iterable[Piece]) -> None:
        """Raises OtherInputsError if the folder holds what these pieces cannot stand beside.

        That is a piece that was made from anything else, or one that shares frames with any of these.
        """
        wanted = [piece.frames for piece in pieces]
        for path in sorted(self._folder.glob("points_*.json")):
            found = _read(path)
            if found is None:
                continue  # no manifest, or a damaged one: its piece counts as not done
            inputs, (first, last) = found["inputs"], found["frames"]
            other = next((name for name in self._inputs if inputs.get(name) != self._inputs[name]), None)
            if any(a <= last and first <= b and (a, b) != (first, last) for a, b in wanted):
                other = "division of the frames"
            if other is not None:
                raise OtherInputsError(
                    f"{self._folder} holds pieces of another scan: {path.name} has another {other}; "
                    "choose another folder, or empty this one"
                )

    def is_done(self, piece: Piece) -> bool:
        """Whether it is there, whole, from these inputs."""
        found, file = _read(self._manifest(piece)), self._file(piece)
        return (
            found is not None
            and found.get("inputs") == self._inputs
            and found.get("frames") == list(piece.frames)
            and file.is_file()
            and found.get("checksum") == checksum(file)
        )

    def write(self, piece: Piece, cloud: PointCloud) -> Path:
        """The file, then its manifest. Raises OSError."""
        path = self._file(piece)
        self._manifest(piece).unlink(missing_ok=True)
        save_cloud(cloud, path)
        manifest = {
            "file": path.name,
            "frames": list(piece.frames),
            "rays": cloud.ray_count,
            "points": len(cloud),
            "object_names": list(cloud.object_names),
            "material_names": list(cloud.material_names),
            **self._errors(piece, cloud),
            "warnings": list(cloud.warnings),
            "checksum": checksum(path),
            "inputs": self._inputs,
        }
        with replacing(self._manifest(piece)) as name:
            name.write_text(json.dumps(manifest, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        return path

    def _errors(self, piece: Piece, cloud: PointCloud) -> dict[str, float | None]:
        """Of a piece of a single stretch, of whose way nothing is known but its ends, there are none."""
        stretches = (piece.frames[1] - piece.frames[0] + 1) * self._inputs["steps"]
        is_known = stretches > 1 and not self._inputs["is_one_pass"]
        return {name: getattr(cloud, name) if is_known else None for name in ("pose_error", "scene_error")}

    def _file(self, piece: Piece) -> Path:
        return self._folder / f"{piece.stem}{self._suffix}"

    def _manifest(self, piece: Piece) -> Path:
        return self._folder / f"{piece.stem}.json"


def _read(path: Path) -> dict[str, Any] | None:
    """A manifest; None for what is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    whole = isinstance(found, dict) and isinstance(found.get("inputs"), dict) and isinstance(found.get("frames"), list)
    return found if whole and len(found["frames"]) == 2 else None
