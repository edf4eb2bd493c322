"""`perfect-bvh labels`: its files agree with the images of `perfect-bvh render`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
from blender.command_lines import run, save_small_file  # noqa: E402
from oracles.exr import read_exr  # noqa: E402


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.blend"
    save_small_file(path)
    return path


def test_frames_are_labelled_as_they_are_rendered(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "labels"
    arguments = ("--frames", "1-2", "--layers", 2, "--flow", "-q")
    assert run("labels", small_file, "-o", folder, *arguments) == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        "coco_0001-0002.json",
        "labels_0001-0002.coco.jsonl",
        "labels_0001-0002.json",
        "labels_0001.npz",
        "labels_0002.npz",
    ]
    for frame in (1, 2):
        image = tmp_path / f"depth_{frame}.exr"
        arguments = ("--mode", "depth", "--samples", 1, "--frames", frame, "-q")
        assert run("render", small_file, "-o", image, *arguments) == 0
        (depth,) = (plane for name, plane in read_exr(image).items() if name.endswith("R"))
        with np.load(folder / f"labels_{frame:04d}.npz") as data:
            assert np.array_equal(data["depth"], depth)
            assert data["layer_depths"].shape == (2, 36, 64)
            assert np.abs(data["flow"]).max() > 0.1
    content = json.loads((folder / "coco_0001-0002.json").read_text())
    assert [image["file_name"] for image in content["images"]] == ["frame_0001.png", "frame_0002.png"]
    assert {row["name"] for row in content["annotations"]} == {"Cube", "Sheet"}


def test_what_renders_do_not_show_has_no_label(small_file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.data.objects["Cube"].hide_render = True
    bpy.ops.wm.save_mainfile()
    assert run("labels", small_file, "-o", tmp_path / "labels", "--no-coco", "-q") == 0
    (path,) = (tmp_path / "labels").glob("*.npz")
    with np.load(path) as data:
        assert [thing["name"] for thing in json.loads(str(data["things"]))] == ["Sheet"]


def test_a_cropped_render_region_is_labelled_as_it_is_rendered(small_file: Path, tmp_path: Path) -> None:
    """Compare with the depth of the render, and with the same region of the whole frame's labels."""
    arguments = ("--layers", 2, "--flow", "-q")
    assert run("labels", small_file, "-o", tmp_path / "whole", *arguments) == 0
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    render = bpy.context.scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.27, 0.81, 0.13, 0.7
    bpy.ops.wm.save_mainfile()
    assert run("labels", small_file, "-o", tmp_path / "part", *arguments) == 0
    image = tmp_path / "depth.exr"
    assert run("render", small_file, "-o", image, "--mode", "depth", "--samples", 1, "-q") == 0
    (depth,) = (plane for name, plane in read_exr(image).items() if name.endswith("R"))
    rows, columns = slice(36 - int(0.7 * 36), 36 - int(0.13 * 36)), slice(int(0.27 * 64), int(0.81 * 64))
    with (
        np.load(tmp_path / "whole" / "labels_0001.npz") as whole,
        np.load(tmp_path / "part" / "labels_0001.npz") as part,
    ):
        assert np.array_equal(part["depth"], depth) and (depth < 100.0).any()
        for name in ("depth", "positions", "normals", "flow"):
            assert np.array_equal(part[name], whole[name][rows, columns]), name
        assert np.array_equal(part["layer_depths"], whole["layer_depths"][:, rows, columns])
    (row,) = json.loads((tmp_path / "part" / "coco_0001-0001.json").read_text())["images"]
    assert (row["height"], row["width"]) == depth.shape


def test_flow_of_what_viewports_show(small_file: Path, tmp_path: Path) -> None:
    for name, more in (("render", ()), ("viewport", ("--viewport",))):
        assert run("labels", small_file, "-o", tmp_path / name, "--flow", "--no-coco", "-q", *more) == 0
    with np.load(tmp_path / "render/labels_0001.npz") as one, np.load(tmp_path / "viewport/labels_0001.npz") as other:
        assert np.array_equal(one["flow"], other["flow"]) and np.abs(one["flow"]).max() > 0.1


@pytest.mark.parametrize("command", ["render", "labels", "info"])
def test_a_percentage_that_leaves_no_pixel_is_refused(
    small_file: Path, tmp_path: Path, capfd: Any, command: str
) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 160, 99, 1
    bpy.ops.wm.save_mainfile()
    output = [] if command == "info" else ["-o", tmp_path / f"{command}.png"]
    assert run(command, small_file, *output) == 2
    said = capfd.readouterr().err
    assert "160 x 99 pixels at 1 % are 1 x 0, which is no image; choose a larger resolution" in said
    assert ("--size 960x540" in said) == (command != "info")


def test_a_percentage_that_leaves_one_pixel_is_honoured(small_file: Path, tmp_path: Path) -> None:
    """Blender renders less than its minimum resolution if a percentage asks for it."""
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 299, 100, 1
    bpy.ops.wm.save_mainfile()
    image = tmp_path / "depth.exr"
    assert run("render", small_file, "-o", image, "--mode", "depth", "--samples", 1, "-q") == 0
    (depth,) = (plane for name, plane in read_exr(image).items() if name.endswith("R"))
    assert run("labels", small_file, "-o", tmp_path / "labels", "-q") == 0
    with np.load(tmp_path / "labels" / "labels_0001.npz") as data:
        assert data["depth"].shape == (1, 2) and np.array_equal(data["depth"], depth)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--layers", "0"), "must be 1 to 1000"),
        (("--frames", "x"), "expected frames such as"),
        (("--size", "1x3"), "no side below 4 pixels, got 1x3; render a larger image and crop it"),
        (("--depth-scale", "0.01"), "--depth-scale applies to PNG files: add png or bop to --format"),
        (("-o", "{file}"), "expected a folder, but it is a file"),
    ],
)
def test_mistakes_are_named(
    small_file: Path, tmp_path: Path, capfd: Any, arguments: tuple[str, ...], said: str
) -> None:
    given = [text.format(file=small_file) for text in arguments]
    assert run("labels", small_file, "-o", tmp_path / "labels", *given) == 2
    assert said in capfd.readouterr().err


def test_what_is_there_and_whole_is_not_labelled_again(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "labels"
    asked = ("labels", small_file, "-o", folder, "--frames", "1-4", "--chunk", 2, "-q")
    assert run(*asked) == 0
    before = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}
    (folder / "labels_0003.npz").write_bytes(b"damaged")
    (folder / "coco_0001-0004.json").unlink()
    assert run(*asked, "--resume") == 0
    after = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}
    assert {name: content for name, (content, _) in after.items()} == {name: each[0] for name, each in before.items()}
    assert sorted(name for name in after if after[name] == before[name]) == [
        "labels_0001-0002.coco.jsonl",
        "labels_0001-0002.json",
        "labels_0001.npz",
        "labels_0002.npz",
    ]
    manifest = json.loads((folder / "labels_0001-0002.json").read_text())
    assert manifest["frames"] == [1, 2] and manifest["inputs"]["version"]


def test_a_folder_of_other_labels_is_refused(small_file: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "labels"
    assert run("labels", small_file, "-o", folder, "--frames", "1-2", "-q") == 0
    for more in (("--layers", 2), ("--chunk", 1), ("--resume", "--no-coco")):
        assert run("labels", small_file, "-o", folder, "--frames", "1-2", "-q", *more) == 2
        assert "has chunks of another set of labels" in capfd.readouterr().err
    assert run("labels", small_file, "-o", folder, "--frames", "3-4", "-q") == 0
    assert (folder / "coco_0003-0004.json").exists()


def test_pieces_together_number_images_and_things_as_one_file(small_file: Path, tmp_path: Path) -> None:
    """Ids of instances are an exception: each chunk has its own."""
    found = []
    for size in (1, 4):
        assert run("labels", small_file, "-o", tmp_path / str(size), "--frames", "1-4", "--chunk", size, "-q") == 0
        found.append((tmp_path / str(size) / "coco_0001-0004.json").read_bytes())
    assert found[0] == found[1]
    content = json.loads(found[0])
    assert [image["id"] for image in content["images"]] == [1, 2, 3, 4]
    ids = [row["id"] for row in content["annotations"] + content["hidden"]]
    assert sorted(ids) == list(range(1, len(ids) + 1))


@pytest.mark.parametrize(("fault", "said"), [("engine", "its tree is gone"), ("memory", "there is not enough memory")])
def test_what_the_engine_fails_by_is_told(
    small_file: Path, tmp_path: Path, capfd: Any, monkeypatch: pytest.MonkeyPatch, fault: str, said: str
) -> None:
    """Blender swallows exceptions that are raised while it renders."""
    import perfect_bvh
    from perfect_bvh_addon.live.scene_sync import SceneSync

    error = perfect_bvh.EngineError("its tree is gone") if fault == "engine" else MemoryError()

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(SceneSync, "begin_update", fail)
    assert run("labels", small_file, "-o", tmp_path / "out", "--frames", "1-2", "-q") == 2
    told = capfd.readouterr().err
    assert "frames 1-2" in told and said in told
    assert list((tmp_path / "out").iterdir()) == []


def test_a_piece_that_blender_gives_up_is_no_stop(
    small_file: Path, tmp_path: Path, capfd: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from perfect_bvh_addon.live import scene_view

    monkeypatch.setattr(scene_view, "serve_visit", lambda *_: True)
    assert run("labels", small_file, "-o", tmp_path / "out", "--frames", "1-2", "-q") == 2
    assert "frames 1-2: labels: Blender cannot read scene 'Scene' as a render does" in capfd.readouterr().err
