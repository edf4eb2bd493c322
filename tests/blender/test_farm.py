"""Workers: the output is the same for any number of them, with and without deaths; bad input is refused."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")
pytest.importorskip("distributed")

import psutil  # noqa: E402
from blender.command_lines import run  # noqa: E402
from blender.farm_killer import Killer, complete  # noqa: E402
from blender.farm_runs import JOBS, command, run_job, save_scene  # noqa: E402
from blender.sensor_flight import contents  # noqa: E402
from perfect_bvh_addon.cli import piece_child as child  # noqa: E402
from perfect_bvh_addon.cli.farm import cluster, worker  # noqa: E402

# Scripts of scenes, for workers alone.
DEADLY = """
import bpy, os, sys
def die(scene, *_):
    if scene.frame_current == 5 and "perfect_bvh_addon.cli.piece_child" in sys.orig_argv:
        os.abort()
bpy.app.handlers.frame_change_pre.append(die)
"""
GOING = """
import bpy
def go(scene, *_):
    links, head = scene.collection.objects, bpy.data.objects["Head"]
    if scene.frame_current == 7 and "Head" in links:
        links.unlink(head)
    if scene.frame_current != 7 and "Head" not in links:
        links.link(head)
bpy.app.handlers.frame_change_post.append(go)
"""
FULL_DISK = """
import resource, sys
if "perfect_bvh_addon.cli.piece_child" in sys.orig_argv:
    resource.setrlimit(resource.RLIMIT_FSIZE, (4000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
"""

BROKEN = """
import sys
if "perfect_bvh_addon.cli.piece_child" in sys.orig_argv:
    from perfect_bvh_addon.live.scene_sync import SceneSync
    def fail(*_, **__):
        raise RuntimeError("nothing can be read")
    SceneSync.begin_update = fail
"""
GIVES_BACK = """
import os, sys
if "perfect_bvh_addon.cli.piece_child" in sys.orig_argv and "MALLOC_TRIM_THRESHOLD_" in os.environ:
    os.abort()
"""


def save_with_script(folder: Path, to: Path, script: str) -> None:
    """Save a copy of the scene that runs a script when it is opened."""
    bpy.ops.wm.open_mainfile(filepath=str(folder / "small.blend"))
    text = bpy.data.texts.new("script.py")
    text.write(script)
    text.use_module = True
    bpy.ops.wm.save_as_mainfile(filepath=str(to / "small.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    (to / "sensor.toml").write_bytes((folder / "sensor.toml").read_bytes())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("farm")
    save_scene(made)
    return made


@pytest.fixture(scope="module")
def whole(folder: Path) -> dict[str, dict[str, bytes]]:
    """The output of each job without workers."""
    found = {}
    for name in JOBS:
        status, errors = run_job(folder, name, folder / f"whole_{name}", "--resume")
        assert status == 0, errors
        found[name] = contents(folder / f"whole_{name}")
    return found


@pytest.mark.parametrize(("name", "workers"), [("scan", 1), ("labels", 2), ("render", 2), ("labels", 4), ("bake", 2)])
def test_any_number_of_workers_makes_the_same_bytes(
    folder: Path, tmp_path: Path, whole: dict[str, dict[str, bytes]], name: str, workers: int
) -> None:
    status, errors = run_job(folder, name, tmp_path / "out", "--workers", workers)
    assert status == 0, errors
    assert contents(tmp_path / "out") == whole[name]
    assert len(whole[name]) == {"scan": 12, "labels": 25, "render": 18, "bake": 18}[name]


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL, which Windows has not")
def test_whatever_is_killed_the_bytes_are_the_same(
    folder: Path, tmp_path: Path, whole: dict[str, dict[str, bytes]]
) -> None:
    killer = Killer(seed=7, rate=0.7)
    complete(folder, "labels", tmp_path / "out", killer, most=5)
    assert contents(tmp_path / "out") == whole["labels"]
    assert killer.killed


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL, which Windows has not")
def test_a_worker_that_is_killed_while_it_starts_is_started_again(folder: Path, tmp_path: Path) -> None:
    with subprocess.Popen(
        command("labels", tmp_path / "out", "--no-coco", "--workers", 2, frames="1-2"),
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
    ) as started:
        root, killed = psutil.Process(started.pid), False
        while not killed:
            assert started.poll() is None
            for child in root.children():
                with contextlib.suppress(psutil.NoSuchProcess):  # Dask and Blender start short-lived ones, too
                    if not killed and "spawn_main" in " ".join(child.cmdline()):
                        child.kill()
                        killed = True
        errors = started.communicate(timeout=300)[1]
    assert started.returncode == 0, errors
    assert len(contents(tmp_path / "out")) == 3


def test_workers_run_no_modules_of_the_users(folder: Path, tmp_path: Path) -> None:
    """This concerns modules in the current folder with names of Python's own modules, and a script without a guard."""
    for name in ("random", "queue", "socket", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the user's own module')")
    script = tmp_path / "scripts" / "run.py"
    script.parent.mkdir()
    verb, *more = command("labels", tmp_path / "out", "--no-coco", "--workers", 2, frames="1-4")[3:]
    arguments = [verb, str(folder / "small.blend"), *more[1:]]
    script.write_text(f"from perfect_bvh_addon.cli import main\nprint('status', main({arguments!r}))\n")
    done = subprocess.run([sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.stdout.endswith("status 0\n"), done.stderr
    assert len(contents(tmp_path / "out")) == 6


def test_what_a_blender_has_died_of_is_told(folder: Path, tmp_path: Path) -> None:
    save_with_script(folder, tmp_path, BROKEN)
    status, errors = run_job(tmp_path, "labels", tmp_path / "out", "--workers", 1, "--autoexec", frames="1-2")
    assert status == 3, errors
    assert "RuntimeError: nothing can be read" in errors


def test_a_piece_of_which_workers_die_fails_and_the_others_go_on(folder: Path, tmp_path: Path) -> None:
    save_with_script(folder, tmp_path, DEADLY)
    out = tmp_path / "out"
    status, errors = run_job(tmp_path, "labels", out, "--no-coco", "--workers", 2, "--autoexec", frames="5-8")
    assert status == 3, errors
    assert errors.count("a worker died") == 2
    assert "frames 5-6: 3 workers died on it" in errors and "it ended with status -6" in errors
    assert "1 of 2 chunks failed" in errors
    assert sorted(contents(out)) == ["labels_0007-0008.json", "labels_0007.npz", "labels_0008.npz"]


def test_blenders_are_spared_how_dask_has_memory_given_back(folder: Path, tmp_path: Path) -> None:
    save_with_script(folder, tmp_path, GIVES_BACK)
    status, errors = run_job(tmp_path, "scan", tmp_path / "out", "--workers", 1, "--autoexec", frames="1-2")
    assert status == 0, errors


def test_a_sensor_that_is_not_there_in_a_frame_is_named_and_the_others_go_on(folder: Path, tmp_path: Path) -> None:
    save_with_script(folder, tmp_path, GOING)
    status, errors = run_job(tmp_path, "scan", tmp_path / "out", "--workers", 2, "--autoexec", frames="1-10")
    assert status == 3, errors
    assert "frames 7-8" in errors and "'Head'" in errors
    assert (tmp_path / "out" / "points_0009-0010.json").exists()


def test_what_workers_cannot_see_is_said_before_anything_starts(folder: Path, tmp_path: Path, capfd: Any) -> None:
    from perfect_bvh_addon.cli.farm.cluster import _fault_of
    from perfect_bvh_addon.cli.farm.worker import look

    class Arguments:
        file = str(folder / "small.blend")
        output = str(tmp_path)

    probe = tmp_path / "probe"
    probe.touch()
    seen = look(Arguments.file, str(probe))
    assert _fault_of(seen, Arguments) is None
    for changed, said in (
        (look(str(tmp_path / "small.blend"), str(probe)), "does not exist there"),
        (look(Arguments.file, str(tmp_path / "missing")), "of -o does not exist there"),
        ({**seen, "size": 3}, "is a different file there, of 3 bytes"),
        ({**seen, "version": "0.1.9"}, "it has Perfect BVH 0.1.9, but "),
        ({**seen, "has_blender": False}, "no module bpy"),
        (ModuleNotFoundError("No module named 'perfect_bvh_addon'"), "is not installed there"),
    ):
        assert said in _fault_of(changed, Arguments)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes], subprocess.Popen[bytes]]]:
    """A user's scheduler: its address, its process, and the process of a worker with another version of Perfect BVH."""
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    options = ["--no-dashboard", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file)]
    with subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_scheduler", *options], **quiet) as process:
        while not file.exists() or not file.stat().st_size:
            assert process.poll() is None
            time.sleep(0.05)
        import json

        address = json.loads(file.read_text())["address"]
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
        with subprocess.Popen([*worker, "--local-directory", str(tmp_path)], **quiet) as other:
            yield address, process, other
            other.kill()
        process.kill()


def test_a_scheduler_of_the_users_is_used_and_may_go_away(
    folder: Path, tmp_path: Path, whole: dict[str, dict[str, bytes]], scheduler: Any
) -> None:
    address, process, _ = scheduler
    out = tmp_path / "out"
    with subprocess.Popen(
        command("render", out, "--scheduler", address), cwd=folder, stderr=subprocess.PIPE, text=True
    ) as started:
        while not list(out.glob("*.manifest.json")):
            assert started.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL) if os.name == "posix" else process.kill()
        errors = started.communicate(timeout=300)[1]
    assert started.returncode == 2, errors
    assert "the connection to the scheduler is lost" in errors and "Traceback" not in errors
    found = contents(out)
    assert 0 < len(found) < 18
    status, errors = run_job(folder, "render", out, "--resume")
    assert status == 0, errors
    assert contents(out) == whole["render"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--workers", 2, "--scheduler", "tcp://127.0.0.1:1"), "give only one of them"),
        (("--workers", 0), "must be at least 1"),
        (("--scheduler", "nonsense://x"), "no scheduler answers"),
    ],
)
def test_mistakes_are_named(folder: Path, tmp_path: Path, capfd: Any, more: tuple[object, ...], said: str) -> None:
    assert run("labels", folder / "small.blend", "-o", tmp_path / "out", *more) == 2
    assert said in capfd.readouterr().err


def test_without_dask_it_says_what_to_install(
    folder: Path, tmp_path: Path, capfd: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    import importlib.util

    true_find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "distributed" else true_find(name))
    assert run("labels", folder / "small.blend", "-o", tmp_path / "out", "--workers", 2) == 2
    assert "pip install 'perfect-bvh[farm]'" in capfd.readouterr().err


def temporary_folders(place: Path) -> list[str]:
    """Return the temporary folders of Blender, and those around them."""
    found = [name for _, folders, _ in os.walk(place) for name in folders]
    return sorted(name for name in found if name.startswith(("blender_", "perfect_bvh_")))


def start_with_temporary(place: Path, folder: Path, out: Path, frames: str) -> subprocess.Popen[str]:
    """Start a scan by two workers that use `place` for temporary files."""
    place.mkdir()
    environment = {**os.environ, **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(place))}
    arguments = command("scan", out, "--workers", 2, frames=frames)
    return subprocess.Popen(arguments, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True)


def test_a_run_leaves_no_temporary_folders(folder: Path, tmp_path: Path) -> None:
    place, seen = tmp_path / "temporary", set()
    with start_with_temporary(place, folder, tmp_path / "out", "1-4") as started:
        while started.poll() is None:
            seen |= set(temporary_folders(place))
            time.sleep(0.02)
        assert started.returncode == 0, started.stderr.read()
    kinds = {kind: sum(name.startswith(kind) for name in seen) for kind in ("blender_", "perfect_bvh_")}
    assert kinds["blender_"] >= 2 and kinds["perfect_bvh_"] >= 1  # the run's own, and those of its workers
    assert temporary_folders(place) == []


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL, which Windows has not")
def test_a_killed_run_leaves_no_process_and_no_temporary_folder_but_its_own(folder: Path, tmp_path: Path) -> None:
    out, place = tmp_path / "out", tmp_path / "temporary"
    with start_with_temporary(place, folder, out, "1-400") as started:
        while not list(out.glob("*.json")):
            assert started.poll() is None
            time.sleep(0.02)
        (own,) = place.glob("blender_*")
        assert len(temporary_folders(place)) >= 3
        processes = psutil.Process(started.pid).children(recursive=True)
        started.kill()
    psutil.wait_procs(processes, timeout=60)
    assert not [each for each in processes if each.is_running()]
    assert temporary_folders(place) == [own.name]


@pytest.fixture
def blender(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[worker.BlenderProcess]:
    """A process with a Blender inside whose scene file is missing."""
    import perfect_bvh
    from perfect_bvh_addon.cli import build_parser

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    arguments = vars(build_parser("perfect-bvh").parse_args(["labels", "missing.blend", "-o", str(tmp_path)]))
    job = {"id": "1", "version": perfect_bvh.__version__, "inputs": {}, "checksums": {}, "arguments": arguments}
    made = worker.BlenderProcess("1")
    try:
        assert "cannot open it" in made.ask({"job": job, "piece": 0})["refused"]
        (around, inside) = sorted(temporary_folders(tmp_path), reverse=True)
        assert around.startswith("perfect_bvh_") and (tmp_path / around / inside).is_dir()
        yield made
    finally:
        made.close()


def test_a_blender_that_is_alone_removes_its_temporary_folder(blender: worker.BlenderProcess, tmp_path: Path) -> None:
    """This happens when its worker was killed."""
    blender._process.stdin.close()
    assert blender._process.wait(60) == child.EXIT_ALONE
    assert temporary_folders(tmp_path) == []


def test_a_blender_that_dies_is_tidied_up_after(blender: worker.BlenderProcess, tmp_path: Path) -> None:
    blender._process.kill()
    with pytest.raises(worker.DeadBlenderError):
        blender.ask({})
    assert len(temporary_folders(tmp_path)) == 2
    blender.close()
    assert temporary_folders(tmp_path) == []


def test_a_blender_that_is_busy_is_ended_with_its_temporary_folder(
    blender: worker.BlenderProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "_busy", {blender})
    worker.end_blenders("1")
    assert blender._process.poll() is not None and temporary_folders(tmp_path) == []


def test_workers_that_end_late_are_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """This happens on a busy machine, when all answers have already arrived."""
    from distributed import LocalCluster

    close = LocalCluster.close

    def close_late(local: LocalCluster, timeout: float | None = None) -> None:
        close(local, timeout)
        raise TimeoutError

    monkeypatch.setattr(LocalCluster, "close", close_late)
    with cluster.cluster_client(Namespace(scheduler=None, workers=1)) as client:
        assert client.submit(pow, 2, 3).result() == 8


def test_a_run_stops_and_ends_its_own_blenders_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs share a worker of one scheduler."""
    made = [StandIn(None, job_id) for job_id in "abab"]
    monkeypatch.setattr(worker, "_busy", set(made[:2]))
    monkeypatch.setattr(worker, "_free", made[2:])
    worker.stop_pieces("a")
    assert [each.heard for each in made] == [["stop"], [], [], []]
    worker.end_blenders("b")
    assert [each.heard for each in made] == [["stop"], ["end", "tidy"], [], ["end", "close"]]
    assert worker._free == [made[2]]


def test_a_run_is_not_given_the_blender_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    import distributed

    other = StandIn(None, "a")
    monkeypatch.setattr(worker, "_free", [other])
    monkeypatch.setattr(worker, "BlenderProcess", lambda job_id: StandIn(None, job_id))
    monkeypatch.setattr(distributed, "get_worker", lambda: SimpleNamespace(address="here"))
    for _ in range(2):
        assert "done" in worker.do_piece({"id": "b"}, 0)
    assert [each.job_id for each in worker._free] == ["a", "b"] and not other.heard


class StandIn:
    """Stands in for a worker's Blender that answers, or has ended with a status. heard: the requests to it."""

    def __init__(self, status: int | None, job_id: str = "1") -> None:
        self.has_left = status == 0
        self.status = status
        self.job_id = job_id
        self.heard: list[str] = []

    def ask(self, _: object) -> dict[str, Any]:
        self.heard.append("ask")
        if self.status is not None:
            raise worker.DeadBlenderError(f"status {self.status}")
        return {"done": {}}

    def stop(self) -> None:
        self.heard.append("stop")

    def end(self) -> None:
        self.heard.append("end")

    def tidy(self) -> None:
        self.heard.append("tidy")

    def close(self) -> None:
        self.heard.append("close")


@pytest.mark.parametrize(
    ("free", "fresh", "answer"),
    [
        ([0, 0], None, {"done": {}}),
        ([0], 0, {"died": "status 0"}),
        ([1], None, {"died": "status 1"}),
        ([], 0, {"died": "status 0"}),
    ],
)
def test_a_blender_that_has_left_for_idleness_is_no_death(
    monkeypatch: pytest.MonkeyPatch, free: list[int], fresh: int | None, answer: dict[str, Any]
) -> None:
    import distributed

    blenders = [StandIn(status) for status in free]
    made = StandIn(fresh)
    monkeypatch.setattr(worker, "_free", [*blenders])
    monkeypatch.setattr(worker, "BlenderProcess", lambda _: made)
    monkeypatch.setattr(distributed, "get_worker", lambda: SimpleNamespace(address="here"))
    found = worker.do_piece({"id": "1"}, 0)
    assert found.items() >= answer.items()
    assert all("close" in each.heard for each in blenders) and ("close" in made.heard) == (fresh is not None)
    assert worker._free == ([made] if "done" in answer else []) and not worker._busy


@pytest.mark.skipif(sys.platform == "win32", reason="process groups that a terminal interrupts, which Windows has not")
@pytest.mark.usefixtures("hears_ctrl_c")
def test_ctrl_c_leaves_whole_files(folder: Path, tmp_path: Path, whole: dict[str, dict[str, bytes]]) -> None:
    """Ctrl+C reaches all processes of a terminal at once."""
    out = tmp_path / "out"
    with subprocess.Popen(
        command("labels", out, "--workers", 2), cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as started:
        while not list(out.glob("*.coco.jsonl")):
            assert started.poll() is None
            time.sleep(0.02)
        processes = psutil.Process(started.pid).children(recursive=True)
        os.killpg(started.pid, signal.SIGINT)
        errors = started.communicate(timeout=300)[1]
    assert started.returncode == 130, errors
    assert "continue with --resume" in errors and "Traceback" not in errors
    psutil.wait_procs(processes, timeout=60)
    assert not [each for each in processes if each.is_running()]
    found = contents(out)
    assert 0 < len(found) < len(whole["labels"])
    assert found.items() <= whole["labels"].items()


def test_a_full_disk_ends_the_run(folder: Path, tmp_path: Path) -> None:
    """Blender's processes can write no file of more than 4,000 bytes."""
    pytest.importorskip("resource", reason="this system limits no process's files, as Windows does not")
    save_with_script(folder, tmp_path, FULL_DISK)
    status, errors = run_job(tmp_path, "labels", tmp_path / "out", "--workers", 1, "--autoexec", frames="1-4")
    assert status == 2, errors
    assert "cannot write" in errors and "File too large" in errors and "0 of 2 chunks are complete" in errors
    assert "Traceback" not in errors
    assert contents(tmp_path / "out") == {}


def test_greys_of_pieces_are_on_the_scale_of_the_first_frame(folder: Path, tmp_path: Path) -> None:
    """Frames in chunks equal those of a single render, and existing frames are not rendered again."""
    asked = ("render", folder / "small.blend", "--frames", "1-3", "--mode", "depth", "-q")
    assert run(*asked, "-o", f"{tmp_path}/whole/") == 0
    assert run(*asked, "-o", f"{tmp_path}/out/", "--resume", "--chunk", 1) == 0
    images = {name: content for name, content in contents(tmp_path / "out").items() if name.endswith(".png")}
    assert images == contents(tmp_path / "whole") and len(images) == 3
    (tmp_path / "out" / "frame_0002.png").write_bytes(b"damaged")
    kept = (tmp_path / "out" / "frame_0003.png").stat().st_mtime_ns
    assert run(*asked, "-o", f"{tmp_path}/out/", "--resume", "--chunk", 1) == 0
    assert contents(tmp_path / "out")["frame_0002.png"] == images["frame_0002.png"]
    assert (tmp_path / "out" / "frame_0003.png").stat().st_mtime_ns == kept
    assert run(*asked, "-o", f"{tmp_path}/out/", "--resume", "--chunk", 1, "--samples", 7) == 2
    assert run(*asked, "-o", f"{tmp_path}/out/", "--resume", "--stats") == 2


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"version": "0.1.9"}, "not 0.1.9"),
        ({"inputs": {"files": {"small.blend": "1"}}}, "its inputs differ in 'files' (small.blend)"),
        ({"inputs": {"blender": "4.2.0"}}, ', not "4.2.0")'),
        ({"arguments": {"file": "missing.blend"}}, "Blender cannot open it"),
    ],
)
def test_a_worker_that_joins_with_other_software_or_files_refuses(
    folder: Path, tmp_path: Path, changed: dict[str, Any], said: str
) -> None:
    import perfect_bvh
    from perfect_bvh_addon import unregister
    from perfect_bvh_addon.cli import build_parser
    from perfect_bvh_addon.cli.blender import StopRequest
    from perfect_bvh_addon.cli.piece_child import Workbench

    asked = ["labels", str(folder / "small.blend"), "-o", str(tmp_path), "--frames", "1-2"]
    arguments = {**vars(build_parser("perfect-bvh").parse_args(asked)), **changed.get("arguments", {})}
    job = {
        "id": "1",
        "version": perfect_bvh.__version__,
        "inputs": {},
        "checksums": {},
        **changed,
        "arguments": arguments,
    }
    try:
        answer = Workbench(StopRequest()).answer({"job": job, "piece": 0})
    finally:
        unregister()
    assert said in answer["refused"]
    assert contents(tmp_path) == {}


def test_a_blender_of_a_worker_reads_no_file_again_that_the_run_has_read(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import perfect_bvh_addon
    from perfect_bvh_addon.cli import build_parser
    from perfect_bvh_addon.cli.blender import StopRequest, open_scene
    from perfect_bvh_addon.cli.farm.run import _job_of
    from perfect_bvh_addon.cli.labels import labels_work
    from perfect_bvh_addon.pieces import piece

    read: list[str] = []
    true_checksum = piece.checksum
    monkeypatch.setattr(piece, "checksum", lambda path: read.append(path.name) or true_checksum(path))
    monkeypatch.setattr(piece, "_known", {})
    bpy.ops.wm.open_mainfile(filepath=str(folder / "small.blend"))
    bpy.data.images.new("wood", 4, 4).save(filepath=str(tmp_path / "wood.png"))
    bpy.data.images.load(str(tmp_path / "wood.png")).use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "linked.blend"))
    asked = ["labels", str(tmp_path / "linked.blend"), "-o", str(tmp_path / "out"), "--frames", "1-2"]
    arguments = build_parser("perfect-bvh").parse_args(asked)
    try:
        scene = open_scene(Path(arguments.file), arguments)
        job = json.loads(json.dumps(_job_of(labels_work(scene, StopRequest(), arguments), arguments, 1)))
        assert sorted(read) == ["linked.blend", "wood.png"]
        piece._known.clear()  # as in the worker's process
        assert child._open(job, StopRequest()).place.inputs == job["inputs"]
    finally:
        perfect_bvh_addon.unregister()
    assert sorted(read) == ["linked.blend", "wood.png"]
