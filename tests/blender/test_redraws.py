"""How often viewports are redrawn while their images are traced, measured with the test's own clock."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon.view3d.rendered import redraws  # noqa: E402
from perfect_bvh_addon.view3d.rendered.redraws import LONGEST_PAUSE, SHARE, RedrawBudget  # noqa: E402


@pytest.mark.parametrize("cost", [0.002, 0.05, 0.3])
def test_redraws_take_no_more_than_their_share(cost: float) -> None:
    budget = RedrawBudget()
    now = drawing = 0.0
    count = 0
    while now < 60.0:
        if budget.allows(now):
            budget.begin(now)
            now += cost
            drawing += cost
            count += 1
            budget.end(now)
        now += 0.001
    assert drawing <= SHARE * now + cost
    assert count > 0.9 * SHARE * 60.0 / (cost + 0.001 * SHARE) - 1


def test_a_redraw_that_took_very_long_delays_the_next_by_no_more_than_seconds() -> None:
    budget = RedrawBudget()
    budget.begin(0.0)
    assert not budget.allows(5.0), "it is not over"
    budget.end(5.0)
    assert not budget.allows(5.0 + 0.9 * LONGEST_PAUSE)
    assert budget.allows(5.0 + LONGEST_PAUSE)


class Working:
    """Stands in for a viewport. stops: the number of calls of `stop`."""

    def __init__(self, pointer: int) -> None:
        self.region_pointer = pointer
        self.is_working = self.has_news = True
        self.has_ended = self.is_denoised = False
        self.asked_at = float("-inf")
        self.stops = 0

    def stop(self) -> None:
        self.stops += 1


class Screen:
    """Stands in for Blender's windows: two regions. tagged: the regions that were tagged for redrawing, in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.tagged: list[int] = []
        self.now = 0.0
        self.screen = SimpleNamespace(is_animation_playing=False, areas=[self._area(1), self._area(2)])
        windows = [SimpleNamespace(screen=self.screen)]
        context = SimpleNamespace(window_manager=SimpleNamespace(windows=windows))
        monkeypatch.setattr(redraws, "bpy", SimpleNamespace(context=context, app=bpy.app))
        monkeypatch.setattr(redraws, "budget", RedrawBudget())
        monkeypatch.setattr(redraws.time, "perf_counter", lambda: self.now)

    def _area(self, pointer: int) -> Any:
        region = SimpleNamespace(as_pointer=lambda: pointer, tag_redraw=lambda: self.tagged.append(pointer))
        return SimpleNamespace(type="VIEW_3D", regions=[region])

    def tick(self, now: float) -> float | None:
        self.now = now
        return redraws._tick()


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> Any:
    made = Screen(monkeypatch)
    yield made
    redraws._viewports.clear()


def draw(*viewports: Working) -> None:
    for viewport in viewports:
        viewport.asked_at = float("-inf")


def test_only_those_with_news_are_drawn_and_all_of_them_at_once(screen: Screen) -> None:
    first, second = Working(1), Working(2)
    for viewport in (first, second):
        redraws.watch(viewport)  # type: ignore[arg-type]
    second.has_news = False
    assert screen.tick(0.0) == 0.0
    assert screen.tagged == [1]
    draw(first)
    assert screen.tick(0.05) > 0.0  # it took 0.05 s, so the next comes after 0.45 s
    second.has_news = True
    screen.tick(0.45)
    assert screen.tagged == [1]
    screen.tick(0.51)
    assert sorted(screen.tagged[1:]) == [1, 2]


@pytest.mark.parametrize("why", ["has_ended", "is_denoised"])
def test_what_has_ended_or_lost_its_noise_is_shown_at_once(screen: Screen, why: str) -> None:
    viewport = Working(1)
    redraws.watch(viewport)  # type: ignore[arg-type]
    screen.tick(0.0)
    draw(viewport)
    screen.tick(0.1)
    assert screen.tagged == [1]
    setattr(viewport, why, True)
    screen.tick(0.12)
    assert screen.tagged == [1, 1]


def test_what_has_lost_its_noise_is_drawn_once(screen: Screen) -> None:
    viewport = Working(1)
    redraws.watch(viewport)  # type: ignore[arg-type]
    viewport.is_denoised = True
    screen.tick(0.0)
    draw(viewport)
    viewport.has_news = False
    screen.tick(5.0)
    assert screen.tagged == [1]


def test_a_region_that_is_hidden_is_not_asked_for_all_the_time(screen: Screen) -> None:
    viewport = Working(1)
    redraws.watch(viewport)  # type: ignore[arg-type]
    for step in range(101):
        screen.tick(step * 0.02)
    assert len(screen.tagged) == 3


def test_playback_draws_by_itself_and_a_timer_without_work_ends(screen: Screen) -> None:
    viewport = Working(1)
    redraws.watch(viewport)  # type: ignore[arg-type]
    screen.screen.is_animation_playing = True
    assert screen.tick(0.0) == redraws.TICK_SECONDS
    assert screen.tagged == []
    viewport.is_working = False
    assert screen.tick(1.0) is None


@pytest.mark.parametrize(("what", "stops"), [("a step was undone", 1), ("the scene was evaluated again", 0)])
def test_what_is_undone_is_traced_no_further(screen: Screen, what: str, stops: int) -> None:
    viewport = Working(1)
    redraws.watch(viewport)  # type: ignore[arg-type]
    redraws._watcher.on_change(what)
    assert viewport.stops == stops
    redraws._watcher.on_file_change()
    assert viewport.stops == stops + 1
