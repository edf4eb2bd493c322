"""The command line's report of a render: the work and its duration, and the features that its images lack."""

from __future__ import annotations

import re
from pathlib import Path

import bpy
import pytest
from blender.command_lines import run
from oracles.png import read_png
from perfect_bvh_addon import SceneSync


def test_an_animation_refits_and_says_so(small_file: Path, tmp_path: Path, capsys) -> None:
    output = tmp_path / "new" / "frames"
    arguments = ("--frames", "1-2", "--stats", "--samples", 1, "--size", "40x30", "--threads", 1)
    assert run("render", small_file, "-o", f"{output}/", *arguments) == 0
    assert sorted(file.name for file in output.iterdir()) == ["frame_0001.png", "frame_0002.png"]
    text = capsys.readouterr().out
    assert "refitted tree: Sheet (800 triangles): positions changed" in text
    assert "moved: Cube" in text
    assert "2 built, 1 refits, 0 rebuilt; instances moved: 1" in text


@pytest.mark.parametrize(("frames", "what"), [("1", "frame"), ("1-3", "median frame")])
def test_each_run_says_where_its_time_went(frames: str, what: str, small_file: Path, tmp_path: Path, capsys) -> None:
    assert run("render", small_file, "-o", tmp_path / "f_#.png", "--frames", frames, "--size", "40x30") == 0
    number = r"(\d+|\d\.\d|0\.\d\d) (ms|s)"
    parts = ", ".join(f"{name} {number}" for name in ("blender", "read", "build", "trace", "denoise", "save"))
    assert re.search(rf"^{what} {number}: {parts}$", capsys.readouterr().out, re.MULTILINE)


def test_an_audit_says_how_many_rays_were_wrong(small_file: Path, tmp_path: Path, capsys) -> None:
    assert run("render", small_file, "-o", tmp_path, "--frames", "1-2", "--samples", "4", "--audit", "0.5") == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("audit: ")]
    match = re.fullmatch(
        r"audit: ([\d,]+) rays checked, 0 wrong, \d+ ambiguous: 0 wrong per million \(0 to [\d,]+ at 95 %\)", line
    )
    assert match is not None, line
    rays = 2 * 4 * 64 * 36
    assert 0.45 * rays < int(match[1].replace(",", "")) < 0.55 * rays
    assert run("render", small_file, "-o", tmp_path / "a.png", "--audit") == 0
    assert "audit: " in capsys.readouterr().out
    for share in ("0", "2", "much"):
        assert run("render", small_file, "-o", tmp_path / "a.png", "--audit", share) == 2
        assert "--audit" in capsys.readouterr().err


def test_quiet_runs_print_nothing(small_file: Path, tmp_path: Path, capfd) -> None:
    assert run("render", small_file, "-o", tmp_path / "a.png", "--samples", 1, "-q") == 0
    assert capfd.readouterr() == ("", "")


# Unsupported features ------------------------------------------------------------------------------------------------


def test_a_scene_without_any_light_is_black_and_says_so(small_file: Path, tmp_path: Path, capsys) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.context.scene.world = None
    dark = tmp_path / "dark.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(dark), copy=True)
    for mode, is_black in (("preview", True), ("clay", False)):
        assert run("render", dark, "-o", tmp_path / "a.png", "--mode", mode, "--samples", 1, "--frames", "1") == 0
        assert (read_png(tmp_path / "a.png")[..., :3].max() == 0) == is_black
        assert ("No light: no light, world" in capsys.readouterr().err) == is_black


def told_of_two_frames(folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Render two frames of Blender's current scene and return the messages."""
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "much.blend"), copy=True)
    assert run("render", folder / "much.blend", "-o", f"{folder}/", "--frames", "1-2", "--samples", 1) == 0
    return [line.removeprefix("perfect-bvh: ") for line in capsys.readouterr().err.splitlines()]


def test_what_the_command_line_does_not_write_is_said_once(small_file: Path, tmp_path: Path, capsys) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    scene = bpy.context.scene
    scene.render.use_stamp = scene.render.use_multiview = True
    scene.view_layers.new("Front")
    scene.sequence_editor_create()
    strips = (
        scene.sequence_editor.strips if hasattr(scene.sequence_editor, "strips") else scene.sequence_editor.sequences
    )
    strips.new_effect("Fade", "COLOR", 1, 1, **{"length" if bpy.app.version >= (5, 0, 0) else "frame_end": 9})
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Post", "CompositorNodeTree")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
    blur, layers = tree.nodes.new("CompositorNodeBlur"), tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs[0], blur.inputs[0])
    assert told_of_two_frames(tmp_path, capsys) == [
        "Compositing: nodes are ignored; the raw render is written",
        "Sequencer: strips are ignored; the scene is rendered",
        "Stereoscopy: it is unsupported; one view is written",
        "Burn Into Image: metadata is not drawn into the image",
        "View Layers: only ViewLayer is rendered, not Front",
    ]


def test_the_command_line_names_what_is_not_shown_once(small_file: Path, tmp_path: Path, capsys) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    wall = bpy.data.materials.new("Wall")
    if not wall.node_tree:
        wall.use_nodes = True
    noise = wall.node_tree.nodes.new("ShaderNodeAmbientOcclusion")
    wall.node_tree.links.new(noise.outputs["Color"], wall.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Sheet"].data.materials.append(wall)
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    assert told_of_two_frames(tmp_path, capsys) == [
        "Smoke: volumes are not supported; left out",
        "Wall: Ambient Occlusion is unsupported; its flat colour is used",
    ]


# Libraries -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def linking_file(small_file: Path, tmp_path: Path) -> Path:
    """A file whose only cube is linked from `parts.blend` in the same folder."""
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.data.libraries.write(str(tmp_path / "parts.blend"), {bpy.data.objects["Cube"]}, compress=True)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    with bpy.data.libraries.load(str(tmp_path / "parts.blend"), link=True, relative=False) as (_, linked):
        linked.objects = ["Cube"]
    bpy.context.scene.collection.objects.link(linked.objects[0])
    path = tmp_path / "linking.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_a_missing_library_is_an_error_unless_it_is_allowed(linking_file: Path, tmp_path: Path, capsys) -> None:
    output, parts = tmp_path / "a.png", tmp_path / "parts.blend"
    assert run("render", linking_file, "-o", output, "--samples", 1) == 0
    assert "library" not in capsys.readouterr().err
    output.unlink()
    parts.rename(tmp_path / "moved.blend")
    for command in (("render", linking_file, "-o", output), ("info", linking_file)):
        assert run(*command) == 2
        told = capsys.readouterr().err
        assert f"the linked library {parts} is missing" in told
        assert "Find Missing Files" in told and "--allow-missing" in told
    assert not output.exists()
    assert run("render", linking_file, "-o", output, "--samples", 1, "--allow-missing") == 0
    assert capsys.readouterr().err.count(f"parts.blend: the linked library {parts} is missing") == 1
    assert output.exists()


def test_what_a_library_does_not_hold_any_more_is_named(linking_file: Path, tmp_path: Path, capsys) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.data.libraries.write(str(tmp_path / "parts.blend"), {bpy.data.objects.new("Other", None)}, compress=True)
    assert run("render", linking_file, "-o", tmp_path / "a.png", "--samples", 1) == 0
    assert f"Cube: it is not in the linked library {tmp_path / 'parts.blend'}" in capsys.readouterr().err


def test_scripts_are_told_of_a_missing_library_too(linking_file: Path, tmp_path: Path) -> None:
    (tmp_path / "parts.blend").unlink()
    bpy.ops.wm.open_mainfile(filepath=str(linking_file))
    sync = SceneSync()
    report = sync.update(bpy.context.evaluated_depsgraph_get())
    sync.close()
    assert [(row.kind, row.name) for row in report.not_shown] == [("library", "parts.blend")]
