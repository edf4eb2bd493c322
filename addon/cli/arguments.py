"""The meaning of the command line's arguments: frames, sizes, file names. Imports neither Blender nor numpy."""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from ..settings.modes import find_mode
from ..support.files import find_fault, find_obstacle, prepare_folder, reachable

if TYPE_CHECKING:
    import bpy


IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".exr")
MIN_SIZE, MAX_SIZE = 4, 65536  # of an image's side, as Blender's properties have them
MAX_SEED = 2**31 - 1  # as the add-on's settings hold seeds
MAX_FRAMES = 1_000_000
MAX_PIECE = 10  # frames, unless --chunk says otherwise
# How a .blend file begins: plain, or compressed by Zstandard (Blender 3 and later) or gzip (before).
BLEND_MAGICS = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
EXIT_ERROR = 2
EXIT_FAILED_PIECES = 3
EXIT_INTERRUPTED = 130
EXIT_PIPE = 141  # as a shell reports a program that SIGPIPE ended; the same where there is no such signal
_FRAME_RANGE = re.compile(r"(-?\d+)(?:-(-?\d+)(?::(\d+))?)?")


class CommandError(Exception):
    """A mistake of the user's: its message is all that is printed."""


@contextmanager
def explained() -> Iterator[None]:
    """Errors of files become CommandErrors, which keep them as their cause."""
    try:
        yield
    except OSError as error:
        raise CommandError(error.strerror or str(error)) from error


def parse_frames(text: str) -> tuple[int, ...]:
    """'5', '1-24', '1-48:2' (every second) and lists of them; in the order given, each frame once."""
    frames: dict[int, None] = {}
    for part in text.split(","):
        match = _FRAME_RANGE.fullmatch(part.strip())
        if match is None:
            raise argparse.ArgumentTypeError(f"expected frames such as 1-24, 1-48:2 or 1,5,9-12, got {text!r}")
        first = int(match[1])
        last = int(match[2]) if match[2] else first
        step = int(match[3]) if match[3] else 1
        if step < 1 or last < first:
            raise argparse.ArgumentTypeError(f"frame range {part.strip()!r} is empty")
        if (last - first) // step >= MAX_FRAMES:
            raise argparse.ArgumentTypeError(f"frame range {part.strip()!r} has over {MAX_FRAMES} frames")
        frames.update(dict.fromkeys(range(first, last + 1, step)))
    return tuple(frames)


def parse_size(text: str) -> tuple[int, int]:
    """'960x540' -> (960, 540)."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", text.strip())
    if match is None:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT such as 960x540, got {text!r}")
    size = int(match[1]), int(match[2])
    if min(size) < MIN_SIZE:
        way_out = "render a larger image and crop it"
        raise argparse.ArgumentTypeError(f"Blender renders no side below {MIN_SIZE} pixels, got {text}; {way_out}")
    if max(size) > MAX_SIZE:
        raise argparse.ArgumentTypeError(f"Blender renders no side above {MAX_SIZE} pixels, got {text}")
    return size


def parse_seed(text: str) -> int:
    """'7' -> 7."""
    if re.fullmatch(r"\d{1,20}", text.strip()) is None or int(text) > MAX_SEED:
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 to {MAX_SEED}, got {text!r}")
    return int(text)


def parse_day(text: str) -> str:
    """'2026-03-21', checked, as text: arguments go to workers."""
    try:
        return date.fromisoformat(text.strip()).isoformat()
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"expected a day such as 2026-03-21, got {text!r} ({error})") from error


def number_type(
    name: str, kind: type[int] | type[float], is_allowed: Callable[[float], bool], range_words: str
) -> Callable[[str], float]:
    """Return a type for `argparse`. name: of the value, for messages. range_words: the allowed range."""

    def parse(text: str) -> float:
        value = kind(text)
        if not is_allowed(value):
            raise argparse.ArgumentTypeError(f"must be {range_words}, got {text}")
        return value

    parse.__name__ = name
    return parse


POSITIVE = number_type("number", int, lambda value: value >= 1, "at least 1")
LAYERS = number_type("number", int, lambda value: 1 <= value <= 1000, "1 to 1000")
SECONDS = number_type("number of seconds", float, lambda value: 0.0 <= value <= 1e9, "0 to 1e9")
SCALE = number_type("number of world units", float, lambda value: 0.0 < value <= 1e9, "above 0 and at most 1e9")
THRESHOLD = number_type("noise threshold", float, lambda value: 0.0 <= value <= 1.0, "0 to 1")
SHARE = number_type("share", float, lambda value: 0.0 < value <= 1.0, "above 0 and at most 1")


def check_mode(name: str | None) -> None:
    """A CommandError unless `name` is a mode or None."""
    if name is not None:
        try:
            find_mode(name)
        except ValueError as error:
            raise CommandError(str(error)) from error


def parse_path(argument: str, text: str) -> Path:
    """The absolute path that an argument names; a CommandError if no file system could hold it."""
    if not text:
        raise CommandError(f"{argument}: expected a name, got an empty one; the current folder is '.'")
    try:
        path = Path(text).expanduser().absolute()
    except RuntimeError as error:
        raise CommandError(f"{argument} {text}: no such user; use './{text}' for a file of that name") from error
    check_name(argument, path)
    return path


def parse_folder(text: str) -> Path:
    """The absolute path of the folder that -o names, made if it was not there; a CommandError if it takes no file."""
    folder = parse_path("-o", text)
    if folder.exists() and not folder.is_dir():
        raise CommandError(f"-o {text}: expected a folder, but it is a file")
    with explained():
        prepare_folder(folder)
    return folder


def check_pieces(arguments: argparse.Namespace) -> None:
    """Sets the number of frames of a chunk. Raises CommandError for conflicting options, or a missing library."""
    if arguments.piece is None:
        arguments.piece = MAX_PIECE
    if arguments.workers is None and arguments.scheduler is None:
        return
    if arguments.workers is not None and arguments.scheduler is not None:
        raise CommandError(
            "--workers starts workers here, --scheduler uses those of another cluster: give only one of them"
        )
    option = "--workers" if arguments.scheduler is None else "--scheduler"
    if importlib.util.find_spec("distributed") is None:
        raise CommandError(f"{option} needs Dask: pip install 'perfect-bvh[farm]'")
    blender = sys.modules.get("bpy")
    if blender is not None and blender.app.binary_path:
        raise CommandError(f"{option} needs Blender as a Python module: pip install 'perfect-bvh[blender,farm]'")


def check_name(argument: str, path: Path) -> None:
    """A CommandError if this system could hold no file of that name."""
    fault = find_fault(path)
    if fault is not None:
        raise CommandError(f"{argument}: {fault}")


def check_blend_file(text: str) -> Path:
    """Return the absolute path of an existing .blend file; raises CommandError with the reason for any other."""
    path = parse_path("FILE", text)
    if not path.exists():
        raise CommandError(f"{text}: no such file")
    if path.is_dir():
        raise CommandError(f"{text} is a folder, not a .blend file")
    try:
        with path.open("rb") as file:
            start = file.read(8)
    except OSError as error:
        raise CommandError(f"{text}: cannot be read ({error.strerror})") from error
    if not start.startswith(BLEND_MAGICS):
        raise CommandError(f"{text} is not a .blend file")
    return path


@dataclass(frozen=True, slots=True)
class Output:
    """The files of images. pattern: absolute, with one run of # in place of the frame number, or with none."""

    pattern: Path

    @classmethod
    def parse(cls, text: str, frame_count: int) -> Output:
        """Parses the argument of -o: an image, a pattern with #, or a folder (a name without an image suffix)."""
        path = parse_path("-o", text)
        suffix = path.suffix.lower()
        if text.endswith(("/", os.sep)) or path.is_dir() or not suffix:
            return cls(path / "frame_####.png")
        if suffix not in IMAGE_SUFFIXES:
            raise CommandError(f"-o {text}: images are {', '.join(IMAGE_SUFFIXES)}, not {path.suffix}")
        numbers = re.findall(r"#+", path.name)
        if len(numbers) > 1:
            raise CommandError(f"-o {text}: the name may have only one group of #")
        if frame_count > 1 and not numbers:
            example = path.with_name(f"{path.stem}_####{path.suffix}").name
            raise CommandError(f"-o {text}: {frame_count} frames need a folder or a name like {example}")
        return cls(path)

    def path_of(self, frame: int) -> Path:
        """The file of one frame: every # is a digit at least, a minus sign comes on top of them."""

        def number(match: re.Match[str]) -> str:
            return f"{'-' if frame < 0 else ''}{abs(frame):0{len(match[0])}d}"

        return self.pattern.with_name(re.sub(r"#+", number, self.pattern.name))

    def describe(self, frames: tuple[int, ...]) -> str:
        """Describes in few words where these frames were saved."""
        if len(frames) == 1:
            return str(self.path_of(frames[0]))
        return f"{self.path_of(frames[0])} ... {self.path_of(frames[-1]).name}"

    def check_frames(self, frames: tuple[int, ...], blend_file: Path) -> None:
        """A CommandError if no image of these frames could be written, or one took the place of the scene's file."""
        for path in map(self.path_of, frames):
            check_name("-o", path)
            target = reachable(path)
            if target.exists() and target.samefile(blend_file):
                raise CommandError(f"-o {path}: the image would replace the scene, FILE; give it another name")
            obstacle = find_obstacle(path)
            if obstacle is not None:
                raise CommandError(f"cannot write {path}: {obstacle}")

    def prepare(self) -> None:
        """Make the folder, and try it with a file, before the work rather than after. Errors: CommandError."""
        folder = self.pattern.parent
        with explained():
            prepare_folder(folder)
        if reachable(self.pattern).is_dir():
            raise CommandError(f"cannot write {self.pattern}: it is a folder")


# Ignored output ------------------------------------------------------------------------------------------------------
# A scene's Output settings that the command line, which writes the engine's own image, ignores.


def find_ignored_output(scene: bpy.types.Scene, active: bpy.types.ViewLayer) -> Iterator[str]:
    """A sentence for each, of a scene as its file has it. active: the view layer that is rendered."""
    render = scene.render
    if render.use_compositing and _has_compositor(scene):
        yield "Compositing: nodes are ignored; the raw render is written"
    if render.use_sequencer and _has_strips(scene):
        yield "Sequencer: strips are ignored; the scene is rendered"
    if render.use_multiview:
        yield "Stereoscopy: it is unsupported; one view is written"
    if render.use_stamp:
        yield "Burn Into Image: metadata is not drawn into the image"
    others = [layer.name for layer in scene.view_layers if layer.use and layer != active]
    if others:
        yield f"View Layers: only {active.name} is rendered, not {', '.join(others)}"


def _has_compositor(scene: bpy.types.Scene) -> bool:
    if hasattr(scene, "compositing_node_group"):  # since Blender 5.0
        tree = scene.compositing_node_group
    else:
        tree = scene.node_tree if scene.use_nodes else None
    return tree is not None and len(tree.links) > 0 and any(node.type not in _TRIVIAL for node in tree.nodes)


_TRIVIAL = frozenset({"R_LAYERS", "COMPOSITE", "VIEWER", "GROUP_OUTPUT", "REROUTE", "FRAME"})


def _has_strips(scene: bpy.types.Scene) -> bool:
    editor = scene.sequence_editor
    return editor is not None and len(editor.strips if hasattr(editor, "strips") else editor.sequences) > 0
