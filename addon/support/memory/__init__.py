"""Whether a request fits into memory: otherwise the system would end Blender in the middle, with unsaved work.

Windows refuses instead, which is no better in the middle of Blender's own work. Each system has a separate module,
except macOS, where this never ran: there nothing is known, and nothing is refused.
"""

from __future__ import annotations

import sys


def free_bytes() -> int | None:
    """Returns the bytes that can still be allocated without swapping; None if they are unknown.

    On Linux the limits of the process count as well as the machine's: control groups, on which containers are based.
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
        raise ValueError(f"{what} needs about {needed} of memory, but only {left} are free: {remedy}")
