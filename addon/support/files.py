"""Files that are whole or not there: what is written takes its place only once it is complete."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Writers that do not notice a full disk leave less room than this behind them.
_ROOM = bytes(1 << 16)
# Characters of a file's name in that of the one beside it, which must not be too long where the first just is not.
_STEM_SHOWN = 32


def check_writable(path: Path) -> None:
    """Raises OSError with the reason if no file could be made beside `path`: to know it before the work."""
    with _explained(path):
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        with tempfile.TemporaryFile(dir=path.parent):
            pass


def prepare_folder(folder: Path) -> None:
    """Makes a folder and tries it with a file: to know before the work. Raises OSError with the reason."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OSError(error.errno, f"cannot write into {folder}: {error.strerror or error}") from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """The name of an empty file beside `path` to write into; it takes the place of `path` if that succeeds.

    After a failure `path` is as it was, and nothing else is left. Raises OSError with the reason, also where the disk
    is full and the writer said nothing.
    """
    with _explained(path):
        if path.is_dir():
            raise IsADirectoryError("it is a folder")
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem[:_STEM_SHOWN]}.", suffix=path.suffix)
        os.close(descriptor)
        try:
            yield Path(name)
            _settle(name)
            os.chmod(name, 0o666 & ~_umask())
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise


def _settle(name: str) -> None:
    """Makes sure that all of a file is on the disk, and that the disk did not end with it."""
    with open(name, "r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.write(_ROOM)
        file.truncate(size)
        os.fsync(file.fileno())


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"cannot write {path}: {error.strerror or error}") from error


def _umask() -> int:
    """Temporary files are private; what a user asks for is not."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
