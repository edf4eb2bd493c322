"""Windows: `GlobalMemoryStatusEx`.

Windows promises ("commits") a program's memory out of memory and page files together before a page of it is used.
A program ends when no commit is left, and crawls when no memory is left. The smaller of both counts.
"""

from __future__ import annotations

import ctypes
from typing import Any


class MachineMemory(ctypes.Structure):
    """MEMORYSTATUSEX."""

    _fields_ = (
        ("length", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        ("total", ctypes.c_uint64),
        ("available", ctypes.c_uint64),
        ("commit_limit", ctypes.c_uint64),
        ("commit_available", ctypes.c_uint64),
        ("virtual_total", ctypes.c_uint64),
        ("virtual_available", ctypes.c_uint64),
        ("extended_available", ctypes.c_uint64),
    )


def free_bytes(system: Any = None) -> int | None:
    """Implements the package's function. system: kernel32's functions, or a replacement."""
    if system is None:
        system = ctypes.CDLL("kernel32")  # of our own: what others say of its functions' types, they say of theirs
    found = MachineMemory(length=ctypes.sizeof(MachineMemory))
    if not system.GlobalMemoryStatusEx(ctypes.byref(found)):
        return None
    return int(min(found.available, found.commit_available))
