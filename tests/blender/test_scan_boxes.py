"""Boxes of a scan's object instances: around their points, with counts and visible shares, in three formats."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.command_lines import run
from blender.drive_scene import add_box, save_drive
from perfect_bvh_addon import PointCloud, SpinningLidar, load_sensor, scan
from perfect_bvh_addon.scanning.point_cloud import BOX_COLUMNS


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return save_drive(tmp_path)


def rows_of(cloud: PointCloud, name: str) -> np.ndarray:
    return np.flatnonzero(cloud.boxes["object_ids"] == cloud.object_names.index(name))


def test_boxes_hold_their_points_and_count_them(file: Path, tmp_path: Path) -> None:
    cloud = scan(load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Ego"], boxes=True)
    boxes = cloud.boxes
    assert tuple(boxes) == BOX_COLUMNS and (boxes["frames"] == 1.0).all() and (boxes["times"] == 0.0).all()
    assert sorted(cloud.object_names[row] for row in boxes["object_ids"]) == sorted(
        ["Ground", "Wall", "Car ahead", "Half", "Hidden", "Aside", "Behind", "Walker"]
    )
    assert boxes["point_counts"].sum() == len(cloud)
    for row, (instance, count) in enumerate(zip(boxes["instance_ids"], boxes["point_counts"], strict=True)):
        points = cloud.positions[cloud.instance_ids == instance]
        local = (points - boxes["centers"][row]) @ boxes["axes"][row].T
        assert len(points) == count and (np.abs(local) <= boxes["sizes"][row] / 2 + 1e-5).all()
    (ahead,), (hidden,) = rows_of(cloud, "Car ahead"), rows_of(cloud, "Hidden")
    assert boxes["sizes"][ahead] == pytest.approx((1.8, 4.2, 1.6), abs=1e-5)
    assert boxes["axes"][ahead][0] == pytest.approx((np.cos(0.4), np.sin(0.4), 0.0), abs=1e-6)
    assert boxes["visible_shares"][ahead] == 1.0
    assert (boxes["point_counts"][hidden], boxes["visible_shares"][hidden]) == (0, 0.0)


def test_visible_shares_are_those_of_a_scan_of_the_object_alone(file: Path, tmp_path: Path) -> None:
    sensor, ego = load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Ego"]
    whole = scan(sensor, ego, boxes=True)
    for name in ("Half", "Ground", "Walker"):
        for thing in bpy.data.objects:
            thing.hide_render = thing.type == "MESH" and thing.name != name
        alone = scan(sensor, ego)
        (row,) = rows_of(whole, name)
        assert whole.boxes["visible_shares"][row] == pytest.approx(whole.boxes["point_counts"][row] / len(alone))
    assert 0.0 < whole.boxes["visible_shares"][rows_of(whole, "Half")[0]] < 1.0


def test_boxes_are_where_each_interval_begins(file: Path, tmp_path: Path) -> None:
    sensor, ego = load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Ego"]
    cloud = scan(sensor, ego, frames=(1, 3), steps_per_frame=2, boxes=True)
    rows = rows_of(cloud, "Ground")
    assert cloud.boxes["frames"][rows].tolist() == [1.0, 1.5, 2.0, 2.5, 3.0, 3.5]
    assert cloud.boxes["times"][rows] == pytest.approx(np.arange(6) / 20)
    rows = rows_of(cloud, "Walker")
    assert cloud.boxes["frames"][rows].tolist() == [1.0, 2.0, 3.0]  # half a turn each: to the right, then to the left
    for frame, center in zip(cloud.boxes["frames"][rows], cloud.boxes["centers"][rows], strict=True):
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
        assert center == pytest.approx(tuple(bpy.data.objects["Walker"].matrix_world.translation), abs=1e-6)
    assert cloud.boxes["point_counts"].sum() == len(cloud)


def test_points_of_each_instance_are_counted_with_light(file: Path, tmp_path: Path) -> None:
    plain = add_box("Plain", (0.0, 4.0, 0.5), (0.5, 0.5, 1.0))
    twin = bpy.data.objects.new("Twin", plain.data)
    twin.location, twin.scale = (0.8, 5.0, 0.5), (0.5, 0.5, -1.0)
    bpy.context.scene.collection.objects.link(twin)
    cloud = scan(load_sensor("spinning-16"), bpy.data.objects["Ego"], boxes=True, seed=3)
    found = dict(zip(cloud.boxes["instance_ids"].tolist(), cloud.boxes["point_counts"].tolist(), strict=True))
    ids, counts = np.unique(cloud.instance_ids, return_counts=True)
    assert {one: count for one, count in found.items() if count} == dict(
        zip(ids.tolist(), counts.tolist(), strict=True)
    )
    assert len(rows_of(cloud, "Twin")) == 1 and (cloud.boxes["visible_shares"] <= 1.0).all()


@pytest.mark.parametrize("suffix", ["npz", "parquet", "h5"])
def test_files_have_boxes(file: Path, tmp_path: Path, suffix: str) -> None:
    pytest.importorskip({"npz": "numpy", "parquet": "pyarrow.parquet", "h5": "h5py"}[suffix])
    asked = ("--sensor", tmp_path / "sensor.toml", "--on", "Ego", "--format", suffix, "--boxes", "-q")
    assert run("scan", file, "-o", tmp_path / "out", *asked) == 0
    path = tmp_path / "out" / f"points_0001-0001.{suffix}"
    bpy.ops.wm.open_mainfile(filepath=str(file))
    cloud = scan(load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Ego"], boxes=True)
    for name, expected in cloud.boxes.items():
        np.testing.assert_array_equal(np.array(read_boxes(path, name), expected.dtype), expected)


def read_boxes(path: Path, name: str) -> Any:
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return arrays[f"box_{name}"]
    if path.suffix == ".h5":
        import h5py

        with h5py.File(path) as arrays:
            return arrays[f"box_{name}"][:]
    import pyarrow.parquet

    return json.loads(pyarrow.parquet.read_schema(path).metadata[b"boxes"])[name]


def test_nothing_in_reach_has_no_boxes(file: Path) -> None:
    cloud = scan(SpinningLidar(max_distance=0.1), bpy.data.objects["Ego"], boxes=True)
    assert [(len(column), column.dtype) for column in cloud.boxes.values()] == [
        (0, column.dtype) for column in scan(SpinningLidar(), bpy.data.objects["Ego"], boxes=True).boxes.values()
    ]
    assert scan(SpinningLidar(), bpy.data.objects["Ego"]).boxes == {}


def test_formats_without_a_place_for_them_are_refused(file: Path, tmp_path: Path, capfd: Any) -> None:
    assert run("scan", file, "-o", tmp_path / "out", "--format", "las", "--boxes", "-q") == 2
    assert "las has no table of boxes: leave them out, or write one of npz, parquet, h5" in capfd.readouterr().err
    assert run("scan", file, "-o", tmp_path / "out", "--category", "class", "-q") == 2
    assert "npz has no categories: leave the category out, or write kitti" in capfd.readouterr().err
