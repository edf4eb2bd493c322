"""Failures between the halves of an update: it ends in right answers or in a refusal, and never hangs."""

from __future__ import annotations

import sys
import threading

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from blender.long_builds import PATIENCE, Gate  # noqa: E402
from blender.syncing import assert_stale, cast_down, depsgraph, height, move  # noqa: E402
from forks import needs_fork, run_in_child  # noqa: E402
from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.events import changes  # noqa: E402
from perfect_bvh_addon.live.pending_commit import PendingCommit  # noqa: E402
from perfect_bvh_addon.support import background_work  # noqa: E402
from perfect_bvh_addon.support.background_work import BackgroundWork  # noqa: E402
from perfect_bvh_addon.sync.scene_difference import AppliedDifference  # noqa: E402

FAILED = "the last update did not succeed: call update"


def fail_in_reports(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise MemoryError("no room for the report")

    monkeypatch.setattr(AppliedDifference, "report", fail)


@pytest.mark.parametrize("in_halves", [True, False])
def test_unreported_trees_are_reported_by_the_next(box, sync: SceneSync, monkeypatch, in_halves) -> None:
    """Otherwise an old image would be kept, because images depend on the revision."""
    sync.update(depsgraph())
    move(box, 2.0)
    with monkeypatch.context() as patched:
        fail_in_reports(patched)
        building = sync.begin_update(depsgraph()) if in_halves else None
        for _ in range(2):
            with pytest.raises(MemoryError, match="no room for the report"):
                building.result() if building is not None else sync.update(depsgraph())
        assert sync.building is None
    assert_stale(sync, FAILED)
    report = sync.begin_update(depsgraph()).result()
    assert report.finishes_earlier_update and report.has_changes
    assert (sync.revision, height(sync)) == (2, 3.0)


def test_an_unseen_failure_of_a_report_stops_no_later_update(box, sync: SceneSync, monkeypatch) -> None:
    with monkeypatch.context() as patched:
        fail_in_reports(patched)
        building = sync.begin_update(depsgraph())
        building.settle()
        assert sync.building is None
        with pytest.raises(MemoryError, match="no room for the report"):
            building.result()
    trees = PendingCommit()
    assert trees.begin(sync, lambda: sync.begin_update(depsgraph()), to_the_end=True).has_changes
    assert trees.are_there(lambda: pytest.fail("they are there"))
    assert height(sync) == 1.0


def test_no_caller_joins_a_build_that_was_asked_to_stop(box, sync: SceneSync, gate: Gate) -> None:
    building = sync.begin_update(depsgraph())
    sync.ask_to_stop_building()
    other = sync.begin_update(depsgraph())
    assert other is not building
    gate.open()
    assert other.result().finishes_earlier_update
    assert height(sync) == 1.0


def test_hits_from_before_anybody_asked_for_the_result_can_be_looked_up(box, sync: SceneSync) -> None:
    building = sync.begin_update(depsgraph())
    assert building.wait(PATIENCE)
    hits = cast_down(sync)
    sync._get_lookup()  # asked too early: it knows of no commit
    building.result()
    assert sync.polygon_ids(hits)[0] >= 0
    assert sync.describe(hits.instance_ids).names.tolist() == ["Cube"]


def test_ctrl_c_while_a_thread_starts_leaves_nothing_running(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()

    def work(progress) -> None:
        while progress(0.5):
            pass
        ended.set()

    start = threading.Thread.start

    def interrupted(thread: threading.Thread) -> None:
        start(thread)
        raise KeyboardInterrupt

    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        BackgroundWork(work, lambda made: made)
    assert ended.wait(PATIENCE)


class Listener:
    def __init__(self) -> None:
        self.told: list[str] = []

    def on_change(self, what: str) -> None:
        self.told.append(what)

    def on_file_change(self) -> None:
        pass


def test_all_listeners_are_told_while_others_begin_to_listen(box) -> None:
    listeners = [Listener() for _ in range(20)]
    stop = threading.Event()

    def come_and_go() -> None:
        while not stop.is_set():
            passing = [Listener() for _ in range(50)]
            for listener in passing:
                changes.listen(listener)
            for listener in passing:
                changes.stop_listening(listener)

    for listener in listeners:
        changes.listen(listener)
    switches = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    thread = threading.Thread(target=come_and_go)
    thread.start()
    try:
        for number in range(3000):
            changes._announce(str(number))
    finally:
        stop.set()
        thread.join()
        sys.setswitchinterval(switches)
        for listener in listeners:
            changes.stop_listening(listener)
    assert all(listener.told == [str(number) for number in range(3000)] for listener in listeners)


# In a forked process -------------------------------------------------------------------------------------------------


@needs_fork
@pytest.mark.usefixtures("one_thread")
def test_a_forked_process_starts_over_where_a_build_was_under_way(box, sync: SceneSync, monkeypatch) -> None:
    """The engine holds its scene's lock during a commit; in the child process no thread can release it."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=700, y_subdivisions=700)  # large enough for progress reports
    in_engine, opened = threading.Event(), threading.Event()
    advance = BackgroundWork._advance

    def hold(work: BackgroundWork, share: float) -> bool:
        in_engine.set()
        opened.wait(60.0)
        return advance(work, share)

    monkeypatch.setattr(BackgroundWork, "_advance", hold)
    building = sync.begin_update(depsgraph())
    assert in_engine.wait(PATIENCE)
    graph = depsgraph()

    def go_on() -> bool:
        assert not background_work._running
        assert building.wait(0.0) and building.is_lost
        with pytest.raises(perfect_bvh.EngineError, match="the process was forked during the work"):
            building.result()
        opened.set()
        assert sync.begin_update(graph).result().added_count == 2
        return height(sync) == 1.0

    assert run_in_child(go_on) == 0
    opened.set()
    assert building.result().added_count == 2
    assert not building.is_lost
    assert height(sync) == 1.0


@needs_fork
def test_a_forked_process_keeps_what_was_built(box, sync: SceneSync) -> None:
    building = sync.begin_update(depsgraph())
    assert building.wait(PATIENCE)
    graph = depsgraph()

    def go_on() -> bool:
        return building.result().added_count == 1 and not sync.begin_update(graph).result().has_changes

    assert run_in_child(go_on) == 0
    assert building.result().added_count == 1
