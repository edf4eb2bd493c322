"""A growing image is shown at once, and then at intervals that leave Blender's main thread free."""

from __future__ import annotations

import pytest
from perfect_bvh_addon.image.progressive import SHOW_SECONDS, Throttle


def test_the_first_is_shown_at_once_and_others_at_intervals() -> None:
    now, shown = [0.0], []
    throttle = Throttle(lambda image: shown.append((now[0], image)), clock=lambda: now[0])
    for number in range(100):
        now[0] = number * SHOW_SECONDS / 4
        throttle(number)
    assert shown == [(number * SHOW_SECONDS / 4, number) for number in range(0, 100, 4)]


def test_a_slow_display_leaves_time_for_the_rest() -> None:
    now, shown = [0.0], []

    def show(image: int) -> None:
        shown.append(image)
        now[0] += 10 * SHOW_SECONDS

    throttle = Throttle(show, clock=lambda: now[0])
    throttle(1)
    throttle(2)
    now[0] += SHOW_SECONDS
    throttle(3)
    assert shown == [1, 3]


def test_an_error_while_showing_is_not_hidden() -> None:
    def show(_: int) -> None:
        raise ReferenceError("the result is gone")

    with pytest.raises(ReferenceError):
        Throttle(show)(1)
