"""Scans: every ray is where the sensor casts it, and every point is where `scene.ray_cast` finds it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from limits import full_disk

bpy = pytest.importorskip("bpy")

from blender.scanned_room import LIDAR, lidar_rays  # noqa: E402
from perfect_bvh_addon import CameraGrid, SpinningLidar, scan  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.scanning.point_cloud import COLUMNS  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


def expected_point(scene, origin, direction, distance=1e6):
    """Return (position, normal, name) by Blender's own ray, or None."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    hit, place, normal, _, obj, _ = scene.ray_cast(depsgraph, origin, direction, distance=distance)
    return (np.array(place), np.array(normal), obj.name) if hit else None


def compare_with_blender(scene, cloud, rays) -> int:
    """Check that each ray's point (or none) equals Blender's; return the number of hits."""
    rows = {int(ray): row for row, ray in enumerate(cloud.ray_ids)}
    for ray, (origin, direction, distance) in enumerate(rays):
        expected = expected_point(scene, origin, direction, distance)
        assert (ray in rows) == (expected is not None), ray
        if expected is None:
            continue
        row = rows[ray]
        place, normal, name = expected
        np.testing.assert_allclose(cloud.positions[row], place, atol=1e-4)
        np.testing.assert_allclose(cloud.distances[row], np.linalg.norm(place - np.array(origin)), atol=1e-4)
        assert cloud.normals[row] @ normal == pytest.approx(1.0, abs=1e-4)
        assert cloud.object_names[cloud.object_ids[row]] == name
    return len(rows)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_a_camera_grid_sees_what_blenders_rays_see(room, kind: str) -> None:
    camera = room.camera
    camera.data.type, camera.data.ortho_scale = kind, 12.0
    camera.data.clip_start, camera.data.clip_end = 0.5, 14.0
    cloud = scan(CameraGrid(24, 14))
    room.render.resolution_x, room.render.resolution_y = 24, 14
    corners = np.array([corner[:] for corner in camera.data.view_frame(scene=room)])  # from the upper right, clockwise
    depth = -corners[0, 2]
    turn = camera.matrix_world.normalized()
    rays = []
    for row in range(14):
        for column in range(24):
            x = corners[2, 0] + (column + 0.5) / 24 * (corners[0, 0] - corners[2, 0])
            y = corners[0, 1] - (row + 0.5) / 14 * (corners[0, 1] - corners[2, 1])
            local = np.array((x, y, -depth)) / depth if kind == "PERSP" else np.array((0.0, 0.0, -1.0))
            start = np.zeros(3) if kind == "PERSP" else np.array((x, y, 0.0))
            rays.append((np.array(turn) @ [*start, 1.0], np.array(turn.to_3x3()) @ local))
    hits = []
    for origin, direction in rays:
        length = float(np.linalg.norm(direction))
        near = origin[:3] + direction * camera.data.clip_start
        found = expected_point(room, near, direction, (camera.data.clip_end - camera.data.clip_start) * length)
        hits.append(None if found is None else found[0])
    assert sorted(cloud.ray_ids) == [ray for ray, place in enumerate(hits) if place is not None]
    np.testing.assert_allclose(cloud.positions, [hits[ray] for ray in cloud.ray_ids], atol=2e-4)
    assert 20 < len(cloud) < cloud.ray_count == 24 * 14


def test_a_panoramas_grid_sees_what_blenders_rays_see(room) -> None:
    camera = room.camera
    camera.data.type = "PANO"
    settings = panorama_settings(camera.data)
    settings.panorama_type = "EQUIRECTANGULAR"
    settings.longitude_min, settings.longitude_max, settings.latitude_min, settings.latitude_max = -2.5, 1.0, -1.5, 0.5
    camera.data.clip_start, camera.data.clip_end = 0.5, 14.0
    cloud = scan(CameraGrid(24, 14))
    turn = np.array(camera.matrix_world.normalized())
    rays = []
    for row in range(14):
        up = 0.5 - (row + 0.5) / 14 * 2.0
        for column in range(24):
            right = -2.5 + (column + 0.5) / 24 * 3.5
            local = (math.sin(right) * math.cos(up), math.sin(up), -math.cos(right) * math.cos(up))
            rays.append((turn[:3, 3], turn[:3, :3] @ local, 14.0))
    assert 20 < compare_with_blender(room, cloud, rays) < cloud.ray_count == 24 * 14


def test_a_lidar_turns_once_and_sees_what_blenders_rays_see(room) -> None:
    head = bpy.data.objects["Head"]
    cloud = scan(LIDAR, head)
    assert cloud.ray_count == 36 * 4
    assert compare_with_blender(room, cloud, lidar_rays(head, LIDAR, range(36))) > 40
    np.testing.assert_allclose(cloud.times, cloud.ray_ids // 4 / 360.0)
    assert set(cloud.object_names) >= {"Red", "Plane"}
    red = cloud.object_ids == cloud.object_names.index("Red")
    assert [cloud.material_names[row] for row in set(cloud.material_ids[red])] == ["red"]
    assert set(cloud.material_ids[~red]) == {-1}


def test_its_range_ends_where_it_says(room) -> None:
    head = bpy.data.objects["Head"]
    near = SpinningLidar(elevations=LIDAR.elevations, columns=36, max_distance=5.0)
    cloud = scan(near, head)
    assert compare_with_blender(room, cloud, lidar_rays(head, near, range(36))) < len(scan(LIDAR, head))
    assert cloud.distances.max() <= 5.0


def test_a_frame_range_follows_the_animation_and_spins_on(room) -> None:
    head, red = bpy.data.objects["Head"], bpy.data.objects["Red"]
    for frame, x in ((1, 4.0), (4, 7.0)):
        red.location.x = x
        red.keyframe_insert("location", frame=frame)
    room.frame_set(2, subframe=0.5)
    cloud = scan(LIDAR, head, frames=(1, 3), steps_per_frame=2)
    assert (room.frame_current, room.frame_subframe) == (2, 0.5)
    # 24 frames a second, 360 columns a second: 45 columns in three frames; each column has a different time.
    assert cloud.ray_count == 45 * 4
    rows = {int(ray): row for row, ray in enumerate(cloud.ray_ids)}
    for column in range(45):
        at = 1 + column / 15
        room.frame_set(int(at), subframe=at % 1)
        for ring, (origin, direction, _) in enumerate(lidar_rays(head, LIDAR, range(column, column + 1))):
            expected, row = expected_point(room, origin, direction), rows.get(4 * column + ring)
            assert (expected is None) == (row is None)
            if row is not None:
                # The cube's path is curved, most at its start, and rays hit it at an angle.
                bound = 1e-4 + 1.5 * cloud.scene_error / cloud.incidences[row]
                assert np.linalg.norm(cloud.positions[row] - expected[0]) < bound
    assert len(rows) > 50 and 0.03 < cloud.scene_error < 0.05


def test_instances_are_told_apart_and_hidden_things_are_not_seen(room) -> None:
    copy = bpy.data.objects.new("Copy", bpy.data.objects["Red"].data)
    copy.location = (-4.0, 0.0, 1.0)
    room.collection.objects.link(copy)
    cloud = scan(LIDAR, bpy.data.objects["Head"])
    numbers = {name: set(cloud.instance_ids[cloud.object_ids == row]) for row, name in enumerate(cloud.object_names)}
    assert len(numbers["Red"]) == len(numbers["Copy"]) == 1
    assert numbers["Red"] != numbers["Copy"]
    copy.visible_camera = False
    assert "Copy" not in scan(LIDAR, bpy.data.objects["Head"]).object_names


# Files ---------------------------------------------------------------------------------------------------------------


def test_a_file_holds_all_columns(room, tmp_path: Path) -> None:
    cloud = scan(CameraGrid(16, 9))
    path = cloud.save(tmp_path / "points")
    assert path == tmp_path / "points.npz"
    with np.load(path) as file:
        for name in COLUMNS:
            np.testing.assert_array_equal(file[name], getattr(cloud, name))
        assert tuple(file["object_names"]) == cloud.object_names
        assert int(file["ray_count"]) == 16 * 9
        assert float(file["pose_error"]) == float(file["scene_error"]) == 0.0


def test_a_full_disk_leaves_the_old_file_and_nothing_else(room, tmp_path: Path) -> None:
    cloud = scan(CameraGrid(64, 36))
    path = tmp_path / "points.npz"
    path.write_bytes(b"old")
    with full_disk(4096), pytest.raises(OSError, match=r"cannot write .*points\.npz: File too large"):
        cloud.save(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def drive(head, speed: float, turns: float, tilt: float = 0.0) -> None:
    """Move along the x axis, in units a second at 24 frames, and turn about z so often a second, evenly."""
    for frame in (1, 49):
        head.location = (speed * (frame - 1) / 24, 0.0, 2.0)
        head.rotation_euler = (tilt, 0.0, 2 * math.pi * turns * (frame - 1) / 24)
        head.keyframe_insert("location", frame=frame)
        head.keyframe_insert("rotation_euler", frame=frame)
    action = head.animation_data.action
    curves = action.fcurves if hasattr(action, "fcurves") else action.layers[0].strips[0].channelbags[0].fcurves
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


@pytest.mark.parametrize(("speed", "turns", "steps"), [(30.0, 0.0, 1), (30.0, 0.25, 1), (30.0, 2.0, 4)])
def test_a_lidar_that_drives_and_turns_returns_the_closed_form(speed: float, turns: float, steps: int) -> None:
    """Over a plane, at 10 turns a second: each ray starts at the sensor's position at its time, to a millimetre."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=4000.0)
    head = bpy.data.objects.new("Head", None)
    bpy.context.scene.collection.objects.link(head)
    drive(head, speed, turns)
    lidar = SpinningLidar(elevations=(-30.0, -10.0, -5.0), columns=1800, rate=10.0)
    cloud = scan(lidar, head, frames=(1, 24), steps_per_frame=steps)
    assert len(cloud) == cloud.ray_count == 3 * 18_000
    rays = lidar.cast(0.0, 1.0, None)
    times = rays.times[cloud.ray_ids]
    np.testing.assert_allclose(cloud.times, times)
    forward = rays.directions[cloud.ray_ids] @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T
    angle = 2 * math.pi * turns * times
    x = np.cos(angle) * forward[:, 0] - np.sin(angle) * forward[:, 1]
    y = np.sin(angle) * forward[:, 0] + np.cos(angle) * forward[:, 1]
    distance = -2.0 / forward[:, 2]
    expected = np.stack([speed * times + distance * x, distance * y, np.zeros_like(x)], axis=1)
    error = np.linalg.norm(cloud.positions - expected, axis=1)
    assert error.max() < 1e-3
    assert cloud.pose_error < 1e-3


def test_a_curved_way_is_as_far_off_as_the_cloud_says() -> None:
    """The sensor goes in a circle; more steps a frame follow it more closely, and the reported error is smaller."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=4000.0)
    scene, head = bpy.context.scene, bpy.data.objects.new("Head", None)
    scene.collection.objects.link(head)
    for index, expression in enumerate(("10*cos(frame/4)", "10*sin(frame/4)", "2")):
        head.driver_add("location", index).driver.expression = expression
    lidar = SpinningLidar(elevations=(-30.0,), columns=720, rate=10.0)
    said = []
    for steps in (1, 4):
        cloud = scan(lidar, head, frames=(1, 12), steps_per_frame=steps)
        frames = 1 + cloud.times * 24
        away = lidar.cast(0.0, 0.5, None).directions[cloud.ray_ids] @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T
        centre = 10 * np.stack([np.cos(frames / 4), np.sin(frames / 4)], axis=1)
        expected = centre + away[:, :2] * (-2.0 / away[:, 2])[:, None]
        error = np.linalg.norm(cloud.positions[:, :2] - expected, axis=1).max()
        assert error < 1.05 * cloud.pose_error < 1.3 * error
        said.append(cloud.pose_error)
    assert said[1] < said[0] / 10
