"""The Scan button's files: equal to the command line's byte for byte; resumed, refused, and stopped by Esc."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from blender.command_lines import run  # noqa: E402
from blender.long_builds import ESCAPE, TIMER, FakeOperator, FakeWindow, patiently  # noqa: E402
from blender.sensor_flight import SENSOR, contents, save_flight  # noqa: E402
from perfect_bvh_addon.operators import piece_jobs, scan_request  # noqa: E402
from perfect_bvh_addon.operators.scan_button import PERFECT_BVH_OT_scan  # noqa: E402
from perfect_bvh_addon.scanning.point_data import colors_of_column  # noqa: E402


@pytest.fixture
def small_file(tmp_path: Path) -> Iterator[Path]:
    """An open file with an empty that flies past; the panel is set to six frames of it in three files."""
    path = save_flight(tmp_path)
    open_again(path)
    yield path
    perfect_bvh_addon.unregister()


@pytest.fixture(autouse=True)
def steps_are_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """End each tick of the timer as soon as possible: the work in a tick does not depend on the machine's speed."""
    monkeypatch.setattr(piece_jobs, "STEP_SECONDS", 0.0)


def open_again(path: Path) -> None:
    perfect_bvh_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    settings = scan_settings()
    settings.pattern, settings.sensor_file = "FILE", str(path.parent / "sensor.toml")
    settings.sensor = bpy.data.objects["Head"]
    settings.frames, settings.frame_start, settings.frame_end, settings.frames_per_file = "RANGE", 1, 6, 2
    settings.use_points, settings.use_files, settings.folder = False, True, str(path.parent / "panel")


def scan_settings() -> Any:
    return bpy.context.scene.perfect_bvh.scan


def scanned_by_command(path: Path, *more: object) -> dict[str, bytes]:
    """Return the files that the command line writes for the same scan."""
    out = path.parent / "command"
    asked = ("--sensor", path.parent / "sensor.toml", "--on", "Head", "--chunk", 2, "-q")
    assert run("scan", path, "-o", out, *asked, *(more or ("--frames", "1-6"))) == 0
    open_again(path)
    return contents(out)


def started() -> tuple[FakeOperator, FakeWindow]:
    operator, window = FakeOperator(PERFECT_BVH_OT_scan), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    return operator, window


def tick_until(operator: FakeOperator, window: FakeWindow, condition: Callable[[], object]) -> None:
    for _ in patiently("it does not come to that"):
        if condition():
            return
        assert operator.modal(window, TIMER) == {"RUNNING_MODAL"}


@pytest.mark.parametrize("suffix", ["npz", "ply", "laz"])
def test_the_button_writes_what_the_command_line_writes(small_file: Path, suffix: str) -> None:
    pytest.importorskip({"npz": "numpy", "ply": "plyfile", "laz": "lazrs"}[suffix])
    expected = scanned_by_command(small_file, "--frames", "1-6", "--format", suffix)
    scan_settings().file_format = suffix
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    found = contents(small_file.parent / "panel")
    assert len(found) == 6 and found == expected
    assert "Scan" not in "".join(bpy.data.objects.keys())


def test_noise_is_that_of_the_seed(small_file: Path) -> None:
    (small_file.parent / "sensor.toml").write_text(SENSOR + "\n[noise]\nrange = 0.02\n")
    expected = scanned_by_command(small_file, "--frames", "1-6", "--seed", 5)
    scan_settings().seed = 5
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(small_file.parent / "panel") == expected
    scan_settings().seed = 6
    with pytest.raises(RuntimeError, match="differs in 'seed'"):
        bpy.ops.perfect_bvh.scan()


def test_labels_are_columns_of_files_and_of_points_to_color(small_file: Path) -> None:
    expected = scanned_by_command(small_file, "--frames", "1-6", "--labels", "object", "collection")
    settings = scan_settings()
    settings.labels, settings.use_points = "object, collection", True
    settings.point_color, settings.point_column = "COLUMN", "label_object"
    with pytest.raises(RuntimeError, match=r"have no column 'label_object', but .*, object, collection"):
        bpy.ops.perfect_bvh.scan()
    settings.point_column = "object"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(small_file.parent / "panel") == expected
    with np.load(small_file.parent / "panel" / "points_0003-0004.npz") as written:
        colors = colors_of_column(written["object"], "ids")
    shown = np.empty(colors.size, np.float32)
    bpy.data.objects["Scan 3-4"].data.attributes["Color"].data.foreach_get("color", shown)
    np.testing.assert_array_equal(shown.reshape(-1, 4), colors)
    settings.labels = "collection"
    settings.point_color = "DISTANCE"
    with pytest.raises(RuntimeError, match="differs in 'labels'"):
        bpy.ops.perfect_bvh.scan()


def test_a_pass_in_the_current_frame_is_that_of_the_command_line(small_file: Path) -> None:
    expected = scanned_by_command(small_file, "--format", "npz")
    scan_settings().frames = "CURRENT"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(small_file.parent / "panel") == expected and len(expected) == 2


def test_what_is_simulated_is_played_and_the_frame_set_back(small_file: Path) -> None:
    bpy.context.view_layer.objects.active = cube = bpy.data.objects["Cube"]
    cube.animation_data_clear()
    cube.location.z = 8.0
    bpy.ops.rigidbody.object_add()
    bpy.ops.wm.save_mainfile()
    expected = scanned_by_command(small_file)
    folder = small_file.parent / "panel"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    (folder / "points_0005-0006.npz").unlink()
    open_again(small_file)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(folder) == expected and bpy.context.scene.frame_current == 1


def test_whole_files_are_kept_and_others_written_again(small_file: Path) -> None:
    folder = small_file.parent / "panel"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    expected = contents(folder)
    times = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    (whole, missing, damaged) = sorted(times)
    missing.unlink()
    damaged.write_bytes(damaged.read_bytes()[:-50] + bytes(50))
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(folder) == expected and whole.stat().st_mtime_ns == times[whole]
    scan_settings().use_resume = False
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert contents(folder) == expected and whole.stat().st_mtime_ns > times[whole]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"steps_per_frame": 3}, "has chunks of another scan: points_0001-0002.json differs in 'steps'"),
        ({"frames_per_file": 3}, "differs in the division of frames into chunks"),
        ({"pattern": "spinning-16"}, "differs in 'sensor'; choose another folder, or empty this one"),
        ({"frames": "CURRENT"}, "differs in the division of frames into chunks"),
    ],
)
def test_a_folder_of_another_scan_is_refused(small_file: Path, change: dict[str, Any], message: str) -> None:
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    expected = contents(small_file.parent / "panel")
    for name, value in change.items():
        setattr(scan_settings(), name, value)
    for scan_settings().use_resume in (True, False):
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.perfect_bvh.scan()
    assert contents(small_file.parent / "panel") == expected


def test_esc_leaves_whole_pieces_and_start_goes_on(small_file: Path) -> None:
    expected, folder = scanned_by_command(small_file), small_file.parent / "panel"
    operator, window = started()
    tick_until(operator, window, lambda: (folder / "points_0003-0004.json").exists())
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    told = f"Scan canceled: 2 of 3 files written to {folder}. Start Scan continues"
    assert operator.reports == [("INFO", told)]
    assert window.timers == 0 and window.status is None and bpy.context.scene.frame_current == 1
    kept = contents(folder)
    assert sorted(kept) == sorted(expected)[:4] and all(expected[name] == kept[name] for name in kept)
    assert window.progress == sorted(window.progress) and 0.0 < window.progress[-1] < 100.0
    operator, window = started()
    for _ in patiently("it does not end"):
        if operator.modal(window, TIMER) != {"RUNNING_MODAL"}:
            break
    assert contents(folder) == expected and window.progress[-1] == 100.0
    ((kind, report),) = operator.reports
    assert kind == "INFO" and report.startswith("Wrote 1 file with ")
    assert f" points to {folder}, 2 files existed, " in report


def test_the_status_bar_tells_which_frame_is_worked_on(small_file: Path) -> None:
    operator, window = started()
    seen: list[str | None] = []
    tick_until(operator, window, lambda: seen.append(window.status) or "frame 6 of 6" in (window.status or ""))
    operator.modal(window, ESCAPE)
    assert seen[0] == "Scanning frame 1 of 6 | Esc: Cancel"
    told = {text.rpartition("frame ")[2].partition(" ")[0] for text in seen if text}
    assert {"1", "3", "5", "6"} <= told <= set("123456")


@pytest.mark.parametrize("as_files", [True, False])
def test_a_file_that_is_saved_meanwhile_stores_the_users_frame(small_file: Path, as_files: bool) -> None:
    scan_settings().use_files, scan_settings().use_points = as_files, not as_files
    scene = bpy.context.scene
    scene.frame_set(2)
    operator, window = started()
    tick_until(operator, window, lambda: scene.frame_current > 3)
    there, saved = scene.frame_current, small_file.parent / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(saved), copy=True)
    assert scene.frame_current == there
    assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    assert scene.frame_current == 2
    assert not any("saving" in handler.__name__ for handler in bpy.app.handlers.save_pre)
    open_again(saved)
    assert bpy.context.scene.frame_current == 2


def test_two_scans_do_not_write_into_one_folder(small_file: Path) -> None:
    operator, window = started()
    with pytest.raises(RuntimeError, match=r"Files are still being written into .*panel: wait"):
        bpy.ops.perfect_bvh.scan()
    operator.modal(window, ESCAPE)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}


def test_what_the_panel_says_meanwhile_does_not_count(small_file: Path) -> None:
    expected, settings = scanned_by_command(small_file), scan_settings()
    settings.use_points = True
    operator, window = started()
    settings.use_files, settings.use_points, settings.folder, settings.labels = False, False, "", "collection"
    settings.point_color, settings.point_column, settings.steps_per_frame = "COLUMN", "nothing", 3
    for _ in patiently("it does not end"):
        if (ended := operator.modal(window, TIMER)) != {"RUNNING_MODAL"}:
            break
    assert ended == {"FINISHED"} and contents(small_file.parent / "panel") == expected
    assert "Scan 5-6" in bpy.data.objects


def test_points_are_added_as_well_if_that_is_chosen_an_object_a_piece(small_file: Path) -> None:
    scan_settings().use_points = True
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    for name, stem in (("Scan 1-2", "0001-0002"), ("Scan 3-4", "0003-0004"), ("Scan 5-6", "0005-0006")):
        written = np.load(small_file.parent / "panel" / f"points_{stem}.npz")["positions"].astype(np.float32)
        places = np.empty(written.size, np.float32)
        bpy.data.objects[name].data.attributes["position"].data.foreach_get("vector", places)
        np.testing.assert_array_equal(places.reshape(-1, 3), written)
    operator, window = started()  # the scan's own points do not make it another scene
    for _ in patiently("it does not end"):
        if operator.modal(window, TIMER) != {"RUNNING_MODAL"}:
            break
    assert [kind for kind, _ in operator.reports] == ["WARNING", "INFO"]
    assert operator.reports[0][1].startswith("3 files existed: these frames were not scanned again")


def test_a_scene_that_is_not_saved_is_recognised_until_it_is_edited(small_file: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(scan_request, "is_dirty", lambda: True)
    folder = small_file.parent / "panel"
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    times = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    scan_settings().use_resume = True
    bpy.context.scene.frame_set(4)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")} == times
    bpy.data.objects["Sheet"].location.z += 0.1
    with pytest.raises(RuntimeError, match="differs in 'files'"):
        bpy.ops.perfect_bvh.scan()
    monkeypatch.setattr(scan_request, "is_dirty", lambda: False)
    with pytest.raises(RuntimeError, match="differs in 'files'"):
        bpy.ops.perfect_bvh.scan()


def test_an_edit_during_the_scan_ends_it_with_the_pieces_before(small_file: Path, monkeypatch: Any) -> None:
    folder = small_file.parent / "panel"
    operator, window = started()
    tick_until(operator, window, lambda: (folder / "points_0001-0002.json").exists())
    monkeypatch.setattr(scan_request, "is_dirty", lambda: True)
    bpy.data.objects["Sheet"].location.z += 0.1
    bpy.context.view_layer.update()
    for _ in patiently("it goes on"):
        if operator.modal(window, TIMER) != {"RUNNING_MODAL"}:
            break
    ((kind, report),) = operator.reports
    assert kind == "ERROR" and "edited during the work: the files from frame" in report
    assert "points_0005-0006.npz" not in contents(folder)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"folder": ""}, "Choose a folder for the files"),
        ({"folder": "small.blend"}, "is a file: choose a folder"),
        ({"use_files": False}, "Nothing to output: enable Add Point Cloud or Write Files"),
        ({"frame_end": -3}, "The range must end at or after its start, 1: got -3"),
        ({"sensor_file": ""}, "Choose a sensor's file, or another sensor"),
        ({"sensor_file": "small.blend"}, "A sensor's file ends in .toml, got 'small.blend'"),
        ({"sensor_file": "none.toml"}, "Cannot read .*none.toml: No such file or directory"),
    ],
)
def test_what_is_wrong_is_named_before_a_folder_is_made(
    small_file: Path, changes: dict[str, Any], message: str
) -> None:
    for name, value in changes.items():
        is_path = name in ("folder", "sensor_file") and value
        setattr(scan_settings(), name, str(small_file.parent / value) if is_path else value)
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.perfect_bvh.scan()
    assert not (small_file.parent / "panel").exists()


def test_a_format_without_its_library_is_named_with_how_to_get_it(small_file: Path, monkeypatch: Any) -> None:
    from blender.drawn_texts import drawn
    from perfect_bvh_addon import panels
    from perfect_bvh_addon.scanning import formats

    def library(name: str) -> Any:
        raise ImportError(f"this format needs {name}: pip install 'perfect-bvh[data]'")

    monkeypatch.setattr(formats, "_library", library)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    scan_settings().file_format = "laz"
    with pytest.raises(RuntimeError, match="Laz: this format needs laspy: pip install"):
        bpy.ops.perfect_bvh.scan()
    told = " ".join(drawn(panels.output.PERFECT_BVH_PT_scan))
    monkeypatch.undo()
    assert "LAZ files need laspy and lazrs" in told and "-m pip install laspy lazrs" in told
    assert "perfect_bvh.copy_command" in told
    scan_settings().file_format = "npz"
    told = " ".join(drawn(panels.output.PERFECT_BVH_PT_scan))
    assert "-m pip install" not in told and "perfect_bvh.copy_command" not in told
