"""Workers of Dask: those of a cluster on this machine, made for one run, or those of the user's scheduler."""

from __future__ import annotations

import argparse
import logging
import os
import secrets
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..arguments import CommandError, explained
from . import worker

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

    from ...pieces.work import PieceWork
    from ..blender import StopRequest

CONNECT_SECONDS = 20
CLOSE_SECONDS = 5
POLL_SECONDS = 0.2
SAFE_PATH = "PYTHONSAFEPATH"
LOCAL_SETTINGS = {
    # The first death of a worker is reported at once, not after several: this module counts them, by chunk.
    "distributed.scheduler.allowed-failures": 0,
    # Dask watches itself oftener than tasks of seconds need.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.system-monitor.gil.enabled": False,
}


@contextmanager
def cluster_client(arguments: argparse.Namespace) -> Iterator[Client]:
    """A client of the workers that the arguments name; workers that were started for it end with it."""
    from distributed import Client

    _silence()
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
    with _ignoring_interrupts() as hearing, _local_cluster(arguments.workers) as cluster:
        client = Client(cluster, set_as_default=False)
        try:
            with hearing():
                yield client
        finally:
            client.close(timeout=CLOSE_SECONDS)


def _silence() -> None:
    """Silences Dask's logs: problems of workers are reported in our own words."""
    for name in [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)


@contextmanager
def _local_cluster(count: int) -> Iterator[LocalCluster]:
    import dask
    from distributed import LocalCluster

    from .nanny import PatientNanny

    with _without_users_modules(), dask.config.set(LOCAL_SETTINGS):
        try:
            cluster = LocalCluster(
                n_workers=count,
                worker_class=PatientNanny,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",  # any free port; None would be that of another cluster
                memory_limit=0,  # Blenders are separate processes
                silence_logs=logging.CRITICAL,
                preload=[worker.__name__],
            )
        except (OSError, RuntimeError) as error:
            raise CommandError(f"--workers {count}: they could not be started ({error})") from error
        try:
            yield cluster
        finally:
            with suppress(TimeoutError):  # of a busy machine: workers end with this process in any case
                cluster.close(timeout=CLOSE_SECONDS)


@contextmanager
def _without_users_modules() -> Iterator[None]:
    """Keeps workers that start while this is active, initially and after a death, from running the user's modules.

    They look for no modules in the current folder, and do not run the user's script again, as multiprocessing would to
    find its functions: a script then needs no `if __name__ == "__main__"`.
    """
    main, safe_path = sys.modules["__main__"], os.environ.get(SAFE_PATH)
    sys.modules["__main__"], os.environ[SAFE_PATH] = ModuleType("__main__"), "1"
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        if safe_path is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = safe_path


@contextmanager
def _ignoring_interrupts() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Ignores Ctrl-C while active, in started processes as well; yields a context in which it works as before."""
    if threading.current_thread() is not threading.main_thread():  # which alone hears of it
        yield nullcontext
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)

    @contextmanager
    def hearing() -> Iterator[None]:
        nonlocal before
        signal.signal(signal.SIGINT, before)
        try:
            yield
        finally:
            before = signal.signal(signal.SIGINT, signal.SIG_IGN)

    try:
        yield hearing
    finally:
        signal.signal(signal.SIGINT, before)


def check_workers(client: Client, work: PieceWork, stop: StopRequest, arguments: argparse.Namespace) -> int:
    """How many threads each worker is to use. Raises CommandError if one cannot do the work, with why.

    Checks workers before anything starts; those that join later are checked with their first chunk.
    """
    found: dict[str, Any] = {}
    while not found:
        _wait_for_workers(client, stop)
        # A worker that dies during this is left out.
        found = {
            address: seen
            for address, seen in _look(client, work, arguments.file).items()
            if not isinstance(seen, OSError)
        }
    for address, seen in found.items():
        fault = _fault_of(seen, arguments)
        if fault is not None:
            host = f" on {seen['host']}" if isinstance(seen, dict) else ""
            raise CommandError(f"worker {address}{host} cannot take part: {fault}")
    if arguments.threads is not None:
        return int(arguments.threads)
    on_host = Counter(seen["host"] for seen in found.values())
    return min(max(1, seen["cores"] // on_host[seen["host"]]) for seen in found.values())


def _look(client: Client, work: PieceWork, file: str) -> dict[str, Any]:
    """Returns workers' reports, or the exceptions of asking them, by their addresses."""
    probe = work.place.folder / f".{secrets.token_hex(4)}"
    with explained():
        probe.touch()
    try:
        found: dict[str, Any] = client.run(worker.look, file, str(probe), on_error="return")
    finally:
        probe.unlink(missing_ok=True)
    return found


def _wait_for_workers(client: Client, stop: StopRequest) -> None:
    """Waits for the first worker."""
    is_told = False
    while not client.nthreads():
        if stop.is_set:
            raise KeyboardInterrupt
        if not is_told:
            sys.stderr.write("perfect-bvh: the scheduler has no workers yet; waiting for one\n")
            is_told = True
        time.sleep(POLL_SECONDS)


def _fault_of(seen: Any, arguments: argparse.Namespace) -> str | None:
    """Returns why a worker cannot do the work; None if it can. seen: its report, or the exception."""
    import perfect_bvh

    own = perfect_bvh.__version__
    if isinstance(seen, ImportError):
        return f"Perfect BVH {own} is not installed there ({seen})"
    if not isinstance(seen, dict):
        return f"{type(seen).__name__}: {seen}"
    if seen["version"] != own:
        return f"it has Perfect BVH {seen['version']}, but {own} is required; install the same version on both"
    if not seen["has_blender"]:
        return "its Python has no module bpy: pip install 'perfect-bvh[blender]'"
    if seen["size"] is None:
        return (
            f"{arguments.file} does not exist there; the scene and its files must be at the same path on all machines"
        )
    if seen["size"] != os.path.getsize(arguments.file):
        return f"{arguments.file} is a different file there, of {seen['size']:,} bytes"
    if not seen["sees_output"]:
        folder = Path(arguments.output)
        return f"the output folder {folder} of -o does not exist there; all machines must write into the same folder"
    return None
