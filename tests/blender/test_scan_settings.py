"""The scan button's settings and a scan's arguments: errors are reported before any object or file is created."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import pytest
from limits import full_disk

bpy = pytest.importorskip("bpy")

from blender.scanned_room import LIDAR, values_of  # noqa: E402
from perfect_bvh_addon import CameraGrid, SpinningLidar, scan  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.scanning.sensor_settings import parse_elevations  # noqa: E402
from perfect_bvh_addon.statistics.messages import messages_of, notes_of  # noqa: E402

needs_proc = pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux has /proc, where not even root can make a file"
)
pytestmark = pytest.mark.usefixtures("registered")


# The button ----------------------------------------------------------------------------------------------------------


def test_the_button_scans_with_a_lidar_over_frames(room) -> None:
    settings = room.perfect_bvh.scan
    settings.pattern, settings.sensor = "LIDAR", bpy.data.objects["Head"]
    settings.elevations, settings.columns, settings.use_frame_range = "-30:20:6", 36, True
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    pattern = SpinningLidar(elevations=parse_elevations("-30:20:6"), columns=36, max_distance=100.0)
    cloud = scan(pattern, bpy.data.objects["Head"], frames=(1, 3))
    assert len(values_of(bpy.data.objects["Scan"], "distance", "value")) == len(cloud)


@pytest.mark.parametrize("use_files", [False, True])
def test_the_mount_is_chosen_and_the_panel_counts_the_rays(room, tmp_path: Path, use_files: bool) -> None:
    """The cube is around the sensor, so it is excluded automatically."""
    settings = room.perfect_bvh.scan
    settings.pattern, settings.sensor, settings.columns = "LIDAR", bpy.data.objects["Red"], 36
    settings.use_files, settings.folder = use_files, str(tmp_path)
    pattern = SpinningLidar(elevations=parse_elevations(settings.elevations), columns=36, max_distance=100.0)
    for settings.mount, is_out in (("AUTO", True), ("EXCLUDE", True), ("SCAN", False)):
        for path in tmp_path.iterdir():
            path.unlink()
        assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
        note, result = notes_of(room, "Scan")
        assert result.startswith("Wrote 1 file with " if use_files else "Scan"), result
        assert note == str(scan(pattern, settings.sensor, exclude_mount=is_out).ray_outcomes)
        found = " ".join(message.text for message in messages_of(room))
        assert ("'Red' and its children are invisible" in found) == (settings.mount == "AUTO") and note not in found
        assert ("or almost all, are on the sensor's own object" in found) == (not is_out)


@pytest.mark.parametrize(
    ("text", "angles"), [("-1, 0,2.5,", (-1.0, 0.0, 2.5)), ("-10:10:3", (-10.0, 0.0, 10.0)), ("7", (7.0,))]
)
def test_elevations_can_be_written_in_two_ways(text: str, angles: tuple[float, ...]) -> None:
    assert parse_elevations(text) == angles


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        pytest.param({"use_files": True, "folder": "/proc/a"}, "Cannot write into /proc/a", marks=needs_proc),
        ({"use_files": True, "folder": "//points"}, "is relative to the .blend file: save that first"),
        ({"pattern": "LIDAR", "elevations": "up"}, "Elevations must be degrees .* got 'up'"),
        ({"pattern": "LIDAR", "elevations": "0:9:1000000000"}, "with a count of at most 4,096, got '0:9:1000000000'"),
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
    with pytest.raises(RuntimeError, match="No sensor: choose a Sensor Object"):
        bpy.ops.perfect_bvh.scan()
    room.camera = bpy.data.objects["Camera"]
    bpy.context.view_layer.objects.active = bpy.data.objects["Red"]
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Switch to Object Mode first"):
        bpy.ops.perfect_bvh.scan()
    bpy.ops.object.mode_set(mode="OBJECT")


def test_points_are_kept_when_the_file_cannot_be_written(room, tmp_path: Path) -> None:
    settings = room.perfect_bvh.scan
    settings.width, settings.height, settings.use_files, settings.folder = 64, 36, True, str(tmp_path)
    with full_disk(4096), pytest.raises(RuntimeError, match=r"Cannot write .*points_0001-0001.npz: File too large"):
        bpy.ops.perfect_bvh.scan()
    assert len(bpy.data.objects["Scan 1-1"].data.attributes["distance"].data)
    assert not list(tmp_path.iterdir())
    bpy.data.objects.remove(bpy.data.objects["Scan 1-1"])
    settings.use_points = False
    with full_disk(4096), pytest.raises(RuntimeError, match="File too large"):
        bpy.ops.perfect_bvh.scan()
    assert not any(obj.name.startswith("Scan") for obj in bpy.data.objects)


# Scripts -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CameraGrid(0, 9), "CameraGrid: width must be an integer from 1 to 2147483647, got 0"),
        (lambda: CameraGrid(20000, 20000), r"at most 33,554,432 rays, got 400,000,000: scan in parts"),
        (lambda: SpinningLidar(columns=1 << 24), r"elevations \* columns must be at most 33,554,432 rays"),
        (lambda: SpinningLidar(columns=0), "SpinningLidar: columns must be an integer from 1 to 2147483647, got 0"),
        (lambda: SpinningLidar(rate=0.0), "rate, in turns a second, must be a finite number above 0, got 0.0"),
        (lambda: SpinningLidar(elevations=()), "elevations must be degrees"),
        (lambda: SpinningLidar(sweep=400.0), "sweep, in degrees, must be a number above 0 and up to 360, got 400.0"),
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
    with pytest.raises(ValueError, match="steps_per_frame must be an integer from 1 to 2147483647, got 0"):
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
