"""Chunks of frames that are processed together, and their files. Does not depend on Blender."""

from __future__ import annotations

import glob
import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..support.files import find_remainders, reachable, replacing


@dataclass(frozen=True, slots=True)
class Piece:
    """frames: rising, one at least. stem: of its manifest's name. files: the names of the files it consists of."""

    frames: tuple[int, ...]
    stem: str
    files: tuple[str, ...]

    @property
    def first(self) -> int:
        """The first frame."""
        return self.frames[0]

    @property
    def last(self) -> int:
        """The last frame."""
        return self.frames[-1]

    def __str__(self) -> str:
        if len(self.frames) == 1:
            return f"frame {self.first}"
        return f"frames {self.first}-{self.last}"


def runs_of(frames: Iterable[int], size: int, *, has_gaps: bool = False) -> list[tuple[int, ...]]:
    """The frames, rising, in runs of at most `size`; has_gaps: whether a run may pass over frames."""
    runs: list[list[int]] = []
    for frame in sorted(set(frames)):
        if not runs or len(runs[-1]) == size or (frame != runs[-1][-1] + 1 and not has_gaps):
            runs.append([])
        runs[-1].append(frame)
    return [tuple(run) for run in runs]


# Inputs --------------------------------------------------------------------------------------------------------------
# The inputs of the bytes of chunks, except their frames, as JSON values.


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
    """files: the scene's own and those that it reads, by their contents; caches of simulations are not read.

    Files of the same name in several folders are listed together. The result equals that read from a manifest.
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


# Folder --------------------------------------------------------------------------------------------------------------
# Manifests of chunks: which are finished, and which do not belong together.
#
# Each chunk has a manifest next to its files, written last: its frames, facts about it, the files' checksums, and
# the inputs that it was made from. A chunk is finished if its manifest exists, has the current inputs, and its
# checksums match the files: damaged or partial chunks are made again. Several processes may write one chunk at
# once, for example if a worker was wrongly presumed dead: each file is replaced as a whole, and by the same bytes.


class OtherInputsError(ValueError):
    """A folder has chunks of other work."""


class PieceFolder:
    """The folder of chunks. inputs: theirs. before: the prefix of manifests' names. what: the content, in words."""

    def __init__(self, folder: Path, inputs: dict[str, Any], before: str, what: str) -> None:
        self.folder = folder
        self.inputs = inputs
        self._before = before
        self._what = what

    def prepare(self, pieces: Iterable[Piece], *others: str, resume: bool) -> None:
        """Before the work: calls `check`, then `clear`; also `forget`, unless it resumes. Raises their errors."""
        pieces = list(pieces)
        self.check(pieces)
        self.clear(pieces, *others)
        if not resume:
            self.forget(pieces)

    def check(self, pieces: Iterable[Piece]) -> None:
        """Raises OtherInputsError if the folder holds a chunk that conflicts with these.

        That is a chunk that was made from other inputs, or one that shares frames with any of these.
        """
        wanted = {frame: piece.frames for piece in pieces for frame in piece.frames}
        for path, found in self._manifests():
            frames = tuple(found["frames"])
            other = find_difference(self.inputs, found["inputs"])
            if any(wanted.get(frame, frames) != frames for frame in frames):
                other = "the division of frames into chunks"
            if other is not None:
                raise OtherInputsError(
                    f"{self.folder} has chunks of another {self._what}: {path.name} differs in {other}; "
                    "choose another folder, or empty this one"
                )

    def manifests(self) -> list[dict[str, Any]]:
        """Returns the manifests of all chunks in the folder whose files exist, in the order of their frames."""
        there = (found for _, found in self._manifests() if all(map(self._has, found["files"])))
        return sorted(there, key=lambda found: found["frames"])

    def _has(self, name: str) -> bool:
        return reachable(self.path_of(name)).is_file()

    def _manifests(self) -> Iterator[tuple[Path, dict[str, Any]]]:
        """Yields the manifests; without one, or with a damaged one, a chunk counts as missing."""
        for path in sorted(self.folder.glob(f"{glob.escape(self._before)}*.json")):
            found = _read(path)
            if found is not None:
                yield path, found

    def forget(self, pieces: Iterable[Piece]) -> None:
        """Marks these chunks as unfinished. Raises OSError."""
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
        """Returns the path of a chunk's file."""
        return self.folder / name

    def finish(self, piece: Piece, **facts: Any) -> None:
        """Writes the manifest of a chunk whose files exist. Raises OSError."""
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
    """Reads a manifest; None for a missing or invalid one."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    kinds = {"inputs": dict, "files": dict, "frames": list}
    if not isinstance(found, dict) or not all(isinstance(found.get(name), kind) for name, kind in kinds.items()):
        return None
    return found if all(isinstance(frame, int) for frame in found["frames"]) else None


# Scene inputs --------------------------------------------------------------------------------------------------------
# What chunks of an open scene depend on: its file and all that it reads, and whose work they are.


def scene_inputs(arguments: Any, *names: str, **options: Any) -> dict[str, Any]:
    """Returns what chunks of the open scene depend on.

    Args:
        arguments: a command's; their `file` is the open one.
        names: of further arguments that count.
        options: what else counts.
    """
    import bpy
    import perfect_bvh

    read = [Path(name) for name in bpy.utils.blend_paths(absolute=True)]
    return inputs_of(
        [Path(arguments.file), *read, *_files_of_images(bpy.data.images)],
        **{name: getattr(arguments, name) for name in (*names, "autoexec", "allow_missing")},
        **options,
        blender=bpy.app.version_string,
        version=perfect_bvh.__version__,
    )


def _files_of_images(images: Iterable[Any]) -> Iterator[Path]:
    """The files of UDIM tiles and of sequences, which Blender lists by one name for all of them."""
    import bpy

    for image in images:
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        if image.source == "TILED":
            pattern = re.sub(r"<UDIM>|<UVTILE>", "*", glob.escape(path.name))
        elif image.source == "SEQUENCE":
            pattern = re.sub(r"\d+(?=\D*$)", "*", glob.escape(path.stem)) + glob.escape(path.suffix)
        else:
            continue
        if path.name and path.parent.is_dir():
            yield from path.parent.glob(pattern)
