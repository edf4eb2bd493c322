"""Assigns the chunks of a command's work to workers of Dask, and counts the outcomes.

The number of chunks in progress equals the number of workers, so that each goes to a free one. A chunk whose worker
dies is done again, elsewhere if there is another; after the third death it counts as failed, and the others continue.
A chunk that has begun leaves only whole files, even when it is interrupted, so `--resume` continues from there.
"""

from __future__ import annotations

import argparse
import queue
import secrets
import sys
from bisect import bisect_left, insort
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from ...pieces.piece import Piece
from ...pieces.work import Done, Outcome, PieceWork
from ..arguments import CommandError, explained
from ..report import Teller, progress_bar
from . import worker
from .cluster import POLL_SECONDS, check_workers, cluster_client

if TYPE_CHECKING:
    from distributed import Client, Future

    from ..blender import StopRequest

# The order of chunks: the longest by expectation are not left to the end, where others would wait for them.
#
# The time of a chunk is estimated from finished ones: per frame, between the nearest of them before and after.


NEAR_THE_END = 4  # chunks for each worker: before that, any order will do


class Costs:
    """The times of chunks. is_in_order: whether they must begin in the order of their frames."""

    def __init__(self, pieces: Sequence[Piece], is_in_order: bool) -> None:
        self._pieces = pieces
        self._is_in_order = is_in_order
        self._measured: list[tuple[int, float]] = []  # a chunk's number, seconds per frame; rising

    def add(self, number: int, seconds: float) -> None:
        """A chunk was made."""
        insort(self._measured, (number, seconds / len(self._pieces[number].frames)))

    def expected(self, number: int) -> float:
        """Seconds; as many as there are frames, as long as nothing is known."""
        return self._rate(number) * len(self._pieces[number].frames)

    def next_of(self, left: Collection[int], worker_count: int) -> int:
        """Returns the number of the next chunk, of those that are left, at least one."""
        if self._is_in_order or not self._measured or len(left) > NEAR_THE_END * worker_count:
            return min(left)
        return max(left, key=lambda number: (self.expected(number), -number))

    def _rate(self, number: int) -> float:
        if not self._measured:
            return 1.0
        at = bisect_left(self._measured, (number, 0.0))
        before, after = self._measured[max(at - 1, 0)], self._measured[min(at, len(self._measured) - 1)]
        if before[0] == after[0]:
            return before[1]
        share = min(max((number - before[0]) / (after[0] - before[0]), 0.0), 1.0)
        return before[1] + share * (after[1] - before[1])


# Run -----------------------------------------------------------------------------------------------------------------


MOST_DEATHS = 3


def do_pieces_on_farm(work: PieceWork, stop: StopRequest, arguments: argparse.Namespace, out: TextIO) -> Outcome:
    """Does all missing chunks; returns the outcome. Errors: CommandError."""
    outcome = Outcome()
    left = {number for number, piece in enumerate(work.pieces) if not work.place.is_done(piece)}
    outcome.kept = len(work.pieces) - len(left)
    if not left:
        return outcome
    with cluster_client(arguments) as client:
        threads = check_workers(client, work, stop, arguments)
        if not arguments.quiet:
            count = len(client.nthreads())
            out.write(f"{len(left)} chunks, {count} workers, {threads} threads each\n")
            out.flush()
        _Farm(client, work, stop, _job_of(work, arguments, threads), outcome).run(left, arguments.quiet)
    with explained():
        work.place.clear(work.pieces, *work.joined)
    return outcome


def _job_of(work: PieceWork, arguments: argparse.Namespace, threads: int) -> dict[str, Any]:
    """Returns all data that a worker needs, as plain values."""
    import perfect_bvh

    from ...pieces.piece import known_checksums

    return {
        "id": secrets.token_hex(8),
        "version": perfect_bvh.__version__,
        "arguments": {**vars(arguments), "threads": threads},
        "inputs": work.place.inputs,
        "checksums": known_checksums(),
    }


class _Farm:
    """One run. job: all that a worker has to know."""

    def __init__(
        self, client: Client, work: PieceWork, stop: StopRequest, job: dict[str, Any], outcome: Outcome
    ) -> None:
        self._client = client
        self._work = work
        self._stop = stop
        self._job = job
        self._outcome = outcome
        self._left: set[int] = set()  # the numbers of the unfinished chunks
        self._costs = Costs(work.pieces, is_in_order=work.is_simulated)
        self._running: dict[Future, int] = {}
        self._ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._deaths: dict[int, list[tuple[str, str]]] = {}  # of a chunk: the worker's address, and the reason
        self._teller = Teller()
        self._is_stopping = self._is_alone = False

    def run(self, left: set[int], is_quiet: bool) -> None:
        """Makes the chunks of these numbers, until none is left, or it is stopped."""
        self._left = left
        with progress_bar("chunk", len(self._work.pieces), is_quiet) as bar:
            bar.update(self._outcome.kept)
            try:
                while self._running or (self._left and not self._stop.is_set):
                    self._hand_out()
                    future = self._wait()
                    if future is not None and self._take(self._running.pop(future), future):
                        bar.update()
            finally:
                self._end_blenders()
        self._outcome.is_stopped = self._stop.is_set and bool(self._left)

    def _hand_out(self) -> None:
        if self._stop.is_set:
            if not self._is_stopping:
                self._is_stopping = True
                self._ask(lambda: self._client.run(worker.stop_pieces, self._job["id"], on_error="return"))
            return
        addresses = list(self._ask(self._client.nthreads))
        if not addresses and not self._is_alone:
            self._teller.say("no workers are left; waiting for one")
        self._is_alone = not addresses
        while self._left and len(self._running) < len(addresses):
            number = self._costs.next_of(self._left, len(addresses))
            self._left.discard(number)
            self._submit(number, addresses)

    def _submit(self, number: int, addresses: list[str]) -> None:
        deaths = self._deaths.get(number, [])
        others = [address for address in addresses if address not in {where for where, _ in deaths}]
        elsewhere = {"workers": others, "allow_other_workers": True} if deaths and others else {}
        key = f"perfect-bvh-{self._job['id']}-{number}-{len(deaths)}"
        future = self._client.submit(worker.do_piece, self._job, number, key=key, pure=False, **elsewhere)
        self._running[future] = number
        future.add_done_callback(self._ended.put)

    def _wait(self) -> Future | None:
        """One that has ended, or None after a while."""
        try:
            future = self._ended.get(timeout=POLL_SECONDS)
        except queue.Empty:
            if self._client.status != "running":
                raise self._scheduler_is_gone() from None
            return None
        return future if future in self._running else None

    def _take(self, number: int, future: Future) -> bool:
        """Counts the outcome of a chunk; returns whether it is settled."""
        from distributed.scheduler import KilledWorker

        if future.status == "cancelled":
            self._left.add(number)
            raise self._scheduler_is_gone()
        if future.status == "error":
            error = self._ask(future.exception)
            if not isinstance(error, KilledWorker):
                raise self._ends(f"a worker failed: {type(error).__name__}: {error}")
            reason = "the Dask worker died"
            return self._bury(number, error.last_worker.address, reason, error.allowed_failures + 1)
        answer = self._ask(future.result)
        if "done" in answer:
            if answer["seconds"] is not None:
                self._costs.add(number, answer["seconds"])
            done = Done(answer["done"], tuple(answer["warnings"]))
            self._outcome.add(done)
            self._teller.tell(done.warnings)
            return True
        return self._take_fault(number, answer)

    def _take_fault(self, number: int, answer: dict[str, Any]) -> bool:
        host = answer["host"]
        if "died" in answer:
            return self._bury(number, answer["worker"], f"on {host} {answer['died']}")
        self._left.add(number)
        if "stopped" in answer:
            return False
        if "refused" in answer:
            raise self._ends(f"a worker on {host} cannot take part: {answer['refused']}")
        if answer["is_of_files"]:
            raise self._ends(f"on {host}: {answer['fault']}")
        self._left.discard(number)
        self._outcome.failed.append((self._work.pieces[number], answer["fault"]))
        return True

    def _bury(self, number: int, where: str, reason: str, count: int = 1) -> bool:
        """Handles the death of a worker during a chunk."""
        if self._is_stopping:
            self._left.add(number)
            return False
        deaths = self._deaths.setdefault(number, [])
        deaths += [(where, reason)] * count
        piece = self._work.pieces[number]
        if len(deaths) < MOST_DEATHS:
            self._left.add(number)
            self._teller.say(f"{piece}: a worker died ({reason}); trying again")
            return False
        self._outcome.failed.append((piece, f"{len(deaths)} workers died on it; the last reason: {reason}"))
        return True

    def _ask(self, call: Callable[[], Any]) -> Any:
        """Returns the scheduler's answer. Errors: CommandError."""
        from distributed import CancelledError

        try:
            return call()
        except (OSError, RuntimeError, CancelledError) as error:
            raise self._scheduler_is_gone() from error

    def _scheduler_is_gone(self) -> CommandError:
        return self._ends("the connection to the scheduler is lost")

    def _ends(self, reason: str) -> CommandError:
        return CommandError(
            f"{reason}; {self._outcome.there} of {len(self._work.pieces)} chunks are complete; continue with --resume"
        )

    def _end_blenders(self) -> None:
        """Ends all Blenders of this run, after success or failure."""
        if self._client.status != "running":
            return
        try:
            self._ask(lambda: self._client.run(worker.end_blenders, self._job["id"], on_error="return"))
        except CommandError:
            sys.stderr.write("perfect-bvh: cannot reach the workers; they will stop by themselves\n")
