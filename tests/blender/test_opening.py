"""Opening a file: viewports are Rendered where a screen asks for it, and no other setting changes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

bpy: Any = pytest.importorskip("bpy")

from perfect_bvh_addon.view3d.rendered.opening import show_rendered  # noqa: E402

FILMS = ("tree_in_wind", "gears", "crowd", "cloth", "ocean", "meadow")
SCENES = ("courtyard", "town", *FILMS, "zoo/twist", "zoo/few_triangles")

pytestmark = pytest.mark.usefixtures("registered")


def viewports(screen: Any) -> list[Any]:
    return [area.spaces.active for area in screen.areas if area.type == "VIEW_3D"]


def shadings() -> dict[str, set[str]]:
    """Return the shadings of the 3D viewports of each screen."""
    return {screen.name: {space.shading.type for space in viewports(screen)} for screen in bpy.data.screens}


@pytest.mark.parametrize("name", SCENES)
def test_an_example_opens_rendered_through_its_camera(name: str, blend_file: Callable[[str], Path]) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(blend_file(name)))
    window = bpy.context.window_manager.windows[0]
    assert window.workspace.name == window.screen.name == "Layout"
    assert bpy.context.scene.render.engine == "PERFECT_BVH"
    show_rendered(bpy.context.scene)
    (space,) = viewports(window.screen)
    assert (space.shading.type, space.region_3d.view_perspective) == ("RENDERED", "CAMERA")
    (properties,) = [area.spaces.active for area in window.screen.areas if area.type == "PROPERTIES"]
    assert properties.context == "RENDER"
    assert all("RENDERED" not in found for screen, found in shadings().items() if screen != "Layout")


def test_a_screen_that_asks_for_it_keeps_that_in_the_file(scene: Any, tmp_path: Path) -> None:
    scene.render.engine = "PERFECT_BVH"
    bpy.data.screens["Layout"].perfect_bvh_open_rendered = True
    path = str(tmp_path / "asks.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings()
    assert not bpy.data.screens["Layout"].perfect_bvh_open_rendered
    bpy.ops.wm.open_mainfile(filepath=path)
    show_rendered(bpy.context.scene)
    assert shadings()["Layout"] == {"RENDERED"}
    assert shadings()["Modeling"] == {"SOLID"}


def test_screens_of_the_user_stay_as_they_are_when_a_file_comes_without_its_own(
    blend_file: Callable[[str], Path],
) -> None:
    bpy.ops.wm.read_factory_settings()
    bpy.ops.wm.open_mainfile(filepath=str(blend_file("gears")), load_ui=False)
    show_rendered(bpy.context.scene)
    assert bpy.context.scene.render.engine == "PERFECT_BVH"
    assert "RENDERED" not in set().union(*shadings().values())


def test_another_engine_is_not_started(scene: Any) -> None:
    bpy.data.screens["Layout"].perfect_bvh_open_rendered = True
    scene.render.engine = "CYCLES"
    show_rendered(scene)
    assert "RENDERED" not in set().union(*shadings().values())
