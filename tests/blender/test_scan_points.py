"""A scan's points in Blender: their attributes and colours, where they are drawn, and that renders omit them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.scanned_room import LIDAR, lidar_rays, values_of  # noqa: E402
from perfect_bvh_addon import CameraGrid, SceneSync, label_image, scan  # noqa: E402
from perfect_bvh_addon.extract import label_values  # noqa: E402
from perfect_bvh_addon.scanning.point_data import ATTRIBUTES, may_have_points, read_points  # noqa: E402
from perfect_bvh_addon.view3d import scan_points  # noqa: E402
from perfect_bvh_addon.view3d.scan_points import shown_scans  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


def test_the_button_makes_an_object_with_attributes(room) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height = 32, 18
    before, meshes = (bpy.context.view_layer.objects.active, bpy.context.selected_objects), len(bpy.data.meshes)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    made = bpy.data.objects["Scan"]
    assert made.type == ("MESH" if bpy.app.version < (4, 4) else "POINTCLOUD")
    assert len(bpy.data.meshes) == meshes + (made.type == "MESH")
    assert bpy.context.view_layer.objects.active == before[0]
    assert bpy.context.selected_objects == before[1]
    cloud = scan(CameraGrid(32, 18))
    places = values_of(made, "position", "vector", 3)
    np.testing.assert_array_equal(places, cloud.positions.astype(np.float32))
    for name, kind, field, column in ATTRIBUTES:
        attribute = made.data.attributes[name]
        assert (attribute.data_type, attribute.domain) == (kind, "POINT")
        expected = getattr(cloud, column)
        found = values_of(made, name, field, expected.size // len(cloud))
        np.testing.assert_array_equal(found, expected.astype(np.int32 if kind == "INT" else np.float32))
    np.testing.assert_array_equal(values_of(made, "radius", "value"), 0.5 * cloud.spacings)
    assert list(made.data["object_names"]) == list(cloud.object_names)


def test_points_know_their_line_how_they_were_met_and_how_far_their_neighbours_are(room) -> None:
    head = bpy.data.objects["Head"]
    cloud = scan(LIDAR, head)
    np.testing.assert_array_equal(cloud.ring_ids, cloud.ray_ids % 4)
    directions = np.array([direction for _, direction, _ in lidar_rays(head, LIDAR, range(36))])[cloud.ray_ids]
    along = np.abs(np.einsum("ij,ij->i", directions, cloud.normals))
    np.testing.assert_allclose(cloud.incidences, along, atol=1e-5)
    np.testing.assert_allclose(cloud.spacings, cloud.distances * 2.0 * np.pi / 36, rtol=1e-5)
    room.camera.data.type, room.camera.data.ortho_scale = "ORTHO", 12.0
    picture = scan(CameraGrid(24, 14))
    np.testing.assert_array_equal(picture.ring_ids, picture.ray_ids // 24)
    np.testing.assert_allclose(picture.spacings, 12.0 / 24, rtol=1e-5)


def test_points_are_drawn_where_blender_would_show_them_in_one_color(room) -> None:
    area = next(area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D")
    space = area.spaces.active

    def shown(shading: str, engine: str = "PERFECT_BVH") -> list[str]:
        space.shading.type = shading
        context = SimpleNamespace(space_data=space, engine=engine, view_layer=bpy.context.view_layer)
        return [obj.name for obj in shown_scans(context)]

    assert not may_have_points() and shown("SOLID") == []
    room.perfect_bvh.scan.width, room.perfect_bvh.scan.height = 32, 18
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert shown("SOLID") == shown("WIREFRAME") == shown("RENDERED") == ["Scan"]
    assert shown("MATERIAL") == shown("RENDERED", "CYCLES") == []
    space.overlay.show_overlays = False
    assert shown("SOLID") == []
    space.overlay.show_overlays = True
    made = bpy.data.objects["Scan"]
    made.hide_set(True)
    assert shown("SOLID") == []
    made.hide_set(False)
    cloud, points = scan(CameraGrid(32, 18)), read_points(made.data)
    np.testing.assert_array_equal(points.positions, cloud.positions.astype(np.float32))
    np.testing.assert_array_equal(points.radii, 0.5 * cloud.spacings)
    assert points.equals(read_points(made.data))
    made.data.attributes["Color"].data[3].color = (0.0, 0.5, 0.0, 1.0)
    assert not points.equals(read_points(made.data))
    made.data.attributes.remove(made.data.attributes["Color"])
    assert shown("SOLID") == []


def test_a_scan_that_is_not_shown_is_named(room) -> None:
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    sync = SceneSync()
    sync.update(bpy.context.evaluated_depsgraph_get())
    told = "Scan: its points are not rendered; 3D viewports show them"
    assert told in sync.warnings
    (row,) = [row for row in sync.record.not_shown if row.name == "Scan"]
    assert (row.kind, row.session_uid, str(row)) == ("scan", bpy.data.objects["Scan"].session_uid, told)
    assert "Geometry Nodes" in row.what_to_do
    sync.close()


def test_further_scans_and_labels_do_not_warn_of_the_points_of_the_last(room) -> None:
    """Nobody expects rays to hit them. Other warnings stay."""
    room.perfect_bvh.scan.width, room.perfect_bvh.scan.height = 32, 18
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    bpy.ops.object.volume_add()
    for made in (scan(CameraGrid(8, 8)), label_image(size=(8, 8))):
        assert [warning.partition(":")[0] for warning in made.warnings] == ["Volume"]


def test_scans_are_looked_up_again_only_when_something_but_the_frame_has_changed(room, monkeypatch) -> None:
    area = next(area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D")
    space = area.spaces.active
    space.shading.type = "SOLID"
    context = SimpleNamespace(space_data=space, engine="PERFECT_BVH", view_layer=bpy.context.view_layer)

    def asked() -> set[str]:
        """Return the objects that are looked up, and check the result."""
        names: set[str] = set()
        has_points = label_values.has_points

        def ask(obj: bpy.types.Object) -> bool:
            names.add(obj.name)
            return has_points(obj)

        with monkeypatch.context() as patch:
            patch.setattr(scan_points, "has_points", ask)
            wanted = [obj for obj in context.view_layer.objects if has_points(obj) and obj.visible_get()]
            assert list(shown_scans(context)) == wanted
        return names

    room.perfect_bvh.scan.width, room.perfect_bvh.scan.height = 32, 18
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    every = {obj.name for obj in context.view_layer.objects}
    assert asked() == every and len(every) > 1
    assert asked() == {"Scan"}
    room.frame_set(room.frame_current + 1)
    assert asked() == {"Scan"}
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    context.view_layer.update()
    assert asked() == every | {"Scan.001"}
    bpy.data.objects.remove(bpy.data.objects["Scan"])
    context.view_layer.update()
    assert asked() == (every | {"Scan.001"}) - {"Scan"}
    context.view_layer = room.view_layers.new("Other")
    assert "Scan.001" in asked()
