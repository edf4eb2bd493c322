"""The command `info`, and the errors that every command gives for bad files and arguments."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest
from blender.command_lines import run


@pytest.fixture
def broken_files(tmp_path: Path, small_file: Path) -> dict[str, Path]:
    """A truncated file, and one whose scene has no camera."""
    truncated = tmp_path / "truncated.blend"
    truncated.write_bytes(small_file.read_bytes()[:3000])
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.context.scene.camera = None
    blind = tmp_path / "blind.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blind), copy=True)
    return {"truncated": truncated, "blind": blind}


def test_info_lists_the_meshes(small_file: Path, capsys) -> None:
    assert run("info", small_file) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Scene, frame 1"
    assert lines[1].split()[:3] == ["mesh", "class", "builder"] and lines[1].endswith("why this class")
    sheet, cube = lines[3], lines[4]
    assert sheet.split()[:5] == ["Sheet", "deforming", "binned", "800", "triangles"]
    assert sheet.endswith(("moves vertices", "shape keys"))
    assert cube.split()[:2] == ["Cube", "rigid"] and cube.split()[3:6] == ["12", "triangles", "1"]
    assert cube.endswith("it is animated")
    build, rays, trace = (float(cell.replace(",", "")) for cell in cube.split()[-6:-3])
    assert build >= 0 and rays > 0 and trace > 0
    assert lines[5].startswith("2 meshes, 812 triangles; 2 instances show 812 triangles; top level")
    assert lines[6] == (
        "rays and trace ms: of one image of 64 x 36 pixels, mode lit, samples 16, on one thread, as expected"
    )


def test_info_needs_no_camera(small_file: Path, broken_files: dict[str, Path], capsys) -> None:
    assert run("info", small_file) == 0
    expected = capsys.readouterr().out
    assert run("info", broken_files["blind"]) == 0
    assert capsys.readouterr().out == expected


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("render", "{tmp}/none.blend", "-o", "{tmp}/a.png"), "none.blend: no such file"),
        (("render", "{text}", "-o", "{tmp}/a.png"), "is not a .blend file"),
        (("info", "{truncated}"), "Blender cannot open it"),
        (("render", "{blind}", "-o", "{tmp}/a.png"), "has no camera"),
        (("render", "{small}", "-o", "{tmp}/a.png", "--mode", "shiny"), "unknown mode 'shiny'"),
        (("render", "{small}", "-o", "{text}/a.png"), "cannot write into"),
        (("render", "{small}", "-o", "{tmp}/a.png", "--frames", "1-3"), "3 frames need a folder"),
        (("render", "{small}", "-o", "{tmp}/a.png", "--size", "big"), "expected WIDTHxHEIGHT"),
        (("render", "{small}", "-o", "{tmp}/a.png", "--size", "1x3"), "no side below 4 pixels, got 1x3"),
        (("render", "{small}", "-o", "{tmp}/a.png", "--samples", "0"), "must be at least 1"),
        (
            ("render", "{small}", "-o", "{tmp}/a/", "--frames", "1-2", "--chunk", "1"),
            "--chunk needs --resume, --workers",
        ),
        (("scan", "{small}", "-o", "{tmp}/a", "--steps", "2"), "--steps needs --frames"),
        (("render", "{small}"), "-o"),
        (("paint", "{small}"), "invalid choice"),
    ],
)
def test_mistakes_are_explained(
    arguments: tuple[str, ...], complaint: str, small_file: Path, broken_files: dict[str, Path], tmp_path: Path, capsys
) -> None:
    text = tmp_path / "text.blend"
    text.write_text("no blend")
    names = {"tmp": tmp_path, "text": text, "small": small_file, **broken_files}
    assert run(*(argument.format(**names) for argument in arguments)) == 2
    printed = capsys.readouterr()
    assert complaint in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""
    assert not (tmp_path / "a.png").exists()
