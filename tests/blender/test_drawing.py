"""Drawing over viewports, where it needs no graphics card: the free room, and the shape of panels."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon.view3d import drawing  # noqa: E402


def region(kind: str, x: int, y: int, width: int, height: int) -> SimpleNamespace:
    return SimpleNamespace(type=kind, x=x, y=y, width=width, height=height)


def test_nothing_is_drawn_under_what_lies_over_a_viewport() -> None:
    window = region("WINDOW", 100, 50, 1000, 600)
    regions = [
        window,
        region("HEADER", 100, 620, 1000, 30),
        region("TOOL_HEADER", 100, 590, 1000, 30),
        region("TOOLS", 100, 50, 58, 540),
        region("UI", 900, 50, 200, 540),
        region("ASSET_SHELF", 100, 50, 1000, 1),  # hidden
    ]
    area = SimpleNamespace(regions=regions)
    assert drawing.free_rect(area, window) == drawing.Rect(58, 0, 800, 540)
    regions[4].width = 1
    assert drawing.free_rect(area, window).right == 1000
    regions[5].height = 80
    assert drawing.free_rect(area, window).bottom == 80


def test_each_of_four_views_has_its_own_room() -> None:
    lower_left, upper_right = region("WINDOW", 0, 0, 500, 300), region("WINDOW", 500, 300, 500, 300)
    tools = region("TOOLS", 0, 0, 60, 600)
    below = region("HEADER", 0, -30, 1000, 30)  # next to the views, over none of them
    area = SimpleNamespace(regions=[lower_left, upper_right, tools, below])
    assert drawing.free_rect(area, lower_left) == drawing.Rect(60, 0, 500, 300)
    assert drawing.free_rect(area, upper_right) == drawing.Rect(0, 0, 500, 300)


@pytest.mark.parametrize("radius", [0.0, 3.0, 100.0])
def test_round_corners_stay_within_the_rectangle(radius: float) -> None:
    points = drawing._rounded(10.0, 20.0, 40.0, 12.0, radius)
    xs, ys = zip(*points, strict=True)
    assert (min(xs), max(xs), min(ys), max(ys)) == pytest.approx((10.0, 50.0, 20.0, 32.0))
    following = zip(points, points[1:] + points[:1], strict=True)
    assert sum(a[0] * b[1] - b[0] * a[1] for a, b in following) > 0.0  # counter-clockwise
