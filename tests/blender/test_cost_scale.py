"""The scale of the mode "cost": its numbers match its colours, and the visits are those of the chosen pixel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

bpy = pytest.importorskip("bpy")

from perfect_bvh import Camera, cost_to_color  # noqa: E402
from perfect_bvh_addon.image.plan import trace_visits  # noqa: E402
from perfect_bvh_addon.view3d import cost_scale  # noqa: E402
from perfect_bvh_addon.view3d.rendered import redraws  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")

SIZE = (40, 30)
NAMES = ("nodes_visited", "primitives_tested")


def test_the_bar_has_the_modes_colours_at_its_numbers() -> None:
    section = cost_scale.section()
    places = np.linspace(0.0, 1.0, len(section.colors))
    for place, label in cost_scale.SCALE.labels:
        drawn = [np.interp(place, places, [color[channel] for color in section.colors]) for channel in range(3)]
        np.testing.assert_allclose(drawn, cost_scale.encoded(cost_to_color(int(label))), atol=1e-5)
    assert cost_scale.SCALE.labels[0] == (0.0, "2") and cost_scale.SCALE.labels[-1] == (1.0, "512")
    between = cost_scale.encoded(cost_to_color(2.0 ** np.linspace(1.0, 9.0, 100)))
    for channel in range(3):
        drawn = np.interp(np.linspace(0.0, 1.0, 100), places, [color[channel] for color in section.colors])
        np.testing.assert_allclose(drawn, between[:, channel], atol=0.03)


@pytest.mark.parametrize("border", [(0.0, 1.0, 0.0, 1.0), (0.25, 0.8, 0.1, 0.6)])
def test_visits_are_those_of_the_pixel(border: tuple[float, ...]) -> None:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.soup(3000, 1, 0.1)), np.eye(4))
    scene.commit()
    whole = Camera.look_at((0.5, -2.0, 1.0), (0.0, 0.0, 0.0), aspect=SIZE[0] / SIZE[1])
    camera = Camera(**{**{name: getattr(whole, name) for name in Camera.__slots__}, "border": border})
    passes = perfect_bvh.render_passes(scene, whole, mode="cost", size=SIZE, passes=NAMES)
    asked = [(column, row) for column in range(0, SIZE[0], 3) for row in range(0, SIZE[1], 4)]
    inside = 0
    for column, row in asked:
        found = trace_visits(scene, camera, SIZE, perfect_bvh.Appearance(), (column, row))
        x, y = (column + 0.5) / SIZE[0], (row + 0.5) / SIZE[1]
        if border[0] <= x < border[1] and border[2] <= y < border[3]:
            assert found == tuple(passes[name][SIZE[1] - 1 - row, column] for name in NAMES)
            inside += 1
        else:
            assert found is None
    assert inside > 20
    assert trace_visits(scene, whole, SIZE, perfect_bvh.Appearance(), (SIZE[0], 0)) is None


class Region:
    def as_pointer(self) -> int:
        return 77


def context_of(mode: str = "RENDER", **shading: Any) -> SimpleNamespace:
    """mode: the viewport's mode."""
    shown = SimpleNamespace(perfect_bvh=SimpleNamespace(mode=mode), **shading)
    space = SimpleNamespace(shading=shown, overlay=SimpleNamespace(show_overlays=True))
    view = SimpleNamespace(perspective_matrix=np.eye(4))
    scene = bpy.context.scene
    return SimpleNamespace(engine="PERFECT_BVH", scene=scene, space_data=space, region=Region(), region_data=view)


def test_what_is_under_the_mouse_is_told_where_costs_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    context, asked = context_of(type="RENDERED"), []
    assert cost_scale.sections(context) == []
    bpy.context.scene.perfect_bvh.mode = "COST"
    assert cost_scale.sections(context_of(type="SOLID")) == []
    assert len(cost_scale.sections(context)) == 1
    viewport = SimpleNamespace(visits_at=lambda place: asked.append(place) or (12, 1))
    monkeypatch.setattr(cost_scale, "viewport_at", lambda pointer: viewport if pointer == 77 else None)
    monkeypatch.setattr(Region, "tag_redraw", lambda self: None, raising=False)
    cost_scale._pointing.on_pointer(context, (3, 4))
    assert asked == [(3, 4)]
    assert cost_scale.tip(context) == ((3, 4), ["12 nodes visited", "1 primitive tested"])
    context.region_data.perspective_matrix = 2.0 * np.eye(4)
    assert cost_scale.tip(context) is None, "the view has moved since"
    cost_scale._pointing.on_pointer_left()
    context.region_data.perspective_matrix = np.eye(4)
    assert cost_scale.tip(context) is None


@pytest.mark.parametrize(
    ("of_scene", "of_viewport", "is_shown"),
    [
        ("PREVIEW", "COST", True),
        ("COST", "PREVIEW", False),
        ("COST", "RENDER", True),
        ("PREVIEW", "RENDER", False),
    ],
)
def test_the_scale_goes_by_the_mode_of_the_viewport(of_scene: str, of_viewport: str, is_shown: bool) -> None:
    bpy.context.scene.perfect_bvh.mode = of_scene
    assert cost_scale.is_shown(context_of(of_viewport, type="RENDERED")) == is_shown


def test_a_viewport_is_found_by_its_region(monkeypatch: pytest.MonkeyPatch) -> None:
    viewports = [SimpleNamespace(region_pointer=pointer) for pointer in (5, 6, 6)]
    monkeypatch.setattr(redraws, "_viewports", viewports)
    assert redraws.viewport_at(5) is viewports[0]
    assert redraws.viewport_at(7) is None
    assert redraws.viewport_at(6) is None, "one of the two was drawn before the other"
