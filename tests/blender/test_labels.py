"""Labelled images: visible pixels agree with a render's passes, hidden ones with an image of each object alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")
coco_mask = pytest.importorskip("pycocotools.mask")

from blender.builders import camera_object, collection, collection_instance, mesh_object  # noqa: E402
from perfect_bvh_addon import CocoFile, Labels, SceneSync, label_image  # noqa: E402
from perfect_bvh_addon.labels.coco import compressed  # noqa: E402
from perfect_bvh_addon.labels.labels import (  # noqa: E402
    masks_of,
    run_lengths,
)

SCENES = Path(__file__).parents[2] / "blend_scenes"
SIZE = (96, 54)


@pytest.fixture
def scene(registered: None) -> Any:
    """Three spheres in a row, one behind the other, on a floor; two cubes of a collection that is shown twice."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.camera = camera_object("camera", lens=35.0)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -9.0, 2.0), (1.37, 0.0, 0.0)
    for number in range(3):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=1.0, location=(0.7 * number, 2.0 * number, 1.0))
        ball = bpy.context.object
        ball.name, ball.pass_index = f"Ball {number}", number + 1
        ball["kind"] = 7 if number == 0 else "round"
        bpy.ops.object.shade_smooth()
    bpy.ops.mesh.primitive_plane_add(size=30.0)
    bpy.context.object.name = "Floor"
    bpy.context.object.data["kind"] = "ground"
    boxes = collection("Boxes", linked=False)
    bpy.ops.mesh.primitive_cube_add(size=0.8)
    cube = bpy.context.object
    cube.name = "Box"
    scene.collection.objects.unlink(cube)
    boxes.objects.link(cube)
    for number, x in enumerate((-2.5, -1.5)):
        shown = collection_instance(f"Shown {number}", boxes, location=(x, float(number), 0.4))
        shown["kind"] = "box"
    return scene


def named(labels: Labels, name: str, instancer: str = "") -> int:
    (row,) = [row for row, thing in enumerate(labels.things) if (thing.name, thing.instancer) == (name, instancer)]
    return row


def test_what_is_seen_is_what_the_passes_of_a_render_say(scene: Any) -> None:
    sync = SceneSync(watch=False)
    labels = label_image(sync=sync, size=SIZE)
    passes = perfect_bvh.render_passes(
        sync.scene,
        sync.camera,
        size=SIZE,
        appearance=sync.appearance,
        passes=("depth", "normal", "instance", "object_index"),
    )
    ids = np.array([*(thing.instance_id for thing in labels.things), -1])
    indices = np.array([*(thing.pass_index for thing in labels.things), 0])
    assert np.array_equal(ids[labels.thing_ids], passes["instance"])
    assert np.array_equal(indices[labels.thing_ids], passes["object_index"])
    assert np.array_equal(labels.depth, passes["depth"])
    np.testing.assert_allclose(labels.normals, passes["normal"], atol=1e-5)
    hit = labels.thing_ids >= 0
    eye = np.array(scene.camera.matrix_world.translation)
    ahead = -np.array(scene.camera.matrix_world)[:3, 2]
    np.testing.assert_allclose((labels.positions[hit] - eye) @ ahead, labels.depth[hit], rtol=1e-6)
    assert labels.uvs[labels.thing_ids == named(labels, "Floor")].std() > 0.05


def test_a_mirrored_and_sheared_mesh_has_the_normals_of_a_render(scene: Any) -> None:
    ball = bpy.data.objects["Ball 0"]
    ball.scale = (-0.6, 1.3, 1.0)
    ball.rotation_euler = (0.3, 0.5, 0.2)
    sync = SceneSync(watch=False)
    labels = label_image(sync=sync, size=SIZE)
    normal = perfect_bvh.render_passes(
        sync.scene, sync.camera, size=SIZE, appearance=sync.appearance, passes=("normal",)
    )["normal"]
    np.testing.assert_allclose(labels.normals, normal, atol=1e-5)


def test_what_is_flattened_has_the_normals_of_a_render(scene: Any) -> None:
    bpy.data.objects["Ball 0"].scale = (1.0, 0.0, 1.0)
    sync = SceneSync(watch=False)
    labels = label_image(sync=sync, size=SIZE)
    normal = perfect_bvh.render_passes(
        sync.scene, sync.camera, size=SIZE, appearance=sync.appearance, passes=("normal",)
    )["normal"]
    assert (labels.thing_ids == named(labels, "Ball 0")).any()
    np.testing.assert_allclose(labels.normals, normal, atol=1e-5)


def test_amodal_masks_are_those_of_each_thing_alone(scene: Any) -> None:
    labels = label_image(size=SIZE)
    overlap = np.zeros((SIZE[1], SIZE[0]), int)
    hidden = 0
    for row, thing in enumerate(labels.things):
        visible, amodal = labels.visible.image_of(row), labels.amodal.image_of(row)
        assert np.array_equal(visible, labels.thing_ids == row)
        assert not (visible & ~amodal).any()
        overlap += visible
        hidden += int(amodal.sum() - visible.sum())
        alone = SceneSync(watch=False)
        keep = thing.instancer or thing.name
        others = [obj for obj in scene.objects if obj.name not in (keep, "camera")]
        for obj in others:
            obj.hide_render = True
        bpy.context.view_layer.update()
        shown = label_image(sync=alone, size=SIZE)
        for obj in others:
            obj.hide_render = False
        bpy.context.view_layer.update()
        assert len(shown.things) == 1
        assert np.array_equal(amodal, shown.thing_ids == 0), thing
        assert labels.visible_shares[row] == pytest.approx(visible.sum() / amodal.sum())
    assert overlap.max() == 1
    assert hidden > 100


def test_each_thing_has_the_box_around_it_along_its_own_axes(scene: Any) -> None:
    ball = bpy.data.objects["Ball 0"]
    ball.scale, ball.rotation_euler = (0.6, 1.3, 1.0), (0.3, 0.5, 0.2)
    labels = label_image(size=SIZE)
    shown = labels.things[named(labels, "Box", "Shown 1")].box3d
    np.testing.assert_allclose(shown["center"], (-1.5, 1.0, 0.4), atol=1e-6)
    np.testing.assert_allclose(shown["size"], (0.8, 0.8, 0.8), atol=1e-6)
    np.testing.assert_allclose(shown["axes"], np.eye(3), atol=1e-6)
    number = named(labels, "Ball 0")
    box = labels.things[number].box3d
    np.testing.assert_allclose(box["axes"], np.array(ball.matrix_world.to_euler().to_matrix()).T, atol=1e-6)
    np.testing.assert_allclose(box["size"], ball.dimensions, atol=1e-5)
    seen = (labels.positions[labels.thing_ids == number] - box["center"]) @ np.array(box["axes"]).T
    assert (np.abs(seen) <= np.array(box["size"]) / 2 + 1e-5).all() and len(seen) > 100
    assert json.loads(json.dumps(labels.described_things()))[number]["box3d"] == box


def test_the_camera_projects_positions_to_their_pixels(scene: Any) -> None:
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.1, -0.2
    render = scene.render
    for is_cropped in (False, True):
        render.use_border = render.use_crop_to_border = is_cropped
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.1, 0.9
        labels = label_image(size=SIZE)
        hit = labels.thing_ids >= 0
        seen = labels.positions[hit] @ np.array(labels.camera["world_to_camera"])[:, :3].T
        seen += np.array(labels.camera["world_to_camera"])[:, 3]
        np.testing.assert_allclose(seen[:, 2], labels.depth[hit], rtol=1e-5)
        pixels = seen @ np.array(labels.camera["intrinsics"]).T
        rows, columns = np.nonzero(hit)
        np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], np.stack([columns, rows], axis=-1), atol=1e-3)
    scene.camera.data.type = "ORTHO"
    assert label_image(size=SIZE).camera.keys() == {"projection", "world_to_camera"}


def test_layers_are_all_surfaces_from_near_to_far(scene: Any) -> None:
    labels = label_image(size=SIZE, layers=6)
    depths, ids = labels.layer_depths, labels.layer_ids
    assert np.array_equal(depths[0], labels.depth) and np.array_equal(ids[0], labels.thing_ids)
    assert (np.diff(depths, axis=0) >= 0.0).all()
    assert np.array_equal(ids >= 0, depths < 1e9)
    row = named(labels, "Ball 2")
    # All surfaces of a sphere are among the first six of a ray here.
    assert np.array_equal((ids == row).any(axis=0), labels.amodal.image_of(row))
    assert ((ids == row).sum(axis=0) <= 2).all()


def test_categories_are_what_a_property_says(scene: Any) -> None:
    labels = label_image(size=SIZE, category="kind")
    assert labels.categories == ("7", "box", "ground", "round")
    names = {
        (thing.name, thing.instancer): labels.categories[thing.category] if thing.category >= 0 else None
        for thing in labels.things
    }
    assert names == {
        ("Ball 0", ""): "7",
        ("Ball 1", ""): "round",
        ("Ball 2", ""): "round",
        ("Floor", ""): "ground",
        ("Box", "Shown 0"): "box",
        ("Box", "Shown 1"): "box",
    }
    seen = labels.thing_ids == named(labels, "Floor")
    assert (labels.category_ids[seen] == 2).all()
    with pytest.raises(ValueError, match=r"label_image: no object.* custom property 'kinds'.*is it 'kind'"):
        label_image(size=SIZE, category="kinds")
    assert label_image(size=SIZE).categories == ("Ball 0", "Ball 1", "Ball 2", "Box", "Floor")


def test_flow_is_that_of_the_vector_pass(scene: Any) -> None:
    ball = bpy.data.objects["Ball 0"]
    for frame, x in ((1, -1.0), (3, 1.0)):
        ball.location.x = x
        ball.keyframe_insert("location", frame=frame)
    scene.frame_set(2)
    scene.render.use_border, scene.render.border_max_x = True, 0.3
    labels = label_image(size=SIZE, flow=True)
    assert labels.flow is not None
    moves = np.abs(labels.flow).max(axis=2) > 0.1
    assert np.array_equal(moves, labels.thing_ids == named(labels, "Ball 0"))
    assert scene.frame_current == 2
    assert label_image(size=SIZE).flow is None


@pytest.mark.parametrize("name", ["courtyard", "meadow"])
def test_examples_have_masks_that_never_overlap(registered: None, name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    labels = label_image(size=SIZE, layers=3)
    assert labels.visible.areas.sum() == (labels.thing_ids >= 0).sum() > 0.5 * SIZE[0] * SIZE[1]
    assert np.array_equal(labels.layer_depths[0], labels.depth)
    assert np.array_equal(labels.layer_ids[0], labels.thing_ids)
    assert (labels.amodal.areas >= labels.visible.areas).all()
    seen = np.concatenate([labels.visible.pixels_of(row) for row in range(len(labels.things))])
    assert len(np.unique(seen)) == len(seen)


# Files ---------------------------------------------------------------------------------------------------------------


def test_a_file_holds_everything(scene: Any, tmp_path: Path) -> None:
    labels = label_image(size=SIZE, layers=2, flow=True)
    path = labels.save(tmp_path / "labels")
    assert path.name == "labels.npz"
    with np.load(path) as data:
        for name in ("depth", "positions", "normals", "uvs", "thing_ids", "layer_depths", "flow"):
            assert np.array_equal(data[name], getattr(labels, name))
        assert np.array_equal(data["amodal_pixels"], labels.amodal.pixels)
        things = json.loads(str(data["things"]))
    assert [thing["name"] for thing in things] == [thing.name for thing in labels.things]


def test_a_coco_file_holds_the_masks(scene: Any, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_cube_add(size=0.2, location=(0.0, 0.0, 1.0))  # within the first sphere
    bpy.context.object.name = "Inside"
    labels = label_image(size=SIZE, category="kind")
    coco = CocoFile()
    coco.add(labels, "image_0001.png")
    coco.add(labels, "image_0002.png")
    content = json.loads(coco.save(tmp_path / "coco.json").read_text())
    assert [image["file_name"] for image in content["images"]] == ["image_0001.png", "image_0002.png"]
    assert [category["id"] for category in content["categories"]] == [1, 2, 3, 4, 5]
    assert [row["name"] for row in content["hidden"]] == ["Inside", "Inside"]
    ids = [row["id"] for row in (*content["annotations"], *content["hidden"])]
    assert sorted(ids) == list(range(1, 2 * len(labels.things) + 1))
    for row in content["annotations"]:
        number = named(labels, row["name"], row["instancer"])
        visible, amodal = labels.visible.image_of(number), labels.amodal.image_of(number)
        assert np.array_equal(coco_mask.decode(row["segmentation"]), visible)
        assert np.array_equal(coco_mask.decode(row["amodal_segmentation"]), amodal)
        assert row["area"] == visible.sum() and row["amodal_area"] == amodal.sum()
        left, top, width, height = row["bbox"]
        assert row["bbox"] == coco_mask.toBbox(row["segmentation"]).astype(int).tolist()
        assert visible[top : top + height, left : left + width].sum() == row["area"]


def test_masks_may_be_empty_and_overlap() -> None:
    owners, pixels = np.array([0, 2, 2, 0, 2]), np.array([5, 5, 1, 5, 3])
    masks = masks_of(owners.astype(np.int64), pixels.astype(np.int64), 3, (3, 2))
    assert masks.areas.tolist() == [1, 0, 3]
    assert masks.boxes().tolist() == [[2, 1, 1, 1], [0, 0, 0, 0], [0, 0, 3, 2]]
    assert masks.image_of(2).tolist() == [[False, True, False], [True, False, True]]
    assert not masks.image_of(1).any()


@pytest.mark.parametrize("size", [(7, 5), (1, 9), (9, 1), (64, 48)])
def test_run_lengths_are_those_of_single_masks(size: tuple[int, int]) -> None:
    random = np.random.default_rng(sum(size))
    count, pixel_count = 40, size[0] * size[1]
    # None, all, the first, the last, one column, and anything.
    some = [[], range(pixel_count), [0], [pixel_count - 1], range(0, pixel_count, size[0])]
    some += [np.flatnonzero(random.random(pixel_count) < random.random()) for _ in range(count - len(some))]
    owners = np.repeat(np.arange(count), [len(pixels) for pixels in some])
    pixels = np.concatenate([np.asarray(each, np.int64) for each in some])
    masks = masks_of(owners.astype(np.int64), pixels, count, size)
    for number, runs in enumerate(run_lengths(masks)):
        expected = coco_mask.encode(np.asfortranarray(masks.image_of(number).astype(np.uint8)))
        assert coco_mask.frPyObjects(runs, size[1], size[0]) == expected, number
        assert compressed(runs["counts"]).encode() == expected["counts"], number
    assert run_lengths(masks_of(owners[:0], pixels[:0], 0, size)) == []


@pytest.mark.parametrize("largest", [1, 16, 33, 1000, 10**6, 2**28])
def test_run_lengths_are_compressed_as_cocos_api_does(largest: int) -> None:
    """Also where a run is much longer or shorter than the one before the last."""
    random = np.random.default_rng(largest)
    for length in range(1, 9):
        counts = random.integers(1, largest, length, endpoint=True).tolist()
        counts[0] = int(random.integers(2)) * counts[0]  # a mask may begin at the first pixel
        expected = coco_mask.frPyObjects({"size": [sum(counts), 1], "counts": counts}, sum(counts), 1)
        assert compressed(counts).encode() == expected["counts"], counts


# Errors --------------------------------------------------------------------------------------------------------------


def test_bad_arguments_are_named(scene: Any) -> None:
    for layers in (0, 1.5, True, 2000):
        with pytest.raises(ValueError, match="label_image: layers must be an integer from 1 to 1000"):
            label_image(layers=layers)
    scene.camera = None
    with pytest.raises(ValueError, match="has no usable camera"):
        label_image(size=SIZE)


def test_it_can_be_cancelled(scene: Any) -> None:
    asked = []

    def stop(done: float) -> bool:
        asked.append(done)
        return done < 0.5

    with pytest.raises(perfect_bvh.Cancelled):
        label_image(size=(2000, 1000), progress=stop)
    assert asked and asked[-1] >= 0.5


def test_nothing_to_see(registered: None) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.camera = camera_object("camera")
    labels = label_image(size=SIZE)
    assert labels.things == () and (labels.thing_ids == -1).all() and (labels.depth == 1e10).all()
    assert len(labels.visible) == 0 and labels.visible_shares.shape == (0,)


def test_a_mesh_without_uvs_has_none(registered: None) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.camera = camera_object("camera")
    bpy.context.scene.camera.location = (0.0, 0.0, 5.0)
    mesh_object("Plain")
    labels = label_image(size=SIZE)
    assert labels.things and not labels.uvs.any()
