"""Images of several tiles (UDIM) in the mode "preview", compared with Cycles' picture, and edits of the images.

The floor has a vertex in each tile's square: Cycles loads only the tiles of squares with a vertex.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.node_setups import add, new_red, shader  # noqa: E402
from blender.program_slots import slots_of  # noqa: E402
from blender.test_layers_cycles import PATCH, SIDE, check, emissive, floor_mesh, scene  # noqa: E402, F401
from perfect_bvh_addon import AttributeRequest, SceneSync  # noqa: E402
from perfect_bvh_addon.extract.looks.images import temporary_data  # noqa: E402
from perfect_bvh_addon.sync.look_records import ImageRecord  # noqa: E402
from wine_gaps import plain_files  # noqa: E402

RED, GREEN, BLUE, MAGENTA = (0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8), (1.0, 0.0, 1.0)
SQUARES = SIDE // PATCH // 4  # patches of a tile's square, of which the floor shows four each way


def save(path: Path, *color: float, size: int = 8) -> None:
    """Save a tile whose right half is darker."""
    image = bpy.data.images.new("tile", size, size)
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = color
    pixels[:, size // 2 :, :3] *= 0.5
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


@pytest.fixture
def image(scene: Any, tmp_path: Path) -> Any:  # noqa: F811
    """Tiles 1001, 1002 and 1012 on a floor that reaches from (-1, -1) to (3, 3)."""
    for number, color, size in ((1001, RED, 8), (1002, GREEN, 16), (1012, BLUE, 8)):
        save(tmp_path / f"t.{number}.png", *color, size=size)
    image = bpy.data.images.load(str(tmp_path / "t.1001.png"))
    image.source, image.filepath = "TILED", str(tmp_path / "t.<UDIM>.png")
    assert [tile.number for tile in image.tiles] == [1001, 1002, 1012]
    for item in floor_mesh(scene).uv_layers[0].uv:
        item.vector = 4.0 * item.vector[0] - 1.0, 4.0 * item.vector[1] - 1.0
    return image


def shown(scene: Any, image: Any, extension: str = "EXTEND") -> Any:  # noqa: F811
    def output(tree: Any) -> Any:
        node = add(tree, "TexImage")
        node.image, node.extension = image, extension
        return node.outputs[0]

    return emissive(scene, output)


def in_square(picture: Any, column: int, row: int) -> Any:
    """Return the colour in the middle of a tile's left half."""
    return picture[-1 - (SQUARES * (row + 1) + SQUARES // 2), SQUARES * (column + 1) + 1]


@plain_files
@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP"])
def test_each_square_shows_its_tile(scene, image, extension: str) -> None:  # noqa: F811
    shown(scene, image, extension)
    picture = check(scene)
    for place, color in (((0, 0), RED), ((1, 0), GREEN), ((1, 1), BLUE), ((0, 1), MAGENTA), ((2, 2), MAGENTA)):
        linear = [channel if channel in (0.0, 1.0) else ((channel + 0.055) / 1.055) ** 2.4 for channel in color]
        assert in_square(picture, *place) == pytest.approx(linear, abs=0.05)


@plain_files
def test_one_tile_alone_lies_in_its_square_alone(scene, image) -> None:  # noqa: F811
    for number in (1002, 1012):
        image.tiles.remove(next(tile for tile in image.tiles if tile.number == number))
    shown(scene, image)
    assert in_square(check(scene), 1, 0) == pytest.approx(MAGENTA)


@plain_files
def test_what_nodes_do_to_an_image_is_done_to_each_tile(scene, image) -> None:  # noqa: F811
    material = shown(scene, image)
    tree = material.node_tree
    (node,) = (node for node in tree.nodes if node.type == "TEX_IMAGE")
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    moved = add(tree, "Mapping", (add(tree, "TexCoord").outputs["UV"], 0), Location=(0.25, 0.0, 0.0))
    tree.links.new(moved.outputs[0], node.inputs[0])
    darker = add(tree, "Gamma", (node.outputs[0], 0), Gamma=1.5)
    tree.links.new(darker.outputs[0], emission.inputs["Color"])
    check(scene)


def records(sync: SceneSync) -> tuple[ImageRecord, ...]:
    report = sync.update(bpy.context.evaluated_depsgraph_get(), verify=True)
    assert report.mismatches == ()
    return sync.record.images


@plain_files
def test_edits_of_tiles_show(scene, image, tmp_path: Path) -> None:  # noqa: F811
    """Files, the list of tiles, and pixels are edited."""
    shown(scene, image)
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        (first,) = records(sync)
        assert {number: tile.shape for number, tile in first.tiles.items()} == {
            1001: (8, 8, 4),
            1002: (16, 16, 4),
            1012: (8, 8, 4),
        }
        (again,) = records(sync)
        assert all(again.tiles[number] is first.tiles[number] for number in first.tiles)
        assert sync.byte_count >= (64 + 256 + 64) * 4

        save(tmp_path / "t.1002.png", *BLUE)
        image.reload()
        (rewritten,) = records(sync)
        assert rewritten.tiles[1002][0, 0].tolist() == first.tiles[1012][0, 0].tolist()
        check(scene)

        image.tiles.remove(next(tile for tile in image.tiles if tile.number == 1012))
        (tmp_path / "t.1012.png").unlink()  # a reload would restore it otherwise
        assert [*records(sync)[0].tiles] == [1001, 1002]
        check(scene)

        save(tmp_path / "t.1011.png", *GREEN)
        image.tiles.new(tile_number=1011)
        image.reload()
        assert sorted(records(sync)[0].tiles) == [1001, 1002, 1011]
        assert sync.last_change.materials_changed
        check(scene)
    finally:
        sync.close()


@plain_files
def test_strokes_that_were_not_saved_show(scene, image) -> None:  # noqa: F811
    """No comparison with Cycles: it shows the files, and discards the strokes."""
    shown(scene, image)
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        (before,) = records(sync)
        image.pixels.foreach_set(np.tile(np.float32((0.2, 0.4, 0.6, 1.0)), 64))
        assert image.is_dirty
        (painted,) = records(sync)
        assert (painted.tiles[1001] == (51, 102, 153, 255)).all()
        np.testing.assert_array_equal(painted.tiles[1002], before.tiles[1002])
        assert image.is_dirty and "<UDIM>" in image.filepath
    finally:
        sync.close()


@plain_files
@pytest.mark.parametrize("is_painted", [False, True])
def test_reading_tiles_is_no_change(scene, image, is_painted: bool) -> None:  # noqa: F811
    """Otherwise a viewport would read them for ever. Tiles are read as data if the image is data."""
    image.colorspace_settings.name = "Non-Color"
    shown(scene, image)
    if is_painted:
        image.pixels.foreach_set(np.tile(np.float32((0.2, 0.4, 0.6, 1.0)), 64))
    sync = SceneSync(AttributeRequest(shading=True))
    count = len(bpy.data.images)
    try:
        sync.update(bpy.context.evaluated_depsgraph_get())
        bpy.context.view_layer.update()
        sync.scene.cast_rays((0.0, 0.0, 4.0), (0.0, 0.0, -1.0))  # raises if anything is stale
        (record,) = sync.record.images
    finally:
        sync.close()
    assert len(bpy.data.images) == count
    assert record.is_linear
    assert record.tiles[1002][0, 0].tolist() == [26, 204, 26, 255]


@plain_files
def test_a_file_that_is_missing_is_named(scene, image, tmp_path: Path) -> None:  # noqa: F811
    shown(scene, image)
    (tmp_path / "t.1002.png").unlink()
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        assert [*records(sync)[0].tiles] == [1001, 1012]
        assert any("tile 1002" in warning and "<UDIM>" in warning for warning in sync.warnings)
    finally:
        sync.close()
    check(scene)


@plain_files
@pytest.mark.skipif(
    "save_copy" not in bpy.types.Image.bl_rna.functions["save"].parameters,
    reason="Blender 4.2 writes no copies of tiles: they are warned of",
)
def test_tiles_in_memory_alone_are_read(scene) -> None:  # noqa: F811
    """New images are in memory only until they are saved."""
    image = bpy.data.images.new("new", 8, 8, tiled=True)
    image.tiles.new(1002)
    image.tiles.active_index = 1
    with bpy.context.temp_override(edit_image=image):
        bpy.ops.image.tile_fill(color=(0.0, 1.0, 0.0, 1.0), width=4, height=4)
    shown(scene, image)
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        (record,) = records(sync)
        assert [*record.tiles] == [1001, 1002]
        assert record.tiles[1002].shape == (4, 4, 4)
        assert record.tiles[1002][0, 0].tolist() == [0, 255, 0, 255]
    finally:
        sync.close()


@plain_files
def test_a_tile_that_was_never_filled_is_named(scene, image) -> None:  # noqa: F811
    """Blender can write neither that tile nor the others then; tiles that have files are shown."""
    image.pixels.foreach_set(np.tile(np.float32((0.2, 0.4, 0.6, 1.0)), 64))
    image.tiles.new(tile_number=1003)
    shown(scene, image)
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        (record,) = records(sync)
        assert [*record.tiles] == [1001, 1002, 1012]
        assert (record.tiles[1001] == (51, 102, 153, 255)).all()
        assert any("unsaved tiles" in warning for warning in sync.warnings)
        assert any("tile 1003" in warning for warning in sync.warnings)
    finally:
        sync.close()


def test_what_tiles_are_loaded_into_is_dropped_once() -> None:
    """Blender itself releases it once too often, which would release any object that took its memory."""
    for _ in range(100):
        with temporary_data() as data:
            pass
        held_once = object()
        assert sys.getrefcount(data) == sys.getrefcount(held_once)
        made = [[{}, [], (1, data), object()] for _ in range(50)]  # would reuse the memory of the freed object
        del data
        assert len(made) == 50
    gc.collect()


@plain_files
def test_a_map_of_gloss_is_looked_up_in_its_tiles(scene, image) -> None:  # noqa: F811
    material = new_red()
    tree = material.node_tree
    node = add(tree, "TexImage")
    node.image = image
    tree.links.new(node.outputs[0], shader(material).inputs["Roughness"])
    floor_mesh(scene).materials.append(material)
    sync = SceneSync(AttributeRequest(shading=True))
    try:
        assert records(sync) != ()
        (read,) = sync.record.materials
        assert set(slots_of(read.program)) == {"ROUGHNESS"}
    finally:
        sync.close()
