"""The command line: its arguments, its files, its errors, and whole runs in a process of their own."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from perfect_bvh_addon.cli.arguments import CommandError, Output, check_blend_file, check_mode, parse_frames, parse_size
from perfect_bvh_addon.cli.console import format_table
from perfect_bvh_addon.settings.modes import MODE_NAMES
from perfect_bvh_addon.support.files import replacing
from perfect_bvh_addon.support.paths import reachable
from wine_gaps import console_events, symbolic_links

needs_users = pytest.mark.skipif(os.name == "nt", reason="Windows knows no names of other users' folders")

# Arguments ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("7", (7,)),
        ("1-4", (1, 2, 3, 4)),
        ("1-10:3", (1, 4, 7, 10)),
        ("5, 1-3", (5, 1, 2, 3)),
        ("2,1-3", (2, 1, 3)),
        ("-2-1", (-2, -1, 0, 1)),
        ("-5--3", (-5, -4, -3)),
    ],
)
def test_frames_are_ranges_steps_and_lists(text: str, frames: tuple[int, ...]) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "a", "1-", "4-1", "1-4:0", "1..4", "1-4:", "1,,2", "1-2000000"])
def test_frames_that_mean_nothing_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError):
        parse_frames(text)


def test_a_size_is_two_positive_numbers() -> None:
    assert parse_size("960x540") == (960, 540)
    for text in ("960", "0x5", "5x-1", "axb", "99999x1", "1.5x2"):
        with pytest.raises(argparse.ArgumentTypeError):
            parse_size(text)


def test_an_unknown_mode_is_refused_with_the_known_ones() -> None:
    check_mode(None)
    check_mode("depth")
    with pytest.raises(CommandError, match=r"'shiny'.*clay.*cost"):
        check_mode("shiny")


@pytest.mark.parametrize(
    ("output", "frame", "expected"),
    [
        ("a.png", 3, "a.png"),
        ("a_###.exr", 3, "a_003.exr"),
        ("a_##.png", 1234, "a_1234.png"),
        ("a_####.png", -7, "a_-0007.png"),
        ("folder/", 3, "folder/frame_0003.png"),
        ("folder", 3, "folder/frame_0003.png"),
        ("existing.png", 3, "existing.png/frame_0003.png"),
    ],
)
def test_output_names(output: str, frame: int, expected: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "existing.png").mkdir()
    assert Output.parse(output, 1).path_of(frame) == tmp_path / expected


@pytest.mark.parametrize(
    ("output", "count", "complaint"),
    [
        ("a.png", 2, r"a_####\.png"),
        ("a.gif", 1, r"not \.gif"),
        ("a#b#.png", 1, "one run of #"),
    ],
)
def test_output_names_that_cannot_work(output: str, count: int, complaint: str) -> None:
    with pytest.raises(CommandError, match=complaint):
        Output.parse(output, count)


def test_an_output_folder_is_made_and_tried(tmp_path: Path) -> None:
    Output.parse(str(tmp_path / "new" / "deep" / "a.png"), 1).prepare()
    assert list((tmp_path / "new" / "deep").iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(CommandError, match="cannot write into"):
        Output.parse(str(tmp_path / "file" / "a.png"), 1).prepare()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "expected a name, got an empty one"),
        ("a/" * 16_400 + "a.png", r"a path may have \d+ (bytes|characters), got \d+; give a shorter one"),
        ("n" * 252 + ".png", "a name may have 255 (bytes|characters), got 256"),
        # Of two characters each where names are UTF-16, else of four bytes.
        ("\N{GRINNING FACE}" * 130 + ".png", "a name may have 255 (bytes, got 524|characters, got 264)"),
        ("a\0b.png", "cannot hold a zero byte"),
        pytest.param("~nobody_at_all/a.png", "no such user", marks=needs_users),
    ],
)
def test_names_that_no_file_can_have_are_refused_before_any_work(
    text: str, complaint: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "scene.blend"
    scene.write_bytes(b"BLENDER-v405")
    monkeypatch.setitem(sys.modules, "bpy", None)
    for command in (("render", scene, "-o", text), ("render", text, "-o", "a.png"), ("bench", scene, "-o", text)):
        with pytest.raises(CommandError, match=complaint):
            run_command(*command)
    assert list(tmp_path.iterdir()) == [scene]


def run_command(*arguments: object) -> int:
    from perfect_bvh_addon.cli import build_parser
    from perfect_bvh_addon.cli.bench import run_bench
    from perfect_bvh_addon.cli.render import run_render

    parsed = build_parser("perfect-bvh").parse_args([str(argument) for argument in arguments])
    return {"render": run_render, "bench": run_bench}[parsed.command](parsed)


def test_a_frame_number_may_make_a_name_too_long(tmp_path: Path) -> None:
    output = Output.parse(str(tmp_path / ("n" * 246 + "_####.png")), 2)
    output.check_frames((1, 9999), tmp_path)
    with pytest.raises(CommandError, match="got 256"):
        output.check_frames((1, 10000), tmp_path)


@pytest.mark.parametrize("name", ["scene.png", "scene_0007.png"])
def test_an_image_never_replaces_its_scene(name: str, tmp_path: Path) -> None:
    scene = tmp_path / name
    scene.write_bytes(b"BLENDER-v405")
    for output in (name, name.replace("0007", "####")):
        check_keeps(scene, tmp_path / output)
    assert list(tmp_path.iterdir()) == [scene]


@symbolic_links
def test_nor_does_an_image_that_is_a_link_to_it(tmp_path: Path) -> None:
    scene, link = tmp_path / "scene.blend", tmp_path / "link.png"
    scene.write_bytes(b"BLENDER-v405")
    link.symlink_to(scene)
    check_keeps(scene, link)
    assert link.is_symlink()


def check_keeps(scene: Path, output: Path) -> None:
    with pytest.raises(CommandError, match="the image would replace the scene, FILE; give it another name"):
        run_command("render", scene, "-o", output, "--frames", "7")
    assert scene.read_bytes() == b"BLENDER-v405"


def test_files_may_have_names_of_any_language_and_length(small_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "Jörg Müller 立方体"
    folder.mkdir()
    scene, image = folder / "scène 1.blend", folder.joinpath(*["x" * 60] * 5, "立方体.png")
    shutil.copy(small_file, scene)
    assert run("render", scene, "-o", image) == 0
    assert reachable(image).read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in reachable(image.parent).iterdir()] == [image.name]


def test_the_longest_name_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 251 + ".png")
    with replacing(path) as beside:
        beside.write_bytes(b"image")
    assert path.read_bytes() == b"image"


def test_only_blend_files_are_taken(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="no such file"):
        check_blend_file(str(tmp_path / "none.blend"))
    with pytest.raises(CommandError, match="folder"):
        check_blend_file(str(tmp_path))
    wrong = tmp_path / "wrong.blend"
    wrong.write_bytes(b"PNG")
    with pytest.raises(CommandError, match=r"wrong\.blend is not a \.blend file"):
        check_blend_file(str(wrong))
    for number, start in enumerate((b"BLENDER-v405", b"\x28\xb5\x2f\xfdxxxx", b"\x1f\x8bxxxx")):
        path = tmp_path / f"{number}.blend"
        path.write_bytes(start)
        assert check_blend_file(str(path)) == path


# Text --------------------------------------------------------------------------------------------------------------


def test_tables_line_up() -> None:
    lines = format_table(["name", "count"], [["a", "1"], ["long name", "1,000"]]).splitlines()
    assert lines == ["name       count", "---------  -----", "a              1", "long name  1,000"]


# Whole runs --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two frames of a cube that moves and a sheet that bends, 64 x 36 pixels."""
    bpy = pytest.importorskip("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=6.0)
    sheet = bpy.context.object
    sheet.name = sheet.data.name = "Sheet"
    sheet.shape_key_add(name="Basis")
    bent = sheet.shape_key_add(name="Bent")
    for point in bent.data:
        point.co.z = 0.1 * point.co.x**2
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 1.5))
    cube = bpy.context.object
    for frame in (1, 2):
        bent.value = cube.location.x = frame - 1.0
        bent.keyframe_insert("value", frame=frame)
        cube.keyframe_insert("location", frame=frame)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (5.0, -5.0, 5.0), (0.96, 0.0, 0.785)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 128, 72, 50
    scene.render.image_settings.exr_codec = "NONE"  # as the tests' reader wants it
    path = tmp_path_factory.mktemp("small") / "small.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def broken_files(tmp_path: Path, small_file: Path) -> dict[str, Path]:
    """A file that ends too early, and one whose scene has no camera."""
    import bpy

    truncated = tmp_path / "truncated.blend"
    truncated.write_bytes(small_file.read_bytes()[:3000])
    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.context.scene.camera = None
    blind = tmp_path / "blind.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blind), copy=True)
    return {"truncated": truncated, "blind": blind}


def run(*arguments: object) -> int:
    from perfect_bvh_addon import unregister
    from perfect_bvh_addon.cli import main

    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as stop:  # argparse's own errors
        return stop.code
    finally:
        unregister()


@pytest.mark.parametrize("mode", [*MODE_NAMES, "lit"])
def test_every_mode_writes_an_image(mode: str, small_file: Path, tmp_path: Path, capfd) -> None:
    from oracles.png import read_png

    output = tmp_path / f"{mode}.png"
    assert run("render", small_file, "-o", output, "--mode", mode, "--samples", 2) == 0
    image = read_png(output)
    assert image.shape == (36, 64, 4)
    assert len(np.unique(image[..., :3].reshape(-1, 3), axis=0)) > 2
    printed = capfd.readouterr()
    assert str(output) in printed.out
    assert "Blender" not in printed.out
    assert "Read blend" not in printed.out


@pytest.mark.parametrize(
    ("arguments", "status", "told"),
    [
        (("render", "FILE", "-o", "OUT", "--samples", "1"), 0, "1 frame in"),
        (("render", "FILE"), 2, "blender --command perfect_bvh render: error: the following arguments are required"),
        (("--help",), 0, "usage: blender --command perfect_bvh"),
        (("info", "missing.blend"), 2, "perfect-bvh: error: missing.blend: no such file"),
    ],
)
def test_blenders_own_command_line_takes_the_same(
    arguments: tuple[str, ...], status: int, told: str, small_file: Path, tmp_path: Path, monkeypatch, capfd
) -> None:
    from perfect_bvh_addon import unregister
    from perfect_bvh_addon.cli import blender_command

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    places = {"FILE": str(small_file), "OUT": str(tmp_path / "a.png")}
    try:
        assert blender_command.run([places.get(argument, argument) for argument in arguments]) == status
    finally:
        unregister()
    printed = capfd.readouterr()
    assert told in printed.out + printed.err
    assert (tmp_path / "a.png").is_file() == ("OUT" in arguments)


@pytest.mark.parametrize("mode", ["normal", "depth"])
def test_an_image_that_is_cropped_has_its_borders_size(mode: str, small_file: Path, tmp_path: Path) -> None:
    """The same pixels as of the whole frame, and as many as Blender's own engines write."""
    import bpy
    from oracles.png import read_png

    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    render = bpy.context.scene.render
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.3, 0.71
    render.border_min_y, render.border_max_y = 0.25, 0.9
    images = {}
    for is_cropped in (False, True):
        bpy.context.scene.render.use_crop_to_border = is_cropped
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "border.blend"), copy=True)
        output = tmp_path / f"{is_cropped}.png"
        assert run("render", tmp_path / "border.blend", "-o", output, "--mode", mode, "--samples", 1) == 0
        images[is_cropped] = read_png(output)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "border.blend"))
    render = bpy.context.scene.render
    render.engine, render.filepath = "CYCLES", str(tmp_path / "cycles.png")
    bpy.context.scene.cycles.samples = 1
    bpy.ops.render.render(write_still=True)
    height, width = read_png(tmp_path / "cycles.png").shape[:2]
    assert images[True].shape == (height, width, 4)
    left, top = int(np.float32(0.3) * 64), 36 - int(np.float32(0.9) * 36)
    np.testing.assert_array_equal(images[True], images[False][top : top + height, left : left + width])
    assert images[False].shape == (36, 64, 4)
    assert (images[True][..., :3] > 0).any()


def test_a_scene_without_any_light_is_black_and_says_so(small_file: Path, tmp_path: Path, capsys) -> None:
    import bpy
    from oracles.png import read_png

    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    bpy.context.scene.world = None
    dark = tmp_path / "dark.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(dark), copy=True)
    for mode, is_black in (("preview", True), ("clay", False)):
        assert run("render", dark, "-o", tmp_path / "a.png", "--mode", mode, "--samples", 1, "--frames", "1") == 0
        assert (read_png(tmp_path / "a.png")[..., :3].max() == 0) == is_black
        assert ("No light: neither a light" in capsys.readouterr().err) == is_black


def test_what_the_command_line_does_not_write_is_said_once(small_file: Path, tmp_path: Path, capsys) -> None:
    import bpy

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
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "much.blend"), copy=True)
    arguments = ("render", tmp_path / "much.blend", "-o", f"{tmp_path}/", "--frames", "1-2", "--samples", 1)
    assert run(*arguments) == 0
    told = [line.removeprefix("perfect-bvh: ") for line in capsys.readouterr().err.splitlines()]
    assert told == [
        "Compositing: its nodes are not applied; the render as it is, is written",
        "Sequencer: its strips are not shown; the scene is",
        "Stereoscopy: it is not written; one view is",
        "Burn Into Image: it is not done",
        "View Layers: Front is not rendered; ViewLayer is",
    ]


def test_the_command_line_names_what_is_not_shown_once(small_file: Path, tmp_path: Path, capsys) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(small_file))
    wall = bpy.data.materials.new("Wall")
    if not wall.node_tree:
        wall.use_nodes = True
    noise = wall.node_tree.nodes.new("ShaderNodeTexNoise")
    wall.node_tree.links.new(noise.outputs["Color"], wall.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Sheet"].data.materials.append(wall)
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "much.blend"), copy=True)
    arguments = ("render", tmp_path / "much.blend", "-o", f"{tmp_path}/", "--frames", "1-2", "--samples", 1)
    assert run(*arguments) == 0
    told = [line.removeprefix("perfect-bvh: ") for line in capsys.readouterr().err.splitlines()]
    assert told == [
        "Smoke: a volume has no triangles; left out",
        "Wall: Noise Texture is not shown; its flat colour is",
    ]


@pytest.fixture
def linking_file(small_file: Path, tmp_path: Path) -> Path:
    """A file whose only cube comes out of `parts.blend` beside it."""
    import bpy

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
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.data.libraries.write(str(tmp_path / "parts.blend"), {bpy.data.objects.new("Other", None)}, compress=True)
    assert run("render", linking_file, "-o", tmp_path / "a.png", "--samples", 1) == 0
    assert f"Cube: it is not in the linked library {tmp_path / 'parts.blend'}" in capsys.readouterr().err


def test_scripts_are_told_of_a_missing_library_too(linking_file: Path, tmp_path: Path) -> None:
    import bpy
    from perfect_bvh_addon import SceneSync

    (tmp_path / "parts.blend").unlink()
    bpy.ops.wm.open_mainfile(filepath=str(linking_file))
    sync = SceneSync()
    report = sync.update(bpy.context.evaluated_depsgraph_get())
    sync.close()
    assert [(row.kind, row.name) for row in report.not_shown] == [("library", "parts.blend")]


def test_an_animation_refits_and_says_so(small_file: Path, tmp_path: Path, capsys) -> None:
    output = tmp_path / "new" / "frames"
    arguments = ("--frames", "1-2", "--stats", "--samples", 1, "--size", "40x30", "--threads", 1)
    assert run("render", small_file, "-o", f"{output}/", *arguments) == 0
    assert sorted(file.name for file in output.iterdir()) == ["frame_0001.png", "frame_0002.png"]
    text = capsys.readouterr().out
    assert "refitted tree: Sheet (800): positions changed" in text
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


def test_openexr_holds_depth_as_it_is(small_file: Path, tmp_path: Path) -> None:
    from oracles.exr import read_exr

    assert run("render", small_file, "-o", tmp_path / "a.exr", "--mode", "distance", "--samples", 1) == 0
    planes = read_exr(tmp_path / "a.exr")
    hit = planes["R"] < 1e9
    assert hit.any()
    assert 4.0 < planes["R"][hit].min() < planes["R"][hit].max() < 13.0


def test_info_lists_the_meshes(small_file: Path, capsys) -> None:
    assert run("info", small_file) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Scene, frame 1"
    assert lines[1].split()[:3] == ["mesh", "class", "builder"] and lines[1].endswith("why this class")
    sheet, cube = lines[3], lines[4]
    assert sheet.split()[:5] == ["Sheet", "deforming", "binned", "800", "1"]
    assert sheet.endswith(("moves vertices", "shape keys"))
    assert cube.split()[:2] == ["Cube", "rigid"] and cube.split()[3:5] == ["12", "1"]
    assert cube.endswith("it is animated")
    build, rays, trace = (float(cell.replace(",", "")) for cell in cube.split()[-6:-3])
    assert build >= 0 and rays > 0 and trace > 0
    assert lines[5].startswith("2 meshes, 812 triangles; 2 instances show 812; top level")
    assert lines[6] == (
        "rays and trace ms: of one image of 64 x 36 pixels, mode preview, samples 16, on one thread, as expected"
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
        (("render", "{small}", "-o", "{tmp}/a.png", "--samples", "0"), "must be at least 1"),
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


# To Windows' programs a signal is an event of the console, for a whole group of them.
INTERRUPT = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT)
OWN_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
RUN_MAIN = "from perfect_bvh_addon.cli import main; sys.exit(main())"


@console_events
def test_ctrl_c_stops_an_animation(small_file: Path, tmp_path: Path) -> None:
    """In a process of its own, as a user has it: the signal comes while frames are traced."""
    code = f"import sys; sys.argv[0] = 'perfect-bvh'; {RUN_MAIN}"
    command = [sys.executable, "-c", code, "render", str(small_file), "-o", f"{tmp_path}/out/"]
    command += ["--frames", "1-5000", "--samples", "64", "--stats"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, creationflags=OWN_GROUP
    ) as process:
        first = [process.stdout.readline() for _ in range(3)]  # the header, and a frame with what it built
        process.send_signal(INTERRUPT)
        output, errors = process.communicate(timeout=300)
    assert "built tree" in first[2]
    assert process.returncode == 130
    assert "stopped;" in errors
    assert "of 5000 frames are written" in errors
    assert "Traceback" not in output + errors


def test_without_blender_the_command_says_what_to_install(small_file: Path) -> None:
    code = (
        "import sys; sys.modules['bpy'] = None\n"
        "from perfect_bvh_addon.cli import main\n"
        f"sys.exit(main(['info', {str(small_file)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert "pip install 'perfect-bvh[blender]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_reader_that_goes_away_is_no_error(small_file: Path) -> None:
    """As in `perfect-bvh info FILE | head`."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    code = f"import sys; sys.argv[0] = 'perfect-bvh'; {RUN_MAIN}"
    with os.fdopen(write_end, "w") as pipe:
        command = [sys.executable, "-c", code, "info", str(small_file)]
        done = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 141
    assert done.stderr == ""
