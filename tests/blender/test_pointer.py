"""The position of the mouse: listeners are notified until it has left."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon.view3d import pointer  # noqa: E402


class Listener:
    def __init__(self, wants: bool = True) -> None:
        self.wants, self.heard, self.left = wants, [], 0

    def wants_pointer(self, context: Any) -> bool:
        return self.wants

    def on_pointer(self, context: Any, place: tuple[int, int]) -> None:
        self.heard.append(place)

    def on_pointer_left(self) -> None:
        self.left += 1


@pytest.fixture
def listeners(monkeypatch: pytest.MonkeyPatch) -> tuple[Listener, Listener]:
    found = Listener(), Listener(wants=False)
    monkeypatch.setattr(pointer, "listeners", list(found))
    monkeypatch.setattr(pointer, "_region", None)
    timers: set[Any] = set()
    fake = SimpleNamespace(is_registered=timers.__contains__, register=lambda call, first_interval: timers.add(call))
    monkeypatch.setattr(pointer, "bpy", SimpleNamespace(app=SimpleNamespace(timers=fake)))
    return found


def named(address: int) -> SimpleNamespace:
    return SimpleNamespace(as_pointer=lambda: address)


def test_those_who_listen_are_told_until_the_mouse_leaves(listeners: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    wanting, other = listeners
    context = SimpleNamespace(window=named(1), region=named(2))
    pointer._note(context, (3, 4))
    assert wanting.heard == [(3, 4)] and not other.heard
    assert pointer.bpy.app.timers.is_registered(pointer._look)
    monkeypatch.setattr(pointer, "_is_inside", lambda *asked: asked == (1, 2))
    assert pointer._look() == pointer.LOOKING_SECONDS and not wanting.left
    monkeypatch.setattr(pointer, "_is_inside", lambda *_: False)
    assert pointer._look() is None and wanting.left == 1


def test_nobody_looks_for_a_mouse_that_nobody_wants(listeners: Any) -> None:
    listeners[0].wants = False
    pointer._note(SimpleNamespace(window=named(1), region=named(2)), (3, 4))
    assert not pointer.bpy.app.timers.is_registered(pointer._look)


def test_a_gizmo_is_never_under_the_mouse(listeners: Any) -> None:
    context = SimpleNamespace(window=named(1), region=named(2))
    assert pointer.PERFECT_BVH_GT_pointer.test_select(None, context, (7.0, 8.0)) == -1
    assert listeners[0].heard == [(7, 8)]


def test_what_lies_over_a_region_is_not_in_it() -> None:
    def region(kind: str, x: int, y: int, width: int, height: int) -> SimpleNamespace:
        return SimpleNamespace(type=kind, x=x, y=y, width=width, height=height)

    window, sidebar = region("WINDOW", 0, 0, 800, 600), region("UI", 600, 0, 200, 570)
    area = SimpleNamespace(regions=[window, region("HEADER", 0, 570, 800, 30), sidebar])
    assert pointer._is_over(window, area, (10, 10))
    assert not pointer._is_over(window, area, (700, 10))
    assert not pointer._is_over(window, area, (10, 700))
    sidebar.width = 1
    assert pointer._is_over(window, area, (700, 10))
