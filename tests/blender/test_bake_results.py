"""Where baked values go: attributes, copies, images and tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.baked_scenes import SUNS, UP, box, ground, world_corners  # noqa: E402
from blender.builders import collection, collection_instance, instances_on_grid, made_cube, mesh_object  # noqa: E402
from perfect_bvh_addon import bake_rays  # noqa: E402
from perfect_bvh_addon.baking import Baker, BakeSettings  # noqa: E402

pytestmark = pytest.mark.usefixtures("scene")


@pytest.mark.parametrize("domain", ["FACE", "CORNER", "POINT"])
def test_attributes_are_those_of_the_own_mesh(domain: str) -> None:
    floor = ground("Floor", (4.0, 4.0), (3, 2))
    floor.modifiers.new("Wave", "WAVE")  # it moves vertices, and makes none
    bake = bake_rays([floor], kind="SUN_HOURS", domain=domain, directions=SUNS)
    assert bake.write_attributes("Light") == ("Light",)
    attribute = floor.data.attributes["Light"]
    assert (attribute.domain, attribute.data_type) == (domain, "FLOAT")
    found = np.empty(len(attribute.data), np.float32)
    attribute.data.foreach_get("value", found)
    assert found.tolist() == bake["Floor"].values.astype(np.float32).tolist()
    assert bake.write_attributes("Light") == ("Light",)  # the same place again


def test_instances_and_shared_meshes_get_copies() -> None:
    boxes = collection("Boxes", linked=False)
    part = ground("Part", (1.0, 1.0), (2, 2))
    bpy.context.scene.collection.objects.unlink(part)
    boxes.objects.link(part)
    bpy.context.scene.collection.children.link(boxes)
    collection_instance("Shown", boxes, location=(5.0, 0.0, 1.0))
    ground("Roof", (1.0, 1.0), (1, 1), location=(5.0, 0.0, 3.0))
    bake = bake_rays([part], kind="SUN_HOURS", directions=UP, instances=True)
    assert [(baked.name, bool(baked.instance)) for baked in bake.objects] == [("Part", False), ("Part", True)]
    assert [baked.values.tolist() for baked in bake.objects] == [[1.0] * 4, [0.0] * 4]
    assert [table["instance"][0] for table in bake.tables()] == ["", "Shown 0"]
    with pytest.raises(ValueError, match=r"'Part' shares its mesh with an instance of it: .*realise=True"):
        bake.write_attributes()
    assert "sun_hours" not in part.data.attributes
    bake.write_attributes(realise=True)
    bpy.context.view_layer.update()
    copies = bpy.data.collections["Baked"].objects
    assert [tuple(copy.matrix_world.translation) for copy in copies] == [(0.0, 0.0, 0.0), (5.0, 0.0, 1.0)]
    assert [copy.data.attributes["sun_hours"].data[0].value for copy in copies] == [1.0, 0.0]


def test_instances_that_geometry_nodes_make_are_no_copies_of_the_mesh() -> None:
    field = instances_on_grid("Field", made_cube, keep_own=True)
    bake = bake_rays([field], kind="SUN_HOURS", directions=UP, instances=True, evaluated=True)
    assert [len(baked.values) for baked in bake.objects] == [len(bake.objects[0].origins)]
    assert not bake.objects[0].instance


def test_a_sheared_object_has_a_copy_in_its_place() -> None:
    turned = box("Turned", (0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    for mirror in (1.0, -1.0):
        turned.parent = mesh_object(f"Stretched {mirror}", location=(1.0, 2.0, 3.0))
        turned.parent.scale, turned.rotation_euler = (1.0, 5.0 * mirror, 1.0), (0.5, 0.6, 0.7)
        bpy.context.view_layer.update()
        bake_rays([turned], kind="SUN_HOURS", directions=UP).write_attributes(realise=True)
        bpy.context.view_layer.update()
        copy = bpy.data.collections["Baked"].objects[-1]
        np.testing.assert_allclose(world_corners(copy), world_corners(turned), atol=1e-5)
        assert copy.matrix_world.is_negative == turned.matrix_world.is_negative


def test_an_object_of_a_library_may_have_the_name_of_another(tmp_path: Path) -> None:
    floor = ground("Floor", (1.0, 1.0), (1, 1), location=(5.0, 0.0, 0.0))
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {floor})
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Floor"]
    bpy.context.collection.objects.link(wanted.objects[0])
    floor.location.x = 0.0
    bake = bake_rays([floor, wanted.objects[0]], kind="SUN_HOURS", directions=UP)
    assert [baked.transform[0, 3] for baked in bake.objects] == [0.0, 5.0]


def test_what_frames_do_not_share_is_named(scene: Any) -> None:
    floor, gone = ground("Floor", (1.0, 1.0), (1, 1)), ground("Gone", (1.0, 1.0), (1, 1), location=(5.0, 0.0, 0.0))
    for frame, is_hidden in ((1, False), (2, True)):
        gone.hide_render = is_hidden
        gone.keyframe_insert("hide_render", frame=frame)
    for frames in ((1, 2), (2, 1)):
        settings = BakeSettings("EXPOSURE", viewers=[(0.0, 0.0, 1.0)], frames=frames)
        with pytest.raises(ValueError, match="bake_rays: object 'Gone' is not the same in all of the frames"):
            Baker([floor, gone], settings, skip_missing=True).run()
    viewer = mesh_object("Viewer", location=(0.0, 0.0, 2.0))
    steps = Baker([floor], BakeSettings("EXPOSURE", viewers=viewer, frames=(1, 2))).steps()
    next(steps)
    bpy.data.objects.remove(viewer)
    with pytest.raises(ValueError, match="object 'Viewer' was deleted during the bake"):
        list(steps)


def test_an_image_shows_faces_by_their_uv_map() -> None:
    wide = ground("Wide", (2.0, 2.0), (2, 1))
    for loop, uv in enumerate(wide.data.uv_layers.active.uv):
        vertex = wide.data.vertices[wide.data.loops[loop].vertex_index].co
        uv.vector = (0.25 + 0.25 * (vertex.x + 1.0), 0.25 + 0.25 * (vertex.y + 1.0))
    box("Roof", (0.0, -5.0, 1.0), (5.0, 5.0, 2.0))
    bake = bake_rays([wide], kind="SUN_HOURS", domain="TEXEL", directions=UP, image_size=(32, 16))
    values = bake["Wide"].values.reshape(16, 32)
    assert np.isnan(values[:4]).all()
    assert np.isnan(values[12:]).all()
    assert (values[4:12, 8:16] == 1.0).all()
    assert (values[4:12, 16:24] == 0.0).all()
    (image,) = bake.to_image(margin=2)
    pixels = np.array(image.pixels[:]).reshape(16, 32, 4)
    assert tuple(image.size) == (32, 16)
    assert (pixels[:, :, 3] > 0.0).sum() == 12 * 20
    assert (pixels[2, 6:14, 0] == 1.0).all()
    assert bake.to_image(margin=0)[0] == image
    with pytest.raises(ValueError, match="to_image: margin must be an integer from 0"):
        bake.to_image(margin=-1)
    bpy.data.images.remove(image)
    bpy.data.images.new("Wide sun_hours", 32, 16)
    assert bake.to_image()[0].is_float
    with pytest.raises(ValueError, match="texels belong to images"):
        bake.write_attributes()


def test_tables_have_a_row_a_face(tmp_path: Path) -> None:
    objects = [ground("One", (2.0, 1.0), (2, 1)), ground("Two", (1.0, 1.0), (1, 1), location=(9.0, 0.0, 0.0))]
    bake = bake_rays(objects, kind="SKY_VIEW", rays=8)
    rows = list(csv.DictReader(bake.write_csv(tmp_path / "sky.csv").read_text("utf-8").splitlines()))
    assert [(row["object"], row["face"]) for row in rows] == [("One", "0"), ("One", "1"), ("Two", "0")]
    assert [float(row["area"]) for row in rows] == pytest.approx([1.0, 1.0, 1.0])
    assert [float(row["sky_view"]) for row in rows] == [*bake["One"].values, *bake["Two"].values]
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(bake.write_parquet(tmp_path / "sky.parquet")).to_pydict()
    assert table["sky_view"] == [float(row["sky_view"]) for row in rows]
    assert list(table) == list(rows[0]) == ["object", "instance", "face", "area", "sky_view", "sky_view_error"]
