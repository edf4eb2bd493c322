"""Seconds that tasks which do nothing take through Dask's scheduler and one worker: `empty_tasks.py COUNT`.

This is a separate program because workers load the program that starts them, and this one does not load Blender.
"""

from __future__ import annotations

import sys
import time

from distributed import Client, LocalCluster


def main() -> None:
    """Prints the seconds."""
    count = int(sys.argv[1])
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(abs, range(100)))
        started = time.perf_counter()
        client.gather(client.map(abs, range(-count, 0), pure=False))
        print(time.perf_counter() - started)


if __name__ == "__main__":
    main()
