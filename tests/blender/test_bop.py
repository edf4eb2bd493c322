"""`labels --format bop`: poses, masks, depths and models that fit together, to the pixel."""

from __future__ import annotations

import json
from itertools import count
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from blender.command_lines import run
from perfect_bvh_addon import label_image
from perfect_bvh_addon.labels.bop import _number_of, _parted

images = pytest.importorskip("PIL.Image", reason="Pillow is not installed: pip install '.[data]'")

WIDTH, HEIGHT = 96, 64
TRAIN = Path("bop", "train", "000001")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """Two cubes of one mesh, one of them moving and turned; a stretched sphere in front of one; and a mirrored cone."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.frame_start, scene.frame_end = 1, 2
    bpy.ops.object.camera_add(location=(0.0, -8.0, 1.0), rotation=(1.45, 0.0, 0.0))
    scene.camera = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-1.5, 0.0, 0.5))
    cube = bpy.context.object
    twin = bpy.data.objects.new("Twin", cube.data)
    scene.collection.objects.link(twin)
    for frame, turn in ((1, 0.3), (2, 0.8)):
        twin.location, twin.rotation_euler = (1.0 + 0.2 * frame, 0.5, 0.5), (0.1, turn, 0.2)
        twin.keyframe_insert("location", frame=frame)
        twin.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(-1.2, -1.5, 0.5), scale=(1.0, 0.5, 2.0))
    bpy.ops.mesh.primitive_cone_add(radius1=0.5, location=(0.0, 0.0, 0.5), scale=(-1.0, 1.0, 1.0))
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def read(folder: Path, what: str) -> Any:
    return json.loads((folder / TRAIN / f"scene_{what}.json").read_text())


def image(path: Path) -> np.ndarray:
    return np.array(images.open(path))


def model(folder: Path, number: int) -> np.ndarray:
    data = (folder / "bop" / "models" / f"obj_{number:06d}.ply").read_bytes()
    head, _, rest = data.partition(b"end_header\n")
    count = int(head.split(b"element vertex ")[1].split()[0])
    return np.frombuffer(rest, "<f4", 3 * count).reshape(-1, 3).astype(np.float64)


def test_poses_masks_depths_and_models_fit_together(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    arguments = ("labels", file, "-o", folder, "--format", "bop", "--no-coco", "--frames", "1-2", "--chunk", 1, "-q")
    assert run(*arguments) == 0
    poses, facts, cameras = (read(folder, what) for what in ("gt", "gt_info", "camera"))
    assert list(poses) == list(facts) == list(cameras) == ["1", "2"]
    numbers = [[thing["obj_id"] for thing in poses[frame]] for frame in poses]
    assert [len(set(each)) for each in numbers] == [3, 3]
    assert sorted(numbers[0]) == sorted(numbers[1])
    assert len(list((folder / "bop" / "models").glob("*.ply"))) == 3
    for frame, things in poses.items():
        camera = np.array(cameras[frame]["cam_K"]).reshape(3, 3)
        depth = image(folder / TRAIN / "depth" / f"{int(frame):06d}.png") * cameras[frame]["depth_scale"]
        seen = np.zeros((HEIGHT, WIDTH), int)
        for place, (thing, fact) in enumerate(zip(things, facts[frame], strict=True)):
            mask, visible = (
                image(folder / TRAIN / name / f"{int(frame):06d}_{place:06d}.png") > 0
                for name in ("mask", "mask_visib")
            )
            seen += visible
            assert (mask.sum(), visible.sum()) == (fact["px_count_all"], fact["px_count_visib"])
            assert fact["visib_fract"] == pytest.approx(visible.sum() / mask.sum())
            assert not (visible & ~mask).any()
            turn = np.array(thing["cam_R_m2c"]).reshape(3, 3)
            np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-6)
            assert np.linalg.det(turn) > 0.0
            points = model(folder, thing["obj_id"]) @ turn.T + thing["cam_t_m2c"]
            near, far = points[:, 2].min(), points[:, 2].max()
            assert ((depth[visible] >= near - 1.5) & (depth[visible] <= far + 1.5)).all()
            pixels = points @ camera.T
            pixels = pixels[:, :2] / pixels[:, 2:]
            left, top, width, height = fact["bbox_obj"]
            # A mask has the pixels whose centre hits the object: at a tip fewer than the object covers.
            over = np.array([left, top, -left - width + 1, -top - height + 1]) - [
                *pixels.min(axis=0),
                *-pixels.max(axis=0),
            ]
            assert ((over > -0.01) & (over < 3.0)).all()
        assert ((seen == 1) == (depth > 0.0)).all()
    info = json.loads((folder / "bop" / "models" / "models_info.json").read_text())
    sizes = sorted(round(fact["diameter"]) for fact in info.values())
    assert round(1000.0 * 3.0**0.5) in sizes
    assert 1599 in sizes or 1600 in sizes  # the sphere is .8 m high, stretched twice


def test_masks_are_those_of_each_object_alone(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    assert run("labels", file, "-o", folder, "--format", "bop", "npz", "--no-coco", "-q") == 0
    with np.load(folder / "labels_0001.npz") as arrays:
        names = [thing["name"] for thing in json.loads(str(arrays["things"]))]
    bpy.ops.wm.open_mainfile(filepath=str(file))
    for place, name in enumerate(names):
        for other in bpy.data.objects:
            other.hide_render = other.type == "MESH" and other.name != name
        alone = label_image().thing_ids >= 0
        assert (image(folder / TRAIN / "mask" / f"000001_{place:06d}.png") > 0).tolist() == alone.tolist()


def test_twenty_objects_in_a_room_have_exact_masks_and_an_image(tmp_path: Path) -> None:
    """As BlenderProc's example of BOP: objects of a few models, thrown over the floor of a room."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    bpy.ops.object.camera_add(location=(0.0, -2.8, 2.4), rotation=(0.9, 0.0, 0.0))
    scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="POINT", location=(0.0, 0.0, 2.8))
    bpy.context.object.data.energy = 300.0
    bpy.ops.mesh.primitive_cube_add(size=6.0, location=(0.0, 0.0, 3.0))
    bpy.context.object.name = "Room"
    bpy.ops.mesh.primitive_torus_add(major_radius=0.3, minor_radius=0.1)
    bpy.ops.mesh.primitive_monkey_add(size=0.6)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.2, depth=0.7)
    bpy.ops.mesh.primitive_cube_add(size=0.45)
    models = [obj for obj in scene.objects if obj.type == "MESH" and obj.name != "Room"]
    random = np.random.default_rng(4)
    things = [
        *models,
        *(bpy.data.objects.new(f"Thing {i}", models[i % 4].data) for i in range(16)),
    ]
    for obj in things:
        if obj.name not in scene.objects:
            scene.collection.objects.link(obj)
        obj.location = (*random.uniform((-1.3, -1.2), (1.3, 1.2)), random.uniform(0.2, 0.8))
        obj.rotation_euler = random.uniform(0.0, 6.3, 3)
        obj["class"] = obj.data.name
    thrown = {obj.name for obj in things}
    path = tmp_path / "room.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    folder = tmp_path / "out"
    assert run("labels", path, "-o", folder, "--format", "bop", "npz", "--no-coco", "-q") == 0
    with np.load(folder / "labels_0001.npz") as arrays:
        names = [thing["name"] for thing in json.loads(str(arrays["things"]))]
    facts = read(folder, "gt_info")["1"]
    assert thrown <= set(names)
    assert len({pose["obj_id"] for pose in read(folder, "gt")["1"]}) == 5
    picture = image(folder / TRAIN / "rgb" / "000001.png")
    assert picture.shape[:2] == (120, 160)
    assert picture[..., :3].std() > 5.0  # it shows something
    seen = np.zeros((120, 160), int)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    for place, name in enumerate(names):
        for other in bpy.data.objects:
            other.hide_render = other.type == "MESH" and other.name != name
        alone = label_image().thing_ids >= 0
        mask, visible = (
            image(folder / TRAIN / each / f"000001_{place:06d}.png") > 0 for each in ("mask", "mask_visib")
        )
        assert mask.tolist() == alone.tolist()
        assert not (visible & ~mask).any()
        assert facts[place]["px_count_visib"] == visible.sum()
        seen += visible
    assert (seen == 1).all()


def test_a_later_run_of_other_frames_keeps_the_earlier_ones(file: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "out"
    common = ("labels", file, "-o", folder, "--format", "bop", "--no-coco", "--depth-scale", "0.0001")
    assert run(*common, "--frames", "1") == 0
    assert "BOP: depth beyond 6.5535 is written as 0" in "".join(capfd.readouterr())
    first = {path.name: path.read_bytes() for path in (folder / TRAIN / "mask").iterdir()}
    assert run(*common, "--frames", "2", "-q") == 0
    assert [list(read(folder, what)) for what in ("gt", "gt_info", "camera")] == [["1", "2"]] * 3
    assert len(list((folder / TRAIN / "mask").iterdir())) == 2 * len(first)
    assert all((folder / TRAIN / "mask" / name).read_bytes() == content for name, content in first.items())


def test_a_mirrored_object_that_turns_is_one_model_with_its_outside_out(file: Path, tmp_path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(file))
    for name, scale in (("Cube", (-1.0, 1.0, 1.0)), ("Twin", (-0.7, -0.7, -0.7))):
        thing = bpy.data.objects[name]
        for frame in (1, 2, 3):
            thing.scale, thing.rotation_euler = scale, (0.1, 0.4 * frame, 0.2 * frame)
            thing.keyframe_insert("rotation_euler", frame=frame)
    bpy.data.objects.remove(bpy.data.objects["Cone"])  # inside out: the operator mirrors its mesh
    bpy.ops.wm.save_mainfile()
    folder = tmp_path / "out"
    arguments = ("labels", file, "-o", folder, "--format", "bop", "--no-coco", "--frames", "1-3", "--chunk", 1, "-q")
    assert run(*arguments) == 0
    poses = read(folder, "gt").values()
    assert [[thing["obj_id"] for thing in things] for things in poses] == [[1, 2, 3]] * 3
    for number in (1, 2, 3):
        data = (folder / "bop" / "models" / f"obj_{number:06d}.ply").read_bytes().partition(b"end_header\n")[2]
        vertices = model(folder, number)
        faces = np.frombuffer(data[12 * len(vertices) :], np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
        a, b, c = np.moveaxis(vertices[faces["corners"]], 1, 0)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0


def test_a_stretch_is_one_model_whatever_the_rotation() -> None:
    """Numbers such as 1.234565 are between two roundings."""
    random, numbers = np.random.default_rng(2), count(1)
    for scale in ((1.0, 1.0, -1.0), (1.234565, -0.5000049999, 2.0), (1.0, 0.0, 3.0)):
        known: list[Any] = []
        for _ in range(100):
            turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
            linear = (turn * np.linalg.det(turn) @ np.diag(scale)).astype(np.float32).astype(np.float64)
            rotation, stretch = _parted(linear)
            assert np.linalg.det(rotation) == pytest.approx(1.0)
            np.testing.assert_allclose(rotation @ stretch, linear, atol=1e-6)
            _number_of(known, stretch, numbers)
        assert len(known) == 1


def test_files_of_others_are_left_alone(file: Path, tmp_path: Path) -> None:
    others = [tmp_path / "out" / TRAIN / "mask" / "mine.png", tmp_path / "out" / "bop" / "models" / "mine.ply"]
    for other in others:
        other.parent.mkdir(parents=True)
        other.write_text("mine")
    assert run("labels", file, "-o", tmp_path / "out", "--format", "bop", "--no-coco", "-q") == 0
    assert [other.read_text() for other in others] == ["mine"] * 2


def test_chunks_are_kept_and_the_camera_must_be_perspective(file: Path, tmp_path: Path, capfd: Any) -> None:
    folder = tmp_path / "out"
    arguments = ("labels", file, "-o", folder, "--format", "bop", "--no-coco", "--frames", "1-2", "--chunk", 1)
    assert run(*arguments, "-q") == 0
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    assert run(*arguments, "--resume") == 0
    assert "2 existed" in "".join(capfd.readouterr())
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before
    bpy.ops.wm.open_mainfile(filepath=str(file))
    bpy.context.scene.camera.data.type = "ORTHO"
    bpy.ops.wm.save_mainfile()
    assert run("labels", file, "-o", tmp_path / "other", "--format", "bop", "--no-coco", "-q") != 0
    assert "the camera must be a perspective one, not orthographic" in "".join(capfd.readouterr())
