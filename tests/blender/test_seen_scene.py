"""Every rule of visibility, level and camera, with every command: all see the scene of a render, or of viewports."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.command_lines import run  # noqa: E402
from oracles.exr import read_exr  # noqa: E402
from perfect_bvh_addon import CameraGrid, label_image, load_sensor, scan  # noqa: E402
from perfect_bvh_addon.bench.measurements import subject_of  # noqa: E402

HALF = 0.4  # of a cube's side
SIDE = 64  # pixels
# The camera of the frame's marker is here. The other one, active when the file was saved, looks at nothing.
PLACE = (0.0, -12.0, 0.0)
SENSOR = 'kind = "raster"\nwidth = 96\nheight = 96\nhorizontal = 40.0\nvertical = 40.0\nrate = 24.0\n'


@dataclass(frozen=True, slots=True)
class Shape:
    """nearest: the least y of the visible surface. triangles: of the mesh; 0 for strands."""

    nearest: float
    triangles: int


Seen = tuple[Shape | None, Shape | None]  # by a render, by viewports
FLAT = Shape(-HALF, 12)
BEHIND = Shape(-HALF + 0.2, 12)


def evaluated(obj: Any) -> Shape:
    """Evaluate an object as Blender does for viewports; return its shape."""
    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    return Shape(min((obj.matrix_world @ vertex.co).y for vertex in mesh.vertices), len(mesh.loop_triangles))


def in_collection(obj: Any) -> tuple[Any, Any]:
    """Move an object into a new collection; return the collection and its layer collection."""
    made = bpy.data.collections.new(obj.name)
    bpy.context.scene.collection.children.link(made)
    bpy.context.scene.collection.objects.unlink(obj)
    made.objects.link(obj)
    return made, bpy.context.view_layer.layer_collection.children[made.name]


def displace(obj: Any, **shown: bool) -> None:
    modifier = obj.modifiers.new("Displace", "DISPLACE")
    modifier.direction, modifier.mid_level, modifier.strength = "Y", 0.0, BEHIND.nearest - FLAT.nearest
    for name, value in shown.items():
        setattr(modifier, name, value)


def plain(_: Any) -> Seen:
    return FLAT, FLAT


def hidden_in_renders(obj: Any) -> Seen:
    obj.hide_render = True
    return None, FLAT


def hidden_in_viewports(obj: Any) -> Seen:
    obj.hide_viewport = True
    return FLAT, None


def eye_closed(obj: Any) -> Seen:
    obj.hide_set(True)
    return FLAT, None


def collection_hidden_in_renders(obj: Any) -> Seen:
    in_collection(obj)[0].hide_render = True
    return None, FLAT


def collection_hidden_in_viewports(obj: Any) -> Seen:
    in_collection(obj)[0].hide_viewport = True
    return FLAT, None


def eye_of_collection_closed(obj: Any) -> Seen:
    in_collection(obj)[1].hide_viewport = True
    return FLAT, None


def collection_excluded(obj: Any) -> Seen:
    in_collection(obj)[1].exclude = True
    return None, None


def subdivided(obj: Any) -> Seen:
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = 2
    fine = evaluated(obj)
    modifier.levels = 0
    assert fine.nearest > FLAT.nearest + 0.05 and fine.triangles == 192
    return fine, FLAT


def displaced_in_renders(obj: Any) -> Seen:
    displace(obj, show_viewport=False)
    return BEHIND, FLAT


def displaced_in_viewports(obj: Any) -> Seen:
    displace(obj, show_render=False)
    return FLAT, BEHIND


def moved_by_nodes_in_viewports(obj: Any) -> Seen:
    tree = bpy.data.node_groups.new("Moved", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    given, made = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    moved, switch = tree.nodes.new("GeometryNodeTransform"), tree.nodes.new("GeometryNodeSwitch")
    switch.input_type = "VECTOR"
    switch.inputs["True"].default_value = (0.0, BEHIND.nearest - FLAT.nearest, 0.0)
    tree.links.new(tree.nodes.new("GeometryNodeIsViewport").outputs[0], switch.inputs["Switch"])
    tree.links.new(switch.outputs[0], moved.inputs["Translation"])
    tree.links.new(given.outputs[0], moved.inputs["Geometry"])
    tree.links.new(moved.outputs[0], made.inputs[0])
    obj.modifiers.new("Nodes", "NODES").node_group = tree
    return FLAT, BEHIND


def round_curve(obj: Any) -> Seen:
    bpy.ops.curve.primitive_bezier_circle_add(radius=HALF, location=obj.location)
    circle, name = bpy.context.object, obj.name
    bpy.data.meshes.remove(obj.data)
    circle.name = circle.data.name = name
    circle.rotation_euler.z = np.pi / 4.0
    circle.data.extrude = HALF
    circle.data.resolution_u = circle.data.render_resolution_u = 12
    bpy.context.view_layer.update()
    fine = evaluated(circle)
    circle.data.resolution_u = 1
    coarse = evaluated(circle)
    assert coarse.nearest > fine.nearest + 0.05
    return fine, coarse


def instancer_without_instances(obj: Any) -> Seen:
    obj.show_instancer_for_render = False
    obj.instance_type = "FACES"
    return None, FLAT


def hairy_in_renders(obj: Any) -> Seen:
    obj.show_instancer_for_render = obj.show_instancer_for_viewport = False
    modifier = obj.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = modifier.particle_system.settings
    settings.type, settings.count, settings.hair_length, settings.emit_from = "HAIR", 60, 0.3, "FACE"
    settings.radius_scale, settings.root_radius, settings.tip_radius = 0.1, 1.0, 1.0
    modifier.show_viewport = False
    return Shape(-HALF - 0.35, 0), None


RULES: tuple[Callable[[Any], Seen], ...] = (
    plain,
    hidden_in_renders,
    hidden_in_viewports,
    eye_closed,
    collection_hidden_in_renders,
    collection_hidden_in_viewports,
    eye_of_collection_closed,
    collection_excluded,
    subdivided,
    displaced_in_renders,
    displaced_in_viewports,
    moved_by_nodes_in_viewports,
    round_curve,
    instancer_without_instances,
    hairy_in_renders,
)


@dataclass(frozen=True, slots=True)
class Table:
    """The expected surfaces by the names of rules: in a render, and in viewports."""

    file: Path
    folder: Path
    rows: tuple[dict[str, Shape], dict[str, Shape]]

    def run(self, into: Path, command: str, for_viewport: bool, *arguments: object) -> Path:
        """Run the command; return the path of its output."""
        output = into / f"{command}_{for_viewport}{'.exr' if command == 'render' else ''}"
        line = [command, self.file, *(["-o", output] if command != "info" else []), *arguments]
        assert run(*line, *(["--viewport"] if for_viewport else [])) == 0
        return output


def add_camera(name: str, frame: int, turn: float) -> Any:
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    camera.location, camera.rotation_euler = PLACE, (np.pi / 2.0, 0.0, turn)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.timeline_markers.new(name, frame=frame).camera = camera
    return camera


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    """The file is saved at frame 3 with the camera of frame 1, as scripts may do."""
    folder = tmp_path_factory.mktemp("seen")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.exr_codec = "NONE"  # as the tests' reader wants it
    rows: tuple[dict[str, Shape], dict[str, Shape]] = {}, {}
    for number, rule in enumerate(RULES):
        place = (number % 4 * 1.6 - 2.4, 0.0, number // 4 * 1.6 - 2.4)
        bpy.ops.mesh.primitive_cube_add(size=2.0 * HALF, location=place)
        obj = bpy.context.object
        obj.name = obj.data.name = rule.__name__
        for row, shape in zip(rows, rule(obj), strict=True):
            if shape is not None:
                row[rule.__name__] = shape
    away = add_camera("Away", 1, np.pi)
    add_camera("Before", 3, 0.0)
    scene.frame_set(3)
    scene.camera = away
    (folder / "sensor.toml").write_text(SENSOR)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "seen.blend"))
    return Table(folder / "seen.blend", folder, rows)


def nearest(names: list[str], rows: Any, positions: Any) -> dict[str, float]:
    """Return the least y of each object's visible points. rows: (..., ) of names, -1 for none. positions: (..., 3)."""
    return {names[row]: float(positions[rows == row][:, 1].min()) for row in np.unique(rows) if row >= 0}


def check_nearest(found: dict[str, float], expected: dict[str, Shape]) -> None:
    assert found.keys() == expected.keys()
    for name, shape in expected.items():
        tolerance = {0: 0.3, 12: 0.001}.get(shape.triangles, 0.03)  # of strands, of planes, of round shapes
        assert found[name] == pytest.approx(shape.nearest, abs=tolerance), name


def labelled(path: Path) -> dict[str, float]:
    with np.load(path) as data:
        names = [thing["name"] for thing in json.loads(str(data["things"]))]
        return nearest(names, data["thing_ids"], data["positions"])


@pytest.mark.parametrize("for_viewport", [False, True])
def test_labels_and_renders_show_it(table: Table, tmp_path: Path, for_viewport: bool) -> None:
    folder = table.run(tmp_path, "labels", for_viewport, "--frames", "3", "--no-coco", "-q")
    (path,) = folder.glob("*.npz")
    check_nearest(labelled(path), table.rows[for_viewport])
    image = table.run(tmp_path, "render", for_viewport, "--mode", "depth", "--samples", 1, "--frames", "3", "-q")
    (plane,) = (plane for name, plane in read_exr(image).items() if name.endswith("R"))
    with np.load(path) as data:
        assert np.array_equal(data["depth"], plane)


@pytest.mark.parametrize("for_viewport", [False, True])
@pytest.mark.parametrize("frames", [(), ("--frames", "3"), ("--frames", "2-3", "--chunk", 1)])
def test_scans_hit_it(table: Table, tmp_path: Path, for_viewport: bool, frames: tuple[object, ...]) -> None:
    asked = ("--sensor", table.folder / "sensor.toml", *frames, "-q")
    folder = table.run(tmp_path, "scan", for_viewport, *asked)
    path = max(folder.glob("*.npz"))
    with np.load(path) as data:
        found = nearest([str(name) for name in data["object_names"]], data["object_ids"], data["positions"])
    check_nearest(found, table.rows[for_viewport])


@pytest.mark.parametrize("for_viewport", [False, True])
def test_info_and_bench_count_it(table: Table, tmp_path: Path, for_viewport: bool, capsys: Any) -> None:
    expected = table.rows[for_viewport]
    table.run(tmp_path, "info", for_viewport, "--frame", 3)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    rows = {line[0]: line for line in lines if line and line[0] in {rule.__name__ for rule in RULES}}
    shown = {name: line for name, line in rows.items() if line[1] != "unseen"}
    assert shown.keys() == expected.keys()
    for name, shape in expected.items():
        assert shape.triangles == 0 or shown[name][3:5] == [str(shape.triangles), "triangles"]
    folder = table.run(tmp_path, "bench", for_viewport, "--seconds", 1)
    figures = json.loads((folder / "bench.json").read_text())
    assert figures["triangles"] == sum(shape.triangles for shape in expected.values())


def test_a_markers_camera_alone_is_enough(table: Table, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(table.file))
    bpy.context.scene.camera = None
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "blind.blend"))
    blind = Table(tmp_path / "blind.blend", table.folder, table.rows)
    image = blind.run(tmp_path, "render", False, "--mode", "depth", "--samples", 1, "--frames", "3", "-q")
    (plane,) = (plane for name, plane in read_exr(image).items() if name.endswith("R"))
    before = image.read_bytes()
    blind.run(tmp_path, "render", False, "--mode", "depth", "--samples", 1, "--frames", "3", "--resume", "-q")
    assert image.read_bytes() == before
    folder = blind.run(tmp_path, "labels", False, "--frames", "3", "--no-coco", "-q")
    (path,) = folder.glob("*.npz")
    check_nearest(labelled(path), table.rows[False])
    with np.load(path) as data:
        assert np.array_equal(data["depth"], plane)


@pytest.mark.parametrize("for_viewport", [False, True])
def test_functions_see_it(table: Table, for_viewport: bool) -> None:
    """The add-on is not registered, and the scene is set to frame 3: the camera is that of the marker."""
    bpy.ops.wm.open_mainfile(filepath=str(table.file))
    bpy.context.scene.frame_set(3)
    expected = table.rows[for_viewport]
    labels = label_image(for_viewport=for_viewport)
    check_nearest(nearest([thing.name for thing in labels.things], labels.thing_ids, labels.positions), expected)
    cloud = scan(CameraGrid(SIDE, SIDE), for_viewport=for_viewport)
    check_nearest(nearest(list(cloud.object_names), cloud.object_ids, cloud.positions), expected)
    record = subject_of(bpy.context.scene, for_viewport=for_viewport).record
    assert sum(len(mesh.triangles) for mesh in record.meshes) == sum(shape.triangles for shape in expected.values())
    assert np.asarray(record.camera.matrix)[:3, 3].tolist() == list(PLACE)
    assert np.asarray(record.camera.matrix)[:3, 2] == pytest.approx((0.0, -1.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("for_viewport", [False, True])
def test_a_scan_changes_to_the_camera_of_a_marker(table: Table, for_viewport: bool) -> None:
    """Frame 2 still uses the camera that looks away."""
    bpy.ops.wm.open_mainfile(filepath=str(table.file))
    bpy.context.scene.frame_set(1)
    cloud = scan(load_sensor(table.folder / "sensor.toml"), frames=(2, 3), for_viewport=for_viewport)
    assert cloud.ray_ids.min() >= 96 * 96
    found = nearest(list(cloud.object_names), cloud.object_ids, cloud.positions)
    check_nearest(found, table.rows[for_viewport])


def test_a_sensor_that_renders_hide_is_where_it_would_be(table: Table) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(table.file))
    head = bpy.data.objects.new("Head", None)
    bpy.context.scene.collection.objects.link(head)
    for frame, x in ((1, -1.0), (4, 1.0)):
        head.location = (x, PLACE[1], 0.0)
        head.keyframe_insert("location", frame=frame)
    clouds = []
    for hide in (False, True):
        head.hide_render = hide
        clouds.append(scan(load_sensor(table.folder / "sensor.toml"), head, frames=(1, 3)))
    assert len(clouds[0]) > 1000
    assert np.array_equal(clouds[0].positions, clouds[1].positions)


def test_a_reading_leaves_the_scene_as_it_was(table: Table) -> None:
    """The scene has no camera, and another engine is set: Blender alone renders nothing then."""
    bpy.ops.wm.open_mainfile(filepath=str(table.file))
    scene = bpy.context.scene
    scene.timeline_markers.clear()
    head, scene.camera = scene.camera, None
    head.rotation_euler.z = 0.0
    scene.frame_set(2)
    scene.render.engine, scene.render.use_compositing, scene.render.use_persistent_data = "CYCLES", True, False

    def state() -> tuple[Any, ...]:
        render = scene.render
        switches = render.engine, render.use_compositing, render.use_persistent_data, render.use_sequencer
        return (scene.frame_current, scene.camera, *switches, len(bpy.data.cameras), len(bpy.data.objects))

    before = state()
    cloud = scan(load_sensor(table.folder / "sensor.toml"), head, frames=(3, 3))
    check_nearest(nearest(list(cloud.object_names), cloud.object_ids, cloud.positions), table.rows[False])
    with pytest.raises(ValueError, match="scene 'Scene' has no usable camera"):
        label_image()
    assert state() == before
