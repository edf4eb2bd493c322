"""The examples run and leave pictures; the pages of docs/how_to show them, and their shell commands run, too."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "release"))

import gallery

REPOSITORY = Path(__file__).resolve().parent.parent
WIDTH = 64
PAGES = sorted((REPOSITORY / "docs" / "how_to").glob("*.md"))
BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHELL = {page.name: found for page in PAGES if (found := BLOCK.findall(page.read_text(encoding="utf-8")))}
# The last line that each example prints. A blade is over the point at (atan(.2) -+ asin(.1 / 1.53)) / 18 degrees.
PRINTED = {
    "bvhtree.py": r"polygon \d+ at 4\.\d+",
    "closest_points.py": r"\[ ?\S+ +0\. +\S+\] is [34]\.\d+ from \[.+\]",
    "compare_builders.py": r"\s*spatial( +\d\S*){4}",
    "drive.py": r"\d{5,} points and [1-9]\d* boxes in the first of three frames",
    "label_image.py": r".+: \d+% of it is visible",
    "lidar.py": r"\d{5,} points on \d\d objects from \d{5,} rays",
    "mesh_costs.py": r".+ took longest to build: \d+ triangles, by \w+: .+",
    "modes.py": r".+mode_cost\.png",
    "motion_blur.py": r"\d\d instances and meshes move, over [1-9]\d?\.\d% of the view",
    "own_sensor.py": r"\d+ on_objects, .*\d+ dropped_out, \d+ hit_nothing",
    "photogrammetry.py": r"\d\d% of the places are seen by three cameras or more, \d\d?% by none",
    "preview.py": r".+preview\.png",
    "rays_in_time.py": r"a blade is over \(1\.5, 0\.3\) between 0\.42\d and 0\.83\d",
    "rays_without_blender.py": r"7\d% of 2304 rays hit, \d+% in shadow",
    "refitting.py": r".+refitting\.png",
    "sun_hours.py": r"\d\.\d hours of sun in the mean, 1\d\.\d at most",
    "synced_rays.py": r"1 instances were moved; now the highest is at 1\d\.\d\d m",
    "town_sun.py": r"year: the court has 0 to 1\d{3} of 44\d\d hours",
    "xray.py": r"\d{4,} surfaces on 4096 rays; 1 of 1 meets a vertex",
    "tree_boxes.py": r"a random ray .+ is expected to cost [1-9]\d*\.\d visits and tests",
}

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="the commands are those of a POSIX shell")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, gallery.Made]:
    """The output of each example with tiny pictures; the gallery's page is next to their folders."""
    return gallery.make_gallery(tmp_path_factory.mktemp("gallery"), WIDTH)


def test_the_examples_print_what_they_found(made: dict[str, gallery.Made]) -> None:
    last = {name: [line for line in result.printed.splitlines() if line.strip()][-1] for name, result in made.items()}
    assert {name: line for name, line in last.items() if not re.fullmatch(PRINTED[name], line)} == {}
    assert PRINTED.keys() == made.keys()


def test_each_example_leaves_pictures_with_something_on_them(made: dict[str, gallery.Made]) -> None:
    images = pytest.importorskip("PIL.Image", reason="Pillow is not installed: pip install '.[data]'")
    for name, result in made.items():
        pictures = [path for path in result.files if path.suffix == ".png"]
        assert pictures, name
        for path in pictures:
            with images.open(path) as picture:
                assert picture.width % WIDTH == 0, path
                assert len(picture.convert("RGB").getcolors(picture.width * picture.height)) > 4, path


def test_refitting_fails_where_triangles_fly_apart(made: dict[str, gallery.Made]) -> None:
    rows = [line.split() for line in made["refitting.py"].printed.splitlines() if line.split()[1:2] == ["8"]]
    (waves, _, flight, governed) = (float(row[-1]) / float(row[-2]) for row in rows)
    assert waves < 1.5 < 2 < flight
    assert governed < 1.5


def test_the_gallery_shows_all_pictures(made: dict[str, gallery.Made]) -> None:
    folder = made["lidar.py"].files[0].parent.parent
    page = (folder / "index.md").read_text(encoding="utf-8")
    shown = re.findall(r"^!\[[^\]]*\]\(([^)]+)\)", page, re.MULTILINE)
    assert len(shown) == len(set(shown)) >= 24
    own = {(folder / name).resolve() for name in shown if not name.startswith("../")}
    assert own == {path.resolve() for result in made.values() for path in result.files if path.suffix == ".png"}
    others = [name.removeprefix("../") for name in shown if name.startswith("../")]
    assert [name for name in others if not (REPOSITORY / name).is_file()] == []


@POSIX
def test_the_drive_through_the_crowd_opens_in_pykitti_and_rosbags(
    made: dict[str, gallery.Made], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from blender.drive_scene import pykitti

    rosbags = pytest.importorskip("rosbags.highlevel", reason="rosbags is not installed: pip install '.[ros]'")
    folder = made["drive.py"].files[0].parent
    drive = pykitti(monkeypatch).odometry(str(folder / "kitti"), "00")
    assert len(drive) == len(drive.poses) == 3
    x, y, z = drive.poses[2][:3, 3]
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-5) and 0.01 < z < 0.5  # it sets out
    labels = (folder / "kitti" / "training" / "label_2" / "000001.txt").read_text().splitlines()
    assert {line.split()[0] for line in labels} == {"Pedestrian"} and len(labels) > 5
    command = "perfect-bvh scan drive.blend -o bag --on Mount --format mcap --frames 1-2 --sensor spinning-16 -q"
    run_shell(f"cd {folder}; {command.replace('-o bag', f'-o {tmp_path}/bag')}", tmp_path)
    with rosbags.AnyReader([tmp_path / "bag"]) as bag:
        assert {topic: info.msgcount for topic, info in bag.topics.items()} == {
            "/points": 2, "/camera/image_raw": 2, "/camera/camera_info": 2, "/tf": 5,
        }  # fmt: skip
        sizes = [
            bag.deserialize(raw, "sensor_msgs/msg/PointCloud2").width
            for one, _, raw in bag.messages()
            if one.topic == "/points"
        ]
    assert len(sizes) == 2 and min(sizes) > 1000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_is_short_and_has_something_that_runs(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 60
    assert "```python" not in text  # code is in examples, which are run
    assert "examples/" in text or page.name in SHELL


def test_each_page_is_listed() -> None:
    menu = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8")
    (listed,) = (page.read_text(encoding="utf-8") for page in PAGES if page.name == "README.md")
    for page in PAGES:
        assert f": docs/how_to/{page.name}\n" in menu
        assert page.name == "README.md" or f"]({page.name})" in listed
    assert len(PAGES) > 14


def test_each_example_is_short_and_on_a_page() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in [*PAGES, REPOSITORY / "examples" / "README.md"])
    for path in gallery.list_examples():
        links = (f"[`examples/{path.name}`](../../examples/{path.name})", f"[`examples/{path.name}`]({path.name})")
        assert all(link in text for link in links), path.name
        assert len(path.read_text(encoding="utf-8").splitlines()) < 50


def run_shell(script: str, folder: Path) -> str:
    """Run lines of a POSIX shell that has `perfect-bvh` and the example scenes, and return their output."""
    if not (folder / "bin").exists():
        (folder / "blend_scenes").symlink_to(REPOSITORY / "blend_scenes")
        command = folder / "bin" / "perfect-bvh"
        command.parent.mkdir()
        main = "from perfect_bvh_addon.cli import main\n\nif __name__ == '__main__':\n    main()\n"
        command.write_text(f"#!{sys.executable}\n{main}")
        command.chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    run = ("sh", "-ec", script)
    done = subprocess.run(run, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@POSIX
@pytest.mark.parametrize("page", SHELL)
def test_the_commands_of_a_page_run(page: str, tmp_path: Path) -> None:
    for block in SHELL[page]:
        run_shell(block, tmp_path)


@POSIX
def test_the_data_set_step_by_step_is_made(tmp_path: Path) -> None:
    """The page's own lines, for two frames instead of two hundred, in this process's Python; without the drawing."""
    text = (REPOSITORY / "docs" / "data_set.md").read_text(encoding="utf-8")
    walk, points, _ = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    _, scan, labels = (block.replace(".venv/bin/", "") for block in BLOCK.findall(text))
    (tmp_path / "walk.py").write_text(walk)
    (tmp_path / "points.py").write_text(points)
    run_shell(f"{sys.executable} walk.py", tmp_path)
    run_shell(scan.replace("1-200", "1-2").replace(" --workers 2", ""), tmp_path)
    assert re.search(r"points_0001-0002\.laz \d{3,} points \{'", run_shell(f"{sys.executable} points.py", tmp_path))
    run_shell(labels.replace("1-20", "1-2").replace("640x480", "64x48").replace(" --workers 2", ""), tmp_path)
    assert (tmp_path / "labels" / "coco_0001-0002.json").stat().st_size > 1000
