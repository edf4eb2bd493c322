"""Every chart can be drawn from its figures in data/, which say where they come from."""

from __future__ import annotations

import importlib
import json
import math
import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.rows import write_rows
from charts import image_error, make, measure, stability, told
from charts.chart import PALETTE, Axis, Chart, Panel, Series
from charts.drawn import drawn
from charts.figures import DATA, FOLDER, PICTURES, load
from charts.labels import Box, place_beside, spread_out
from charts.layout import WIDTH, lay_out
from charts.scales import Scale

FILES = sorted(DATA.glob("*.json"))


@pytest.mark.parametrize("name", make.CHARTS)
def test_a_chart_can_be_drawn_from_its_figures(name: str):
    chart = make.describe(name)
    picture = lay_out(chart)
    assert (picture.width, len(chart.panels) > 0) == (WIDTH, True)
    for panel in chart.panels:
        assert panel.x.label
        assert panel.y.label
        assert any(len(series.x) for series in panel.series), panel.title
        assert all(series.color in PALETTE for series in panel.series)
        assert all(len(series.x) == len(series.y) for series in panel.series)
    for text in picture.texts:
        assert text.words
        assert 0.0 <= text.at[0] <= WIDTH
        assert 0.0 <= text.at[1] <= picture.height
    assert any("Measured by" in text.words for text in picture.texts)


@pytest.mark.parametrize("name", make.CHARTS)
def test_a_picture_is_in_step_with_its_figures(name: str):
    drawn_from = make.fingerprint(make.describe(name))
    assert drawn_from.encode() in (PICTURES / f"{name}.png").read_bytes(), f"python tests/charts/make.py {name}"


def test_the_readme_tells_what_the_figures_say():
    text = told.README.read_text(encoding="utf-8")
    assert {found[2] for found in told.SECTION.finditer(text)} == told.TOLD.keys()
    assert told.retold(text) == text, "python tests/charts/make.py"


def test_the_projects_readme_says_how_the_image_compares_with_cycles(repository: Path):
    few, many = image_error.share_of_cycles(load("image_error"))
    text = " ".join((repository / "README.md").read_text(encoding="utf-8").split())
    said = (
        f"to the error of Cycles' 4 denoised samples a render takes {few:.2f} of its CPU time, to that of 16 {many:.2f}"
    )
    assert said in text


def test_a_fingerprint_tells_figures_apart():
    figures = load("stability")
    before = make.fingerprint(stability.chart(figures))
    figures["motions"]["twist"][3]["policies"]["refit"]["speed"]["median"] += 0.001
    assert make.fingerprint(stability.chart(figures)) != before
    assert make.fingerprint(stability.chart()) == before


def test_each_chart_has_its_module_its_picture_and_its_place_in_the_readme():
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    pictures = {path.stem for path in PICTURES.glob("*.png")}
    assert pictures == set(make.CHARTS)
    for name in make.CHARTS:
        assert f"(pictures/{name}.png)" in readme
        module = importlib.import_module(f"charts.{name}")
        assert module.DATA in {*measure.WHOLE, *measure.OF_MESHES}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_figures_say_where_they_were_measured_and_not_when(path: Path):
    text = path.read_text(encoding="utf-8")
    machine = json.loads(text)["machine"]
    assert {"processor", "threads", "isa", "versions", "command", "commit"} <= set(machine)
    assert "time" not in machine
    assert not any(word.startswith("/") for word in machine["command"])
    assert re.search(r"\d{4}-\d{2}-\d{2}", text) is None


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_figures_are_those_that_are_drawn_one_row_a_line(path: Path, tmp_path: Path):
    figures = load(path.stem)
    kept = drawn(path.stem, {**figures, "besides": [1.0]})
    assert kept == figures, f"python tests/charts/make.py draws less than data/{path.name} holds"
    write_rows(tmp_path / path.name, kept)
    assert path.read_bytes() == (tmp_path / path.name).read_bytes()


def test_rows_are_lines_however_deep_they_lie(tmp_path: Path):
    figures = {
        "machine": {"load": [1.0, 2.0]},
        "meshes": [{"name": "a", "trees": [{"sah": 1}, {"sah": 2}]}],
        "none": [],
    }
    write_rows(tmp_path / "new" / "figures.json", figures)
    text = (tmp_path / "new" / "figures.json").read_text(encoding="utf-8")
    assert json.loads(text) == figures
    lines = [line.strip() for line in text.splitlines()]
    assert lines[1:4] == ['"machine": {"load": [1.0, 2.0]},', '"meshes": [', "{"]
    assert lines[4:7] == ['"name": "a",', '"trees": [', '{"sah": 1},']
    assert len(lines) == 13


def test_a_scale_has_a_place_for_zero_below_its_first_power():
    scale = Scale.over(Axis("wrong", log=True, has_zero=True), [0.0, 20.0, 3e5])
    places = [scale.place(value) for value in (0.0, scale.low, 20.0, 3e5)]
    assert places == sorted(places)
    assert 0.0 < places[0] < places[1]
    assert [label for _, label in scale.ticks(200.0)][:2] == ["0", "10"]
    assert math.isnan(scale.place(math.nan))


@pytest.mark.parametrize("values", [[0.3, 0.9], [1e-7, 1e9], [5.0], [2.0, 2.0], []])
@pytest.mark.parametrize("log", [False, True])
def test_ticks_lie_on_the_axis(values: list[float], log: bool):
    scale = Scale.over(Axis("any", log=log), values)
    ticks = scale.ticks(200.0)
    assert 1 <= len(ticks) <= 12
    for value, label in ticks:
        assert label
        assert scale.low * 0.999 <= value <= scale.high * 1.001


def test_names_cover_neither_points_nor_one_another():
    points = [(50.0 + 8.0 * i, 50.0 + 6.0 * (i % 3)) for i in range(6)]
    obstacles = [Box(x - 4.0, y - 4.0, x + 4.0, y + 4.0) for x, y in points]
    boxes = place_beside(points, [(30.0, 12.0)] * 6, obstacles, Box(0.0, 0.0, 200.0, 120.0))
    for i, box in enumerate(boxes):
        assert sum(box.overlap(other) for other in boxes[:i]) == 0.0
        assert sum(box.overlap(point) for point in obstacles) < 40.0
    assert spread_out([10.0, 11.0, 50.0], 12.0, 0.0, 100.0) == pytest.approx([4.5, 16.5, 50.0])


def test_a_picture_is_written_as_png(tmp_path: Path):
    pytest.importorskip("matplotlib", reason="matplotlib is not installed: pip install '.[bench]'")
    panel = Panel("a", Axis("x", log=True), Axis("y"), [Series("s", [1.0, 10.0], [math.nan, 2.0], labels="points")])
    path = tmp_path / "new" / "chart.png"
    lay_out(Chart("One", "two", [panel])).save(path)
    first = path.read_bytes()
    assert first.startswith(b"\x89PNG")
    lay_out(Chart("One", "two", [panel])).save(path)
    assert path.read_bytes() == first
