"""The command line's arguments: their meaning, and the errors that refuse them before any work."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

import pytest
from blender.command_lines import run_command
from perfect_bvh_addon.cli import build_parser
from perfect_bvh_addon.cli.arguments import CommandError, Output, check_blend_file, check_mode, parse_frames, parse_size
from perfect_bvh_addon.cli.report import format_table
from perfect_bvh_addon.support.files import replacing
from wine_gaps import symbolic_links

needs_users = pytest.mark.skipif(os.name == "nt", reason="Windows has no names for other users' folders")


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("7", (7,)),
        ("1-4", (1, 2, 3, 4)),
        ("1-10:3", (1, 4, 7, 10)),
        ("5, 1-3", (5, 1, 2, 3)),
        ("2,1-3", (2, 1, 3)),
        ("-2-1", (-2, -1, 0, 1)),
        ("-5--3", (-5, -4, -3)),
    ],
)
def test_frames_are_ranges_steps_and_lists(text: str, frames: tuple[int, ...]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "a", "1-", "4-1", "1-4:0", "1..4", "1-4:", "1,,2", "1-2000000"])
def test_frames_that_mean_nothing_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        parse_frames(text)


def test_a_size_is_two_numbers_that_blender_can_have() -> None:
    assert parse_size("960x540") == (960, 540)
    assert parse_size("4x65536") == (4, 65536)
    for text in ("960", "5x-1", "axb", "1.5x2"):
        with pytest.raises(argparse.ArgumentTypeError, match="expected WIDTHxHEIGHT"):
            parse_size(text)
    for text in ("0x5", "1x3", "4x3", "3x540"):
        with pytest.raises(argparse.ArgumentTypeError, match=f"no side below 4 pixels, got {text}; render a larger"):
            parse_size(text)
    with pytest.raises(argparse.ArgumentTypeError, match="no side above 65536 pixels, got 4x65537"):
        parse_size("4x65537")


def test_the_former_name_of_chunk_works_and_names_the_new_one(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["scan", "scene.blend", "-o", "out"]
    assert build_parser("perfect-bvh").parse_args([*line, "--chunk", "3"]).piece == 3
    assert capsys.readouterr().err == ""
    assert build_parser("perfect-bvh").parse_args([*line, "--piece", "3"]).piece == 3
    assert "--piece is now --chunk" in capsys.readouterr().err


def test_all_commands_take_the_same_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    parser = build_parser("perfect-bvh")
    for command in ("render", "scan"):
        line = [command, "scene.blend", "-o", "out", "--seed"]
        assert parser.parse_args([*line, str(2**31 - 1)]).seed == 2**31 - 1
        for wrong in ("-1", str(2**31), "1.0", "x"):
            with pytest.raises(SystemExit):
                parser.parse_args([*line, wrong])
            assert f"must be a whole number from 0 to {2**31 - 1}, got {wrong!r}" in capsys.readouterr().err


def test_an_unknown_mode_is_refused_with_the_known_ones() -> None:
    check_mode(None)
    check_mode("depth")
    with pytest.raises(CommandError, match=r"'shiny'.*clay.*cost"):
        check_mode("shiny")


# File names ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("output", "frame", "expected"),
    [
        ("a.png", 3, "a.png"),
        ("a_###.exr", 3, "a_003.exr"),
        ("a_##.png", 1234, "a_1234.png"),
        ("a_####.png", -7, "a_-0007.png"),
        ("folder/", 3, "folder/frame_0003.png"),
        ("folder", 3, "folder/frame_0003.png"),
        ("existing.png", 3, "existing.png/frame_0003.png"),
    ],
)
def test_output_names(output: str, frame: int, expected: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "existing.png").mkdir()
    assert Output.parse(output, 1).path_of(frame) == tmp_path / expected


@pytest.mark.parametrize(
    ("output", "count", "complaint"),
    [
        ("a.png", 2, r"a_####\.png"),
        ("a.gif", 1, r"not \.gif"),
        ("a#b#.png", 1, "one group of #"),
    ],
)
def test_output_names_that_cannot_work(output: str, count: int, complaint: str) -> None:
    with pytest.raises(CommandError, match=complaint):
        Output.parse(output, count)


def test_an_output_folder_is_made_and_tried(tmp_path: Path) -> None:
    Output.parse(str(tmp_path / "new" / "deep" / "a.png"), 1).prepare()
    assert list((tmp_path / "new" / "deep").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(CommandError, match="cannot write into"):
        Output.parse(str(tmp_path / "file" / "a.png"), 1).prepare()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "expected a name, got an empty one"),
        ("a/" * 16_400 + "a.png", r"a path may have \d+ (bytes|characters), got \d+; give a shorter one"),
        ("n" * 252 + ".png", "a name may have 255 (bytes|characters), got 256"),
        # Of two characters each where names are UTF-16, else of four bytes.
        ("\N{GRINNING FACE}" * 130 + ".png", "a name may have 255 (bytes, got 524|characters, got 264)"),
        ("a\0b.png", "cannot hold a zero byte"),
        pytest.param("~nobody_at_all/a.png", "no such user", marks=needs_users),
    ],
)
def test_names_that_no_file_can_have_are_refused_before_any_work(
    text: str, complaint: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "scene.blend"
    scene.write_bytes(b"BLENDER-v405")
    importlib.import_module("perfect_bvh_addon.extract.camera")  # which needs it, but does nothing yet
    monkeypatch.setitem(sys.modules, "bpy", None)
    for command in (("render", scene, "-o", text), ("render", text, "-o", "a.png"), ("bench", scene, "-o", text)):
        with pytest.raises(CommandError, match=complaint):
            run_command(*command)
    assert list(tmp_path.iterdir()) == [scene]


def test_a_frame_number_may_make_a_name_too_long(tmp_path: Path) -> None:
    output = Output.parse(str(tmp_path / ("n" * 246 + "_####.png")), 2)
    output.check_frames((1, 9999), tmp_path)
    with pytest.raises(CommandError, match="got 256"):
        output.check_frames((1, 10000), tmp_path)


@pytest.mark.parametrize("name", ["scene.png", "scene_0007.png"])
def test_an_image_never_replaces_its_scene(name: str, tmp_path: Path) -> None:
    scene = tmp_path / name
    scene.write_bytes(b"BLENDER-v405")
    for output in (name, name.replace("0007", "####")):
        check_keeps(scene, tmp_path / output)
    assert list(tmp_path.iterdir()) == [scene]


@symbolic_links
def test_nor_does_an_image_that_is_a_link_to_it(tmp_path: Path) -> None:
    scene, link = tmp_path / "scene.blend", tmp_path / "link.png"
    scene.write_bytes(b"BLENDER-v405")
    link.symlink_to(scene)
    check_keeps(scene, link)
    assert link.is_symlink()


def check_keeps(scene: Path, output: Path) -> None:
    with pytest.raises(CommandError, match="the image would replace the scene, FILE; give it another name"):
        run_command("render", scene, "-o", output, "--frames", "7")
    assert scene.read_bytes() == b"BLENDER-v405"


def test_the_longest_name_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 251 + ".png")
    with replacing(path) as beside:
        beside.write_bytes(b"image")
    assert path.read_bytes() == b"image"


def test_only_blend_files_are_taken(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="no such file"):
        check_blend_file(str(tmp_path / "none.blend"))
    with pytest.raises(CommandError, match="folder"):
        check_blend_file(str(tmp_path))
    wrong = tmp_path / "wrong.blend"
    wrong.write_bytes(b"PNG")
    with pytest.raises(CommandError, match=r"wrong\.blend is not a \.blend file"):
        check_blend_file(str(wrong))
    for number, start in enumerate((b"BLENDER-v405", b"\x28\xb5\x2f\xfdxxxx", b"\x1f\x8bxxxx")):
        path = tmp_path / f"{number}.blend"
        path.write_bytes(start)
        assert check_blend_file(str(path)) == path


# Text ----------------------------------------------------------------------------------------------------------------


def test_tables_line_up() -> None:
    lines = format_table(["name", "count"], [["a", "1"], ["long name", "1,000"]]).splitlines()
    assert lines == ["name       count", "---------  -----", "a              1", "long name  1,000"]
