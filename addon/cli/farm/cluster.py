"""Workers of Dask: those of a cluster on this machine, made for one run, or those of the user's scheduler."""

from __future__ import annotations

import argparse
import logging
import os
import secrets
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import CommandError
from . import worker

if TYPE_CHECKING:
    from distributed import Client

    from ..piece_work import PieceWork

CONNECT_SECONDS = 20
CLOSE_SECONDS = 5
POLL_SECONDS = 0.2


@contextmanager
def cluster_client(arguments: argparse.Namespace) -> Iterator[Client]:
    """A client of the workers that the arguments name; workers that were started for it end with it."""
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is told in our own words
    if arguments.scheduler is not None:
        try:
            client = Client(arguments.scheduler, timeout=CONNECT_SECONDS, set_as_default=False)
        except (OSError, ValueError) as error:
            raise CommandError(f"--scheduler {arguments.scheduler}: no scheduler answers there ({error})") from error
        try:
            yield client
        finally:
            client.close(timeout=CLOSE_SECONDS)
        return
    # The first death of a worker is told at once, not after several: they are counted here, by piece.
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        _ignoring_interrupts(),
        LocalCluster(
            n_workers=arguments.workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            memory_limit=0,  # Blenders are processes of their own
            silence_logs=logging.CRITICAL,
            preload=[worker.__name__],
        ) as cluster,
        _hearing_interrupts(),
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


_handlers: list[Any] = []


@contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """What is started meanwhile ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    _handlers.append(before)
    try:
        yield
    finally:
        _handlers.pop()
        signal.signal(signal.SIGINT, before)


@contextmanager
def _hearing_interrupts() -> Iterator[None]:
    """Within the former: as before it. Once it ends, what is still to do is done whatever is pressed."""
    signal.signal(signal.SIGINT, _handlers[-1])
    try:
        yield
    finally:
        _handlers[-1] = signal.signal(signal.SIGINT, signal.SIG_IGN)


def check_workers(client: Client, work: PieceWork) -> int:
    """How many threads each worker is to use. Raises CommandError if one cannot do the work, with why.

    Looks before anything starts: who joins later is looked at when its first piece is.
    """
    arguments = work.arguments
    _wait_for_workers(client, work)
    probe = work.place.folder / f".{secrets.token_hex(4)}"
    probe.touch()
    try:
        found = client.run(worker.look, arguments.file, str(probe), on_error="return")
    finally:
        probe.unlink(missing_ok=True)
    for address, seen in found.items():
        fault = _fault_of(seen, arguments)
        if fault is not None:
            host = f" on {seen['host']}" if isinstance(seen, dict) else ""
            raise CommandError(f"the worker {address}{host} cannot do this: {fault}")
    if arguments.threads is not None:
        return int(arguments.threads)
    on_host = Counter(seen["host"] for seen in found.values())
    return min(max(1, seen["cores"] // on_host[seen["host"]]) for seen in found.values())


def _wait_for_workers(client: Client, work: PieceWork) -> None:
    """Until there is one."""
    is_told = False
    while not client.nthreads():
        if work.stop.is_set:
            raise KeyboardInterrupt
        if not is_told:
            sys.stderr.write("perfect-bvh: the scheduler has no workers yet; waiting for one\n")
            is_told = True
        time.sleep(POLL_SECONDS)


def _fault_of(seen: Any, arguments: argparse.Namespace) -> str | None:
    """Why a worker cannot do the work; None if it can. seen: what it says of itself, or the exception that came."""
    import perfect_bvh

    own = perfect_bvh.__version__
    if isinstance(seen, ImportError):
        return f"it has not this version, {own}, of Perfect BVH ({seen})"
    if not isinstance(seen, dict):
        return f"{type(seen).__name__}: {seen}"
    if seen["version"] != own:
        return f"it has version {seen['version']} of Perfect BVH, and {own} is asked for; install the same on both"
    if not seen["has_blender"]:
        return "its Python has no module bpy: pip install 'perfect-bvh[blender]'"
    if seen["size"] is None:
        return f"it does not see {arguments.file}; all machines have to find the scene and all that it reads there"
    if seen["size"] != os.path.getsize(arguments.file):
        return f"it sees another file as {arguments.file}, of {seen['size']:,} bytes"
    if not seen["sees_output"]:
        folder = Path(arguments.output)
        return f"it does not see the output folder of -o {folder}; all machines have to write into the same"
    return None
