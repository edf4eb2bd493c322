"""Whether what is asked for fits into memory: else the system would end Blender in the middle, unsaved work and all."""

from __future__ import annotations

from pathlib import Path


def free_bytes() -> int | None:
    """What can still be allocated without pushing anything out; None where the system does not tell."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    for line in lines:
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) << 10
    return None


def check_fits(what: str, byte_count: int, remedy: str) -> None:
    """Raises ValueError if `what` needs more than is free. remedy: the way out, as an order."""
    free = free_bytes()
    if free is not None and byte_count > free:
        needed, left = (f"{size / 2**30:,.1f} GiB" for size in (byte_count, free))
        raise ValueError(f"{what} needs about {needed} of memory, and {left} are free: {remedy}")
