"""macOS: `host_statistics64`, of which what is free and what was not used lately count.

The latter is what macOS gives away first, files that it reads again or memory that it compresses; Activity Monitor's
"memory used" leaves out the files. No limit is set to groups of processes there.
"""

from __future__ import annotations

import ctypes
from typing import Any

_VM_INFO_64 = 4  # HOST_VM_INFO64


class Statistics(ctypes.Structure):
    """vm_statistics64: counts of pages."""

    _fields_ = (
        ("free", ctypes.c_uint32),  # those read ahead of what asked for them among them
        ("active", ctypes.c_uint32),
        ("inactive", ctypes.c_uint32),
        ("wired", ctypes.c_uint32),
        ("events", ctypes.c_uint64 * 9),
        ("purgeable", ctypes.c_uint32),
        ("speculative", ctypes.c_uint32),
        ("transfers", ctypes.c_uint64 * 4),
        ("compressor", ctypes.c_uint32),
        ("throttled", ctypes.c_uint32),
        ("external", ctypes.c_uint32),
        ("internal", ctypes.c_uint32),
        ("compressed", ctypes.c_uint64),
    )


def free_bytes(system: Any = None) -> int | None:
    """As the package's. system: libSystem's functions, or what stands for them."""
    if system is None:
        system = _lib_system()
    found = Statistics()
    count = ctypes.c_uint32(ctypes.sizeof(found) // ctypes.sizeof(ctypes.c_uint32))
    if system.host_statistics64(system.mach_host_self(), _VM_INFO_64, ctypes.byref(found), ctypes.byref(count)):
        return None
    return int(found.free + found.inactive) * _page_size(system)


def _lib_system() -> Any:
    library = ctypes.CDLL("/usr/lib/libSystem.B.dylib")
    library.mach_host_self.restype = ctypes.c_uint32
    library.host_statistics64.argtypes = (ctypes.c_uint32, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    return library


def _page_size(system: Any) -> int:
    """Of what the statistics count: the kernel's, which is not that of a process for Intel on an Apple processor."""
    return int(ctypes.c_size_t.in_dll(system, "vm_kernel_page_size").value)
