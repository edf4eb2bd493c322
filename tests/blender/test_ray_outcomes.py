"""The outcome of each ray of a scan, the sentences on useless scans, and mounts that rays pass through."""

from __future__ import annotations

import json
import math
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.command_lines import run  # noqa: E402
from blender.light_scenes import ONE_RAY, add_plate, diffuse, empty_scene, names_of, simple  # noqa: E402
from perfect_bvh_addon import (  # noqa: E402
    DepthCamera,
    Detection,
    Light,
    Noise,
    Raster,
    RayCounts,
    Sensor,
    SpinningLidar,
    load_sensor,
    scan,
)
from perfect_bvh_addon.scanning.outcomes import WORDS, Outcome  # noqa: E402

WIDE = Raster(width=40, height=1, horizontal=90.0, vertical=1.0, min_distance=1.0, max_distance=10.0)


@pytest.fixture
def head() -> Any:
    return empty_scene()


def add_box(name: str, place: tuple[float, float, float], size: tuple[float, float, float]) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place, scale=size)
    bpy.context.object.name = name
    bpy.ops.object.transform_apply(location=False, rotation=False)
    return bpy.context.object


def counted(cloud: Any) -> dict[str, int]:
    """Return the counts that are not 0, and check that all add up to the number of rays."""
    assert cloud.ray_outcomes.cast == sum(cloud.ray_outcomes.named.values()) == cloud.ray_count
    assert cloud.ray_outcomes.with_points == len(np.unique(cloud.ray_ids))
    return {name: count for name, count in cloud.ray_outcomes.named.items() if count}


def test_outcomes_are_the_fields_of_counts() -> None:
    assert [outcome.name.lower() for outcome in Outcome] == [field.name for field in fields(RayCounts)]
    assert len(WORDS) == len(Outcome)
    assert str(RayCounts(on_objects=1200, hit_nothing=3)) == "1,203 rays: 1,200 hit objects, 3 hit nothing"
    assert str(RayCounts()) == "0 rays"
    assert RayCounts(1, 2) + RayCounts(0, 3, 4) == RayCounts(1, 5, 4)


def test_rays_without_light_hit_miss_or_are_out_of_range(head) -> None:
    """A plate on the right is in range, one on the left too far, one in the middle too near; rays have known angles."""
    add_plate(5.0, x=2.5, size=4.0)
    add_plate(20.0, x=-10.0, size=16.0)
    add_plate(0.5, size=0.1)
    turns = np.radians((np.arange(40) + 0.5) / 40 * 90.0 - 45.0)
    slopes = np.tan(turns)
    in_range = (slopes > 0.1) & (slopes < 0.9)
    out = ~in_range & ((np.abs(slopes) < 0.1) | ((slopes < -0.1) & (slopes > -0.9)))
    cloud = scan(WIDE, head)
    expected = {"on_objects": in_range.sum(), "out_of_range": out.sum(), "hit_nothing": (~in_range & ~out).sum()}
    assert counted(cloud) == expected and all(expected.values())
    assert cloud.warnings == ()


def test_what_the_second_eye_does_not_see_is_counted(head) -> None:
    add_plate(1.0, size=0.4)
    add_plate(4.0, size=20.0)
    cloud = scan(DepthCamera(width=64, height=48, horizontal=60.0, vertical=45.0, baseline=0.2), head)
    found = counted(cloud)
    assert found["hidden"] == 64 * 48 - len(cloud) > 100 and set(found) == {"on_objects", "hidden"}


@pytest.mark.parametrize("lost", [False, True])
def test_beams_are_dark_or_lost_or_pass_glass(head, lost: bool) -> None:
    """A white plate on the left, a black one on the right, and one in the middle behind a clear pane."""
    add_plate(5.0, diffuse(0.8), x=-3.0, size=4.0)
    add_plate(5.0, diffuse(1e-6), x=3.0, size=4.0)
    add_plate(2.0, simple("ShaderNodeBsdfTransparent", Color=(1.0, 1.0, 1.0, 1.0)), size=0.7)
    add_plate(6.0, diffuse(0.8), size=1.0)
    noise = Noise(dropout=1.0) if lost else Noise()
    light = Light(detection=Detection((1.0, 100.0), (0.1, 0.1)), noise=noise)
    found = counted(scan(WIDE, head, light=light))
    assert {"too_dark", "hit_nothing", *(["dropped_out"] if lost else ["on_objects", "behind_glass"])} == set(found)


def test_half_of_the_rays_are_lost_to_a_dropout_of_a_half(head) -> None:
    add_plate(5.0, diffuse(0.8), size=40.0)
    light = Light(noise=Noise(dropout=0.5))
    cloud = scan(WIDE, head, light=light)
    found = counted(cloud)
    assert set(found) == {"on_objects", "dropped_out"} and found["dropped_out"] == 40 - len(cloud)


@pytest.mark.parametrize("name", ["spinning-16", "stereo-depth-camera", "time-of-flight-camera"])
def test_counts_of_known_sensors_add_up(head, name: str) -> None:
    add_box("Room", (0.0, 4.0, 0.0), (6.0, 6.0, 6.0))
    assert counted(scan(load_sensor(name), head))["on_objects"] > 100


# Mounts --------------------------------------------------------------------------------------------------------------


def carried_lidar() -> tuple[Any, Any]:
    """A car around the sensor with a child object outside the sensor, and a wall."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    car = add_box("Car", (0.0, 0.0, 0.0), (1.0, 2.0, 0.7))
    mirror = add_box("Mirror", (0.0, 3.0, 0.0), (0.5, 0.1, 0.5))
    mirror.parent = car
    add_box("Wall", (0.0, 20.0, 0.0), (10.0, 0.1, 10.0))
    bpy.context.view_layer.update()
    return car, load_sensor("spinning-16")


def test_a_mesh_around_a_known_sensor_is_left_out_and_told() -> None:
    car, sensor = carried_lidar()
    left_out, asked, seen = (scan(sensor, car, exclude_mount=value) for value in (None, True, False))
    assert set(names_of(left_out)) == {"Wall"} and np.array_equal(left_out.positions, asked.positions)
    assert "'Car' and its children are invisible to the sensor" in left_out.warnings[0] and len(left_out.warnings) == 1
    assert asked.warnings == ()
    assert counted(left_out)["on_objects"] == len(left_out)
    assert counted(seen) == {"on_mount": seen.ray_count}
    assert "All points of the scan" in seen.warnings[0] and "--exclude-mount" in seen.warnings[0]
    hidden = scan(sensor, car, frames=(1, 2))
    assert set(names_of(hidden)) == {"Wall"} and len(hidden) > 0


def test_a_mount_beside_the_sensor_and_a_bare_pattern_stay_as_they_were() -> None:
    car, sensor = carried_lidar()
    assert counted(scan(sensor.pattern, car)) == {"on_mount": sensor.pattern.columns * 16}
    for vertex in car.data.vertices:
        vertex.co.z -= 0.5  # the sensor is above its roof
    car.data.update()
    cloud = scan(sensor, car)
    assert set(names_of(cloud)) == {"Car", "Mirror", "Wall"} and cloud.warnings == ()
    assert counted(cloud)["on_mount"] == np.isin(names_of(cloud), ("Car", "Mirror")).sum()
    assert set(names_of(scan(sensor, car, exclude_mount=True))) == {"Wall"}


def test_instances_of_the_mount_are_of_it(head) -> None:
    """An empty that shows a collection around the sensor."""
    shell = bpy.data.collections.new("shell")
    box = add_box("Box", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    bpy.context.scene.collection.objects.unlink(box)
    shell.objects.link(box)
    head.instance_type, head.instance_collection = "COLLECTION", shell
    add_plate(5.0)
    bpy.context.view_layer.update()
    assert counted(scan(ONE_RAY, head)) == {"on_mount": 1}
    assert names_of(scan(ONE_RAY, head, exclude_mount=True)) == ["Plane"]


# Scans without use ---------------------------------------------------------------------------------------------------


def test_a_scene_in_millimetres_is_named(head) -> None:
    bpy.context.scene.unit_settings.scale_length = 0.001
    add_box("Wall", (0.0, 3000.0, 0.0), (2000.0, 1.0, 2000.0))
    bpy.context.view_layer.update()
    cloud = scan(load_sensor("spinning-16"), head)
    assert len(cloud) == 0 and counted(cloud)["out_of_range"] > 1000
    unit, useless = cloud.warnings
    assert "Unit Scale is 0.001" in unit and "up to 100 units, which are 0.1 m" in unit
    assert "No ray of the scan" in useless and "nearer or farther than the sensor's range" in useless
    own = Sensor("own", "", "", SpinningLidar(elevations=(0.0,), columns=36, max_distance=math.inf))
    assert len(scan(own, head)) > 0 and scan(own, head).warnings == ()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: add_plate(80.0, diffuse(0.0), size=40.0), "too little light to be detected"),
        (
            lambda: add_plate(1e4, diffuse(0.8), size=1e4),
            r"nearer or farther than the sensor's range \(.* to 100 scene",
        ),
        (lambda: None, "they hit nothing"),
    ],
)
def test_a_scan_without_points_says_why(head, make: Any, words: str) -> None:
    make()
    cloud = scan(load_sensor("spinning-16"), head)
    counted(cloud)
    assert len(cloud) == 0 and len(cloud.warnings) == 1
    assert re.search(words, cloud.warnings[0])


def test_the_command_counts_and_the_manifest_keeps_it(tmp_path: Path, capfd: Any) -> None:
    carried_lidar()
    path = tmp_path / "car.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    out = tmp_path / "out"
    assert run("scan", path, "-o", out, "--on", "Car", "--frames", "1-2", "--chunk", 1) == 0
    told = capfd.readouterr()
    assert "'Car' and its children are invisible to the sensor" in told.err
    found = [json.loads(name.read_text()) for name in sorted(out.glob("*.json"))]
    sums = RayCounts(**found[0]["ray_outcomes"]) + RayCounts(**found[1]["ray_outcomes"])
    assert str(sums) in told.out and sums.cast == found[0]["rays"] + found[1]["rays"]
    assert sums.on_objects == found[0]["points"] + found[1]["points"] > 0
    assert run("scan", path, "-o", out, "--on", "Car", "--frames", "1-2", "--chunk", 1, "--no-exclude-mount") == 2
    assert "differs in 'exclude_mount'" in capfd.readouterr().err
    assert run("scan", path, "-o", tmp_path / "all", "--on", "Car", "--no-exclude-mount") == 0
    told = capfd.readouterr()
    assert "28,800 hit only the mount" in told.out and "--exclude-mount" in told.err
