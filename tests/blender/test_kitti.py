"""`scan --format kitti`: points, images, calibration and boxes that fit together, and that pykitti opens."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh_addon
import pytest
from blender.command_lines import run
from blender.drive_scene import HEIGHT, SENSOR, WIDTH, asked, pykitti, save_drive
from perfect_bvh_addon import label_image, load_sensor, scan

FOLDERS = {"image_2": "png", "velodyne": "bin", "calib": "txt", "label_2": "txt"}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return save_drive(tmp_path)


def contents(folder: Path) -> dict[str, bytes]:
    """Read all files but the manifests of chunks."""
    paths = sorted(path for path in folder.rglob("*.*") if path.is_file() and path.suffix != ".json")
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def boxes(folder: Path, frame: int) -> list[dict[str, Any]]:
    """Read the labels of a frame as the development kit of KITTI does."""
    found = []
    for line in (folder / "training" / "label_2" / f"{frame:06d}.txt").read_text().splitlines():
        kind, *numbers = line.split(" ")
        assert len(numbers) == 14
        values = [float(number) for number in numbers]
        names = ("truncated", "occluded", "alpha", *("left", "top", "right", "bottom"), *"hwlxyz", "turn")
        found.append({"kind": kind, **dict(zip(names, values, strict=True))})
    return found


def calibration(folder: Path, frame: int) -> dict[str, np.ndarray]:
    lines = (folder / "training" / "calib" / f"{frame:06d}.txt").read_text().splitlines()
    values = {line.split(":")[0]: np.array(line.split(":")[1].split(), float) for line in lines}
    assert list(values) == ["P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo"]
    return {name: value.reshape(3, -1) for name, value in values.items()}


def in_box(points: np.ndarray, box: dict[str, Any]) -> np.ndarray:
    """Return which points of the camera's space are in a box, with a millimetre to spare."""
    turn = box["turn"]
    local = points - [box["x"], box["y"], box["z"]]
    along = local @ [np.cos(turn), 0.0, -np.sin(turn)]
    across = local @ [np.sin(turn), 0.0, np.cos(turn)]
    is_in = (np.abs(along) <= box["l"] / 2 + 1e-3) & (np.abs(across) <= box["w"] / 2 + 1e-3)
    return is_in & (local[:, 1] <= 1e-3) & (local[:, 1] >= -box["h"] - 1e-3)


def test_pykitti_opens_it(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "kitti", "--category", "class", "--piece", 2)) == 0
    drive = pykitti(monkeypatch).odometry(str(folder), "00")
    assert len(drive) == len(drive.poses) == len(drive.cam2_files) == len(drive.velo_files) == 3
    assert [time.total_seconds() for time in drive.timestamps] == pytest.approx([0.0, 0.1, 0.2])
    assert (
        drive.get_cam2(0).size == (WIDTH, HEIGHT)
        and len(np.unique(np.array(drive.get_cam2(2)).reshape(-1, 3), axis=0)) > 10
    )
    np.testing.assert_allclose(drive.poses[0], np.eye(4), atol=1e-9)
    bpy.ops.wm.open_mainfile(filepath=str(file))
    sensor = load_sensor(file.parent / "sensor.toml")
    views = []
    for number, frame in enumerate((1, 2, 3)):
        bpy.context.scene.frame_set(frame)
        cloud = scan(sensor, bpy.data.objects["Ego"])
        views.append(np.array(bpy.data.objects["Camera"].matrix_world) @ np.diag([1.0, -1.0, -1.0, 1.0]))
        points = drive.get_velo(number)
        np.testing.assert_allclose(points[:, 3], cloud.intensities)
        world = views[0] @ drive.poses[number] @ drive.calib.T_cam0_velo @ np.c_[points[:, :3], np.ones(len(points))].T
        np.testing.assert_allclose(world[:3].T, cloud.positions, atol=2e-5)
        # Ahead is x, to the left y: the car Aside is to the left, the car Behind behind.
        middle = {
            name: points[cloud.object_ids == cloud.object_names.index(name)].mean(axis=0)
            for name in ("Aside", "Behind")
        }
        assert (
            middle["Aside"][1] > 3.0
            and middle["Behind"][0] < -5.0
            and points[:, 2].min() == pytest.approx(-1.7, abs=1e-3)
        )


def test_points_are_in_their_objects_boxes_and_on_their_pixels(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "kitti")) == 0
    bpy.ops.wm.open_mainfile(filepath=str(file))
    sensor = load_sensor(file.parent / "sensor.toml")
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        cloud, labels = scan(sensor, bpy.data.objects["Ego"]), label_image()
        points = np.fromfile(folder / "training" / "velodyne" / f"{frame:06d}.bin", np.float32).reshape(-1, 4)
        calib = calibration(folder, frame)
        seen = np.c_[points[:, :3], np.ones(len(points))] @ calib["Tr_velo_to_cam"].T
        found = {box["kind"]: box for box in boxes(folder, frame)}
        assert set(found) == {"Ground", "Wall", "Car_ahead", "Half", "Aside", "Walker"}
        names = np.array([name.replace(" ", "_") for name in cloud.object_names])[cloud.object_ids]
        for kind, box in found.items():
            assert in_box(seen[names == kind], box).all() and (names == kind).sum() > 3
            if kind != "Ground":
                assert not in_box(seen[(names != kind) & (names != "Ground")], box).any()
        pixels = np.c_[seen, np.ones(len(seen))] @ calib["P2"].T
        ahead = seen[:, 2] > 0.1
        places = np.round(pixels[ahead, :2] / pixels[ahead, 2:]).astype(int)
        inside = ((places >= 0) & (places < [WIDTH, HEIGHT])).all(axis=1)
        rows = labels.thing_ids[places[inside, 1], places[inside, 0]]
        shown = np.array([thing.name.replace(" ", "_") for thing in labels.things] + [""])[rows]
        assert inside.sum() > 500 and (shown == names[ahead][inside]).mean() > 0.95  # but at outlines


def test_labels_are_those_of_the_objects(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "kitti", "--category", "class", "--frames", "1")) == 0
    found = boxes(folder, 1)
    assert sorted(box["kind"] for box in found) == ["Car", "Car", "Car", "On_foot"]
    ahead, half, aside = sorted(
        (box for box in found if box["kind"] == "Car"), key=lambda box: box["x"] != pytest.approx(-1.1, abs=0.01)
    )
    half, aside = sorted((half, aside), key=lambda box: -box["x"])
    # The front of an object is its -Y: at a turn of 0 it faces the sensor, which in KITTI is a quarter turn.
    assert (ahead["h"], ahead["w"], ahead["l"]) == pytest.approx((1.6, 1.8, 4.2), abs=1e-3)
    assert (ahead["x"], ahead["y"], ahead["z"]) == pytest.approx((-1.1, 1.5, 11.4), abs=1e-3)
    assert ahead["turn"] == pytest.approx(np.pi / 2 - 0.4, abs=1e-3)
    assert ahead["alpha"] == pytest.approx(ahead["turn"] - np.arctan2(-1.1, 11.4), abs=1e-3)
    assert [box["occluded"] for box in (ahead, half)] == [0, 2]
    assert ahead["truncated"] == 0.0 and aside["truncated"] > 0.2 and aside["left"] == 0.0
    assert 0 < ahead["left"] < ahead["right"] < WIDTH and 0 < ahead["top"] < ahead["bottom"] < HEIGHT


def test_boxes_hold_what_leans(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.data.objects["Camera"].rotation_euler = (1.35, 0.2, 0.1)
    bpy.data.objects["Car ahead"].rotation_euler = (np.pi / 2, 0.0, 0.3)
    bpy.data.objects["Walker"].rotation_euler = (0.4, -0.5, 0.3)
    bpy.data.objects["Half"].scale = (-1.8, 4.2, 0.0)
    bpy.ops.wm.save_mainfile()
    folder = tmp_path / "out"
    assert run(*asked(file, folder, "kitti", "--frames", "1")) == 0
    bpy.ops.wm.open_mainfile(filepath=str(file))
    cloud = scan(load_sensor(file.parent / "sensor.toml"), bpy.data.objects["Ego"])
    points = np.fromfile(folder / "training" / "velodyne" / "000001.bin", np.float32).reshape(-1, 4)
    seen = np.c_[points[:, :3], np.ones(len(points))] @ calibration(folder, 1)["Tr_velo_to_cam"].T
    names = np.array([name.replace(" ", "_") for name in cloud.object_names])[cloud.object_ids]
    found = {box["kind"]: box for box in boxes(folder, 1)}
    assert {"Car_ahead", "Walker"} < set(found)
    for kind, box in found.items():
        assert in_box(seen[names == kind], box).all(), kind


def test_chunks_are_the_same_bytes_and_are_resumed(file: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "out"
    (tmp_path / "sensor.toml").write_text(SENSOR + "[noise]\nrange = 0.02\ndropout = 0.1\n")
    assert run(*asked(file, folder, "kitti", "--piece", 1)) == 0
    expected = contents(folder)
    assert {Path(name).parts[1] for name in expected if name.startswith("training")} == set(FOLDERS)
    assert run(*asked(file, tmp_path / "whole", "kitti", "--piece", 3)) == 0
    assert contents(tmp_path / "whole") == expected
    (folder / "training" / "label_2" / "000002.txt").unlink()
    (folder / "training" / "velodyne" / "000003.bin").write_bytes(b"")
    (folder / "poses" / "00.txt").unlink()
    kept = (folder / "training" / "image_2" / "000001.png").stat().st_mtime_ns
    assert run(*asked(file, folder, "kitti", "--piece", 1, "--resume")) == 0
    assert contents(folder) == expected
    assert (folder / "training" / "image_2" / "000001.png").stat().st_mtime_ns == kept
    assert run(*asked(file, folder, "kitti", "--piece", 1, "--category", "class")) == 2
    assert "differs in 'category'" in capfd.readouterr().err


def test_each_pass_has_its_own_noise(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    for name in ("Ego", "Walker"):
        bpy.data.objects[name].animation_data_clear()
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "still", "kitti")) == 0
    (tmp_path / "sensor.toml").write_text(SENSOR + "[noise]\nrange = 0.02\n")
    assert run(*asked(file, tmp_path / "noisy", "kitti")) == 0
    still, noisy = (
        [np.fromfile(path, np.float32).reshape(-1, 4) for path in sorted((tmp_path / name).glob("training/*/*.bin"))]
        for name in ("still", "noisy")
    )
    assert len(still) == 3 and (still[0] == still[1]).all() and (still[0] == still[2]).all()
    for one, other in combinations(noisy, 2):
        off = np.linalg.norm(one[:, :3], axis=1) - np.linalg.norm(other[:, :3], axis=1)
        assert 0.015 < off.std() < 0.045


def test_the_button_writes_the_same_bytes(file: Path, tmp_path: Path) -> None:
    arguments = asked(file, tmp_path / "command", "kitti", "--category", "class", "--piece", 2)
    assert run(*arguments) == 0
    perfect_bvh_addon.register()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(file))
        settings = bpy.context.scene.perfect_bvh.scan
        settings.pattern, settings.sensor_file = "FILE", str(tmp_path / "sensor.toml")
        settings.sensor, settings.frames, settings.frames_per_file = bpy.data.objects["Ego"], "SCENE", 2
        settings.use_points, settings.use_files, settings.folder = False, True, str(tmp_path / "panel")
        settings.file_format, settings.category = "kitti", "class"
        assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
        assert bpy.context.scene.frame_current == 1
        settings.steps_per_frame = 2
        with pytest.raises(RuntimeError, match="one moment for each frame"):
            bpy.ops.perfect_bvh.scan()
    finally:
        perfect_bvh_addon.unregister()
    assert contents(tmp_path / "panel") == contents(tmp_path / "command")


def test_later_frames_are_added(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    for frames in ("1", "3,1"):  # in any order
        assert run(*asked(file, folder, "kitti", "--frames", frames)) == 0
    assert (folder / "ImageSets" / "trainval.txt").read_text().split() == ["000001", "000003"]
    assert len((folder / "poses" / "00.txt").read_text().splitlines()) == 2
    assert [float(line) for line in (folder / "sequences" / "00" / "times.txt").read_text().split()] == [0.0, 0.2]


def test_a_chunk_with_a_lost_file_is_left_out_and_files_of_others_stay(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    other = folder / "sequences" / "00" / "velodyne" / "mine.bin"
    other.parent.mkdir(parents=True)
    other.write_text("mine")
    assert run(*asked(file, folder, "kitti", "--frames", "1,3")) == 0
    (folder / "training" / "velodyne" / "000003.bin").unlink()
    assert run(*asked(file, folder, "kitti", "--frames", "1")) == 0
    assert (folder / "ImageSets" / "trainval.txt").read_text().split() == ["000001"]
    assert other.read_text() == "mine"


def test_a_blank_class_is_none(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.data.objects["Car ahead"]["class"], bpy.data.objects["Aside"]["class"] = " ", "  a  Van "
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "kitti", "--category", "class", "--frames", "1")) == 0
    assert sorted(box["kind"] for box in boxes(tmp_path / "out", 1)) == ["Car", "On_foot", "a_Van"]


def test_a_frame_without_points_or_objects_is_a_frame(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    for thing in list(bpy.data.objects):
        if thing.type == "MESH":
            bpy.data.objects.remove(thing)
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "kitti")) == 0
    drive = pykitti(monkeypatch).odometry(str(tmp_path / "out"), "00")
    assert [len(points) for points in drive.velo] == [0, 0, 0] and boxes(tmp_path / "out", 2) == []


def test_a_camera_that_moves_against_the_sensor_is_named(file: Path, tmp_path: Path, capfd: Any) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.data.objects["Camera"].parent = None
    bpy.data.objects["Camera"].location.z = 1.5
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "kitti")) == 0
    assert "sequences/00/calib.txt is right in the first frame alone" in "".join(capfd.readouterr())
    found = [calibration(tmp_path / "out", frame)["Tr_velo_to_cam"] for frame in (1, 3)]
    assert not np.allclose(*found, atol=0.1)


def test_a_border_that_does_not_crop_is_named(file: Path, tmp_path: Path, capfd: Any) -> None:
    for is_cropped in (False, True):
        bpy.ops.wm.open_mainfile(filepath=str(file))
        render = bpy.context.scene.render
        render.use_border, render.border_min_x, render.use_crop_to_border = True, 0.5, is_cropped
        bpy.ops.wm.save_mainfile()
        assert run(*asked(file, tmp_path / f"out {is_cropped}", "kitti", "--frames", "1")) == 0
        assert ("black outside of the render border" in "".join(capfd.readouterr())) == (not is_cropped)


def test_a_file_in_a_folders_place_is_named(file: Path, tmp_path: Path, capfd: Any) -> None:
    place = tmp_path / "out" / "sequences" / "00" / "image_2"
    place.parent.mkdir(parents=True)
    place.write_text("mine")
    assert run(*asked(file, tmp_path / "out", "kitti", "--frames", "1")) == 2
    assert f"cannot write {place}" in capfd.readouterr().err and place.read_text() == "mine"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--labels", "class"), "--format: kitti has no columns for labels: leave them out, or write npz"),
        (("--steps", 2), "--format: kitti has one moment for each frame"),
        (("--boxes",), "--format: kitti has no table of boxes: leave them out, or write one of npz, parquet, h5"),
        (("--frames", "1-2", "--category", "clas"), "a custom property 'clas' that could be a label (is it 'class'?)"),
    ],
)
def test_mistakes_are_named(file: Path, tmp_path: Path, capfd: Any, more: tuple[object, ...], said: str) -> None:
    assert run(*asked(file, tmp_path / "out", "kitti", *more)) == 2
    assert said in capfd.readouterr().err


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (
            lambda scene: setattr(scene, "camera", None),
            "kitti: scene 'Scene' has no camera for images and boxes: add one",
        ),
        (lambda scene: setattr(scene.camera.data, "type", "ORTHO"), "must be a perspective one, not orthographic"),
        (lambda scene: setattr(scene.perfect_bvh, "mode", "DEPTH"), "the mode depth has no colors: choose another"),
    ],
)
def test_a_scene_without_a_picture_is_refused(
    file: Path, tmp_path: Path, capfd: Any, registered: None, edit: Any, said: str
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    edit(bpy.context.scene)
    bpy.ops.wm.save_mainfile()
    assert run(*asked(file, tmp_path / "out", "kitti")) == 2
    assert said in capfd.readouterr().err
