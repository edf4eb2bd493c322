"""Images of viewports: the part within a border, and the viewports that need separate trees."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.view3d.rendered.redraws import TYPE_FILTERS, filter_of  # noqa: E402
from perfect_bvh_addon.view3d.rendered.screen import WHOLE, border_of, camera_of  # noqa: E402


@pytest.fixture
def camera(scene: Any) -> Any:
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(made)
    scene.camera = made
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.5
    scene.render.border_min_y, scene.render.border_max_y = 0.0, 0.75
    return made


def region_view(camera: Any, width: int, height: int, zoom: float = 1.0) -> SimpleNamespace:
    """A view through `camera` from a region of this shape, with everything zoomed about the middle."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    matrix = np.array(camera.calc_matrix_camera(depsgraph, x=width, y=height))
    matrix[:2] *= zoom
    return SimpleNamespace(view_perspective="CAMERA", window_matrix=matrix)


def space(camera: Any = None, **settings: Any) -> SimpleNamespace:
    defaults = {"camera": camera, "local_view": None, "use_local_collections": False, "use_render_border": False}
    return SimpleNamespace(**defaults | dict.fromkeys(TYPE_FILTERS, True) | settings)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_camera_border_lies_within_the_cameras_frame(scene: Any, camera: Any, kind: str) -> None:
    camera.data.type = kind
    view = region_view(camera, scene.render.resolution_x, scene.render.resolution_y)
    np.testing.assert_allclose(border_of(view, space(camera), scene), (0.25, 0.5, 0.0, 0.75), atol=1e-6)
    zoomed = region_view(camera, scene.render.resolution_x, scene.render.resolution_y, zoom=0.5)
    np.testing.assert_allclose(border_of(zoomed, space(camera), scene), (0.375, 0.5, 0.25, 0.625), atol=1e-6)
    near = region_view(camera, scene.render.resolution_x, scene.render.resolution_y, zoom=4.0)
    np.testing.assert_allclose(border_of(near, space(camera), scene), (0.0, 0.5, 0.0, 1.0), atol=1e-6)


def test_a_panorama_fills_its_cameras_frame_and_no_more(scene: Any, camera: Any) -> None:
    camera.data.type = "PANO"
    settings = panorama_settings(camera.data)
    settings.panorama_type = "EQUIRECTANGULAR"
    settings.longitude_min, settings.longitude_max, settings.latitude_min, settings.latitude_max = -1.0, 2.0, -0.5, 1.0
    depsgraph = bpy.context.evaluated_depsgraph_get()
    zoomed = region_view(camera, scene.render.resolution_x, scene.render.resolution_y, zoom=0.5)  # 0.25 to 0.75
    scene.render.use_border = False
    whole, complaint = camera_of(zoomed, space(camera), depsgraph)
    assert complaint is None
    assert whole.projection == "equirectangular"
    assert whole.border == pytest.approx((0.25, 0.75, 0.25, 0.75), abs=1e-6)
    assert whole.window == pytest.approx((-2.5, 3.5, -1.25, 1.75), abs=1e-5)
    scene.render.use_border = True
    assert camera_of(zoomed, space(camera), depsgraph)[0].border == pytest.approx((0.375, 0.5, 0.25, 0.625), abs=1e-6)


def test_a_panorama_of_another_kind_is_shown_in_perspective_and_said_to_be(scene: Any, camera: Any) -> None:
    camera.data.type = "PANO"
    panorama_settings(camera.data).panorama_type = "MIRRORBALL"
    scene.render.use_border = False
    depsgraph = bpy.context.evaluated_depsgraph_get()
    camera.data.type = "PERSP"  # Blender draws a panorama in perspective
    view = region_view(camera, scene.render.resolution_x, scene.render.resolution_y)
    camera.data.type = "PANO"
    depsgraph.update()
    view.view_matrix = np.eye(4)
    record, complaint = camera_of(view, space(camera), depsgraph)
    assert record.projection == "perspective"
    assert complaint.startswith("Camera 'Camera' cannot be a Mirrorball panorama")
    assert complaint.endswith("choose Equirectangular as its Panorama Type. The view is shown in perspective")


def test_without_a_border_all_is_traced(scene: Any, camera: Any) -> None:
    scene.render.use_border = False
    assert border_of(region_view(camera, 32, 18), space(camera), scene) == WHOLE


def test_a_free_view_has_a_border_of_its_own(scene: Any, camera: Any) -> None:
    view = SimpleNamespace(view_perspective="PERSP")
    assert border_of(view, space(camera), scene) == WHOLE
    edges = {"render_border_min_x": 0.1, "render_border_max_x": 0.6}
    edges |= {"render_border_min_y": 0.2, "render_border_max_y": 0.9}
    bordered = space(camera, use_render_border=True, **edges)
    assert border_of(view, bordered, scene) == (0.1, 0.6, 0.2, 0.9)


def test_views_that_hide_objects_are_told_apart() -> None:
    assert not any(filter_of(space()))
    assert any(filter_of(space(local_view=object())))
    assert any(filter_of(space(use_local_collections=True)))
    assert any(filter_of(space(show_object_viewport_curve=False)))
