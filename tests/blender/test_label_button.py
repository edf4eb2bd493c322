"""The Label Images button: its files are those of the command line, and the last frame is shown in images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.command_lines import run  # noqa: E402
from blender.drawn_texts import drawn  # noqa: E402
from blender.long_builds import ESCAPE, TIMER, FakeOperator, FakeWindow, patiently  # noqa: E402
from perfect_bvh_addon import panels  # noqa: E402
from perfect_bvh_addon.operators.label_button import DEPTH, MASK, OBJECTS, PERFECT_BVH_OT_label_images  # noqa: E402

COUNT = 3  # frames of the file


@pytest.fixture
def scene_file(registered: None, tmp_path: Path) -> Path:
    """A cube that moves in front of a plane."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 1.5))
    cube = bpy.context.object
    for frame in (1, COUNT):
        cube.location.x = float(frame)
        cube.keyframe_insert("location", frame=frame)
    bpy.ops.object.camera_add(location=(0.0, 0.0, 9.0))
    scene.camera = bpy.context.object
    scene.frame_start, scene.frame_end = 1, COUNT
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.frame_set(1)
    path = tmp_path / "moving.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def settings_for(folder: Path, **values: Any) -> Any:
    settings = bpy.context.scene.perfect_bvh.label_images
    settings.folder, settings.frames, settings.formats = str(folder), "SCENE", {"npz"}
    for name, value in values.items():
        setattr(settings, name, value)
    return settings


def arrays(path: Path) -> dict[str, Any]:
    with np.load(path) as data:
        return {name: data[name] for name in data.files}


def test_the_button_writes_what_the_command_line_writes(scene_file: Path, tmp_path: Path) -> None:
    settings_for(tmp_path / "panel", layers=2)
    assert bpy.ops.perfect_bvh.label_images() == {"FINISHED"}
    objects, depth = bpy.data.images[OBJECTS], bpy.data.images[DEPTH]
    assert tuple(objects.size) == tuple(depth.size) == (64, 48)
    colors = {tuple(np.round(pixel, 4)) for pixel in np.array(objects.pixels[:]).reshape(-1, 4)}
    assert len(colors) == 2  # the cube and the plane
    mask = np.array(bpy.data.images[MASK].pixels[:]).reshape(48, 64, 4)[::-1, :, 0]
    last = arrays(tmp_path / "panel" / f"labels_{COUNT:04}.npz")
    plane, cube = (last["thing_ids"] == number for number in range(2))
    assert (mask[plane] == 1.0).all() and (mask[cube] == np.float32(0.4)).mean() > 0.0 and mask[~plane].max() < 0.5
    assert bpy.context.scene.frame_current == 1
    arguments = ("--frames", f"1-{COUNT}", "--layers", "2", "--no-coco", "-q")
    assert run("labels", scene_file, "-o", tmp_path / "command", *arguments) == 0
    names = sorted(path.name for path in (tmp_path / "command").glob("*.npz"))
    assert len(names) == COUNT and names == sorted(path.name for path in (tmp_path / "panel").glob("*.npz"))
    for name in names:
        expected, found = arrays(tmp_path / "command" / name), arrays(tmp_path / "panel" / name)
        assert expected.keys() == found.keys()
        different = [key for key, value in expected.items() if not np.array_equal(found[key], value)]
        assert different == [], name


def test_resume_keeps_what_is_there(scene_file: Path, tmp_path: Path) -> None:
    settings_for(tmp_path / "panel")
    assert bpy.ops.perfect_bvh.label_images() == {"FINISHED"}
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "panel").iterdir()}
    settings_for(tmp_path / "panel", use_resume=True)
    assert bpy.ops.perfect_bvh.label_images() == {"FINISHED"}
    assert before == {path: path.stat().st_mtime_ns for path in (tmp_path / "panel").iterdir()}
    settings_for(tmp_path / "panel", layers=3)
    with pytest.raises(RuntimeError, match="layers"):
        bpy.ops.perfect_bvh.label_images()


def test_size_camera_and_category(scene_file: Path, tmp_path: Path) -> None:
    camera = bpy.data.objects.new("Other", bpy.context.scene.camera.data)
    camera.location = (0.0, 0.0, 30.0)
    bpy.context.collection.objects.link(camera)
    bpy.data.objects["Cube"]["kind"] = "box"
    values = {"camera": camera, "use_render_size": False, "width": 20, "height": 10, "category": "kind"}
    settings_for(tmp_path / "panel", frames="CURRENT", **values)
    assert bpy.ops.perfect_bvh.label_images() == {"FINISHED"}
    found = arrays(tmp_path / "panel" / "labels_0001.npz")
    assert found["depth"].shape == (10, 20)
    assert found["depth"][found["thing_ids"] >= 0].min() == pytest.approx(27.5)
    assert "box" in str(found["categories"])


def test_escape_keeps_whole_files(scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from perfect_bvh_addon.operators import label_button, piece_jobs

    monkeypatch.setattr(piece_jobs, "STEP_SECONDS", 0.0)
    label_button_piece, label_button.PIECE = label_button.PIECE, 1
    try:
        settings_for(tmp_path / "panel")
        operator, window = FakeOperator(PERFECT_BVH_OT_label_images), FakeWindow()
        assert operator.invoke(window, None) == {"RUNNING_MODAL"}
        for _ in patiently("the first file is not written"):
            if (tmp_path / "panel" / "labels_0001-0001.json").exists():
                break
            operator.modal(window, TIMER)
        assert window.status == "Labelling frame 2 of 3 | Esc: Cancel"
        assert operator.modal(window, ESCAPE) == {"CANCELLED"}
    finally:
        label_button.PIECE = label_button_piece
    ((kind, told),) = operator.reports
    assert kind == "INFO" and told.startswith("Labelling canceled: 1 of 3 files written to ")
    assert told.endswith("To continue, enable Resume and press Start Labelling")
    assert bpy.context.scene.frame_current == 1 and window.status is None


def test_what_cannot_be_labelled_is_named(scene_file: Path, tmp_path: Path) -> None:
    settings_for(tmp_path).folder = " "
    with pytest.raises(RuntimeError, match="Choose a folder"):
        bpy.ops.perfect_bvh.label_images()
    settings_for(tmp_path / "panel", category="nonsense")
    with pytest.raises(RuntimeError, match="nonsense"):
        bpy.ops.perfect_bvh.label_images()
    settings_for(tmp_path / "panel", category="", formats=set())
    with pytest.raises(RuntimeError, match="Nothing to output"):
        bpy.ops.perfect_bvh.label_images()
    bpy.context.scene.camera = None
    with pytest.raises(RuntimeError, match="No camera"):
        bpy.ops.perfect_bvh.label_images()


def test_the_panel_shows_what_can_be_chosen(scene_file: Path) -> None:
    bpy.context.scene.perfect_bvh.label_images.use_render_size = False
    told = drawn(panels.output.PERFECT_BVH_PT_label_images)
    assert "Start Labelling" in told and "No camera: choose a Camera, or add one" not in told
    assert panels.output.PNG_LOOKS in " ".join(told) and ".colors.png" in panels.output.PNG_LOOKS
    bpy.context.scene.perfect_bvh.label_images.formats = {"npz"}
    assert panels.output.PNG_LOOKS not in " ".join(drawn(panels.output.PERFECT_BVH_PT_label_images))


def test_images_that_people_can_open_are_preselected(registered: None) -> None:
    settings = bpy.context.scene.perfect_bvh.label_images
    formats = settings.bl_rna.properties["formats"]
    assert formats.default_flag == {"png"} and formats.enum_items[0].identifier == "png"
    numbers = {item.identifier: item.value for item in formats.enum_items}
    assert numbers == {"npz": 1, "npy": 2, "png": 4, "exr": 8}, "files store these"


def test_the_status_bar_counts_frames_and_not_files(scene_file: Path, tmp_path: Path) -> None:
    settings_for(tmp_path / "panel")
    operator, window = FakeOperator(PERFECT_BVH_OT_label_images), FakeWindow()
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    job, seen = operator._job, []
    for _ in operator._steps:
        seen.append(job.where)
    operator._end(window)
    assert list(dict.fromkeys(seen)) == [f" frame {number} of {COUNT}" for number in range(1, COUNT + 1)]


@pytest.mark.parametrize("is_open", [True, False])
def test_the_last_frame_is_shown_in_an_open_editor_or_its_place_is_reported(
    scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_open: bool
) -> None:
    from perfect_bvh_addon.operators import label_button

    shown: list[str] = []
    monkeypatch.setattr(label_button, "set_in_editors", lambda _, image: shown.append(image.name) or is_open)
    settings_for(tmp_path / "panel", frames="CURRENT")
    operator = FakeOperator(PERFECT_BVH_OT_label_images)
    assert operator.execute(bpy.context) == {"FINISHED"}
    ((kind, told),) = operator.reports
    assert shown == [OBJECTS] and kind == "INFO" and told.startswith("Labelled 1 frame into ")
    assert ("open an Image Editor to see it" in told) == (not is_open)
