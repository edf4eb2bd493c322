"""Colours of a scan's points, by each column: new points and recoloured points get the same colours."""

from __future__ import annotations

import colorsys
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.scanned_room import LIDAR, values_of  # noqa: E402
from perfect_bvh_addon import CameraGrid, PointCloud, scan  # noqa: E402
from perfect_bvh_addon.scanning.point_cloud import LUMINANCE  # noqa: E402
from perfect_bvh_addon.scanning.point_data import COLOR_COLUMNS, colors_of, colors_of_column  # noqa: E402
from perfect_bvh_addon.settings.scan_choices import POINT_COLORS, items  # noqa: E402

pytestmark = pytest.mark.usefixtures("registered")


def colors_in(name: str) -> np.ndarray:
    return values_of(bpy.data.objects[name], "Color", "color", 4)


@pytest.fixture
def scanned(room: Any) -> PointCloud:
    """The points that the object "Scan" shows."""
    settings = room.perfect_bvh.scan
    settings.width, settings.height = 32, 18
    bpy.data.materials["red"].diffuse_color = (1.0, 0.0, 0.0, 1.0)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    return scan(CameraGrid(32, 18))


@pytest.mark.parametrize("color_by", [color.identifier for color in POINT_COLORS])
def test_points_have_the_chosen_colors_and_get_them_again(room: Any, scanned: PointCloud, color_by: str) -> None:
    expected = colors_of(scanned, color_by)
    assert expected.dtype == np.float32 and (expected >= 0.0).all() and (expected <= 1.0).all()
    room.perfect_bvh.scan.point_color = color_by
    assert bpy.ops.perfect_bvh.color_points() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan"), expected)
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan.001"), expected)


def test_the_material_shows_the_colors(room: Any, scanned: PointCloud) -> None:
    (material,) = bpy.data.objects["Scan"].data.materials
    (attribute,) = [node for node in material.node_tree.nodes if node.type == "ATTRIBUTE"]
    assert (attribute.attribute_name, attribute.outputs["Color"].links[0].to_socket.name) == ("Color", "Base Color")
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    assert list(bpy.data.objects["Scan.001"].data.materials) == [material]


def test_choices_keep_their_numbers_in_files() -> None:
    numbers = {identifier: number for identifier, _, _, number in items()}
    first = {"DISTANCE": 0, "OBJECT": 1, "INTENSITY": 2, "HEIGHT": 3, "INSTANCE": 4, "MATERIAL": 5, "INCIDENCE": 6}
    assert first.items() <= numbers.items() and len(set(numbers.values())) == len(numbers)
    assert {color.column for color in POINT_COLORS} == set(COLOR_COLUMNS)


def test_colors_tell_near_from_far_and_one_thing_from_another(room: Any) -> None:
    bpy.data.materials["red"].diffuse_color = (1.0, 0.0, 0.0, 1.0)
    cloud = scan(CameraGrid(64, 36))
    assert len(cloud.object_names) == 3
    for color_by, ids in (("OBJECT", cloud.object_ids), ("INSTANCE", cloud.instance_ids)):
        of_ids = [colors_of(cloud, color_by)[ids == row] for row in np.unique(ids)]
        assert all((np.ptp(colors, axis=0) == 0.0).all() for colors in of_ids)
        assert len({tuple(colors[0]) for colors in of_ids}) == 3
    lightness = colors_of(cloud, "DISTANCE")[:, :3] @ LUMINANCE
    order = np.argsort(cloud.distances)
    assert (np.diff(lightness[order]) <= 1e-6).all() and lightness[order[0]] > 5.0 * lightness[order[-1]]
    red = cloud.object_ids == cloud.object_names.index("Red")
    ratio = cloud.intensities / cloud.incidences
    np.testing.assert_allclose(ratio[red], LUMINANCE[0], rtol=1e-5)
    np.testing.assert_allclose(ratio[~red], 0.8, rtol=1e-5)
    greys = colors_of(cloud, "INTENSITY")
    assert greys[:, :3].max() == 1.0 and (np.ptp(greys[:, :3], axis=1) == 0.0).all()
    of_material = colors_of(cloud, "MATERIAL")
    assert (of_material[cloud.material_ids < 0, :3] == np.float32(0.2)).all()
    assert (np.ptp(of_material[red, :3], axis=1) > 0.1).all()


@pytest.mark.parametrize(("color_by", "column"), [("TIME", "times"), ("RING", "ring_ids"), ("INCIDENCE", "incidences")])
def test_a_ramp_falls_in_lightness_with_the_numbers(room: Any, color_by: str, column: str) -> None:
    cloud = scan(LIDAR, bpy.data.objects["Head"])
    lightness = colors_of(cloud, color_by)[:, :3] @ LUMINANCE
    order = np.argsort(getattr(cloud, column), kind="stable")
    assert (np.diff(lightness[order]) <= 1e-6).all() and lightness[order[0]] > 5.0 * lightness[order[-1]]


def test_height_and_normal_are_those_of_points(room: Any) -> None:
    cloud = scan(CameraGrid(64, 36))
    lightness = colors_of(cloud, "HEIGHT")[:, :3] @ LUMINANCE
    order = np.argsort(cloud.positions[:, 2].astype(np.float32), kind="stable")
    assert (np.diff(lightness[order]) <= 1e-6).all()
    srgb = 0.5 + 0.5 * cloud.normals.astype(np.float64)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(colors_of(cloud, "NORMAL")[:, :3], linear, atol=1e-6)


def test_an_id_has_the_same_color_in_every_scan_and_what_has_none_is_grey() -> None:
    ids = np.array([7, -1, 3, 2_000_000_000, 7], np.int32)
    colors = colors_of_column(ids, "ids")
    np.testing.assert_array_equal(colors[[0, 2]], colors_of_column(np.array([7, 3], np.int32), "ids"))
    assert (colors[1] == (np.float32(0.2), np.float32(0.2), np.float32(0.2), 1.0)).all()
    hue, saturation, value = (7 * 0.6180339887498949) % 1.0, (0.55, 0.4, 0.65)[7 % 3], (0.9, 0.75, 0.6)[7 // 3 % 3]
    srgb = np.array(colorsys.hsv_to_rgb(hue, saturation, value))
    np.testing.assert_allclose(colors[0, :3], ((srgb + 0.055) / 1.055) ** 2.4, atol=1e-6)


def test_what_is_no_number_is_grey_and_does_not_spoil_the_rest() -> None:
    numbers = np.array([0.0, np.nan, 1.0, 2.0], np.float32)
    colors = colors_of_column(numbers, "ramp")
    assert (colors[1, :3] == np.float32(0.2)).all()
    np.testing.assert_array_equal(colors[[0, 2, 3]], colors_of_column(numbers[[0, 2, 3]], "ramp"))
    assert colors_of_column(np.empty(0, np.float32), "near").shape == (0, 4)
    assert colors_of_column(np.empty(0, np.int32), "ids").shape == (0, 4)


# Coloured again ------------------------------------------------------------------------------------------------------


def test_another_column_is_any_attribute_of_the_points(room: Any, scanned: PointCloud) -> None:
    data, settings = bpy.data.objects["Scan"].data, room.perfect_bvh.scan
    numbers = np.linspace(5.0, -5.0, len(scanned)).astype(np.float32)
    data.attributes.new("wetness", "FLOAT", "POINT").data.foreach_set("value", numbers)
    settings.point_color, settings.point_column = "COLUMN", "wetness"
    assert bpy.ops.perfect_bvh.color_points() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan"), colors_of_column(numbers, "ramp"))
    settings.point_column = "object_id"
    assert bpy.ops.perfect_bvh.color_points() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan"), colors_of(scanned, "OBJECT"))


def test_selected_scans_are_colored_or_else_the_last_one(room: Any, scanned: PointCloud) -> None:
    assert bpy.ops.perfect_bvh.scan() == {"FINISHED"}
    before, after = colors_of(scanned, "DISTANCE"), colors_of(scanned, "HEIGHT")
    room.perfect_bvh.scan.point_color = "HEIGHT"
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    assert bpy.ops.perfect_bvh.color_points() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan"), before)
    np.testing.assert_array_equal(colors_in("Scan.001"), after)
    bpy.data.objects["Scan"].select_set(True)
    assert bpy.ops.perfect_bvh.color_points() == {"FINISHED"}
    np.testing.assert_array_equal(colors_in("Scan"), after)


def test_a_column_that_is_not_there_is_named(room: Any, scanned: PointCloud) -> None:
    settings = room.perfect_bvh.scan
    settings.point_color, settings.point_column = "COLUMN", "wetness"
    before, count = colors_in("Scan"), len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="have no column 'wetness', but distance, incidence"):
        bpy.ops.perfect_bvh.color_points()
    np.testing.assert_array_equal(colors_in("Scan"), before)
    with pytest.raises(RuntimeError, match="have no column 'wetness', but distance, incidence"):
        bpy.ops.perfect_bvh.scan()
    assert len(bpy.data.objects) == count


def test_without_a_scan_there_is_nothing_to_color(room: Any) -> None:
    with pytest.raises(RuntimeError, match="No scan to color"):
        bpy.ops.perfect_bvh.color_points()


def test_columns_that_there_are_are_suggested(room: Any, scanned: PointCloud) -> None:
    from perfect_bvh_addon.settings.scan_settings import suggest_columns

    names = suggest_columns(room.perfect_bvh.scan, bpy.context, "")
    assert {"distance", "object_id", "ring"} <= set(names) and names == sorted(names)
    assert suggest_columns(room.perfect_bvh.scan, bpy.context, "RIN") == ["ring"]
