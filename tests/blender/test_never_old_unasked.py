"""Queries where Blender must not evaluate: they neither evaluate nor crash, and answer from the known data."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import pytest
from blender.builders import SQUARE, in_render, mesh_data, mesh_object
from blender.syncing import height
from perfect_bvh import StaleSceneError
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.events import asking


@pytest.fixture
def square(scene: Any) -> Any:
    return mesh_object("a", mesh_data("a", *SQUARE))


@pytest.fixture
def watching(square: Any) -> Iterator[SceneSync]:
    """A sync of one square at height 0."""
    made = SceneSync()
    made.update(bpy.context.evaluated_depsgraph_get())
    yield made
    made.close()
    assert asking.may_ask()


@contextlib.contextmanager
def handler(name: str, function: Callable[..., object], first: bool = False) -> Iterator[None]:
    handlers = getattr(bpy.app.handlers, name)
    handlers.insert(0 if first else len(handlers), function)
    try:
        yield
    finally:
        handlers.remove(function)


@contextlib.contextmanager
def evaluations() -> Iterator[list[int]]:
    """Collect one entry for each evaluation inside the context."""
    seen: list[int] = []

    def count(*_: Any) -> None:
        seen.append(1)

    with handler("depsgraph_update_pre", count, first=True):
        yield seen


def height_or_stale(sync: SceneSync) -> float | str:
    try:
        return height(sync)
    except StaleSceneError:
        return "stale"


def test_another_thread_answers_from_what_was_evaluated(square: Any, watching: SceneSync) -> None:
    square.location.z = 2.0
    answers: list[float | str] = []
    with evaluations() as seen:
        asker = threading.Thread(target=lambda: answers.append(height_or_stale(watching)))
        asker.start()
        asker.join()
        assert (answers, seen) == ([0.0], [])
        assert height_or_stale(watching) == "stale"
        assert len(seen) == 1


def test_another_thread_notices_emptied_handlers(watching: SceneSync) -> None:
    bpy.app.handlers.depsgraph_update_post.clear()
    answers: list[float | str] = []
    asker = threading.Thread(target=lambda: answers.append(height_or_stale(watching)))
    asker.start()
    asker.join()
    assert answers == ["stale"]


@pytest.mark.parametrize("first", [True, False], ids=["before ours", "after ours"])
@pytest.mark.parametrize(
    "event", ["depsgraph_update_pre", "depsgraph_update_post", "frame_change_pre", "frame_change_post"]
)
def test_a_handler_that_asks_during_a_change_is_refused(
    square: Any, watching: SceneSync, event: str, first: bool
) -> None:
    answers: list[float | str] = []
    with handler(event, lambda *_: answers.append(height_or_stale(watching)), first), evaluations() as seen:
        square.location.z = 2.0
        if event.startswith("frame"):
            bpy.context.scene.frame_set(3)
        else:
            bpy.context.view_layer.update()
    assert answers and set(answers) == {"stale"}
    assert len(seen) <= 2  # one more if the handler runs before ours has noted the change


@pytest.mark.parametrize("event", ["depsgraph_update_post", "frame_change_post"])
def test_a_handler_that_updates_may_ask_and_never_evaluates_inside(
    square: Any, watching: SceneSync, event: str
) -> None:
    """An edit inside the handler waits: the query that follows it must not evaluate a second time."""
    answers: list[float | str] = []

    def follow(_scene: Any, depsgraph: Any) -> None:
        watching.update(depsgraph)
        answers.append(height_or_stale(watching))
        square.location.y += 0.01
        answers.append(height_or_stale(watching))

    with handler(event, follow), evaluations() as seen:
        square.location.z = 2.0
        if event.startswith("frame"):
            bpy.context.scene.frame_set(3)
        else:
            bpy.context.view_layer.update()
        assert answers == [2.0, 2.0]
        assert len(seen) == (0 if event.startswith("frame") else 1)


def test_a_driver_that_asks_is_refused(square: Any, watching: SceneSync) -> None:
    answers: list[float | str] = []

    def ask() -> float:
        answers.append(height_or_stale(watching))
        return 0.0

    bpy.app.driver_namespace["ask"] = ask
    square.driver_add("location", 0).driver.expression = "ask()"
    assert height_or_stale(watching) == "stale"
    watching.update(bpy.context.evaluated_depsgraph_get())
    answers.clear()
    square.location.z = 2.0
    bpy.context.view_layer.update()
    bpy.context.scene.frame_set(3)
    assert answers and set(answers) == {"stale"}


def test_a_driver_of_which_no_handler_told_is_refused_by_blender(square: Any, watching: SceneSync) -> None:
    answers: list[float | str] = []

    def ask() -> float:
        watching.scene.commit()
        asking.forget_all()
        answers.append(height_or_stale(watching))
        return 0.0

    bpy.app.driver_namespace["ask"] = ask
    square.driver_add("location", 0).driver.expression = "ask()"
    bpy.context.view_layer.update()
    assert answers and set(answers) == {"stale"}


def test_a_render_is_not_interrupted_by_an_evaluation(square: Any, watching: SceneSync) -> None:
    def ask(depsgraph: Any) -> tuple[float | str, int]:
        watching.update(depsgraph)
        square.location.z = 2.0
        with evaluations() as seen:
            return height_or_stale(watching), len(seen)

    assert in_render(ask) == (0.0, 0)
    assert height_or_stale(watching) == "stale"
    watching.update(bpy.context.evaluated_depsgraph_get())
    assert height(watching) == 2.0


def test_a_render_job_in_a_window_is_not_interrupted(
    square: Any, watching: SceneSync, monkeypatch: pytest.MonkeyPatch
) -> None:
    square.location.z = 2.0
    with monkeypatch.context() as patch, evaluations() as seen:
        patch.setattr(asking, "is_render_job_running", lambda: True)
        assert (height_or_stale(watching), seen) == (0.0, [])
    assert height_or_stale(watching) == "stale"


def test_a_query_while_an_add_on_registers_evaluates_nothing(
    square: Any, watching: SceneSync, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While an add-on registers, Blender replaces its context by another object."""
    restricted = pytest.importorskip("_bpy_restrict_state")._RestrictContext()
    square.location.z = 2.0
    with monkeypatch.context() as patch, evaluations() as seen:
        patch.setattr(bpy, "context", restricted)
        assert (height_or_stale(watching), seen) == (0.0, [])
    assert height_or_stale(watching) == "stale"
