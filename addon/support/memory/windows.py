"""Windows: `GlobalMemoryStatusEx` for the machine, and the limits of the job object that the process is in.

A program's memory is promised out of memory and page files together (it is "committed") before a page of it is touched:
what is left of that ends a program, what is left of memory alone makes it crawl. The less of both counts.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any

# Classes of information, and flags of the limits that are set, as winnt.h numbers them.
_EXTENDED_LIMITS, _MEMORY_USAGE = 9, 28
_LIMITS_PROCESS, _LIMITS_JOB = 0x100, 0x200


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


class JobLimits(ctypes.Structure):
    """JOBOBJECT_EXTENDED_LIMIT_INFORMATION of 64 bits."""

    _fields_ = (
        ("times", ctypes.c_int64 * 2),
        ("flags", ctypes.c_uint32),
        ("working_set", ctypes.c_size_t * 2),
        ("processes", ctypes.c_uint32),
        ("affinity", ctypes.c_size_t),
        ("priority", ctypes.c_uint32),
        ("scheduling", ctypes.c_uint32),
        ("transfers", ctypes.c_uint64 * 6),
        ("process", ctypes.c_size_t),
        ("job", ctypes.c_size_t),
        ("peaks", ctypes.c_size_t * 2),
    )


class JobUsage(ctypes.Structure):
    """JOBOBJECT_MEMORY_USAGE_INFORMATION, which Windows has since 10."""

    _fields_ = (("now", ctypes.c_uint64), ("peak", ctypes.c_uint64))


class ProcessUsage(ctypes.Structure):
    """PROCESS_MEMORY_COUNTERS; `committed` is what limits of processes and jobs count."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("faults", ctypes.c_uint32),
        ("working_sets", ctypes.c_size_t * 2),
        ("pools", ctypes.c_size_t * 4),
        ("committed", ctypes.c_size_t),
        ("peak", ctypes.c_size_t),
    )


def free_bytes(system: Any = None) -> int | None:
    """As the package's. system: kernel32's functions, or what stands for them."""
    if system is None:
        system = _kernel32()
    free = [*_free_in_machine(system), *_free_in_job(system)]
    return min(free, default=None)


def _kernel32() -> Any:
    library = ctypes.CDLL("kernel32")  # of our own: what others say of its functions' types, they say of theirs
    library.GetCurrentProcess.restype = ctypes.c_void_p
    library.K32GetProcessMemoryInfo.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32)
    query = library.QueryInformationJobObject
    query.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p)
    return library


def _free_in_machine(system: Any) -> Iterator[int]:
    found = MachineMemory(length=ctypes.sizeof(MachineMemory))
    if system.GlobalMemoryStatusEx(ctypes.byref(found)):
        yield from (found.available, found.commit_available)


def _free_in_job(system: Any) -> Iterator[int]:
    """Of the innermost job, if there is one; Windows tells a process nothing of those around it."""
    limits = _job_information(system, _EXTENDED_LIMITS, JobLimits())
    if limits is None or not limits.flags & (_LIMITS_PROCESS | _LIMITS_JOB):
        return
    own = ProcessUsage(size=ctypes.sizeof(ProcessUsage))
    if not system.K32GetProcessMemoryInfo(system.GetCurrentProcess(), ctypes.byref(own), own.size):
        return
    if limits.flags & _LIMITS_PROCESS:
        yield max(0, limits.process - own.committed)
    if limits.flags & _LIMITS_JOB:
        usage = _job_information(system, _MEMORY_USAGE, JobUsage())
        # Before Windows 10 nothing tells what the job's other processes take.
        yield max(0, limits.job - (own.committed if usage is None else usage.now))


def _job_information(system: Any, number: int, found: Any) -> Any:
    """`found`, filled in; None if there is no job, or Windows does not know the question."""
    answered = system.QueryInformationJobObject(None, number, ctypes.byref(found), ctypes.sizeof(found), None)
    return found if answered else None
