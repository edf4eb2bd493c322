"""The code that runs in workers of Dask. Each chunk is done by a Blender in a separate process, which is reused.

Blender needs a process's main thread, which Dask does not give; and a crash of that Blender leaves the worker intact.
Several runs may share a worker: each run has its own Blenders, and stops and ends only these.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

CHILD = "perfect_bvh_addon.cli.piece_child"
FOLDER_PREFIX = "perfect_bvh_"
# To itself, so that Ctrl-C in a terminal does not end it.
OWN_GROUP: dict[str, Any] = (
    {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if sys.platform == "win32" else {"process_group": 0}
)
TRIM = "MALLOC_TRIM_THRESHOLD_"
LAST_SECONDS = 5  # in which it may say why it ends
LAST_WORDS = 4000  # bytes of its last output that are read after its death
KILL_SECONDS = 5  # a killed process may hang in a system call, such as one to a server that does not answer

_free: list[BlenderProcess] = []
_busy: set[BlenderProcess] = set()
_lock = threading.Lock()


class DeadBlenderError(Exception):
    """It has ended although it was to answer; why, as far as is known."""


class BlenderProcess:
    """A process that makes chunks of one job, one at a time.

    A Blender that is killed leaves its temporary files behind. So it gets a folder for them, which goes with it; if its
    worker dies first, it removes that itself.
    """

    def __init__(self, job_id: str) -> None:
        self.job_id = job_id
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 - closed with the process
        self._folder = tempfile.mkdtemp(prefix=FOLDER_PREFIX)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", CHILD, self._folder],  # -P: a random.py of the user's is not Python's
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            encoding="utf-8",
            env=_environment(self._folder),
            **OWN_GROUP,
        )
        self._writing = threading.Lock()

    @property
    def has_left(self) -> bool:
        """Whether it has ended by itself, in order."""
        return self._process.poll() == 0

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Returns the process's answer. Raises DeadBlenderError."""
        line = ""
        if self._write(request):
            line = self._process.stdout.readline()  # type: ignore[union-attr]
        if not line.endswith("\n"):
            raise DeadBlenderError(self._last_words())
        answer: dict[str, Any] = json.loads(line)
        return answer

    def stop(self) -> None:
        """Asks it to drop its current chunk."""
        self._write({"stop": True})

    def end(self) -> None:
        """Kills the process at any point: its files are whole or missing."""
        self._process.kill()

    def tidy(self) -> None:
        """Removes the temporary files of a killed process, once it has ended."""
        if self._status(KILL_SECONDS) is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def close(self) -> None:
        """Ends the process; there are no more requests."""
        self.end()
        self.tidy()
        self._said.close()
        for pipe in (self._process.stdin, self._process.stdout):
            try:
                pipe.close()  # type: ignore[union-attr]
            except OSError:  # what could not be written to a dead process any more
                continue

    def _write(self, request: dict[str, Any]) -> bool:
        """Sends a request; returns whether that succeeded."""
        with self._writing:
            try:
                self._process.stdin.write(json.dumps(request) + "\n")  # type: ignore[union-attr]
                self._process.stdin.flush()  # type: ignore[union-attr]
            except OSError:
                return False
        return True

    def _status(self, seconds: float) -> int | None:
        """Returns its exit status, if it ends within that time."""
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def _last_words(self) -> str:
        """The status with which it has ended, and the last line that it has said."""
        if self._status(LAST_SECONDS) is None:  # it only has closed its output
            self._process.kill()
        status = self._status(KILL_SECONDS)
        self._said.seek(max(0, self._said.seek(0, os.SEEK_END) - LAST_WORDS))
        said = self._said.read().decode("utf-8", "replace").strip()
        return ": ".join((f"it ended with status {status}", *said.splitlines()[-1:]))


def _environment(folder: str) -> dict[str, str]:
    """Returns the environment of a Blender with a folder for temporary files: ours, without a setting of Dask's.

    That setting makes the C library return memory to the system at once, and request it again for each large array.
    """
    from dask import config

    by_dask = (config.get("distributed.nanny.pre-spawn-environ", None) or {}).get(TRIM)
    kept = {name: value for name, value in os.environ.items() if name != TRIM or value != str(by_dask)}
    return {**kept, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)}


def do_piece(job: dict[str, Any], number: int) -> dict[str, Any]:
    """A task of Dask: the answer of a Blender, or that it has `died`; and where that was."""
    from distributed import get_worker

    request = {"job": job, "piece": number}
    answer = None
    while answer is None:
        with _lock:
            free = next(iter(_of_job(_free, job["id"])), None)
            if free is not None:
                _free.remove(free)
            blender = free or BlenderProcess(job["id"])
            _busy.add(blender)
        answer = _ask(blender, request, may_have_left=free is not None)
    return {**answer, "host": socket.gethostname(), "worker": get_worker().address}


def _ask(blender: BlenderProcess, request: dict[str, Any], may_have_left: bool) -> dict[str, Any] | None:
    """Returns the answer of a busy Blender, which is free then; None if it has ended, idle for long."""
    lives = False
    try:
        answer = blender.ask(request)
        lives = True
    except DeadBlenderError as error:
        return None if may_have_left and blender.has_left else {"died": str(error)}
    finally:
        with _lock:
            _busy.discard(blender)
            if lives:
                _free.append(blender)
        if not lives:
            blender.close()
    return answer


def stop_pieces(job_id: str) -> None:
    """Asks the Blenders of a job on this worker to give up what they do. Does not wait for it."""
    with _lock:
        for blender in _of_job(_busy, job_id):
            blender.stop()


def end_blenders(job_id: str) -> None:
    """Ends the Blenders of a job on this worker, at once."""
    with _lock:
        busy, free = _of_job(_busy, job_id), _of_job(_free, job_id)
        for blender in (*busy, *free):
            blender.end()
        for blender in busy:
            blender.tidy()
        for blender in free:
            _free.remove(blender)
            blender.close()


def _of_job(blenders: Iterable[BlenderProcess], job_id: str) -> list[BlenderProcess]:
    return [blender for blender in blenders if blender.job_id == job_id]


def look(file: str, probe: str) -> dict[str, Any]:
    """Reports on a worker. file: the scene. probe: a new file in the output folder, whose visibility is tested."""
    import importlib.util

    import perfect_bvh

    affinity = getattr(os, "sched_getaffinity", None)
    return {
        "version": perfect_bvh.__version__,
        "has_blender": importlib.util.find_spec("bpy") is not None,
        "size": os.path.getsize(file) if Path(file).is_file() else None,
        "sees_output": Path(probe).is_file(),
        "host": socket.gethostname(),
        "cores": len(affinity(0)) if affinity is not None else os.cpu_count() or 1,
    }


def dask_setup(_worker: Any) -> None:
    """Prepares workers that Dask starts with this module as a preload: only their starter handles Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
