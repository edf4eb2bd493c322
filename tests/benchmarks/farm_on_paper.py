"""What a farm of many workers saturates first, calculated from the measured figures of one worker and the scheduler.

Three things are shared: the scheduler, which handles one task at a time; the disk where all chunks go; and, at the
start, the disk that all read the scene from. Each is busy for a share of the time that grows with the workers; a larger
farm waits for the one whose share reaches 1 first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

WORKERS = 1000
MESSAGES = 1.0  # tasks of the scheduler for a chunk
DISK_MEGABYTES = 1000.0  # a second: a shared file system on a network of 10 gigabits
LIBRARIES_MEGABYTES = 400.0  # Blender's module and its files, read by each worker where they are on the shared disk too


@dataclass(frozen=True)
class Farm:
    """piece_seconds, piece_megabytes: of a worker. task_microseconds: of the scheduler. scene_megabytes: the .blend."""

    piece_seconds: float
    piece_megabytes: float
    task_microseconds: float
    scene_megabytes: float


def saturations(farm: Farm, workers: int = WORKERS) -> dict[str, Any]:
    """Busy shares with these workers, the number that saturates each, the first of them, and the start's time."""
    busy = {
        "scheduler": MESSAGES * farm.task_microseconds * 1e-6 / farm.piece_seconds,
        "disk": farm.piece_megabytes / farm.piece_seconds / DISK_MEGABYTES,
    }
    most = {name: 1.0 / share for name, share in busy.items()}
    first = min(most, key=lambda name: most[name])
    return {
        "workers": workers,
        "busy": {name: share * workers for name, share in busy.items()},
        "saturated_by_workers": most,
        "first": first,
        "start_seconds_scene": workers * farm.scene_megabytes / DISK_MEGABYTES,
        "start_seconds_libraries_on_the_shared_disk": workers * LIBRARIES_MEGABYTES / DISK_MEGABYTES,
    }
