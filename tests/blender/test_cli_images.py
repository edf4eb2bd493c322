"""Images that the command line writes: in every mode, of a border, as PNG and OpenEXR, to any path."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

import bpy
import numpy as np
import pytest
from blender.command_lines import run
from oracles.exr import read_exr
from oracles.png import read_png
from perfect_bvh_addon import unregister
from perfect_bvh_addon.cli import blender_command
from perfect_bvh_addon.settings.modes import MODE_NAMES
from perfect_bvh_addon.support.files import reachable


@pytest.mark.parametrize("mode", [*MODE_NAMES, "lit"])
def test_every_mode_writes_an_image(mode: str, small_file: Path, tmp_path: Path, capfd) -> None:
    output = tmp_path / f"{mode}.png"
    assert run("render", small_file, "-o", output, "--mode", mode, "--samples", 2) == 0
    image = read_png(output)
    assert image.shape == (36, 64, 4)
    assert len(np.unique(image[..., :3].reshape(-1, 3), axis=0)) > 2
    printed = capfd.readouterr()
    assert str(output) in printed.out
    assert "Blender" not in printed.out
    assert "Read blend" not in printed.out


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (("render", "FILE", "-o", "OUT", "--samples", "1"), 0, "1 frame in"),
        (("render", "FILE"), 2, "blender --command perfect_bvh render: error: the following arguments are required"),
        (("--help",), 0, "usage: blender --command perfect_bvh"),
        (("info", "missing.blend"), 2, "perfect-bvh: error: missing.blend: no such file"),
    ],
)
def test_blenders_own_command_line_takes_the_same(
    arguments: tuple[str, ...], status: int, told: str, small_file: Path, tmp_path: Path, monkeypatch, capfd
) -> None:
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    places = {"FILE": str(small_file), "OUT": str(tmp_path / "a.png")}
    try:
        assert blender_command.run([places.get(argument, argument) for argument in arguments]) == status
    finally:
        unregister()
    printed = capfd.readouterr()
    assert told in printed.out + printed.err
    assert (tmp_path / "a.png").is_file() == ("OUT" in arguments)


@pytest.mark.parametrize("mode", ["normal", "depth"])
def test_an_image_that_is_cropped_has_its_borders_size(mode: str, small_file: Path, tmp_path: Path) -> None:
    """The pixels equal those of the whole frame, and their number is that of Blender's own engines."""
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    render = bpy.context.scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.3, 0.71
    render.border_min_y, render.border_max_y = 0.25, 0.9
    images = {}
    for is_cropped in (False, True):
        bpy.context.scene.render.use_crop_to_border = is_cropped
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "border.blend"), copy=True)
        output = tmp_path / f"{is_cropped}.png"
        assert run("render", tmp_path / "border.blend", "-o", output, "--mode", mode, "--samples", 1) == 0
        images[is_cropped] = read_png(output)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "border.blend"))
    render = bpy.context.scene.render
    render.engine, render.filepath = "CYCLES", str(tmp_path / "cycles.png")
    bpy.context.scene.cycles.samples = 1
    bpy.ops.render.render(write_still=True)
    height, width = read_png(tmp_path / "cycles.png").shape[:2]
    assert images[True].shape == (height, width, 4)
    left, top = int(np.float32(0.3) * 64), 36 - int(np.float32(0.9) * 36)
    np.testing.assert_array_equal(images[True], images[False][top : top + height, left : left + width])
    assert images[False].shape == (36, 64, 4)
    assert (images[True][..., :3] > 0).any()


def test_openexr_holds_depth_as_it_is(small_file: Path, tmp_path: Path) -> None:
    assert run("render", small_file, "-o", tmp_path / "a.exr", "--mode", "distance", "--samples", 1) == 0
    planes = read_exr(tmp_path / "a.exr")
    hit = planes["R"] < 1e9
    assert hit.any()
    assert 4.0 < planes["R"][hit].min() < planes["R"][hit].max() < 13.0


def test_files_may_have_names_of_any_language_and_length(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "Jörg Müller 立方体"
    folder.mkdir()
    scene, image = folder / "scène 1.blend", folder.joinpath(*["x" * 60] * 5, "立方体.png")
    shutil.copy(small_file, scene)
    assert run("render", scene, "-o", image) == 0
    assert reachable(image).read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in reachable(image.parent).iterdir()] == [image.name]
