"""A process with a Blender, which does chunks on request: `python -m perfect_bvh_addon.cli.piece_child DIR`.

It reads a request as a line of JSON on its standard input and answers by a line on its standard output. The scene is
opened once and kept from chunk to chunk. Any error that is not the user's ends the process: then the chunk is tried
again elsewhere. It also ends when its worker is gone, even in the middle of a chunk. DIR is only for its temporary
files, Blender's among them. Its worker removes it after the process has ended, or the process does so itself if
its worker has ended first.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import shutil
import signal
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

if TYPE_CHECKING:
    from ..pieces.work import PieceWork
    from .blender import StopRequest
    from .frames import Job

IDLE_SECONDS = 600.0  # without a request for this time the process ends
EXIT_ALONE = 1

Request = dict[str, Any]


class Workbench:
    """The scene of a job, and its chunks."""

    def __init__(self, stop: StopRequest) -> None:
        self._stop = stop
        self._job_id: str | None = None
        self._work: PieceWork | None = None

    def answer(self, request: Request) -> dict[str, Any]:
        """Does a chunk: answers `done` with its report; `stopped`; `refused`, or the `fault`, in words.

        seconds: of the chunk, without opening the scene; None if it existed.
        """
        from .arguments import CommandError
        from .frames import do_piece

        job, number = request["job"], request["piece"]
        try:
            work = self._work_of(job, number)
        except CommandError as error:
            self._work = None
            return {"refused": str(error)}
        piece, before, self._work = work.pieces[number], self._work, None  # what goes wrong leaves no scene behind
        try:
            if work.place.is_done(piece):
                self._work = before
                return {"done": {}, "warnings": [], "seconds": None}
            started = time.monotonic()
            done = do_piece(work, piece, self._stop)
        except CommandError as error:
            return {"fault": str(error), "is_of_files": isinstance(error.__cause__, OSError)}
        if done is None:
            return {"stopped": True}
        self._work = work
        return {"done": done.counts, "warnings": list(done.warnings), "seconds": time.monotonic() - started}

    def _work_of(self, job: dict[str, Any], number: int) -> PieceWork:
        """Makes the work, opening the scene if necessary. Raises CommandError if this is no worker for that job."""
        if self._job_id != job["id"] or self._work is None or not self._work.can_do(self._work.pieces[number]):
            self._work, self._job_id = _open(job, self._stop), job["id"]
        return self._work


def _open(job: dict[str, Any], stop: StopRequest) -> PieceWork:
    import perfect_bvh

    from ..pieces.piece import find_difference, learn_checksums
    from .arguments import CommandError
    from .bake import bake_work
    from .blender import open_scene
    from .commands import scan_work
    from .frames import RenderWork
    from .labels import labels_work

    if perfect_bvh.__version__ != job["version"]:
        raise CommandError(f"it has Perfect BVH {perfect_bvh.__version__}, not {job['version']}")
    arguments = argparse.Namespace(**{name: _tuple(value) for name, value in job["arguments"].items()})
    scene = open_scene(Path(arguments.file), arguments)
    learn_checksums(job["checksums"])
    jobs: dict[str, Job] = {"scan": scan_work, "labels": labels_work, "bake": bake_work, "render": RenderWork}
    work = jobs[arguments.command](scene, stop, arguments)
    other = find_difference(job["inputs"], work.place.inputs)
    if other is not None:
        raise CommandError(f"its inputs differ in {other}")
    return work


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _take_streams() -> tuple[TextIO, TextIO]:
    """Standard input and output, for requests and answers alone: Blender's chatter goes nowhere."""
    requests = os.fdopen(os.dup(0), encoding="utf-8")
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    for descriptor, mode in ((0, os.O_RDONLY), (1, os.O_WRONLY)):
        silence = os.open(os.devnull, mode)
        os.dup2(silence, descriptor)
        os.close(silence)
    return requests, answers


def _leave(folder: str, status: int) -> NoReturn:
    """Ends this process with any running threads, for which Blender cannot clean up."""
    try:
        shutil.rmtree(folder, ignore_errors=True)
    finally:
        os._exit(status)


def _listen(requests: TextIO, inbox: queue.SimpleQueue[Request], stop: StopRequest, folder: str) -> None:
    try:
        for line in requests:
            request = json.loads(line)
            stop.is_set = "stop" in request
            if not stop.is_set:
                inbox.put(request)
    finally:  # who has asked is gone, in the middle of a line perhaps
        _leave(folder, EXIT_ALONE)


def main(folder: str) -> None:
    """Answers requests until there are no more. folder: for temporary files, also set in the environment."""
    from .blender import StopRequest

    requests, answers = _take_streams()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asks decides what Ctrl-C means
    inbox: queue.SimpleQueue[Request] = queue.SimpleQueue()
    stop = StopRequest()
    threading.Thread(target=_listen, args=(requests, inbox, stop, folder), daemon=True).start()
    bench = Workbench(stop)
    while True:
        try:
            request = inbox.get(timeout=IDLE_SECONDS)
        except queue.Empty:
            _leave(folder, 0)
        answers.write(json.dumps(bench.answer(request)) + "\n")
        answers.flush()


if __name__ == "__main__":
    main(sys.argv[1])
