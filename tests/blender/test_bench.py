"""Measuring the user's scene: the written figures, stopping early, the table, and charts with matplotlib."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import count, islice
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh_addon.bench as bench_room
import pytest
from blender.long_builds import TIMER, FakeOperator, FakeWindow, Gate, building_threads
from limits import full_disk
from oracles.png import load_image
from perfect_bvh_addon import register
from perfect_bvh_addon.bench.advice import advice
from perfect_bvh_addon.bench.measurements import SceneBench, subject_of
from perfect_bvh_addon.bench.results import HOW_TO_GET_CHARTS, Row, forget, format_table, last_results, table, write
from perfect_bvh_addon.operators import measure
from perfect_bvh_addon.operators.measure import PERFECT_BVH_OT_bench

PARTS = {"builders", "total_time", "answers", "frames", "decay"}
WITH_CHARTS = PARTS - {"answers"}
needs_matplotlib = pytest.mark.skipif(find_spec("matplotlib") is None, reason="matplotlib is not installed")


@pytest.fixture
def no_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make imports of matplotlib and all of its parts fail, as if it is not installed."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "perfect_bvh_addon.bench.charts", raising=False)
    monkeypatch.delattr(bench_room, "charts", raising=False)


@pytest.fixture
def moving_ball() -> bpy.types.Scene:
    """A sphere that a shape key deforms, over a plane."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=8.0, location=(0, 0, -1.2))
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
    ball = bpy.context.object
    ball.shape_key_add(name="rest")
    tall = ball.shape_key_add(name="tall")
    for point in tall.data:
        point.co.z *= 2.0
    for frame, value in ((1, 0.0), (4, 1.0)):
        tall.value = value
        tall.keyframe_insert("value", frame=frame)
    bpy.ops.object.camera_add(location=(0, -8, 2), rotation=(1.3, 0, 0))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.frame_start, scene.frame_end = 1, 4
    scene.frame_set(2)
    return scene


def measured(scene: bpy.types.Scene, seconds: float = 4.0) -> dict[str, Any]:
    """Measure with a clock that advances by a millisecond at each reading: the results do not depend on the machine."""
    bench = SceneBench(subject_of(scene), seconds, count(0.0, 1e-3).__next__)
    shares = [share for share, _ in bench.steps()]
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] < 1.0
    return bench.figures


def test_every_part_is_measured_and_written(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    figures = measured(moving_ball)
    assert {row["name"] for row in figures["builders"]} == {"fast", "auto", "sweep", "spatial"}
    assert figures["triangles"] == 320 + 2
    assert figures["answers"]["checked"] > 0 and figures["answers"]["wrong"] == 0
    assert [row["frame"] for row in figures["frames"]] == [1, 2, 3, 4]
    assert figures["frames"][0]["policies"]["governed"]["actions"] == ["built"]
    assert figures["frames"][2]["policies"]["rebuild"]["actions"] == ["rebuilt"]
    visits = [row["policies"]["refit"]["visits"] for row in figures["frames"]]
    assert len(set(visits)) == 4 and min(visits) >= 1.0
    results = write(figures, tmp_path / "new")
    assert set(results.advice) == PARTS
    written = json.loads(results.json.read_text())
    assert written["advice"] == results.advice
    assert all(sentence.endswith(".") for sentence in results.advice.values())
    builders = [(name, "Builder") for name in ("Fast", "Automatic", "Full Sweep", "Spatial Splits")]
    others = [(policy, "Updates") for policy in ("Always Refit", "Always Rebuild", "Automatic")]
    assert [(row.name, row.part) for row in results.table] == [*builders, *others, ("Sample", "Results")]


@needs_matplotlib
def test_charts_are_drawn_where_matplotlib_is(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    results = write(measured(moving_ball), tmp_path)
    assert results.can_draw
    assert set(results.pictures) == WITH_CHARTS
    for name, path in results.pictures.items():
        assert path == tmp_path / f"{name}.png"
        image = load_image(path)
        assert image.size[0] == 1600 and image.size[1] > 700
        assert np.array(image.pixels).reshape(-1, 4)[:, :3].std() > 0.02  # the chart is not empty
    assert results.overview is not None
    image = load_image(results.overview)
    assert image.size[0] == 1600 and image.size[1] > 2800


@needs_matplotlib
def test_drawing_leaves_matplotlibs_settings_alone(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    write(measured(moving_ball, 1.0), tmp_path)
    assert dict(mpl.rcParams) == before
    assert "matplotlib.pyplot" not in sys.modules or not sys.modules["matplotlib.pyplot"].get_fignums()


@pytest.mark.usefixtures("no_matplotlib")
def test_without_matplotlib_there_are_figures_table_and_advice(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    figures = measured(moving_ball)
    results = write(figures, tmp_path)
    assert (results.can_draw, results.pictures, results.overview) == (False, {}, None)
    assert [path.name for path in tmp_path.iterdir()] == ["bench.json"]
    assert results.table == table(figures)
    assert set(results.advice) == PARTS


def test_the_table_can_be_read() -> None:
    def spread(value: float) -> dict[str, float]:
        return {"typical": value, "low": value, "high": value, "count": 9}

    builders = [
        {"name": "fast", "build_ms": spread(0.1234), "trace_ms": spread(20.0), "byte_count": 1},
        {"name": "auto", "build_ms": spread(12345.6), "trace_ms": spread(0.05), "byte_count": 1},
    ]
    policies = [{"refit": {"update_ms": ms, "trace_ms": 100.0}} for ms in (500.0, 1.0, 3.0)]
    frames = [{"frame": i, "rays": 1_000_000, "policies": each} for i, each in enumerate(policies)]
    answers = {"checked": 12345, "wrong": 0}
    rows = table({"rays": 100_000, "builders": builders, "frames": frames, "answers": answers})
    assert rows == (
        Row("Builder", "Fast", "0.12 ms", "5.00 M rays/s", 0.0025),
        Row("Builder", "Automatic", "12.3 s", "2,000 M rays/s", 1.0),
        Row("Updates", "Always Refit", "2.00 ms", "10.0 M rays/s", 1.0),
        Row("Results", "Sample", "12,345", "0"),
    )
    lines = format_table(rows).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert [line.split()[0] for line in lines if not line.startswith(" ")] == ["Builder", "Updates", "Results"]
    assert table({"rays": 1}) == () and format_table(()) == ""


def frame_of(frame: int, action: str, refit: float, rebuild: float = 20.0) -> dict[str, Any]:
    """Figures of a frame. action: the governor's. refit: visits in refitted trees; rebuild: in rebuilt and governed."""
    done = {"refit": ["refitted"], "rebuild": ["rebuilt"], "governed": [action]}
    visits = {"refit": refit, "rebuild": rebuild, "governed": rebuild}
    row = {"update_ms": 1.0, "trace_ms": 1.0, "moved": 0}
    policies = {policy: {**row, "actions": done[policy], "visits": visits[policy]} for policy in done}
    return {"frame": frame, "rays": 1_000_000, "policies": policies}


def test_advice_tells_of_trees_that_decay() -> None:
    first = frame_of(1, "built", 20.0)
    worse = advice({"frames": [first, frame_of(3, "refitted", 60.0), frame_of(5, "rebuilt", 41.25)]})["decay"]
    assert worse == (
        "In frame 5 a ray visits 41.2 nodes and primitives in BVHs that are only refitted, 20.0 with automatic "
        "updates, 20.0 in new ones. Refitted BVHs are slowest in frame 3: 3.00 times what new ones cost. "
        "Automatic updates improved or rebuilt BVHs in 1 of 2 frames, first in 5."
    )
    same = advice({"frames": [first, frame_of(2, "refitted", 20.5)]})["decay"]
    assert same.endswith("Refitted BVHs stay as good as new ones. Automatic updates rebuilt none.")
    still = frame_of(2, "refitted", 20.0)
    still["policies"]["governed"]["actions"] = []
    assert advice({"frames": [first, still]})["decay"].startswith("Nothing moves")


def test_stopping_keeps_what_there_is(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    bench = SceneBench(subject_of(moving_ball), 60.0)
    steps = bench.steps()
    begin(steps, "builder Automatic")
    assert [row["name"] for row in bench.figures["builders"]] == ["fast"]
    assert advice(bench.figures) == {}
    assert [row.name for row in table(bench.figures)] == ["Fast"]
    begin(steps, "builder Fast")
    steps.close()
    assert set(advice(bench.figures)) == {"builders", "total_time"}
    assert write(bench.figures, tmp_path).json.is_file()
    assert json.loads((tmp_path / "bench.json").read_text())["builders"] == bench.figures["builders"]


def begin(steps: Iterator[tuple[float, str]], part: str) -> None:
    """Go on until `part` is the next one; long parts have several steps."""
    assert any(what == part for _, what in steps)


PARTS_THAT_BUILD = ("rays", "builder Spatial Splits", "choice of builders", "frame 1")


@pytest.mark.parametrize("part", PARTS_THAT_BUILD)
def test_it_goes_on_while_it_builds_and_stops_in_the_middle(
    moving_ball: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    gate = Gate(monkeypatch)
    gate.open()
    bench = SceneBench(subject_of(moving_ball), 60.0, count(0.0, 1e-3).__next__)
    steps = bench.steps()
    begin(steps, part)
    gate.close()
    assert [next(steps)[1] for _ in range(3)] == [part] * 3
    assert building_threads() == 1
    steps.close()
    assert building_threads() == 0


def test_it_goes_on_while_it_audits_and_hands_on_what_is_wrong(
    moving_ball: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = SceneBench(subject_of(moving_ball), 60.0, count(0.0, 1e-3).__next__).steps()
    begin(steps, "check of results")

    def fail(*_: object, **__: object) -> None:
        raise MemoryError("no room for an audit")

    monkeypatch.setattr(SceneBench, "_audit", fail)
    with pytest.raises(MemoryError, match="no room for an audit"):
        next(steps)


def test_no_audit_is_not_called_a_good_one() -> None:
    spread = {"typical": 1.0, "low": 1.0, "high": 1.0, "count": 1}
    row = {"trace_ms": spread, "checked": 0, "not_judged": 0, "wrong": 0, "wrong_per_million": 0.0}
    machine = {"processor": "one", "threads": 1, "isa": "scalar", "perfect_bvh": "0"}
    scene = {"scene": "s", "triangles": 1, "meshes": 1, "instances": 1, "rays": 10, "machine": machine}
    sentence = advice({**scene, "answers": {**row, "interval": [0.0, 1e6]}})["answers"]
    assert "too large" in sentence
    row["not_judged"] = 10
    sentence = advice({**scene, "answers": {**row, "interval": [0.0, 1e6]}})["answers"]
    assert "near curves or points" in sentence


def test_an_empty_scene_is_refused() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with pytest.raises(ValueError, match="no triangles"):
        next(islice(SceneBench(subject_of(bpy.context.scene)).steps(), 1, None))


@needs_matplotlib
def test_the_button_makes_an_image_and_sets_the_frame_back(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    register()
    assert bpy.ops.perfect_bvh.bench(seconds=2.0, folder=str(tmp_path)) == {"FINISHED"}
    assert moving_ball.frame_current == 2
    assert bpy.data.images["Perfect BVH Bench"].size[0] == 1600
    assert (tmp_path / "bench.json").is_file()


@pytest.mark.usefixtures("registered", "no_matplotlib")
def test_the_button_makes_a_table_without_matplotlib(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    forget()
    assert last_results(moving_ball.session_uid) is None
    assert bpy.ops.perfect_bvh.bench(seconds=2.0, folder=str(tmp_path)) == {"FINISHED"}
    assert moving_ball.frame_current == 2
    assert "Perfect BVH Bench" not in bpy.data.images
    results = last_results(moving_ball.session_uid)
    assert results is not None and results.table and results.json == tmp_path / "bench.json"
    assert last_results(bpy.data.scenes.new("Other").session_uid) is None


def begin_button(folder: Path) -> tuple[FakeOperator, FakeWindow]:
    """Start a measurement with the button and go on until it has reached the frames."""
    operator, window = FakeOperator(PERFECT_BVH_OT_bench), FakeWindow()
    operator.seconds, operator.folder, operator.for_viewport = 60.0, str(folder), False
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    operator._bench._clock = count(operator._bench._started, 1e-3).__next__
    operator._bench._seconds = 4.0
    while window.status is None or "frame 2" not in window.status:
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    return operator, window


@needs_matplotlib
@pytest.mark.parametrize("is_shown", [True, False])
@pytest.mark.usefixtures("registered")
def test_charts_that_no_editor_shows_are_named(
    moving_ball: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_shown: bool
) -> None:
    """As where the preferences show renders nowhere."""
    monkeypatch.setattr(measure, "_show", lambda context, charts: is_shown)
    operator, window = begin_button(tmp_path)
    while operator.modal(window, TIMER) == {"RUNNING_MODAL"}:
        pass
    told = ("INFO", 'The charts are in the image "Perfect BVH Bench": open an Image Editor to see them')
    assert (told in operator.reports) == (not is_shown)


@pytest.mark.usefixtures("registered")
def test_the_button_measures_its_scene_whichever_is_shown(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    operator, window = begin_button(tmp_path)
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    while operator.modal(window, TIMER) == {"RUNNING_MODAL"}:
        pass
    rows = json.loads((tmp_path / "bench.json").read_text())["frames"]
    assert [row["frame"] for row in rows] == [1, 2, 3, 4]
    assert [row["policies"]["refit"]["actions"] for row in rows[1:]] == [["refitted"]] * 3
    assert (other.frame_current, moving_ball.frame_current) == (1, 2)


@pytest.mark.usefixtures("registered")
def test_the_button_says_that_its_scene_is_gone(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    operator, window = begin_button(tmp_path)
    bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(moving_ball)
    while operator.modal(window, TIMER) == {"RUNNING_MODAL"}:
        pass
    assert ("ERROR", "The scene was removed during the bench") in operator.reports
    assert (window.timers, window.status) == (0, None)


def test_a_folder_that_takes_no_files_is_named_before_anything_is_measured(
    moving_ball: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    register()
    (tmp_path / "file").touch()
    monkeypatch.setattr(SceneBench, "steps", lambda _: pytest.fail("it has begun"))
    with pytest.raises(RuntimeError, match=r"Cannot write into .*nowhere: \w"):
        bpy.ops.perfect_bvh.bench(folder=str(tmp_path / "file" / "nowhere"))


def test_a_full_disk_leaves_the_older_figures(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    bench = SceneBench(subject_of(moving_ball), 60.0)
    older = write(bench.figures, tmp_path).json.read_bytes()
    with full_disk(16), pytest.raises(OSError, match=r"cannot write .*bench\.json: File too large"):
        write(bench.figures, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["bench.json"]
    assert (tmp_path / "bench.json").read_bytes() == older


@pytest.mark.parametrize("blocked", [pytest.param(False, marks=needs_matplotlib), True])
def test_the_command(moving_ball: bpy.types.Scene, tmp_path: Path, *, blocked: bool) -> None:
    file = tmp_path / "ball.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    out = tmp_path / "charts"
    words = ["bench", str(file), "-o", str(out), "--seconds", "3"]
    block = "sys.modules['matplotlib'] = None; " if blocked else ""
    code = f"import sys; {block}from perfect_bvh_addon.cli import main; sys.exit(main({words!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Builder") and done.stdout.rstrip().endswith("bench.json")
    assert (HOW_TO_GET_CHARTS in done.stdout.splitlines()) == blocked
    assert f"\nbuilders{'' if blocked else '.png'}: " in done.stdout
    names = {path.name for path in out.iterdir()}
    assert names == {"bench.json"} if blocked else names >= {"bench.json", "builders.png", "overview.png"}
    file_in_the_way = tmp_path / "file"
    file_in_the_way.write_text("")
    words[3] = str(file_in_the_way)
    code = f"import sys; from perfect_bvh_addon.cli import main; sys.exit(main({words!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2 and "expected a folder" in done.stderr
