"""Recorded images of Cycles: another scene never gets them, and a scene without recording is rendered and reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from oracles import recorded  # noqa: E402
from oracles.cycles import preserved, render_noisy, render_passes  # noqa: E402
from oracles.recorded import Planes, Recordings, pack, unpack  # noqa: E402
from oracles.recorded_hooks import TESTS, Hooks, mode_of  # noqa: E402
from oracles.scene_digest import scene_digest  # noqa: E402

SIZE = 16, 8


def build(folder: Path) -> Any:
    """Build a scene with a little of everything that the tests change."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=10, y_subdivisions=10)
    obj = bpy.context.object
    obj.name = "Grid"
    mesh = obj.data
    mesh.uv_layers.new(name="Other")
    for name in ("First", "Second"):
        mesh.color_attributes.new(name, "FLOAT_COLOR", "POINT")
    obj.vertex_groups.new(name="Group").add([0, 1], 0.5, "REPLACE")
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Key")
    obj["answer"] = 42
    obj.keyframe_insert("location", frame=1)
    nodes = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    nodes.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    nodes.interface.new_socket("Amount", in_out="INPUT", socket_type="NodeSocketFloat")
    nodes.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    ends = [nodes.nodes.new(f"NodeGroup{end}") for end in ("Input", "Output")]
    nodes.links.new(ends[0].outputs[0], ends[1].inputs[0])
    bpy.ops.object.particle_system_add()
    obj.modifiers.new("Nodes", "NODES").node_group = nodes
    material = bpy.data.materials.new("Material")
    material.use_nodes = True
    mesh.materials.append(material)
    add = material.node_tree.nodes.new
    add("ShaderNodeValToRGB").name = "Ramp"
    add("ShaderNodeRGBCurve").name = "Curve"
    picture = bpy.data.images.new("Picture", 2, 2)
    add("ShaderNodeTexImage").image = picture
    saved = bpy.data.images.new("Saved", 2, 2)
    saved.filepath_raw, saved.file_format = str(folder / "saved.png"), "PNG"
    saved.save()
    add("ShaderNodeTexImage").image = bpy.data.images.load(str(folder / "saved.png"))
    scene.world = bpy.data.worlds.new("World")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 3.0)
    for item in (lamp, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    bpy.ops.object.armature_add()
    bpy.context.object.name = "Armature"
    return scene


def grid() -> Any:
    return bpy.data.objects["Grid"]


def node(name: str) -> Any:
    return bpy.data.materials["Material"].node_tree.nodes[name]


def change_file(folder: Path) -> None:
    path = folder / "saved.png"
    path.write_bytes(path.read_bytes() + b"\0")


def merge_two_faces(folder: Path) -> None:
    """Flip all faces; the number of corners and the vertices do not change."""
    bpy.context.view_layer.objects.active = grid()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.flip_normals()
    bpy.ops.object.mode_set(mode="OBJECT")


def lengthen_bone(folder: Path) -> None:
    armature = bpy.data.objects["Armature"]
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones[0].tail = (0.0, 0.0, 3.0)
    bpy.ops.object.mode_set(mode="OBJECT")


def setting(owner: Callable[[], Any], name: str, value: object) -> Callable[[Path], None]:
    return lambda folder: setattr(owner(), name, value)


def scene_of() -> Any:
    return bpy.context.scene


CHANGES: dict[str, Callable[[Path], Any]] = {
    "a vertex": lambda folder: setattr(grid().data.vertices[50], "co", (0.1, 0.0, 0.0)),
    "the faces": merge_two_faces,
    "a smooth face": lambda folder: setattr(grid().data.polygons[3], "use_smooth", True),
    "a weight": lambda folder: grid().vertex_groups[0].add([0], 0.25, "REPLACE"),
    "a key's vertex": lambda folder: setattr(grid().data.shape_keys.key_blocks[1].data[70], "co", (9.0, 0.0, 0.0)),
    "a key's value": lambda folder: setattr(grid().data.shape_keys.key_blocks[1], "value", 0.5),
    "a uv": lambda folder: setattr(grid().data.uv_layers[1].data[5], "uv", (0.3, 0.4)),
    "the rendered uv map": lambda folder: setattr(grid().data.uv_layers[1], "active_render", True),
    "the rendered colours": lambda folder: setattr(grid().data.color_attributes, "render_color_index", 1),
    "a colour": lambda folder: setattr(grid().data.color_attributes[1].data[9], "color", (0.1, 0.2, 0.3, 1.0)),
    "a custom property": lambda folder: grid().__setitem__("answer", 43),
    "an input of geometry nodes": lambda folder: grid().modifiers["Nodes"].__setitem__("Socket_1", 2.0),
    "a setting of particles": lambda folder: setattr(grid().particle_systems[0].settings, "count", 77),
    "the seed of particles": lambda folder: setattr(grid().particle_systems[0], "seed", 3),
    "a key frame": lambda folder: grid().keyframe_insert("location", frame=9),
    "a driver": lambda folder: grid().driver_add("scale", 0),
    "a constraint": lambda folder: grid().constraints.new("LIMIT_SCALE"),
    "a place": setting(grid, "location", (0.0, 0.0, 0.5)),
    "who sees it": setting(grid, "visible_shadow", False),
    "a pass index": setting(grid, "pass_index", 4),
    "a Cycles setting of an object": setting(lambda: grid().cycles, "use_deform_motion", False),
    "a bone at rest": lengthen_bone,
    "a pose": lambda folder: setattr(bpy.data.objects["Armature"].pose.bones[0], "location", (0.0, 1.0, 0.0)),
    "a ramp": lambda folder: setattr(node("Ramp").color_ramp.elements[0], "position", 0.2),
    "a curve": lambda folder: setattr(node("Curve").mapping.curves[0].points[0], "location", (0.0, 0.3)),
    "a socket": lambda folder: setattr(node("Principled BSDF").inputs["Roughness"], "default_value", 0.1),
    "a link": lambda folder: node("Ramp").id_data.links.new(
        node("Ramp").outputs[0], node("Principled BSDF").inputs["Base Color"]
    ),
    "a pixel": lambda folder: bpy.data.images["Picture"].pixels.__setitem__(0, 0.75),
    "an image's file": change_file,
    "an image's colour space": lambda folder: setattr(
        bpy.data.images["Picture"].colorspace_settings, "name", "Non-Color"
    ),
    "a packed image": lambda folder: node("Image Texture.001").image.pack(),
    "the noise of a field": setting(lambda: grid().particle_systems[0].settings.force_field_1, "noise", 0.5),
    "the world": lambda folder: setattr(scene_of().world, "color", (1.0, 0.0, 0.0)),
    "a lamp": lambda folder: setattr(bpy.data.lights["Lamp"], "energy", 5.0),
    "a lens": lambda folder: setattr(bpy.data.cameras["Camera"], "lens", 35.0),
    "the frame": lambda folder: scene_of().frame_set(7),
    "a camera from a frame on": lambda folder: setattr(
        scene_of().timeline_markers.new("M", frame=1), "camera", bpy.data.objects["Camera"]
    ),
    "the samples": lambda folder: setattr(scene_of().cycles, "samples", 3),
    "the seed": lambda folder: setattr(scene_of().cycles, "seed", 3),
    "a thickness of hair": lambda folder: setattr(scene_of().cycles_curves, "subdivisions", 3),
    "the size": lambda folder: setattr(scene_of().render, "resolution_percentage", 50),
    "an overriding material": lambda folder: setattr(
        scene_of().view_layers[0], "material_override", bpy.data.materials["Material"]
    ),
    "a collection left out": lambda folder: scene_of().collection.children.link(bpy.data.collections.new("Other")),
}


@pytest.fixture
def built(registered: None, tmp_path: Path) -> Any:
    return build(tmp_path)


@pytest.mark.parametrize("change", CHANGES)
def test_what_changes_images_changes_the_digest(built: Any, tmp_path: Path, change: str) -> None:
    before = scene_digest(built)
    CHANGES[change](tmp_path)
    assert scene_digest(bpy.context.scene) != before


def test_a_scene_made_again_has_the_same_digest(built: Any, tmp_path: Path) -> None:
    """The digest depends neither on the folder of the files nor on the engine's settings nor on the output's."""
    before = scene_digest(built)
    assert scene_digest(built) == before
    other = tmp_path / "elsewhere"
    other.mkdir()
    again = build(other)
    again.perfect_bvh.samples, again.render.filepath = 77, str(other)
    assert scene_digest(again) == before


def test_what_python_cannot_see_is_never_the_same(built: Any) -> None:
    tiled = bpy.data.images.new("Tiled", 2, 2, tiled=True)
    node("Image Texture").image = tiled
    tiled.pixels[0] = 0.5
    assert tiled.is_dirty
    assert scene_digest(built) != scene_digest(built)


# Recordings ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def noise(rng: np.random.Generator) -> Planes:
    return {name: rng.random((4, 6), np.float32) for name in ("A", "B")}


def never() -> Planes:
    raise AssertionError("this has a recording")


def recorded_in(folder: Path, digest: str, planes: Planes, is_half: bool = False) -> None:
    writer = Recordings(folder, "record")
    writer.current = "blender/test_some"
    writer.planes(digest, list(planes), is_half, lambda: planes)
    writer.write()


def reader(folder: Path, mode: recorded.Mode = "recall", current: str | None = "blender/test_some") -> Recordings:
    made = Recordings(folder, mode)
    made.current = current
    return made


def test_a_recording_comes_back_as_it_was(tmp_path: Path, noise: Planes) -> None:
    recorded_in(tmp_path, "digest", noise)
    recordings = reader(tmp_path)
    back = recordings.planes("digest", ["B", "A"], False, never)
    assert list(back) == ["B", "A"]
    for name, plane in back.items():
        np.testing.assert_array_equal(plane, noise[name])
    assert recordings.take_counts() == {"recalled": 1} and not recordings.take_counts()


def test_what_has_no_recording_is_rendered(tmp_path: Path, noise: Planes) -> None:
    recorded_in(tmp_path, "digest", {"A": noise["A"]})
    others = {"A": noise["A"], "B": noise["B"] + 1.0}
    for recordings, digest, names in (
        (reader(tmp_path), "another", ["A"]),
        (reader(tmp_path), "digest", ["A", "B"]),
        (reader(tmp_path, current="blender/test_other"), "digest", ["A"]),
        (reader(tmp_path, current=None), "digest", ["A"]),
    ):
        made = recordings.planes(digest, names, False, lambda: others)
        for name in names:
            np.testing.assert_array_equal(made[name], others[name])
        assert recordings.take_counts() == ({"rendered": 1} if recordings.current else {})


def test_recording_again_drops_what_no_test_renders_any_more(tmp_path: Path, noise: Planes) -> None:
    recorded_in(tmp_path, "old", noise)
    recorded_in(tmp_path, "new", noise)
    recordings = reader(tmp_path)
    np.testing.assert_array_equal(recordings.planes("old", ["A"], False, lambda: {"A": noise["B"]})["A"], noise["B"])
    recordings.planes("new", ["A"], False, never)


def test_files_with_failures_stay_as_they_are(tmp_path: Path, noise: Planes) -> None:
    recorded_in(tmp_path, "old", noise)
    writer = reader(tmp_path, "record")
    writer.planes("new", ["A"], False, lambda: noise)
    writer.write(failed={"blender/test_some"})
    reader(tmp_path).planes("old", ["A"], False, never)


@pytest.mark.parametrize("mode", ["record", "live"])
def test_two_images_of_one_digest_are_an_error(tmp_path: Path, noise: Planes, mode: recorded.Mode) -> None:
    """Both while images are recorded, and when they are compared with an earlier recording."""
    recorded_in(tmp_path, "digest", noise)
    recordings = reader(tmp_path, mode)
    recordings.planes("digest", ["A"], False, lambda: noise)
    recordings.planes("digest", ["A"], False, lambda: {"A": noise["A"] * 1.001})  # another processor's
    with pytest.raises(
        AssertionError, match="two images of Cycles differ whose scenes have one digest, digest/whole/A"
    ):
        recordings.planes("digest", ["A"], False, lambda: {"A": noise["B"]})


@pytest.mark.parametrize(
    ("values", "is_half", "size"),
    [
        ([0.0, 3.0, 255.0], False, 1),
        ([0.0, 3.0, 256.0], False, 4),
        ([0.5, -3.0, 1e10], False, 4),
        ([0.5, -3.0, 1e10], True, 4),
        ([0.5, np.nan, np.inf], True, 4),
        ([0.5, -3.0, 7.25], True, 2),
    ],
)
def test_values_are_kept_in_few_bytes(values: list[float], is_half: bool, size: int) -> None:
    plane = np.array([values], np.float32)
    packed = pack(plane, is_half)
    assert packed.shape == (size, 1, 3)
    np.testing.assert_array_equal(unpack(packed), plane)


def test_half_precision_is_close(noise: Planes) -> None:
    np.testing.assert_allclose(unpack(pack(noise["A"], True)), noise["A"], rtol=5e-4, atol=1e-7)


# With Cycles and pytest ---------------------------------------------------------------------------------------------


@pytest.fixture
def replaced(monkeypatch: pytest.MonkeyPatch) -> Callable[[Recordings], None]:
    """Make oracles use other recordings during the test."""
    return lambda recordings: monkeypatch.setattr(recorded, "active", recordings)


def test_cycles_renders_once(built: Any, tmp_path: Path, replaced: Callable[[Recordings], None]) -> None:
    writer = reader(tmp_path, "record")
    replaced(writer)
    with preserved((built.cycles, "samples", 2), (built.cycles, "use_denoising", False)):
        passes, noisy = render_passes(built), render_noisy(built, "CYCLES")
        writer.write()
        recalling = reader(tmp_path)
        replaced(recalling)
        again = render_passes(built)
        for name in ("combined", "depth", "normal", "object_index", "material_index"):
            np.testing.assert_array_equal(getattr(again, name), getattr(passes, name))
        np.testing.assert_array_equal(render_noisy(built, "CYCLES"), noisy)
        np.testing.assert_allclose(noisy, passes.combined, rtol=5e-4, atol=1e-6)
        assert recalling.take_counts() == {"recalled": 2}
        built.camera.location.z = 2.0
        assert np.abs(render_passes(built).depth - passes.depth).max() > 0.5
    assert recalling.take_counts() == {"rendered": 1}


def test_the_summary_says_what_was_rendered(tmp_path: Path, noise: Planes) -> None:
    """Counts are part of the reports, which may come from another process."""
    worker, controller = Hooks("recall", tmp_path), Hooks("recall", tmp_path)
    worker.pytest_runtest_setup(SimpleNamespace(path=TESTS / "blender" / "test_some.py"))
    assert worker.recordings.current == "blender/test_some"
    report = SimpleNamespace(location=("tests/blender/test_some.py", 1, "test"), failed=False)
    for _ in range(2):
        worker.recordings.planes("digest", ["A"], False, lambda: noise)
        make = worker.pytest_runtest_makereport(None)
        next(make)
        with pytest.raises(StopIteration):
            make.send(report)
        controller.pytest_runtest_logreport(report)
    lines: list[str] = []
    controller.pytest_terminal_summary(SimpleNamespace(section=lines.append, line=lines.append))
    assert "tests/blender/test_some.py: 2 rendered, for they are not recorded" in lines
    assert lines[-1] == "nox -s cycles_images -- tests/blender/test_some.py"


def options(**given: object) -> Any:
    named = {"record_cycles": False, "live_cycles": False, "keyword": "", "markexpr": "", "numprocesses": None} | given
    return SimpleNamespace(option=SimpleNamespace(**named), args=["tests/blender/test_some.py"])


def test_options_tell_the_mode() -> None:
    assert mode_of(options()) == "recall"
    assert mode_of(options(live_cycles=True)) == "live"
    assert mode_of(options(record_cycles=True, numprocesses=0)) == "record"


@pytest.mark.parametrize("wrong", [{"keyword": "sky"}, {"live_cycles": True}, {"numprocesses": 2}])
def test_parts_of_files_are_not_recorded(wrong: dict[str, object]) -> None:
    with pytest.raises(pytest.UsageError, match="--record-cycles"):
        mode_of(options(record_cycles=True, **wrong))
