"""`perfect-bvh bake`: a table for each frame, by the values of `bake_rays`."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from blender.command_lines import run, save_small_file  # noqa: E402
from perfect_bvh_addon import bake_rays  # noqa: E402


@pytest.fixture
def small_file(tmp_path: Path) -> Path:
    path = tmp_path / "small.blend"
    save_small_file(path)
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))


def test_frames_have_a_table_each(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sky"
    command = ("bake", small_file, "-o", folder, "--kind", "sky-view", "--rays", 16, "--frames", "1-2", "-q")
    assert run(*command) == 0
    names = ["bake_0001-0002.json", "bake_0001.csv", "bake_0002.csv"]
    assert sorted(path.name for path in folder.iterdir()) == names
    for frame in (1, 2):
        bpy.context.scene.frame_set(frame)
        bake = bake_rays([bpy.data.objects["Sheet"]], kind="SKY_VIEW", rays=16)
        rows = [row for row in rows_of(folder / f"bake_{frame:04d}.csv") if row["object"] == "Sheet"]
        assert [float(row["sky_view"]) for row in rows] == bake["Sheet"].values.tolist()
    manifest = json.loads((folder / names[0]).read_text())
    assert manifest["units"] == {"sky_view": ""}
    before = (folder / names[2]).read_bytes()
    (folder / names[2]).write_text("damaged")
    assert run(*command, "--resume") == 0
    assert (folder / names[2]).read_bytes() == before


def test_exposure_has_one_table_for_all_frames(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "seen"
    how = ("--objects", "Sheet", "--frames", "1-2", "-q")
    assert run("bake", small_file, "-o", folder, "--kind", "exposure", *how) == 0
    rows = rows_of(folder / "bake_0001-0002.csv")
    bake = bake_rays([bpy.data.objects["Sheet"]], kind="EXPOSURE", frames=(1, 2))
    assert [float(row["exposure"]) for row in rows] == bake["Sheet"].values.tolist()
    assert {row["object"] for row in rows} == {"Sheet"}


def test_faces_that_modifiers_make_have_rows(small_file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.data.objects["Cube"].modifiers.new("Smoother", "SUBSURF").render_levels = 1
    bpy.data.objects["Sheet"].hide_render = True
    bpy.ops.wm.save_mainfile()
    folder = tmp_path / "thick"
    assert run("bake", small_file, "-o", folder, "--kind", "thickness", "--method", "sphere", "-q") == 0
    (path,) = folder.glob("*.csv")
    assert [row["object"] for row in rows_of(path)] == ["Cube"] * 24


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        ("--kind sun-hours needs --place and --days, or", ("--kind", "sun-hours")),
        ("--place needs --days", ("--kind", "sun-hours", "--place", 1, 2)),
        ("no.epw: No such file", ("--kind", "sun-hours", "--epw", "no.epw")),
        ("has no object 'Tower'", ("--kind", "sky-view", "--objects", "Tower")),
        ("falloff needs a distance", ("--kind", "ambient-occlusion", "--falloff", 1)),
        ("--viewer: scene 'Scene' has no object 'Eye'", ("--kind", "exposure", "--viewer", "Eye")),
    ],
)
def test_what_cannot_be_baked_is_named(
    small_file: Path, tmp_path: Path, capsys: Any, words: str, arguments: Any
) -> None:
    folder = tmp_path / "out"
    assert run("bake", small_file, "-o", folder, "-q", *arguments) == 2
    assert words in capsys.readouterr().err
    assert not list(folder.glob("*"))


def test_the_sun_shines_on_the_place(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sun"
    how = ("--place", -33.9, 151.2, "--zone", "Australia/Sydney", "--days", "2026-12-21", "--objects", "Sheet", "-q")
    assert run("bake", small_file, "-o", folder, "--kind", "sun-hours", *how) == 0
    hours = [float(row["sun_hours"]) for row in rows_of(folder / "bake_0001.csv")]
    assert max(hours) == pytest.approx(14.4, abs=0.2)  # the longest day there
    assert min(hours) < 11.0  # below the cube


def test_hours_are_weighted_by_the_cosine_if_asked(small_file: Path, tmp_path: Path) -> None:
    sums = []
    for name, words in (("plain", ()), ("cosine", ("--cosine",))):
        how = ("--place", 0, 0, "--days", "2026-03-21", "--minutes", 60, "--objects", "Sheet", "-q", *words)
        assert run("bake", small_file, "-o", tmp_path / name, "--kind", "sun-hours", *how) == 0
        sums.append(max(float(row["sun_hours"]) for row in rows_of(tmp_path / name / "bake_0001.csv")))
    assert sums[1] == pytest.approx(sums[0] * 2.0 / math.pi, rel=0.02)  # the mean sine of a sun that crosses the zenith


def test_a_sun_that_does_not_rise_is_told(small_file: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    place = ("--kind", "sun-hours", "--place", 80, 0, "--days", "2026-12-21")
    assert run("bake", small_file, "-o", tmp_path / "night", *place) == 0
    assert {float(row["sun_hours"] or 0.0) for row in rows_of(tmp_path / "night" / "bake_0001.csv")} == {0.0}
    assert "The sun does not rise at latitude 80, longitude 0 on 2026-12-21" in capfd.readouterr().err
