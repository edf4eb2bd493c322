"""`scan --format mcap`: a bag of ROS 2 whose points, images and poses fit together, as rosbags reads them."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.command_lines import run
from blender.drive_scene import HEIGHT, SENSOR, WIDTH, asked, save_drive
from perfect_bvh_addon import load_sensor, scan
from perfect_bvh_addon.datasets.bag import quaternion

NEEDS = "rosbags is not installed: pip install '.[ros]'"
POINT = np.dtype({"names": ["x", "y", "z", "intensity", "ring", "time"], "formats": ["<f4"] * 4 + ["<u2", "<f4"]})


@pytest.fixture
def file(tmp_path: Path) -> Path:
    pytest.importorskip("rosbags.highlevel", reason=NEEDS)
    return save_drive(tmp_path)


def read(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return the messages of a bag by their topics, with their times in nanoseconds."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([folder]) as reader:
        for connection, when, raw in reader.messages():
            found.setdefault(connection.topic, []).append((when, reader.deserialize(raw, connection.msgtype)))
        assert reader.message_count == sum(map(len, found.values()))
        assert {topic: info.msgcount for topic, info in reader.topics.items()} == {t: len(m) for t, m in found.items()}
    return found


def nanoseconds(message: Any) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def matrix(transform: Any) -> np.ndarray:
    x, y, z, w = (getattr(transform.rotation, name) for name in "xyzw")
    turn = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = turn, [getattr(transform.translation, name) for name in "xyz"]
    return found


def poses(messages: list[tuple[int, Any]], child: str) -> dict[int, np.ndarray]:
    """Return the poses in the map, by their stamps."""
    found = {}
    for when, message in messages:
        (stamped,) = message.transforms
        assert nanoseconds(stamped) == when and stamped.header.frame_id == "map"
        if stamped.child_frame_id == child:
            found[when] = matrix(stamped.transform)
    return found


@pytest.mark.parametrize("steps", [1, 2])
def test_points_are_where_the_sensor_measures_them(file: Path, tmp_path: Path, steps: int) -> None:
    """Each point, from the sensor's pose at its own time, is where the scan has it in the world."""
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "mcap", "--piece", 2, "--steps", steps)) == 0
    found = read(folder)
    bpy.ops.wm.open_mainfile(filepath=str(file))
    whole = scan(load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Ego"], frames=(1, 3), steps_per_frame=steps)
    places = poses(found["/tf"], "lidar")
    stamps = sorted(places)
    assert stamps == [10**9 + number * 10**8 // steps for number in range(3 * steps + 1)]
    begin = 0
    for number, (when, message) in enumerate(found["/points"]):
        assert nanoseconds(message) == when == 10**9 + number * 10**8 and message.header.frame_id == "lidar"
        assert [(each.name, each.offset, each.datatype) for each in message.fields] == [
            ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("ring", 16, 4), ("time", 18, 7),
        ]  # fmt: skip
        assert (message.point_step, message.row_step, message.height) == (22, 22 * message.width, 1)
        points = np.frombuffer(message.data.tobytes(), POINT)
        rows = slice(begin, begin + message.width)
        begin += message.width
        times = whole.times[rows]
        np.testing.assert_allclose(points["time"], times - 0.1 * number, atol=1e-7)
        assert points["time"].min() >= 0.0 and points["time"].max() < 0.1
        assert (points["ring"] == whole.ring_ids[rows]).all() and (points["intensity"] == whole.intensities[rows]).all()
        local = np.stack([points[name] for name in "xyz"], axis=1).astype(np.float64)
        for place, (first, last) in enumerate(pairwise(stamps)):
            is_in = (times + 1e-9 >= (first - 10**9) / 1e9) & (times + 1e-9 < (last - 10**9) / 1e9)
            share = ((times[is_in] + 1.0) * 1e9 - first) / (last - first)
            assert is_in.any() == (place // steps == number)
            # Positions move in a straight line; the mount turns about z alone, evenly.
            turns = [np.arctan2(places[stamp][1, 0], places[stamp][0, 0]) for stamp in (first, last)]
            turn = turns[0] + share * (turns[1] - turns[0])
            moved = places[first][:3, 3] + share[:, None] * (places[last][:3, 3] - places[first][:3, 3])
            x, y, z = local[is_in].T
            world = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1)
            np.testing.assert_allclose(world + moved, whole.positions[rows][is_in], atol=2e-5)
    assert begin == len(whole)
    spread = np.ptp([point.width for _, point in found["/points"]])
    assert spread > 0  # it moves


def test_images_and_their_camera_fit_to_the_points(file: Path, tmp_path: Path) -> None:
    images = pytest.importorskip("PIL.Image", reason="Pillow is not installed: pip install '.[data]'")
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "mcap")) == 0
    assert run("render", file, "-o", tmp_path / "images/####.png", "--frames", "1-3", "-q") == 0
    found = read(folder)
    cameras = poses(found["/tf"], "camera")
    assert [len(found[topic]) for topic in ("/camera/image_raw", "/camera/camera_info", "/points")] == [3, 3, 3]
    for number, ((when, image), (_, info)) in enumerate(
        zip(found["/camera/image_raw"], found["/camera/camera_info"], strict=True)
    ):
        assert (image.width, image.height, image.encoding, image.step) == (WIDTH, HEIGHT, "rgb8", 3 * WIDTH)
        expected = np.array(images.open(tmp_path / "images" / f"{number + 1:04d}.png").convert("RGB"))
        assert (image.data.reshape(HEIGHT, WIDTH, 3) == expected).all()
        assert (info.width, info.height, info.distortion_model) == (WIDTH, HEIGHT, "plumb_bob")
        bpy.ops.wm.open_mainfile(filepath=str(file))
        bpy.context.scene.frame_set(number + 1)
        placed = np.array(bpy.data.objects["Camera"].matrix_world) @ np.diag([1.0, -1.0, -1.0, 1.0])
        np.testing.assert_allclose(cameras[when], placed, atol=1e-5)
        # A lens of 24 mm before a sensor of 36 mm, and the middle of the image between two pixels' centres.
        assert info.k.reshape(3, 3)[0, 0] == pytest.approx(WIDTH * 24.0 / 36.0, rel=1e-5)
        assert info.k.reshape(3, 3)[:2, 2] == pytest.approx([WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5])
        assert (info.p.reshape(3, 4)[:, :3] == info.k.reshape(3, 3)).all() and (info.d == 0.0).all()


def test_each_chunk_is_a_file_of_one_bag_and_is_resumed(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "mcap", "--piece", 1)) == 0
    names = [f"points_{frame:04d}-{frame:04d}.mcap" for frame in (1, 2, 3)]
    assert sorted(path.name for path in folder.glob("*.mcap")) == names
    expected = {name: (folder / name).read_bytes() for name in (*names, "metadata.yaml")}
    (folder / names[1]).unlink()
    (folder / "metadata.yaml").unlink()
    assert run(*asked(file, folder, "mcap", "--piece", 1, "--resume")) == 0
    assert {name: (folder / name).read_bytes() for name in expected} == expected
    parts, whole = read(folder), tmp_path / "whole"
    assert run(*asked(file, whole, "mcap", "--piece", 3)) == 0
    for topic, messages in read(whole).items():
        assert [when for when, _ in messages] == [when for when, _ in parts[topic]]
        assert all(
            (one.data == other.data).all()
            for (_, one), (_, other) in zip(messages, parts[topic], strict=True)
            if topic in ("/points", "/camera/image_raw")
        )


def test_a_lost_file_is_not_in_the_bag(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "mcap", "--frames", "1,3")) == 0
    (folder / "points_0003-0003.mcap").unlink()
    assert run(*asked(file, folder, "mcap", "--frames", "1")) == 0
    assert len(read(folder)["/points"]) == 1


def test_one_pass_of_the_current_frame_is_one_message(file: Path, tmp_path: Path) -> None:
    arguments = asked(file, tmp_path / "out", "mcap")
    assert run(*arguments[: arguments.index("--frames")]) == 0
    found = read(tmp_path / "out")
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/points": 1, "/camera/image_raw": 1, "/camera/camera_info": 1, "/tf": 3,
    }  # fmt: skip


def test_without_a_camera_there_are_no_images(file: Path, tmp_path: Path, capfd: Any) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.context.scene.camera = None
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "mcap")) == 0
    assert "The scene has no camera: the bag has no images" in "".join(capfd.readouterr())
    assert {topic: len(messages) for topic, messages in read(tmp_path / "out").items()} == {"/points": 3, "/tf": 4}


def test_a_panorama_has_no_camera_info(file: Path, tmp_path: Path, capfd: Any) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.context.scene.camera.data.type = "ORTHO"
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "mcap")) == 0
    assert "the bag has no camera_info" in "".join(capfd.readouterr())
    assert {*read(tmp_path / "out")} == {"/points", "/tf", "/camera/image_raw"}


def test_nothing_in_reach_is_an_empty_cloud(file: Path, tmp_path: Path) -> None:
    (tmp_path / "sensor.toml").write_text(SENSOR + "max_distance = 0.5\n")
    assert run(*asked(file, tmp_path / "out", "mcap")) == 0
    assert [message.width for _, message in read(tmp_path / "out")["/points"]] == [0, 0, 0]


def test_without_rosbags_the_message_says_how_to_get_it(
    file: Path, tmp_path: Path, capfd: Any, monkeypatch: Any
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    assert run(*asked(file, tmp_path / "out", "mcap")) == 2
    said = capfd.readouterr().err
    assert "this format needs rosbags (perfect-bvh[ros])" in said and "-m pip install rosbags" in said
    assert run(*asked(file, tmp_path / "out", "mcap", "--labels", "class")) == 2


def test_quaternions_turn_as_matrices_do() -> None:
    random = np.random.default_rng(5)
    for _ in range(50):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        x, y, z, w = quaternion(turn)
        vector = random.normal(size=3)
        across = 2.0 * np.cross([x, y, z], vector)
        np.testing.assert_allclose(vector + w * across + np.cross([x, y, z], across), turn @ vector, atol=1e-12)
        assert w >= 0.0 and x * x + y * y + z * z + w * w == pytest.approx(1.0)
