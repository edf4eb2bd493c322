"""Commits on a separate thread: they report progress, stop when asked, and pass on results and errors."""

from __future__ import annotations

import _thread
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from engine.long_work import large_mesh
from perfect_bvh_addon.support.background_work import BackgroundWork

Advance = Callable[[float], bool]


def work_until_stopped(advance: Advance) -> int:
    for step in range(50_000):
        if not advance(step / 50_000):
            raise perfect_bvh.Cancelled("stopped")
        time.sleep(0.002)
    pytest.fail("the work was not stopped")


def test_it_works_on_another_thread_and_finishes_on_the_callers() -> None:
    threads = []

    def commit(advance: Advance) -> str:
        threads.append(threading.current_thread())
        assert advance(0.5)
        return "trees"

    def finish(committed: str) -> str:
        threads.append(threading.current_thread())
        return f"report on {committed}"

    made = BackgroundWork(commit, finish)
    assert made.wait(60.0)
    assert len(threads) == 1, "nothing asked it to finish"
    assert made.result() == made.result() == "report on trees"
    assert made.share == 0.5
    assert not made.is_running
    assert threads[0] is not threads[1] is threading.current_thread()
    assert len(threads) == 2


def test_it_stops_when_asked_and_is_not_finished() -> None:
    finished: list[object] = []
    made = BackgroundWork(work_until_stopped, finished.append)
    assert not made.wait(0.01)
    assert made.is_running
    made.stop()
    assert not made.is_running
    with pytest.raises(perfect_bvh.Cancelled, match="stopped"):
        made.result()
    assert not finished


def test_one_that_is_too_far_to_be_stopped_counts_as_done() -> None:
    may_end = threading.Event()
    finished: list[str] = []
    made = BackgroundWork(lambda _: "trees" if may_end.wait(60.0) else "", finished.append)
    made.ask_to_stop()
    may_end.set()
    made.stop()
    assert finished == ["trees"]
    assert made.result() is None


@pytest.mark.parametrize("problem", [perfect_bvh.EngineError("no"), MemoryError(), KeyboardInterrupt()])
def test_what_the_commit_raises_reaches_the_caller_that_asks_for_the_result(problem: BaseException) -> None:
    def commit(advance: Advance) -> None:
        raise problem

    made = BackgroundWork(commit, pytest.fail)
    made.settle()
    with pytest.raises(type(problem)) as caught:
        made.result()
    assert caught.value is problem


def test_without_a_thread_to_spare_it_is_done_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    made = BackgroundWork(lambda advance: advance(1.0), lambda committed: committed)
    assert not made.is_running
    assert made.result() is True


@pytest.mark.usefixtures("hears_ctrl_c")
def test_ctrl_c_ends_the_waiting_where_it_does_not_interrupt_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: Python receives the signal, but a thread that waits for a lock goes on waiting."""
    made = BackgroundWork(work_until_stopped, pytest.fail)
    is_waited_for, wait = threading.Event(), made._has_ended.wait

    def tell_and_wait(seconds: float) -> bool:
        is_waited_for.set()
        return wait(seconds)

    def press() -> None:
        if is_waited_for.wait(60.0):
            _thread.interrupt_main()

    monkeypatch.setattr(made._has_ended, "wait", tell_and_wait)
    threading.Thread(target=press).start()
    with pytest.raises(KeyboardInterrupt):
        made.result()
    assert not made.is_running and not made.is_wanted


@pytest.mark.usefixtures("hears_ctrl_c", "one_thread")
def test_ctrl_c_ends_a_call_of_the_engine() -> None:
    """On the calling thread, where alone Python handles signals; `interrupt_main` replaces the system's signal."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*large_mesh()))
    asked = []

    def interrupt(share: float) -> None:
        asked.append(share)
        _thread.interrupt_main()

    with pytest.raises(KeyboardInterrupt):
        scene.commit(progress=interrupt)
    assert len(asked) == 1
    scene.commit()


def test_a_process_that_ends_stops_what_is_at_work() -> None:
    script = """
import numpy as np, perfect_bvh
from perfect_bvh_addon.support.background_work import BackgroundWork
scene = perfect_bvh.Scene()
corners = np.random.default_rng(0).normal(size=(300_000, 3)).astype(np.float32)
scene.add_instance(scene.add_mesh(corners, np.arange(len(corners)).reshape(-1, 3)))

def build_on_and_on(progress):
    while progress(0.0):  # however quick this machine is
        scene.replace_mesh(0, corners, np.arange(len(corners)).reshape(-1, 3))
        scene.commit(progress=progress)

made = BackgroundWork(build_on_and_on, print)
print("at work", made.is_running, flush=True)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (0, "at work True\n", "")


@pytest.mark.usefixtures("one_thread")
def test_the_engine_answers_as_if_nothing_had_been_stopped() -> None:
    random, mesh = np.random.default_rng(4), large_mesh()
    rays: Any = (random.normal(size=(2000, 3)), random.normal(size=(2000, 3)))

    def make() -> perfect_bvh.Scene:
        scene = perfect_bvh.Scene()
        scene.add_instance(scene.add_mesh(*mesh))
        return scene

    expected = make()
    expected.commit()
    scene = make()
    is_under_way = threading.Event()

    def commit(advance: Advance) -> perfect_bvh.CommitReport:
        def wait_for_the_stop(share: float) -> bool:
            is_under_way.set()
            while advance(share):
                time.sleep(0.002)
            return False

        return scene.commit(progress=wait_for_the_stop)

    stopped = BackgroundWork(commit, lambda report: report)
    assert is_under_way.wait(60.0)
    stopped.stop()
    with pytest.raises(perfect_bvh.Cancelled):
        stopped.result()
    with pytest.raises(perfect_bvh.StaleSceneError):
        scene.snapshot()
    BackgroundWork(lambda progress: scene.commit(progress=progress), lambda report: report).result()
    hits, wanted = scene.cast_rays(*rays), expected.cast_rays(*rays)
    for name in ("t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs"):
        np.testing.assert_array_equal(getattr(hits, name), getattr(wanted, name))
