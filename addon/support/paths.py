r"""What a path may be on each system: how long, of which characters, and how Windows is told of a long one.

Windows takes up to 259 characters of a path as it is written, and 32,767 of one that begins with `\\?\`. Names hold no
characters there that mean something else to it: a colon would silently write a hidden stream of another file, and some
names are devices.
"""

from __future__ import annotations

import ntpath
import os
import sys
from pathlib import Path, PurePath

IS_WINDOWS = os.name == "nt"

_LONG = 240  # well below what a file or a folder may have
_PREFIX, _SHARE_PREFIX = "\\\\?\\", "\\\\?\\UNC\\"

_FORBIDDEN = frozenset('<>:"|?*') | {chr(code) for code in range(32)}
_DEVICES = frozenset(("CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$")) | {
    f"{port}{digit}" for port in ("COM", "LPT") for digit in "123456789¹²³"
}
# Of a path and of a name in it.
_LIMITS = {"win32": (32_766, 255), "darwin": (1023, 255), "linux": (4095, 255)}


def reachable(path: Path) -> Path:
    """The same file by a name that this system takes whatever its length."""
    return Path(extended_name(str(path))) if IS_WINDOWS else path


def extended_name(name: str) -> str:
    r"""Windows' name of a file with `\\?\` before it if it is long, else as it is."""
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
        return f"a name cannot hold a zero byte, got {text!r}; leave it out"
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
            return f"a name cannot hold {character!r} on Windows, got {name!r}; leave it out"
        if name.partition(".")[0].rstrip(" ").upper() in _DEVICES:
            return f"{name!r} is a device on Windows; give another name"
        if name.endswith((".", " ")) and name.strip("."):
            return f"a name cannot end with {name[-1]!r} on Windows, got {name!r}; leave it out"
    return None


def _names(path: PurePath) -> tuple[str, ...]:
    return path.parts[1:] if path.anchor else path.parts


def _length(text: str, system: str) -> int:
    """As the system counts."""
    if system == "win32":
        return len(text.encode("utf-16-le", "surrogatepass")) // 2
    return len(os.fsencode(text))
