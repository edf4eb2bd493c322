"""`perfect-bvh scan`: its chunks together equal one scan, and a second run recognises them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.command_lines import run  # noqa: E402
from blender.sensor_flight import SENSOR, contents, save_flight  # noqa: E402
from perfect_bvh_addon import SpinningLidar, load_sensor, scan  # noqa: E402
from perfect_bvh_addon.scanning.piece_scan import pieces_of  # noqa: E402


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    return save_flight(tmp_path)


def scanned(small_file: Path, folder: Path, *more: object) -> int:
    asked = ("--sensor", small_file.parent / "sensor.toml", "--on", "Head", "--frames", "1-6", "--chunk", 2, "-q")
    return run("scan", small_file, "-o", folder, *asked, *more)


def columns(folder: Path) -> dict[str, Any]:
    """Concatenate the columns of all chunks."""
    found = [dict(np.load(path)) for path in sorted(folder.glob("*.npz"))]
    return {
        name: np.concatenate([each[name] for each in found]) for name in ("positions", "times", "ring_ids", "ray_ids")
    }


def test_pieces_together_are_the_whole_scan(small_file: Path, tmp_path: Path) -> None:
    assert scanned(small_file, tmp_path / "out") == 0
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == [f"points_{a:04d}-{a + 1:04d}.{suffix}" for a in (1, 3, 5) for suffix in ("json", "npz")]
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    pattern = SpinningLidar(elevations=tuple(np.linspace(-30.0, 30.0, 9).tolist()), columns=120, rate=12)
    whole = scan(pattern, bpy.data.objects["Head"], frames=(1, 6))
    found = columns(tmp_path / "out")
    assert np.array_equal(found["positions"], whole.positions)
    assert np.array_equal(found["times"], whole.times)
    assert np.array_equal(found["ray_ids"], whole.ray_ids)
    manifest = json.loads((tmp_path / "out" / "points_0003-0004.json").read_text())
    assert set(manifest["object_names"]) == {"Cube", "Sheet"} and "Infinity" not in str(manifest)
    assert manifest["frames"] == [3, 4] and manifest["rays"] == 9 * 120 and manifest["points"] > 100


def test_what_is_there_and_whole_is_not_done_again(small_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert scanned(small_file, out) == 0
    whole, missing, damaged = (out / f"points_{a:04d}-{a + 1:04d}.npz" for a in (1, 3, 5))
    contents = [path.read_bytes() for path in (whole, missing, damaged)]
    before = whole.stat().st_mtime_ns
    missing.unlink()
    damaged.write_bytes(contents[2][:-100] + bytes(100))
    assert scanned(small_file, out, "--resume") == 0
    assert whole.stat().st_mtime_ns == before
    assert [path.read_bytes() for path in (whole, missing, damaged)] == contents
    for text in ("{", "3", "{}", '{"inputs": null}', '{"inputs": {}, "frames": 3}'):
        (out / "points_0001-0002.json").write_text(text)
        assert scanned(small_file, out, "--resume") == 0
        assert whole.stat().st_mtime_ns > before and whole.read_bytes() == contents[0]


def test_a_folder_of_another_scan_is_refused(small_file: Path, tmp_path: Path, capfd: Any) -> None:
    out = tmp_path / "out"
    assert scanned(small_file, out) == 0
    kept = contents(out)
    for changed in (("--steps", 3), ("--on", "Cube"), ("--chunk", 4)):
        assert scanned(small_file, out, *changed) == 2
        assert "has chunks of another scan" in capfd.readouterr().err
    (tmp_path / "sensor.toml").write_text(SENSOR.replace("120", "60"))
    assert scanned(small_file, out, "--resume") == 2
    assert "differs in 'sensor'" in capfd.readouterr().err
    assert contents(out) == kept


@pytest.mark.parametrize("suffix", ["ply", "laz", "parquet"])
def test_pieces_have_the_format_that_is_asked_for(small_file: Path, tmp_path: Path, suffix: str) -> None:
    pytest.importorskip({"ply": "plyfile", "laz": "lazrs", "parquet": "pyarrow"}[suffix])
    assert scanned(small_file, tmp_path / "out", "--format", suffix) == 0
    assert len(list((tmp_path / "out").glob(f"*.{suffix}"))) == 3


def test_a_seed_makes_the_noise_and_is_told_apart(small_file: Path, tmp_path: Path, capfd: Any) -> None:
    """Chunks with noise together equal one scan; another seed, or other noise, makes another scan."""
    noisy = SENSOR + "[noise]\nrange = 0.05\ndropout = 0.1\n"
    (tmp_path / "sensor.toml").write_text(noisy)
    assert scanned(small_file, tmp_path / "out", "--seed", 7) == 0
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    sensor, head = load_sensor(tmp_path / "sensor.toml"), bpy.data.objects["Head"]
    found = columns(tmp_path / "out")
    for seed in (7, 8):
        whole = scan(sensor, head, frames=(1, 6), seed=seed)
        assert np.array_equal(found["ray_ids"], whole.ray_ids) == (seed == 7)
        assert np.array_equal(found["positions"], whole.positions) == (seed == 7)
    manifest = json.loads((tmp_path / "out" / "points_0003-0004.json").read_text())
    assert manifest["inputs"]["seed"] == 7 and manifest["inputs"]["light"]["noise"]["range"] == 0.05
    assert scanned(small_file, tmp_path / "out", "--seed", 7, "--resume") == 0
    assert scanned(small_file, tmp_path / "out", "--seed", 8) == 2
    assert "differs in 'seed'" in capfd.readouterr().err
    (tmp_path / "sensor.toml").write_text(noisy.replace("0.05", "0.06"))
    assert scanned(small_file, tmp_path / "out", "--seed", 7) == 2
    assert "differs in 'light'" in capfd.readouterr().err


def test_without_frames_it_is_one_whole_pass(small_file: Path, tmp_path: Path) -> None:
    sensor = small_file.parent / "sensor.toml"
    assert run("scan", small_file, "-o", tmp_path / "out", "--sensor", sensor, "--on", "Head", "-q") == 0
    manifest = json.loads((tmp_path / "out" / "points_0001-0001.json").read_text())
    assert manifest["rays"] == 9 * 120 and manifest["pose_error"] is None
    assert run("scan", small_file, "-o", tmp_path / "out", "--sensor", sensor, "--on", "Head", "--frames", 1, "-q") == 2


def test_sensors_are_listed(capfd: Any) -> None:
    assert run("scan", "--list-sensors") == 0
    lines = capfd.readouterr().out.splitlines()
    assert len(lines) == 8 and any(line.startswith("spinning-64 ") for line in lines)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--sensor", "spining-16"), "is it 'spinning-16'?"),
        (("--sensor", "missing.toml"), "No such file"),
        (("--on", "Haed"), "is it 'Head'?"),
        (("--format", "xyz"), "the format must be one of npz, ply"),
        (("--steps", "0"), "must be at least 1"),
        (("--seed", "-1"), "must be a whole number from 0 to 2147483647, got '-1'"),
    ],
)
def test_mistakes_are_named(small_file: Path, tmp_path: Path, capfd: Any, more: tuple[str, ...], said: str) -> None:
    assert scanned(small_file, tmp_path / "out", *more) == 2
    assert said in capfd.readouterr().err


def test_a_scan_needs_a_file_and_a_folder(tmp_path: Path, capfd: Any) -> None:
    assert run("scan") == 2
    assert "expected FILE.blend" in capfd.readouterr().err
    assert run("scan", tmp_path / "a.blend") == 2
    assert "expected -o DIR" in capfd.readouterr().err


def test_pieces_are_runs_of_frames() -> None:
    assert [(piece.first, piece.last) for piece in pieces_of([1, 2, 3, 4, 5, 9, 11, 12], 2)] == [
        (1, 2),
        (3, 4),
        (5, 5),
        (9, 9),
        (11, 12),
    ]


def test_two_eyes_see_less_than_one(registered: None) -> None:
    """Behind the edge of a near plate is a strip that the second eye, to the right, does not see."""
    from perfect_bvh_addon import DepthCamera

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=2.0, location=(0.0, 2.0, 0.0), rotation=(np.pi / 2, 0.0, 0.0))
    bpy.ops.mesh.primitive_plane_add(size=40.0, location=(0.0, 4.0, 0.0), rotation=(np.pi / 2, 0.0, 0.0))
    eye = bpy.data.objects.new("Eye", None)
    bpy.context.scene.collection.objects.link(eye)
    bpy.context.view_layer.update()
    how = {"width": 160, "height": 120, "horizontal": 80.0, "vertical": 60.0}
    one = scan(DepthCamera(**how), eye)
    two = scan(DepthCamera(**how, baseline=0.2), eye)
    lost = np.setdiff1d(one.ray_ids, two.ray_ids)
    at = one.positions[np.isin(one.ray_ids, lost)]
    # On the wall, to the left of the area that the first eye sees past the plate's left edge: up to .2 m wide there.
    assert len(lost) > 50 and np.allclose(at[:, 1], 4.0)
    assert (at[:, 0] >= -2.2 - 1e-6).all() and (at[:, 0] <= -2.0 + 1e-6).all()


def test_what_is_simulated_is_played_again(small_file: Path, tmp_path: Path) -> None:
    """A falling cube has its simulated position in the last chunk, although the earlier chunks are kept."""
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.context.view_layer.objects.active = cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    cube.location.z = 8.0
    bpy.ops.rigidbody.object_add()
    bpy.ops.wm.save_mainfile()
    out = tmp_path / "out"
    assert scanned(small_file, out) == 0
    last = out / "points_0005-0006.npz"
    content = last.read_bytes()
    last.unlink()
    assert scanned(small_file, out, "--resume") == 0
    assert last.read_bytes() == content


def test_a_sensor_s_object_that_is_deleted_is_named(small_file: Path, tmp_path: Path, capfd: Any) -> None:
    @bpy.app.handlers.persistent
    def delete(scene: Any, *_: Any) -> None:
        if scene.frame_current == 4 and "Head" in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects["Head"])

    bpy.app.handlers.frame_change_pre.append(delete)
    try:
        assert scanned(small_file, tmp_path / "out") == 2
    finally:
        bpy.app.handlers.frame_change_pre.remove(delete)
    assert "frames 3-4: scan: the sensor 'Head' was deleted during the scan" in capfd.readouterr().err
    assert sorted(path.name for path in (tmp_path / "out").glob("*.npz")) == ["points_0001-0002.npz"]


def test_a_library_that_has_changed_is_noticed(small_file: Path, tmp_path: Path, capfd: Any) -> None:
    library = tmp_path / "library.blend"
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    bpy.context.object.name = "Linked"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    with bpy.data.libraries.load(str(library), link=True) as (_, to):
        to.objects = ["Linked"]
    bpy.context.scene.collection.objects.link(to.objects[0])
    bpy.ops.wm.save_mainfile()
    assert scanned(small_file, tmp_path / "out") == 0
    bpy.ops.wm.open_mainfile(filepath=str(library))
    bpy.data.objects["Linked"].scale *= 2.0
    bpy.ops.wm.save_mainfile()
    assert scanned(small_file, tmp_path / "out", "--resume") == 2
    assert "differs in 'files'" in capfd.readouterr().err


def test_the_camera_of_a_marker_does_not_stay(registered: None) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    cameras = []
    for name in "ABC":
        camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
        scene.collection.objects.link(camera)
        cameras.append(camera)
    for frame, camera in ((1, cameras[0]), (3, cameras[1])):
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.camera = cameras[2]
    scan(SpinningLidar(columns=10), cameras[2], frames=(1, 4))
    assert scene.camera == cameras[2] and scene.frame_current == 1
