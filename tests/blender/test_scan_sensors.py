"""The sensors of the Scan panel: the built-in ones, by their titles, and users' own files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.scanned_room import values_of  # noqa: E402
from perfect_bvh_addon import load_sensor, scan, sensor_names  # noqa: E402
from perfect_bvh_addon.settings import scan_choices  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import PERFECT_BVH_PG_scan  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


def items() -> dict[str, Any]:
    return dict(PERFECT_BVH_PG_scan.bl_rna.properties["pattern"].enum_items)


def test_every_sensor_that_is_brought_is_in_the_list_with_its_source() -> None:
    found = items()
    assert set(found) == {"CAMERA", "LIDAR", "FILE", *sensor_names()}
    for name in sensor_names():
        sensor = load_sensor(name)
        assert found[name].name.lower() == sensor.title.lower()
        assert found[name].description[1:] == sensor.source[1:]
    assert found["spinning-16"].name == "16-Line Spinning LiDAR"


def test_sensors_keep_their_numbers_in_files() -> None:
    """Saved files rely on these numbers: they depend on the sensors' names alone, not on the set of sensors."""
    numbers = {name: item.value for name, item in items().items()}
    assert len(set(numbers.values())) == len(numbers)
    assert [numbers[name] for name in ("CAMERA", "LIDAR", "FILE")] == [0, 1, 2]
    assert numbers["spinning-16"] == scan_choices.number_of("spinning-16") == SPINNING_16


SPINNING_16 = 39628244


def test_a_choice_is_kept_in_a_file(tmp_path: Path) -> None:
    bpy.context.scene.perfect_bvh.scan.pattern = "stereo-depth-camera"
    bpy.context.scene.perfect_bvh.scan.frames = "RANGE"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    settings = bpy.context.scene.perfect_bvh.scan
    assert (settings.pattern, settings.frames) == ("stereo-depth-camera", "RANGE")


def test_frames_are_kept_as_files_had_them(scene: Any) -> None:
    settings = scene.perfect_bvh.scan
    assert settings.frames == "CURRENT"
    settings.use_frame_range = True
    assert settings.frames == "SCENE"
    for choice in ("RANGE", "CURRENT", "SCENE"):
        settings.frames = choice
        assert settings.frames == choice and settings.use_frame_range == (choice != "CURRENT")


@pytest.mark.parametrize("name", ["spinning-16", "own"])
def test_the_button_scans_with_a_sensor_by_name_or_of_a_file(room: Any, tmp_path: Path, name: str) -> None:
    settings, head = room.perfect_bvh.scan, bpy.data.objects["Head"]
    settings.sensor, settings.seed = head, 3
    if name == "own":
        path = tmp_path / "own.toml"
        path.write_text('kind = "rosette"\nrate = 5000.0\n\n[noise]\nrange = 0.02\n')
        settings.pattern, settings.sensor_file = "FILE", str(path)
        sensor = load_sensor(path)
    else:
        settings.pattern, sensor = name, load_sensor(name)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    cloud = scan(sensor, head, seed=3)
    places = values_of(bpy.data.objects["Scan"], "position", "vector", 3)
    np.testing.assert_array_equal(places, cloud.positions.astype(np.float32))


def test_frames_of_ones_own_are_scanned(room: Any) -> None:
    settings, head = room.perfect_bvh.scan, bpy.data.objects["Head"]
    settings.pattern, settings.sensor, settings.columns, settings.elevations = "LIDAR", head, 36, "-30:20:6"
    settings.frames, settings.frame_start, settings.frame_end = "RANGE", 2, 3
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    times = values_of(bpy.data.objects["Scan"], "time", "value")
    assert times.min() >= 0.0 and 1.0 / 24.0 < times.max() < 2.0 / 24.0


def test_a_file_that_describes_no_sensor_is_named(room: Any, tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text('kind = "spining"\n')
    room.perfect_bvh.scan.pattern, room.perfect_bvh.scan.sensor_file = "FILE", str(path)
    with pytest.raises(RuntimeError, match=r"own\.toml: kind must be one of .* \(is it 'spinning'\?\)|spining"):
        bpy.ops.perfect_bvh.scan()
