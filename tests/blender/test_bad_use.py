"""Mistakes of users and failures around Blender: the error is clear, nothing is lost, and no file is half written."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from limits import full_disk

bpy = pytest.importorskip("bpy")

from perfect_bvh_addon.cli import main  # noqa: E402
from perfect_bvh_addon.image import saving  # noqa: E402
from perfect_bvh_addon.statistics import update_list  # noqa: E402
from perfect_bvh_addon.support import memory  # noqa: E402
from perfect_bvh_addon.support.files import check_writable, replacing  # noqa: E402
from wine_gaps import plain_files  # noqa: E402


@pytest.fixture(autouse=True)
def empty_file(registered: None) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def scene() -> bpy.types.Scene:
    """A cube under a small camera that looks down."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.camera_add(location=(0.0, 0.0, 8.0))
    scene.camera = bpy.context.object
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    scene.perfect_bvh.samples = 2
    return scene


def save(tmp_path: Path, **options: object) -> Path:
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **({"compress": True} | options))  # Wine reads only compressed ones
    return path


def render(file: Path, output: Path, *more: str) -> int:
    return main(["render", str(file), "-o", str(output), *more])


# Files ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".webp", ".tif", ".exr"])
@pytest.mark.parametrize("is_there", [False, True], ids=["new", "older"])
def test_a_full_disk_leaves_the_older_image_and_nothing_else(scene, tmp_path, capsys, suffix: str, is_there: bool):
    """A part of the image fits on the disk, which Blender's own writers take for success."""
    file, folder = save(tmp_path), tmp_path / "images"
    output = folder / f"a{suffix}"
    assert render(file, output) == 0
    size = output.stat().st_size
    older = output.read_bytes()
    if not is_there:
        output.unlink()
    capsys.readouterr()
    with full_disk(size // 2):
        assert render(file, output) == 2
    printed = capsys.readouterr().err
    assert f"cannot write {output}" in printed
    assert "Traceback" not in printed
    assert [path.read_bytes() for path in folder.iterdir()] == ([older] if is_there else [])
    assert render(file, output) == 0
    assert output.stat().st_size == size


def test_an_image_of_a_name_that_blender_cannot_reach_is_written(scene, tmp_path: Path, monkeypatch):
    """Names that are too long for Windows without a prefix are an example; Blender would cut them off."""
    file = save(tmp_path)
    assert render(file, tmp_path / "plain.png") == 0
    monkeypatch.setattr(saving, "is_extended", lambda _: True)
    folder = tmp_path / "far"
    assert render(file, folder / "a.png") == 0
    assert [path.name for path in folder.iterdir()] == ["a.png"]
    assert (folder / "a.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_a_disk_that_ends_with_the_file_is_found(tmp_path: Path):
    """The writer reports no error, because its file ends exactly at the end of the disk."""
    path = tmp_path / "a.bin"
    path.write_text("older")

    def write(data: bytes) -> None:
        with replacing(path) as name:
            name.write_bytes(data)

    with full_disk(5000), pytest.raises(OSError, match=r"cannot write .*a\.bin: File too large"):
        write(bytes(5000))
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [("a.bin", "older")]
    write(b"newer")
    (tmp_path / "b.bin").touch()
    assert path.read_text() == "newer"
    assert path.stat().st_mode == (tmp_path / "b.bin").stat().st_mode


def test_what_fails_while_a_file_is_written_leaves_nothing(tmp_path: Path):
    def write() -> None:
        with replacing(tmp_path / "a.bin") as name:
            name.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux has /proc and /sys, where not even root can make a file"
)
@pytest.mark.parametrize("folder", ["/proc", "/sys"])
def test_a_folder_that_takes_no_files_is_named_before_the_work(scene, tmp_path: Path, capsys, folder: str):
    assert render(save(tmp_path), Path(folder) / "a.png") == 2
    assert f"cannot write into {folder}" in capsys.readouterr().err
    with pytest.raises(OSError, match=f"cannot write {folder}/a.npz"):
        check_writable(Path(folder) / "a.npz")
    scene.perfect_bvh.scan.use_files, scene.perfect_bvh.scan.folder = True, folder
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=f"Cannot write into {folder}"):
        bpy.ops.perfect_bvh.scan()
    assert len(bpy.data.objects) == count


# .blend files --------------------------------------------------------------------------------------------------------


@plain_files
def test_a_file_of_a_newer_blender_is_rendered_with_a_warning(scene, tmp_path: Path, capsys):
    file = save(tmp_path, compress=False)
    start = file.read_bytes()[:24]
    number = f"{bpy.app.version[0]:02}{bpy.app.version[1]:02}".encode()
    old = start[start.index(b"v") :][:5] if start[12:13] == b"v" else start[12:17]
    assert old.lstrip(b"v") in (number, number.lstrip(b"0"))
    newer = tmp_path / "newer.blend"
    newer.write_bytes(file.read_bytes().replace(old, b"v" + b"9" * (len(old) - 1), 1))
    assert render(newer, tmp_path / "a.png") == 0
    assert "which is newer than this one" in capsys.readouterr().err
    assert (tmp_path / "a.png").exists()
    assert render(file, tmp_path / "b.png") == 0
    assert "newer" not in capsys.readouterr().err


@pytest.mark.skipif(
    bpy.app.version < (5, 0, 0), reason="files of Blender before 5.0 say nothing of the form of their header"
)
def test_a_file_of_a_form_to_come_is_refused(scene, tmp_path: Path, capsys):
    file = save(tmp_path)
    file.write_bytes(file.read_bytes().replace(b"BLENDER17-01", b"BLENDER17-09", 1))
    assert render(file, tmp_path / "a.png") == 2
    assert "may be from a newer version of Blender" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()


# Scenes --------------------------------------------------------------------------------------------------------------


def add_missing_texture(tmp_path: Path) -> str:
    material = bpy.data.materials.new("painted")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("paint", 4, 4)
    node.image.source, node.image.filepath = "FILE", str(tmp_path / "gone.png")
    material.node_tree.links.new(node.outputs[0], material.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Cube"].data.materials.append(material)
    return "paint: it could not be loaded from"


def add_nan(tmp_path: Path) -> str:
    mesh = bpy.data.objects["Cube"].data
    mesh.vertices[0].co.x = float("nan")
    return "not finite"


def empty_mesh(tmp_path: Path) -> str:
    bpy.data.objects["Cube"].data.clear_geometry()
    return ""


@pytest.mark.parametrize("spoil", [add_missing_texture, add_nan, empty_mesh])
def test_what_cannot_be_read_is_named_and_the_rest_rendered(scene, tmp_path: Path, capsys, spoil: Callable):
    words = spoil(tmp_path)
    assert render(save(tmp_path), tmp_path / "a.exr") == 0
    printed = capsys.readouterr().err
    assert words in printed
    assert "Traceback" not in printed
    assert (tmp_path / "a.exr").stat().st_size > 0


def test_an_empty_scene_is_rendered(tmp_path: Path, capsys):
    bpy.ops.object.camera_add()
    bpy.context.scene.camera = bpy.context.object
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 64, 36
    assert render(save(tmp_path), tmp_path / "a.png") == 0
    assert (tmp_path / "a.png").exists()


def test_linked_data_is_rendered_and_scanned_and_not_touched(scene, tmp_path: Path):
    """The active collection is linked from another file, so points are added to the scene's own collection."""
    collection = bpy.data.collections.new("Library")
    collection.objects.link(bpy.data.objects["Cube"])
    scene.collection.objects.unlink(bpy.data.objects["Cube"])
    scene.collection.children.link(collection)
    library = save(tmp_path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["Library"]
    scene = bpy.context.scene
    scene.collection.children.link(bpy.data.collections["Library"])
    bpy.ops.object.camera_add(location=(0.0, 0.0, 8.0))
    scene.camera = bpy.context.object
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    bpy.context.view_layer.active_layer_collection = bpy.context.view_layer.layer_collection.children["Library"]
    assert bpy.context.collection.library is not None
    assert bpy.ops.render.render() == {"FINISHED"}
    scene.perfect_bvh.scan.width, scene.perfect_bvh.scan.height = 16, 9
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert bpy.data.objects["Scan"].name in scene.collection.objects
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}


def test_what_is_locked_is_rendered_and_scanned_and_stays_as_it_is(scene):
    cube, camera = bpy.data.objects["Cube"], scene.camera
    cube.lock_location = cube.lock_rotation = cube.lock_scale = (True, True, True)
    cube.hide_select = scene.render.use_lock_interface = True
    scene.perfect_bvh.scan.width, scene.perfect_bvh.scan.height = 16, 9
    place = cube.matrix_world.copy()
    assert bpy.ops.render.render() == {"FINISHED"}
    assert update_list.rows_of(scene) is None and update_list.fill()
    assert update_list.rows_of(scene).rows[0].name == "Cube"
    assert bpy.ops.perfect_bvh.select_updated() == {"CANCELLED"}
    assert "disables selection" in update_list.rows_of(scene).note
    assert bpy.context.selected_objects == [camera] and bpy.context.view_layer.objects.active == camera
    assert bpy.ops.render.render() == {"FINISHED"}
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}
    assert all(cube.lock_location) and cube.hide_select and cube.matrix_world == place
    cube.hide_select = False
    assert update_list.rows_of(scene) is not None and update_list.fill()
    update_list.rows_of(scene).active = [row.name for row in update_list.rows_of(scene).rows].index("Cube")
    assert update_list.rows_of(scene).note == ""
    assert bpy.context.selected_objects == [cube]


# Sizes ---------------------------------------------------------------------------------------------------------------


def test_an_image_that_does_not_fit_is_refused(scene, tmp_path: Path, capsys, monkeypatch):
    monkeypatch.setattr(memory, "free_bytes", lambda: 64 << 20)
    assert render(save(tmp_path), tmp_path / "a.png", "--size", "1280x720") == 2
    printed = capsys.readouterr().err
    assert printed.count("An image of 1,280 x 720 pixels needs about 0.2 GiB of memory, but only 0.1 GiB are free") == 1
    assert not (tmp_path / "a.png").exists()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1280, 720
    with pytest.raises(RuntimeError, match="choose a smaller size"):
        bpy.ops.render.render()
    scene.render.resolution_percentage = 10
    assert bpy.ops.render.render() == {"FINISHED"}


def test_a_render_that_does_not_fit_leaves_the_older_file(scene, tmp_path: Path, monkeypatch):
    """Blender itself crashes when it writes a file of many layers of a render that was started and has failed."""
    settings, path = scene.render.image_settings, tmp_path / "layers.exr"
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, scene.render.filepath = "OPEN_EXR_MULTILAYER", str(path)
    bpy.ops.render.render(write_still=True)
    older = path.read_bytes()
    monkeypatch.setattr(memory, "free_bytes", lambda: 64 << 10)
    with pytest.raises(RuntimeError, match="An image of 64 x 36 pixels needs about"):
        bpy.ops.render.render(write_still=True)
    assert path.read_bytes() == older
    monkeypatch.undo()
    bpy.ops.render.render(write_still=True)


def test_a_scan_that_does_not_fit_is_refused(scene, monkeypatch):
    monkeypatch.setattr(memory, "free_bytes", lambda: 64 << 20)
    count = len(bpy.data.objects)
    with pytest.raises(RuntimeError, match=r"An interval of 230,400 rays needs about 0\.1 GiB"):
        bpy.ops.perfect_bvh.scan()
    assert len(bpy.data.objects) == count
    scene.perfect_bvh.scan.width = 64
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}


@pytest.mark.parametrize("name", ["samples", "scan.width", "scan.columns"])
def test_settings_cannot_be_nothing(scene, name: str):
    owner = scene.perfect_bvh
    *path, last = name.split(".")
    for part in path:
        owner = getattr(owner, part)
    setattr(owner, last, 0)
    assert getattr(owner, last) == 1


# Renders that end early ----------------------------------------------------------------------------------------------


def test_an_image_of_a_render_that_failed_is_not_saved(scene, tmp_path: Path, monkeypatch):
    from perfect_bvh_addon.image import still

    def fail(*_: object, **__: object) -> None:
        raise MemoryError("nothing left")

    older = tmp_path / "out.png"
    assert render(save(tmp_path), older) == 0
    before = older.read_bytes()
    monkeypatch.setattr(still, "render_frame", fail)
    assert render(tmp_path / "scene.blend", older) == 2
    assert older.read_bytes() == before
    assert np.frombuffer(before[:4], np.uint8).tolist() == [0x89, 0x50, 0x4E, 0x47]
