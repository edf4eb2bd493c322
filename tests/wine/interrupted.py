"""Waits in one way for Ctrl-C, in Windows' Python with a console: notes in a file that it is ready, then the outcome.

Arguments: the file, and "waiting" for Python alone, "request" for the command line, "work" for a thread at work,
"engine" for commits.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import perfect_bvh
from perfect_bvh_addon.cli.blender import stop_on_interrupt
from perfect_bvh_addon.support.background_work import BackgroundWork

SECONDS = 30.0  # after which nothing came


def wait(tell: Callable[[], None]) -> None:
    tell()
    time.sleep(SECONDS)


def wait_for_request(tell: Callable[[], None]) -> None:
    with stop_on_interrupt() as stop:
        tell()
        for _ in range(int(SECONDS / 0.05)):
            if stop.is_set:
                raise KeyboardInterrupt
            time.sleep(0.05)


def wait_for_work(tell: Callable[[], None]) -> None:
    def work(advance: Callable[[float], bool]) -> None:
        tell()
        end = time.monotonic() + SECONDS
        while advance(0.0) and time.monotonic() < end:
            time.sleep(0.01)

    BackgroundWork(work, lambda _: None).result()


def commit_without_end(tell: Callable[[], None]) -> None:
    """Each of which takes most of a second: it is the engine that asks Python for signals."""
    corners = np.random.default_rng(0).normal(size=(600_000, 3)).astype(np.float32)
    triangles = np.arange(len(corners)).reshape(-1, 3)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(corners, triangles))
    tell()
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        scene.replace_mesh(0, corners, triangles)
        scene.commit()


WAYS = {"waiting": wait, "request": wait_for_request, "work": wait_for_work, "engine": commit_without_end}


def main() -> None:
    """The command line."""
    file, way = Path(sys.argv[1]), sys.argv[2]

    def tell() -> None:
        file.write_text("ready")

    try:
        WAYS[way](tell)
        file.write_text("nothing")
    except KeyboardInterrupt:
        file.write_text("interrupted")


if __name__ == "__main__":
    main()
