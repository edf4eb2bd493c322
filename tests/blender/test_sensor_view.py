"""The scan's sensor in a viewport: its position after *Add Sensor*, and the lines and the range that are drawn."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Euler  # noqa: E402
from perfect_bvh_addon.settings.scan_choices import sensor_items  # noqa: E402
from perfect_bvh_addon.view3d import sensor_view  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene", "registered")


def test_a_sensor_is_added_at_the_3d_cursor(scene) -> None:
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    scene.cursor.location, scene.cursor.rotation_euler = (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)
    assert bpy.ops.perfect_bvh.add_sensor() == {"FINISHED"}
    sensor = scene.perfect_bvh.scan.sensor
    bpy.context.view_layer.update()
    expected = Euler((0.1, 0.2, 0.3)).to_matrix().to_4x4()
    expected.translation = (1.0, 2.0, 3.0)
    np.testing.assert_allclose(np.array(sensor.matrix_world), np.array(expected), atol=1e-6)
    assert bpy.context.object == sensor and bpy.context.selected_objects == [sensor]
    assert not cube.select_get()


def test_a_head_that_turns_is_drawn_by_its_lines(scene) -> None:
    settings = scene.perfect_bvh.scan
    settings.pattern, settings.elevations, settings.max_distance = "LIDAR", "-30, 0, 10", 20.0
    outline = sensor_view.outline_of(settings)
    assert len(outline.ends) == 3 * sensor_view.TURN and len(outline.rays) == 2 * 3
    np.testing.assert_allclose(np.linalg.norm(outline.ends, axis=1), 20.0, rtol=1e-5)
    np.testing.assert_array_equal(outline.rays[::2], 0.0)
    ahead = outline.rays[1::2]
    assert np.degrees(np.arcsin(ahead[:, 2] / 20.0)) == pytest.approx([-30.0, 0.0, 10.0], abs=1e-3)
    aside = math.radians(360.0 / sensor_view.TURN)
    assert (ahead[:, 1] > 0.0).all() and (np.abs(np.arctan2(ahead[:, 0], ahead[:, 1])) < aside).all()


@pytest.mark.parametrize("name", [item[0] for item in sensor_items()])
def test_each_known_sensor_is_drawn(scene, name: str) -> None:
    scene.perfect_bvh.scan.pattern = name
    outline = sensor_view.outline_of(scene.perfect_bvh.scan)
    assert 16 < len(outline.ends) <= sensor_view.MOST_ENDS and 2 < len(outline.rays) <= 2 * sensor_view.MOST_RAYS
    assert np.isfinite(outline.ends).all() and np.isfinite(outline.rays).all()
    assert outline.ends[:, 1].max() > 1.0, "it looks along +Y"


def test_it_is_drawn_while_it_is_selected_and_seen(scene) -> None:
    settings, areas = scene.perfect_bvh.scan, bpy.data.screens["Layout"].areas
    space = next(area.spaces.active for area in areas if area.type == "VIEW_3D")
    context = SimpleNamespace(scene=scene, view_layer=bpy.context.view_layer, space_data=space)
    assert sensor_view.shown_sensor(context) is None, "there is none"
    bpy.ops.perfect_bvh.add_sensor()
    sensor = settings.sensor
    bpy.context.view_layer.update()
    assert sensor_view.shown_sensor(context) is None, "Blender draws cameras"
    settings.pattern = "LIDAR"
    assert sensor_view.shown_sensor(context) == sensor
    for owner, name, value in ((sensor, "hide_viewport", True), (space.overlay, "show_overlays", False)):
        before = getattr(owner, name)
        setattr(owner, name, value)
        bpy.context.view_layer.update()
        assert sensor_view.shown_sensor(context) is None, name
        setattr(owner, name, before)
    bpy.context.view_layer.update()
    sensor.select_set(False)
    assert sensor_view.shown_sensor(context) is None
