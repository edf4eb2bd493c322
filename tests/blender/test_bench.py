"""Measuring the user's scene: what is written, what stopping leaves, what the charts advise, and both ways to draw."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import bpy
import pytest
from blender.long_builds import TIMER, FakeOperator, FakeWindow, Gate, building_threads
from perfect_bvh_addon import register
from perfect_bvh_addon.bench import blender_png
from perfect_bvh_addon.bench.from_blender import subject_of
from perfect_bvh_addon.bench.measurements import SceneBench
from perfect_bvh_addon.bench.picture import DrawingError
from perfect_bvh_addon.bench.results import write
from perfect_bvh_addon.bench.scene_charts import make_charts
from perfect_bvh_addon.operators.bench import PERFECT_BVH_OT_bench

PARTS = {"builders", "total_time", "layouts", "answers", "frames"}


@pytest.fixture
def moving_ball() -> bpy.types.Scene:
    """A ball that deforms by a shape key, over a plane."""
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
    """By a clock that goes on by a millisecond whenever it is looked at: what is measured depends on no machine."""
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
    results = write(figures, tmp_path / "new")
    assert set(results.advice) == PARTS
    assert {path.stem for path in results.pictures} == PARTS
    written = json.loads(results.json.read_text())
    assert written["advice"] == results.advice
    assert results.overview is not None
    image = bpy.data.images.load(str(results.overview))
    assert image.size[0] == 1600 and image.size[1] > 2000
    assert all(sentence.endswith(".") for sentence in results.advice.values())


def test_stopping_keeps_what_there_is(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    bench = SceneBench(subject_of(moving_ball), 60.0)
    steps = bench.steps()
    begin(steps, "builder auto")
    assert [row["name"] for row in bench.figures["builders"]] == ["fast"]
    assert make_charts(bench.figures) == {}
    begin(steps, "builder fast")
    steps.close()
    assert set(make_charts(bench.figures)) == {"builders", "total_time"}
    assert write(bench.figures, tmp_path).json.is_file()


def begin(steps: Iterator[tuple[float, str]], part: str) -> None:
    """Go on until this part is the next; what takes long has several steps."""
    assert any(what == part for _, what in steps)


PARTS_THAT_BUILD = ("rays", "builder spatial", "layout compact", "planner", "frame 1")


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
    begin(steps, "audit")

    def fail(*_: object, **__: object) -> None:
        raise MemoryError("no room for an audit")

    monkeypatch.setattr(SceneBench, "_audit", fail)
    with pytest.raises(MemoryError, match="no room for an audit"):
        next(steps)


def test_no_audit_is_not_called_a_good_one() -> None:
    spread = {"typical": 1.0, "low": 1.0, "high": 1.0, "count": 1}
    row = {"trace_ms": spread, "checked": 0, "wrong": 0, "wrong_per_million": 0.0}
    machine = {"processor": "one", "threads": 1, "isa": "scalar", "perfect_bvh": "0"}
    scene = {"scene": "s", "triangles": 1, "meshes": 1, "instances": 1, "rays": 10, "machine": machine}
    chart = make_charts({**scene, "answers": {**row, "interval": [0.0, 1e6]}})["answers"]
    assert "too large" in chart.title


def test_an_empty_scene_is_refused() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with pytest.raises(ValueError, match="no triangles"):
        next(islice(SceneBench(subject_of(bpy.context.scene)).steps(), 1, None))


def test_the_button_makes_an_image_and_sets_the_frame_back(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    register()
    assert bpy.ops.perfect_bvh.bench(seconds=2.0, folder=str(tmp_path)) == {"FINISHED"}
    assert moving_ball.frame_current == 2
    assert bpy.data.images["Perfect BVH Bench"].size[0] == 1600
    assert (tmp_path / "bench.json").is_file()


def begin_button(folder: Path) -> tuple[FakeOperator, FakeWindow]:
    """It measures, and has reached the frames."""
    operator, window = FakeOperator(PERFECT_BVH_OT_bench), FakeWindow()
    operator.seconds, operator.folder = 60.0, str(folder)
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    operator._bench._clock = count(operator._bench._started, 1e-3).__next__
    operator._bench._seconds = 4.0
    while window.status is None or "frame 2" not in window.status:
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}
    return operator, window


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
    assert ("ERROR", "the scene was removed during the bench") in operator.reports
    assert (window.timers, window.status) == (0, None)


def test_a_folder_that_takes_no_files_is_named_before_anything_is_measured(
    moving_ball: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    register()
    monkeypatch.setattr(SceneBench, "steps", lambda _: pytest.fail("it has begun"))
    with pytest.raises(RuntimeError, match="Cannot write into /proc/nowhere: No such file or directory"):
        bpy.ops.perfect_bvh.bench(folder="/proc/nowhere")


def test_a_full_disk_leaves_the_older_figures(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    bench = SceneBench(subject_of(moving_ball), 60.0)
    older = write(bench.figures, tmp_path).json.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, hard))
    try:
        with pytest.raises(OSError, match=r"cannot write .*bench\.json: File too large"):
            write(bench.figures, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path.name for path in tmp_path.iterdir()] == ["bench.json"]
    assert (tmp_path / "bench.json").read_bytes() == older


def test_blender_draws_pictures_without_matplotlib(
    moving_ball: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "perfect_bvh_addon.bench.matplotlib_png", None)  # as if it could not be imported
    figures = measured(moving_ball, 1.0)
    if not hasattr(__import__("blf"), "bind_imbuf"):
        with pytest.raises(DrawingError, match="perfect-bvh bench"):
            write(figures, tmp_path)
        assert (tmp_path / "bench.json").is_file()
        return
    results = write(figures, tmp_path)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in results.pictures)
    assert results.pictures[0].stat().st_size > 5000


def test_the_way_out_is_named_where_nothing_can_draw(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import blf

    monkeypatch.delattr(blf, "bind_imbuf", raising=False)
    from perfect_bvh_addon.bench.picture import Picture

    with pytest.raises(DrawingError, match=r"JSON.*pip install"):
        blender_png.write(Picture(10, 10), tmp_path / "a.png", 1.0)


def test_the_command(moving_ball: bpy.types.Scene, tmp_path: Path) -> None:
    file = tmp_path / "ball.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file), copy=True)
    out = tmp_path / "charts"
    words = ["bench", str(file), "-o", str(out), "--seconds", "3"]
    code = f"import sys; from perfect_bvh_addon.cli import main; sys.exit(main({words!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "builders.png: " in done.stdout and done.stdout.rstrip().endswith("bench.json")
    assert {path.name for path in out.iterdir()} >= {"bench.json", "builders.png", "overview.png"}
    file_in_the_way = tmp_path / "file"
    file_in_the_way.write_text("")
    words[3] = str(file_in_the_way)
    code = f"import sys; from perfect_bvh_addon.cli import main; sys.exit(main({words!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2 and "expected a folder" in done.stderr
