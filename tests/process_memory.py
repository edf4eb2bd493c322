"""How much memory this process takes, as each system reports it, in megabytes of 2^20 bytes."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

MEGABYTE = 2**20


def peak_megabytes() -> float:
    """The most that was resident at any time."""
    if os.name == "nt":
        return _working_sets()[0] / MEGABYTE
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / MEGABYTE if sys.platform == "darwin" else peak / 1024


def resident_megabytes() -> float:
    """The resident memory now."""
    if os.name == "nt":
        return _working_sets()[1] / MEGABYTE
    pages = Path("/proc/self/statm")
    if pages.is_file():
        return int(pages.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE") / MEGABYTE
    told = subprocess.run(["ps", "-o", "rss=", "-p", str(os.getpid())], capture_output=True, text=True, check=True)
    return int(told.stdout) / 1024


class _Mallinfo(ctypes.Structure):
    """glibc's `struct mallinfo2`."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in (
            *("arena", "ordblks", "smblks", "hblks", "hblkhd"),
            *("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"),
        )
    ]


class _ProcessUsage(ctypes.Structure):
    """Windows' PROCESS_MEMORY_COUNTERS."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("faults", ctypes.c_uint32),
        ("working_sets", ctypes.c_size_t * 2),
        ("pools", ctypes.c_size_t * 4),
        ("committed", ctypes.c_size_t * 2),
    )


def held_megabytes() -> float:
    """Memory that is allocated and not freed; the resident memory without glibc >= 2.33.

    Resident memory also grows with fragmentation, which depends on the order of threads.
    """
    tell = None if os.name == "nt" else getattr(ctypes.CDLL(None), "mallinfo2", None)
    if tell is None:
        return resident_megabytes()
    tell.restype = _Mallinfo
    told = tell()
    return (told.uordblks + told.hblkhd) / MEGABYTE


def _working_sets() -> tuple[int, int]:
    """The largest and the current working set of this process on Windows, in bytes."""
    system, found = ctypes.CDLL("kernel32"), _ProcessUsage(size=ctypes.sizeof(_ProcessUsage))
    system.GetCurrentProcess.restype = ctypes.c_void_p
    system.K32GetProcessMemoryInfo.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32)
    assert system.K32GetProcessMemoryInfo(system.GetCurrentProcess(), ctypes.byref(found), found.size)
    peak, now = found.working_sets
    return peak, now
