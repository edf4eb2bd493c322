"""The command line: its arguments, its files, its errors, and whole runs in a process of their own."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from perfect_bvh_addon.cli.arguments import CommandError, Output, check_blend_file, check_mode, parse_frames, parse_size
from perfect_bvh_addon.cli.console import format_bytes, format_table

# Arguments ---------------------------------------------------------------------------------------------------------


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


def test_a_size_is_two_positive_numbers() -> None:
    assert parse_size("960x540") == (960, 540)
    for text in ("960", "0x5", "5x-1", "axb", "99999x1", "1.5x2"):
        with pytest.raises(argparse.ArgumentTypeError):
            parse_size(text)


def test_an_unknown_mode_is_refused_with_the_known_ones() -> None:
    check_mode(None)
    check_mode("depth")
    with pytest.raises(CommandError, match=r"'shiny'.*clay.*cost"):
        check_mode("shiny")


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
        ("a#b#.png", 1, "one run of #"),
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


# Text --------------------------------------------------------------------------------------------------------------


def test_tables_line_up() -> None:
    lines = format_table(["name", "count"], [["a", "1"], ["long name", "1,000"]]).splitlines()
    assert lines == ["name       count", "---------  -----", "a              1", "long name  1,000"]


def test_bytes_have_units() -> None:
    assert [format_bytes(count) for count in (0, 1023, 1536, 5 << 20, 3 << 30)] == [
        "0 B",
        "1023 B",
        "1.5 KiB",
        "5.0 MiB",
        "3.0 GiB",
    ]
