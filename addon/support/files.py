"""Files that are whole or missing: a new file replaces the old one only once it is complete."""

from __future__ import annotations

import errno
import importlib
import importlib.util
import ntpath
import os
import re
import secrets
import stat
import sys
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy.typing as npt

# Named arrays as a file of numpy's.


def write_arrays(path: Path, arrays: Mapping[str, npt.NDArray[Any]], *, is_compressed: bool = False) -> None:
    """Does the same as np.savez, which leaves its archive open when the disk is full. Raises OSError."""
    import numpy as np  # here: the command line lists its options without it

    kind = zipfile.ZIP_DEFLATED if is_compressed else zipfile.ZIP_STORED
    with open(path, "wb") as file, zipfile.ZipFile(file, "w", kind, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


# Libraries -----------------------------------------------------------------------------------------------------------
# Libraries that only some files need, imported when they do.


def data_library(name: str, who_needs: str, packages: Iterable[str] = ()) -> Any:
    """Imports a module of the extra `data`.

    Args:
        name: Of the module, such as "pyarrow.parquet".
        who_needs: The start of the message, such as "EXR files need OpenEXR".
        packages: All to install, if they are more than the module's.

    Raises:
        ImportError: If it is not installed; says how to install it.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(f"{who_needs}. {how_to_install(*packages or (name.partition('.')[0],))}") from error


def how_to_get(what: str, *modules: str) -> str | None:
    """Says that `what`, such as "EXR files", needs missing libraries, and how to install them; None if none is. Fast.

    Args:
        modules: Of the libraries, such as "pyarrow.parquet".
    """
    names = dict.fromkeys(module.partition(".")[0] for module in modules)
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    return f"{what} need {' and '.join(missing)}. {how_to_install(*missing)}" if missing else None


_INSTALL, _RESTART = "Install them with: ", ". Then restart Blender"
# The versions that work with numpy 1, which Blender has before 5.1.
_FOR_NUMPY_1 = {"pyarrow": '"pyarrow<22"'}


def command_in(text: str) -> str | None:
    """Returns the command that a message of `how_to_install` has; None if it has none."""
    return text.rpartition(_INSTALL)[2].removesuffix(_RESTART) if _INSTALL in text else None


def how_to_install(*packages: str) -> str:
    """Says which command installs packages where this Python, or this Blender, imports them from."""
    import numpy as np  # here, as above

    bpy = sys.modules.get("bpy")
    other = _FOR_NUMPY_1 if int(np.__version__.partition(".")[0]) < 2 else {}
    names = " ".join(other.get(name, name) for name in packages)
    if bpy is None or not bpy.app.binary_path:  # Blender's module in an environment of the user's
        return f'{_INSTALL}"{sys.executable}" -m pip install {names}'
    folder = bpy.utils.user_resource("SCRIPTS", path="modules")
    version = ".".join(map(str, sys.version_info[:2]))
    # Any Python's pip will do: Blender's own often has none. Another numpy there would replace Blender's.
    options = f'--only-binary=:all: --python-version {version} --target "{folder}" numpy=={np.__version__}'
    return f"{_INSTALL}python3 -m pip install {options} {names}{_RESTART}"


# Paths ---------------------------------------------------------------------------------------------------------------
# The limits of paths on each system: their length, their characters, and the form of long ones on Windows.
#
# Windows accepts up to 259 characters of a plain path, and 32,767 of one that begins with `\\?\`. Names must not
# contain characters there that have another meaning: a colon would silently write a hidden stream of another file,
# and some names are devices.


IS_WINDOWS = os.name == "nt"

_LONG = 240  # well below the limits of a file's or a folder's path
_PREFIX, _SHARE_PREFIX = "\\\\?\\", "\\\\?\\UNC\\"

_FORBIDDEN = frozenset('<>:"|?*') | {chr(code) for code in range(32)}
_DEVICES = frozenset(("CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$")) | {
    f"{port}{digit}" for port in ("COM", "LPT") for digit in "123456789¹²³"
}
# Of a path and of a name in it.
_LIMITS = {"win32": (32_766, 255), "darwin": (1023, 255), "linux": (4095, 255)}


def reachable(path: Path) -> Path:
    """Returns a path of the same file that this system accepts at any length."""
    return Path(extended_name(str(path))) if IS_WINDOWS else path


def extended_name(name: str) -> str:
    r"""Returns Windows' name of a file, with `\\?\` before it if it is long, else unchanged."""
    if name.startswith(_PREFIX):
        return name
    whole = ntpath.abspath(name)  # no `..` and no slashes: behind the prefix nothing is looked at
    if len(whole) < _LONG:
        return name
    return _SHARE_PREFIX + whole[2:] if whole.startswith("\\\\") else _PREFIX + whole


def is_extended(path: Path) -> bool:
    """Whether `reachable` had to prefix it, which others than Python may not understand."""
    return str(path).startswith(_PREFIX)


def find_fault(path: PurePath, system: str = sys.platform) -> str | None:
    """Why `system` could hold no file of this name, with the way out; None if it could."""
    text = str(path)
    if "\0" in text:
        return f"a name cannot hold a zero byte, got {text!r}; remove it"
    path_limit, name_limit = _LIMITS.get(system, _LIMITS["linux"])
    units = "characters" if system == "win32" else "bytes"
    length = _length(text, system)
    if length > path_limit:
        return f"a path may have {path_limit} {units}, got {length}; give a shorter one"
    longest = max(_names(path), key=lambda name: _length(name, system), default="")
    length = _length(longest, system)
    if length > name_limit:
        return f"a name may have {name_limit} {units}, got {length} ({longest[:20]}...); give a shorter one"
    return find_windows_fault(path) if system == "win32" else None


def find_windows_fault(path: PurePath) -> str | None:
    """Why Windows would take a name in it for something else, with the way out; None if it would not."""
    for name in _names(path):
        if not _FORBIDDEN.isdisjoint(name):
            character = next(each for each in name if each in _FORBIDDEN)
            return f"a name cannot hold {character!r} on Windows, got {name!r}; remove it"
        if name.partition(".")[0].rstrip(" ").upper() in _DEVICES:
            return f"{name!r} is a device on Windows; give another name"
        if name.endswith((".", " ")) and name.strip("."):
            return f"a name cannot end with {name[-1]!r} on Windows, got {name!r}; remove it"
    return None


def _names(path: PurePath) -> tuple[str, ...]:
    return path.parts[1:] if path.anchor else path.parts


def _length(text: str, system: str) -> int:
    """Returns the length as the system counts it."""
    if system == "win32":
        return len(text.encode("utf-16-le", "surrogatepass")) // 2
    return len(os.fsencode(text))


# Files ---------------------------------------------------------------------------------------------------------------


# Writers that do not notice a full disk leave less room than this behind them.
_ROOM = bytes(1 << 16)
# Characters of a file's name in that of its temporary file, whose name must not be too long if the file's just is not.
_STEM_SHOWN = 32
# On Windows virus scanners and indexers open each new file for a moment: the pauses before further tries.
_PATIENCE = (0.05, 0.1, 0.2, 0.4) if IS_WINDOWS else ()
_SHARING_VIOLATION = 32
# Names from `_make_file`: of a trial, or of a temporary file, with the ending of its file.
_REMAINDER = re.compile(r"\.(?:(.+)\.)?[0-9a-f]{8}(\.[^.]*)?")


def check_writable(path: Path) -> None:
    """Raises OSError with the reason if no file could be made at `path`: to know it before the work."""
    with _explained(path):
        _check_place(path)
        obstacle = find_obstacle(path)
        if obstacle is not None:
            raise PermissionError(errno.EACCES, obstacle)
        os.unlink(_make_file(path.parent))


def make_folder(folder: Path) -> None:
    """Makes a folder, and those above it, unless they exist. Raises OSError with the reason."""
    with _explained(folder):
        reachable(folder).mkdir(parents=True, exist_ok=True)


def prepare_folder(folder: Path) -> None:
    """Makes a folder and tries it with a file: to know before the work. Raises OSError with the reason."""
    try:
        _check_names(folder)
        reachable(folder).mkdir(parents=True, exist_ok=True)
        os.unlink(_make_file(folder))
    except OSError as error:
        raise OSError(error.errno, f"cannot write into {folder}: {error.strerror or error}") from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields the name of an empty file next to `path` to write into; it replaces `path` if that succeeds.

    After a failure `path` is unchanged, and nothing else is left, unless only the last step failed, as it does on
    Windows while another program has `path` open: then the new file is kept next to it, and the error names both.
    Raises OSError with the reason, also if the disk is full and the writer did not report it.
    """
    with _explained(path):
        _check_place(path)
        name = _make_file(path.parent, f".{path.stem[:_STEM_SHOWN]}.", path.suffix)
        try:
            yield name
            _settle(name)
        except BaseException:
            with suppress(OSError):  # the original error matters, not that of removing a remainder
                _patiently(os.unlink, name)
            raise
        try:
            _patiently(os.replace, name, reachable(path))
        except OSError as error:
            reason = find_obstacle(path) or error.strerror or str(error)
            raise OSError(error.errno, f"{reason} (the new one is {_keep(name, path)})") from error


def find_remainders(folder: Path, names: Iterable[str]) -> list[Path]:
    """Finds files that a killed process may have left while writing files of these names into a folder.

    names: as paths from the folder; files in missing subfolders were not begun.
    """
    wanted: dict[Path, set[tuple[str, str]]] = {folder: set()}
    for name in names:
        path = folder / name
        wanted.setdefault(path.parent, set()).add((path.stem[:_STEM_SHOWN], path.suffix))
    found: list[Path] = []
    for place, parts in wanted.items():
        if place == folder or reachable(place).is_dir():
            found += _remainders_in(place, parts)
    return sorted(found)


def _remainders_in(folder: Path, wanted: set[tuple[str, str]]) -> Iterator[Path]:
    """Yields remainders. wanted: stems in their shortened form, and endings."""
    for path in reachable(folder).iterdir():
        match = _REMAINDER.fullmatch(path.name)
        is_trial = match is not None and match[1] is None and match[2] is None
        if is_trial or (match is not None and (match[1], match[2] or "") in wanted):
            yield path


def _check_place(path: Path) -> None:
    _check_names(path)
    if reachable(path).is_dir():
        raise IsADirectoryError(errno.EISDIR, "it is a folder")


def _check_names(path: Path) -> None:
    fault = find_windows_fault(path) if IS_WINDOWS else None
    if fault is not None:
        raise OSError(errno.EINVAL, fault)


def find_obstacle(path: Path) -> str | None:
    """Returns why Windows would not let a file be replaced, and advice; None if it would, or the file does not exist.

    On other systems open or write-protected files can be replaced.
    """
    target = reachable(path)
    if not IS_WINDOWS or not target.exists():
        return None
    if not target.stat().st_mode & stat.S_IWRITE:
        return "it is write-protected: change its properties, or use another name"
    try:
        os.rename(target, target)  # does nothing, but fails if another program has it open
    except PermissionError as error:
        if getattr(error, "winerror", None) == _SHARING_VIOLATION:
            return "it is open in another program: close it there, or use another name"
    return None


def _make_file(folder: Path, prefix: str = ".", suffix: str = "") -> Path:
    """An empty file of a new name."""
    path = reachable(folder / f"{prefix}{secrets.token_hex(4)}{suffix}")
    os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666))
    return path


def _settle(name: Path) -> None:
    """Makes sure that all of a file is on the disk, and that the disk did not end with it."""
    with open(name, "r+b") as file:
        size = file.seek(0, os.SEEK_END)
        file.write(_ROOM)
        file.truncate(size)
        os.fsync(file.fileno())


def _patiently(act: Callable[..., object], *paths: Path) -> None:
    """Repeats a refused action for a while, as another program may have opened the file for a moment."""
    for seconds in _PATIENCE:
        try:
            act(*paths)
            return
        except PermissionError:
            time.sleep(seconds)
    act(*paths)


def _keep(name: Path, path: Path) -> Path:
    """Gives what could not take its place a name that a user finds; where it is now."""
    for mark in ("new", *(f"new {number}" for number in range(2, 100))):
        kept = path.with_name(f"{path.stem} ({mark}){path.suffix}")
        try:
            if not reachable(kept).exists():
                _patiently(os.rename, name, reachable(kept))
                return kept
        except OSError:  # too long a name, or a folder in which nothing may be renamed
            break
    return name


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, f"cannot write {path}: {error.strerror or error}") from error
