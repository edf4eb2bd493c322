"""Scans: every ray is where the sensor casts it, every point where `scene.ray_cast` finds it; nothing is half done."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from limits import full_disk

bpy = pytest.importorskip("bpy")

import perfect_bvh  # noqa: E402
from perfect_bvh_addon import CameraGrid, SceneSync, SpinningLidar, scan  # noqa: E402
from perfect_bvh_addon.extract import scans  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.operators.scan import parse_elevations  # noqa: E402
from perfect_bvh_addon.scanning import Scanner  # noqa: E402
from perfect_bvh_addon.scanning.collector import LUMINANCE  # noqa: E402
from perfect_bvh_addon.scanning.point_cloud import COLUMNS  # noqa: E402
from perfect_bvh_addon.scanning.point_colors import colors_of  # noqa: E402
from perfect_bvh_addon.scanning.point_data import ATTRIBUTES, may_have_points, read_points  # noqa: E402
from perfect_bvh_addon.view3d import scan_points  # noqa: E402
from perfect_bvh_addon.view3d.scan_points import shown_scans  # noqa: E402

needs_proc = pytest.mark.skipif(sys.platform != "linux", reason="no folder where not even root can make a file")
LIDAR = SpinningLidar(elevations=(-30.0, -10.0, 0.0, 20.0), columns=36, rate=10.0)


pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture
def room(scene: bpy.types.Scene) -> bpy.types.Scene:
    """A ground, a red and a white cube that share no mesh, a camera and an empty that are turned and scaled."""
    bpy.ops.mesh.primitive_plane_add(size=40.0)
    for name, place in (("Red", (4.0, 0.0, 1.0)), ("White", (0.0, 5.0, 1.5))):
        bpy.ops.mesh.primitive_cube_add(location=place, rotation=(0.1, 0.2, 0.3))
        bpy.context.object.name = name
    material = bpy.data.materials.new("red")
    bpy.data.objects["Red"].data.materials.append(material)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.scale = (-6.0, -6.0, 4.0), (1.1, 0.05, -0.8), (2.0, 2.0, 2.0)
    empty = bpy.data.objects.new("Head", None)
    empty.location, empty.rotation_euler, empty.scale = (0.0, 0.0, 1.5), (0.1, -0.05, 0.4), (3.0, 1.0, 0.5)
    for obj in (camera, empty):
        scene.collection.objects.link(obj)
    scene.camera = camera
    scene.frame_end = 3
    bpy.context.view_layer.update()
    return scene


def expected_point(scene, origin, direction, distance=1e6):
    """(position, normal, name) by Blender's own ray, or None."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    hit, place, normal, _, obj, _ = scene.ray_cast(depsgraph, origin, direction, distance=distance)
    return (np.array(place), np.array(normal), obj.name) if hit else None


def compare_with_blender(scene, cloud, rays) -> int:
    """Each ray's point (or none) must be Blender's; how many hits there were. rays: (origin, direction, distance)."""
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


def lidar_rays(head, pattern: SpinningLidar, columns: range):
    """The rays, one by one, from the definition: forward is the object's +Y, up its +Z, turning to the left."""
    turn = np.array(head.matrix_world.normalized())
    for column in columns:
        azimuth = math.radians(((column % pattern.columns + 0.5) / pattern.columns - 0.5) * pattern.sweep)
        for angle in pattern.elevations:
            up = math.radians(angle)
            local = (-math.sin(azimuth) * math.cos(up), math.cos(azimuth) * math.cos(up), math.sin(up))
            yield turn[:3, 3], turn[:3, :3] @ local, pattern.max_distance if pattern.max_distance < 1e6 else 1e6


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
    # 24 frames a second, 360 columns a second: 45 columns in three frames, the parts of a frame 7 or 8 each.
    assert cloud.ray_count == 45 * 4
    seen = 0
    for step in range(6):
        columns = [column for column in range(45) if step <= column / 360 * 48 + 1e-9 < step + 1]
        room.frame_set(1 + step // 2, subframe=step % 2 / 2)
        mine = np.isin(cloud.ray_ids // 4, columns)
        for row in np.flatnonzero(mine):
            ray = int(cloud.ray_ids[row])
            (origin, direction, _) = list(lidar_rays(head, LIDAR, range(ray // 4, ray // 4 + 1)))[ray % 4]
            np.testing.assert_allclose(cloud.positions[row], expected_point(room, origin, direction)[0], atol=1e-4)
        seen += int(mine.sum())
    assert seen == len(cloud) > 50


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


# Files and meshes ----------------------------------------------------------------------------------------------------


def test_a_file_holds_all_columns(room, tmp_path: Path) -> None:
    cloud = scan(CameraGrid(16, 9))
    path = cloud.save(tmp_path / "points")
    assert path == tmp_path / "points.npz"
    with np.load(path) as file:
        for name in COLUMNS:
            np.testing.assert_array_equal(file[name], getattr(cloud, name))
        assert tuple(file["object_names"]) == cloud.object_names
        assert int(file["ray_count"]) == 16 * 9


def test_a_full_disk_leaves_the_old_file_and_nothing_else(room, tmp_path: Path) -> None:
    cloud = scan(CameraGrid(64, 36))
    path = tmp_path / "points.npz"
    path.write_bytes(b"old")
    with full_disk(4096), pytest.raises(OSError, match=r"cannot write .*points\.npz: File too large"):
        cloud.save(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


# The button ----------------------------------------------------------------------------------------------------------


def test_the_button_makes_an_object_with_attributes(room, tmp_path: Path) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height, settings.filepath = 32, 18, str(tmp_path / "made")
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
    assert (tmp_path / "made.npz").is_file()


def test_the_button_scans_with_a_lidar_over_frames(room) -> None:
    settings = room.perfect_bvh.scan
    settings.pattern, settings.sensor = "LIDAR", bpy.data.objects["Head"]
    settings.elevations, settings.columns, settings.use_frame_range = "-30:20:6", 36, True
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    pattern = SpinningLidar(elevations=parse_elevations("-30:20:6"), columns=36, max_distance=100.0)
    cloud = scan(pattern, bpy.data.objects["Head"], frames=(1, 3))
    assert len(values_of(bpy.data.objects["Scan"], "distance", "value")) == len(cloud)


def values_of(obj: bpy.types.Object, attribute: str, field: str, width: int = 1) -> np.ndarray:
    """(N,) or (N, width) of an attribute of a scan's points."""
    data = obj.data.attributes[attribute].data
    is_whole = obj.data.attributes[attribute].data_type == "INT"
    values = np.empty(len(data) * width, np.int32 if is_whole else np.float32)
    data.foreach_get(field, values)
    return values if width == 1 else values.reshape(-1, width)


@pytest.mark.parametrize("color_by", ["DISTANCE", "OBJECT", "INTENSITY"])
def test_points_are_colored_by_what_was_chosen_and_the_material_shows_it(room, color_by: str) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height, settings.point_color = 32, 18, color_by
    bpy.data.materials["red"].diffuse_color = (1.0, 0.0, 0.0, 1.0)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    made, cloud = bpy.data.objects["Scan"], scan(CameraGrid(32, 18))
    colors = values_of(made, "Color", "color", 4)
    np.testing.assert_array_equal(colors, colors_of(cloud, color_by))
    (material,) = made.data.materials
    (attribute,) = [node for node in material.node_tree.nodes if node.type == "ATTRIBUTE"]
    assert (attribute.attribute_name, attribute.outputs["Color"].links[0].to_socket.name) == ("Color", "Base Color")
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert list(bpy.data.objects["Scan.001"].data.materials) == [material]


def test_colors_tell_near_from_far_and_one_object_from_another(room) -> None:
    bpy.data.materials["red"].diffuse_color = (1.0, 0.0, 0.0, 1.0)
    cloud = scan(CameraGrid(64, 36))
    assert len(cloud.object_names) == 3
    of_object = [colors_of(cloud, "OBJECT")[cloud.object_ids == row] for row in range(3)]
    assert all((np.ptp(colors, axis=0) == 0.0).all() for colors in of_object)
    assert len({tuple(colors[0]) for colors in of_object}) == 3
    lightness = colors_of(cloud, "DISTANCE")[:, :3] @ LUMINANCE
    order = np.argsort(cloud.distances)
    assert (np.diff(lightness[order]) <= 1e-6).all() and lightness[order[0]] > 5.0 * lightness[order[-1]]
    red = cloud.object_ids == cloud.object_names.index("Red")
    ratio = cloud.intensities / cloud.incidences
    np.testing.assert_allclose(ratio[red], LUMINANCE[0], rtol=1e-5)
    np.testing.assert_allclose(ratio[~red], 0.8, rtol=1e-5)
    greys = colors_of(cloud, "INTENSITY")
    assert greys[:, :3].max() == 1.0 and (np.ptp(greys[:, :3], axis=1) == 0.0).all()


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


def test_scans_are_looked_up_again_only_when_something_but_the_frame_has_changed(room, monkeypatch) -> None:
    area = next(area for area in bpy.data.screens["Layout"].areas if area.type == "VIEW_3D")
    space = area.spaces.active
    space.shading.type = "SOLID"
    context = SimpleNamespace(space_data=space, engine="PERFECT_BVH", view_layer=bpy.context.view_layer)

    def asked() -> set[str]:
        """Which objects are asked, and what is found is right."""
        names: set[str] = set()
        has_points = scans.has_points

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


@pytest.mark.parametrize(
    ("text", "angles"), [("-1, 0,2.5,", (-1.0, 0.0, 2.5)), ("-10:10:3", (-10.0, 0.0, 10.0)), ("7", (7.0,))]
)
def test_elevations_can_be_written_in_two_ways(text: str, angles: tuple[float, ...]) -> None:
    assert parse_elevations(text) == angles


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"filepath": "/nowhere/at/all/points"}, "Cannot write /nowhere/at/all/points.npz: No such file or directory"),
        pytest.param({"filepath": "/proc/points"}, "Cannot write /proc/points.npz", marks=needs_proc),
        ({"filepath": "//points"}, "is relative to the .blend file: save that first"),
        ({"pattern": "LIDAR", "elevations": "up"}, "Elevations must be degrees .* got 'up'"),
        ({"pattern": "LIDAR", "elevations": "0:9:1000000000"}, "with a count of at most 4,096, got '0:9:1000000000'"),
        ({"filepath": "/tmp/"}, "/tmp is a folder: name a file in it"),
        ({"pattern": "LIDAR", "elevations": ""}, "elevations must be degrees from -90 to 90, at least one"),
        ({"pattern": "LIDAR", "elevations": "0:100:3"}, "elevations must be degrees from -90 to 90"),
        ({"use_frame_range": True, "sensor": "Red"}, "camera grid needs a camera as its sensor, got 'Red', a MESH"),
    ],
)
def test_bad_settings_are_named_before_anything_is_made(room, changes, message: str) -> None:
    for name, value in changes.items():
        setattr(room.perfect_bvh.scan, name, bpy.data.objects[value] if name == "sensor" else value)
    count = len(bpy.data.objects), len(bpy.data.meshes)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.perfect_bvh.scan()
    assert (len(bpy.data.objects), len(bpy.data.meshes)) == count


def test_a_scan_of_nothing_says_so_and_makes_nothing(room) -> None:
    room.camera.rotation_euler = (math.pi, 0.0, 0.0)  # up into the sky
    count = len(bpy.data.objects)
    assert bpy.ops.perfect_bvh.scan() == {"CANCELLED"}
    assert len(bpy.data.objects) == count


def test_the_button_needs_a_sensor_and_object_mode(room) -> None:
    room.camera = None
    with pytest.raises(RuntimeError, match="neither a sensor nor an active camera"):
        bpy.ops.perfect_bvh.scan()
    room.camera = bpy.data.objects["Camera"]
    bpy.context.view_layer.objects.active = bpy.data.objects["Red"]
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="leave the mode of the active one first"):
        bpy.ops.perfect_bvh.scan()
    bpy.ops.object.mode_set(mode="OBJECT")


def test_points_are_kept_when_the_file_cannot_be_written(room, tmp_path: Path) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height, settings.filepath = 64, 36, str(tmp_path / "points")
    with full_disk(4096), pytest.raises(RuntimeError, match=r"points on .* but cannot write .*: File too large"):
        bpy.ops.perfect_bvh.scan()
    assert len(bpy.data.objects["Scan"].data.attributes["distance"].data)
    assert not list(tmp_path.iterdir())


# Interruptions -------------------------------------------------------------------------------------------------------


def test_a_sensor_deleted_during_the_scan_is_named_and_the_frame_set_back(room) -> None:
    room.frame_set(2)
    steps = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3)).steps()
    next(steps)
    assert room.frame_current == 1
    bpy.data.objects.remove(bpy.data.objects["Head"])
    with pytest.raises(ValueError, match="the sensor 'Head' was deleted during the scan"):
        list(steps)
    assert room.frame_current == 2


def test_a_scanned_object_deleted_during_the_scan_is_gone_from_then_on(room) -> None:
    scanner = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3))
    steps = scanner.steps()
    next(steps)
    bpy.data.objects.remove(bpy.data.objects["Plane"])
    list(steps)
    cloud = scanner.result()
    on_plane = cloud.object_ids == cloud.object_names.index("Plane")
    assert on_plane.any() and cloud.times[on_plane].max() < 1 / 24


def test_giving_up_sets_the_frame_back(room) -> None:
    room.frame_set(3)
    steps = Scanner(LIDAR, bpy.data.objects["Head"], frames=(1, 3)).steps()
    next(steps)
    steps.close()
    assert room.frame_current == 3


def test_a_scan_can_be_given_up_before_its_first_ray(room, monkeypatch) -> None:
    """Once the scene is read, which may take long; the operator heeds Esc between any two steps."""
    monkeypatch.setattr(CameraGrid, "cast", None)
    steps = Scanner(CameraGrid(32, 18)).steps()
    assert next(steps) == 0.0
    steps.close()


def test_progress_can_stop_a_scan(room) -> None:
    seen: list[float] = []

    def stop_halfway(done: float) -> bool:
        seen.append(done)
        return done < 0.5

    with pytest.raises(perfect_bvh.Cancelled):
        scan(LIDAR, bpy.data.objects["Head"], frames=(1, 3), progress=stop_halfway)
    assert seen == sorted(seen) and seen[0] == 0.0 and 0.5 <= seen[-1] < 1.0


def test_large_scans_are_cast_in_pieces(room, monkeypatch) -> None:
    whole = scan(CameraGrid(32, 18))
    monkeypatch.setitem(scan.__globals__, "RAYS_IN_A_STEP", 100)
    monkeypatch.setitem(scan.__globals__, "BUILD_STEP_SECONDS", 60.0)  # the trees are no step, however slow the machine
    scanner = Scanner(CameraGrid(32, 18))
    done = list(scanner.steps())
    assert len(done) == 7 and done == sorted(done) and (done[0], done[-1]) == (0.0, 1.0)
    cloud = scanner.result()
    for name in ("positions", "ray_ids", "object_ids", "times"):
        np.testing.assert_array_equal(getattr(cloud, name), getattr(whole, name))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CameraGrid(0, 9), "CameraGrid: width must be an integer of at least 1, got 0"),
        (lambda: CameraGrid(20000, 20000), r"at most 33,554,432 rays, got 400,000,000: scan in parts"),
        (lambda: SpinningLidar(columns=1 << 24), r"elevations \* columns must be at most 33,554,432 rays"),
        (lambda: SpinningLidar(columns=0), "SpinningLidar: columns must be an integer of at least 1, got 0"),
        (lambda: SpinningLidar(rate=0.0), "rate must be turns a second above 0, got 0.0"),
        (lambda: SpinningLidar(elevations=()), "elevations must be degrees"),
        (lambda: SpinningLidar(sweep=400.0), "sweep must be degrees above 0 and up to 360, got 400.0"),
        (lambda: SpinningLidar(max_distance=0.0), "below max_distance, got 0.0 and 0.0"),
    ],
)
def test_patterns_check_themselves(make, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_scan_names_what_is_wrong(room) -> None:
    head = bpy.data.objects["Head"]
    with pytest.raises(ValueError, match=r"frames must be \(first, last\) with first <= last, got \(3, 1\)"):
        scan(LIDAR, head, frames=(3, 1))
    with pytest.raises(ValueError, match="steps_per_frame must be an integer of at least 1, got 0"):
        scan(LIDAR, head, frames=(1, 1), steps_per_frame=0)
    head.scale = (0.0, 1.0, 1.0)
    with pytest.raises(ValueError, match="'Head' has no usable matrix"):
        scan(LIDAR, head)
    room.collection.objects.unlink(head)
    with pytest.raises(ValueError, match="the sensor 'Head' is not in scene"):
        scan(LIDAR, head)
    room.camera.data.type = "PANO"
    panorama_settings(room.camera.data).panorama_type = "FISHEYE_EQUISOLID"
    with pytest.raises(ValueError, match="choose Equirectangular as its Panorama Type"):
        scan(CameraGrid(4, 4))
    room.camera = None
    with pytest.raises(ValueError, match="has no active camera: name a sensor"):
        scan(LIDAR)
