"""Linux: what `/proc/meminfo` says of the machine, and the control groups of both versions of the process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class _LimitFiles:
    """The names of the files of a control group in one version of Linux' groups, below a folder of `root`.

    cache: in `statistics`, the bytes of file caches that are released when memory is short.
    """

    folder: str
    limit: str
    usage: str
    statistics: str
    cache: str


_VERSION_1 = _LimitFiles(
    "sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "memory.stat", "total_inactive_file"
)
_VERSION_2 = _LimitFiles("sys/fs/cgroup", "memory.max", "memory.current", "memory.stat", "inactive_file")


def free_bytes(root: Path = Path("/")) -> int | None:
    """Implements the package's function; None if there is no `/proc`. root: the folder of `proc` and `sys`."""
    known = [_number_after(root / "proc/meminfo", "MemAvailable:")]
    free = [size << 10 for size in known if size is not None]
    free += _free_in_groups(root)
    return min(free, default=None)


def _free_in_groups(root: Path) -> Iterator[int]:
    """Yields the free memory of each control group of the process; the groups above it limit it, too."""
    for files, group in _groups(root):
        top = root / files.folder
        path = top / group.strip("/")
        # A container may see the path that its group has outside, but only its own files.
        for folder in (path, *path.parents) if path.is_dir() else (top,):
            if folder.is_relative_to(top):
                free = _free_in_group(folder, files)
                if free is not None:
                    yield free


def _groups(root: Path) -> Iterator[tuple[_LimitFiles, str]]:
    """Lines like "4:memory:/path" of version 1 and "0::/path" of version 2."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, group = line.split(":", 2)
        if "memory" in controllers.split(","):
            yield _VERSION_1, group
        elif not controllers:
            yield _VERSION_2, group


def _free_in_group(folder: Path, files: _LimitFiles) -> int | None:
    """Returns the free bytes; None without a limit: version 2 has "max", version 1 a number beyond any memory."""
    limit, usage = (_lines(folder / name) for name in (files.limit, files.usage))
    if not limit or not usage or not limit[0].isdigit():
        return None
    cache = _number_after(folder / files.statistics, files.cache) or 0
    return max(0, int(limit[0]) - int(usage[0]) + cache)


def _number_after(path: Path, name: str) -> int | None:
    for line in _lines(path):
        if line.startswith(f"{name} "):
            return int(line.split()[1])
    return None


def _lines(path: Path) -> list[str]:
    """Returns the lines of a file that the system may not have."""
    try:
        return path.read_text(encoding="ascii").splitlines()
    except OSError:
        return []
