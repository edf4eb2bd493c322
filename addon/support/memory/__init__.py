"""Whether what is asked for fits into memory: else the system would end Blender in the middle, unsaved work and all.

Windows refuses instead, which is no better in the middle of Blender's own work. Each system is asked by a module of its
own, but for macOS, where this never ran: nothing is known there, and nothing is refused.
"""

from __future__ import annotations

import sys


def free_bytes() -> int | None:
    """What can still be allocated without pushing anything out; None where nothing is known.

    On Linux what limits the process counts as well as the machine: control groups, which containers are made of.
    """
    if sys.platform == "win32":
        from .windows import free_bytes
    else:
        from .linux import free_bytes
    return free_bytes()


def check_fits(what: str, byte_count: int, remedy: str) -> None:
    """Raises ValueError if `what` needs more than is free. remedy: the way out, as an order."""
    free = free_bytes()
    if free is not None and byte_count > free:
        needed, left = (f"{size / 2**30:,.1f} GiB" for size in (byte_count, free))
        raise ValueError(f"{what} needs about {needed} of memory, and {left} are free: {remedy}")
