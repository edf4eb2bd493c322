"""Images at places of uv maps, by a loop over single places; and what of materials and meshes surfaces show."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.light_scenes import ONE_RAY, add_plate, diffuse, empty_scene, names_of, principled, simple  # noqa: E402
from perfect_bvh.appearance import ImageTexture  # noqa: E402
from perfect_bvh_addon import Beam, Light, Optics, Raster, scan  # noqa: E402
from perfect_bvh_addon.scanning.light.surface_reader import look_up  # noqa: E402

CALIBRATED = Light(Beam(returns=4), Optics(calibrated=True))


def linear(byte: float) -> float:
    """IEC 61966-2-1; also between bytes, as Cycles interpolates them."""
    value = byte / 255
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def pixel(pixels: np.ndarray, extension: str, column: int, row: int) -> list[float]:
    height, width = pixels.shape[:2]
    if extension == "repeat":
        column, row = column % width, row % height
    elif extension == "clip" and not (0 <= column < width and 0 <= row < height):
        return [0.0] * 4
    return pixels[min(max(row, 0), height - 1), min(max(column, 0), width - 1)].tolist()


def expected_color(pixels: np.ndarray, extension: str, u: float, v: float) -> list[float]:
    """Between the middles of four pixels."""
    height, width = pixels.shape[:2]
    x, y = u * width - 0.5, v * height - 0.5
    column, row = math.floor(x), math.floor(y)
    color = [0.0] * 4
    for right in (0, 1):
        for above in (0, 1):
            share = (x - column if right else 1 - (x - column)) * (y - row if above else 1 - (y - row))
            corner = pixel(pixels, extension, column + right, row + above)
            color = [one + share * other for one, other in zip(color, corner, strict=True)]
    return color if pixels.dtype == np.float32 else [*map(linear, color[:3]), color[3] / 255]


@pytest.mark.parametrize("extension", ["repeat", "extend", "clip"])
@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_images_are_looked_up_between_pixels(extension: Any, kind: type) -> None:
    random = np.random.default_rng(4)
    pixels = random.integers(0, 256, (5, 7, 4)).astype(kind)
    uvs = random.uniform(-1.2, 2.2, (300, 2))
    transform = ((0.5, 0.25, 0.1), (-0.25, 0.75, 0.2))
    found = look_up(ImageTexture(pixels, extension, transform), uvs)
    for row, (u, v) in enumerate(uvs.tolist()):
        place = [across * u + up * v + on for across, up, on in transform]
        assert found[row] == pytest.approx(expected_color(pixels, extension, *place), rel=1e-9, abs=1e-9)


def test_tiles_lie_over_their_squares() -> None:
    pixels = {number: np.full((2, 2, 4), number - 1000, np.float32) for number in (1001, 1002, 1011)}
    image = ImageTexture(pixels[1001], "extend", tiles=pixels)
    uvs = np.array(
        [(0.5, 0.5), (1.5, 0.5), (0.5, 1.5), (-0.5, 0.2), (1.5, 1.5), (np.nan, 0.5), (-1.5, 0.5), (10.5, 0.5)]
    )
    missing = [1.0, 0.0, 1.0, 1.0]
    assert look_up(image, uvs).tolist() == [[1.0] * 4, [2.0] * 4, [11.0] * 4, [1.0] * 4, *([missing] * 4)]


# Surfaces ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def head() -> Any:
    return empty_scene()


def test_materials_differ_by_instance(head) -> None:
    """Object Info's colour: three objects of one material, one behind the other."""
    material = simple("ShaderNodeBsdfDiffuse")
    tree = material.node_tree
    info = tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(info.outputs["Color"], tree.nodes["Diffuse BSDF"].inputs["Color"])
    grays = {}
    for x, gray in ((-2.0, 0.2), (0.0, 0.5), (2.0, 0.9)):
        plate = add_plate(4.0, material, size=1.9, x=x)
        plate.color = (gray, gray, gray, 1.0)
        grays[plate.name] = gray
    fan = Raster(width=9, height=1, horizontal=60.0, vertical=1.0)
    cloud = scan(fan, head, light=CALIBRATED)
    assert set(names_of(cloud)) == set(grays)
    expected = [grays[name] for name in names_of(cloud)] * cloud.incidences
    assert cloud.intensities == pytest.approx(expected, rel=1e-5)


def test_colors_of_the_mesh_are_shown_between_its_corners(head) -> None:
    material = simple("ShaderNodeBsdfDiffuse")
    tree = material.node_tree
    attribute = tree.nodes.new("ShaderNodeVertexColor")
    attribute.layer_name = "shade"
    tree.links.new(attribute.outputs["Color"], tree.nodes["Diffuse BSDF"].inputs["Color"])
    plate = add_plate(4.0, material, size=8.0)
    layer = plate.data.color_attributes.new("shade", "FLOAT_COLOR", "POINT")
    for item, vertex in zip(layer.data, plate.data.vertices, strict=True):
        gray = 0.5 + vertex.co.x / 10.0
        item.color = (gray, gray, gray, 1.0)
    fan = Raster(width=7, height=3, horizontal=60.0, vertical=20.0)
    cloud = scan(fan, head, light=CALIBRATED)
    assert len(cloud) == 21
    expected = (0.5 + cloud.positions[:, 0] / 10.0) * cloud.incidences
    assert cloud.intensities == pytest.approx(expected, rel=1e-5)


def test_what_has_no_material_is_as_blender_shows_it(head) -> None:
    add_plate(2.0)
    add_plate(3.0, diffuse(0.5))
    material = principled(Base_Color=(0.8, 0.8, 0.8, 1.0)) if bpy.app.version >= (5, 0, 0) else diffuse(0.8)
    plain = scan(ONE_RAY, head, light=CALIBRATED)
    bpy.data.objects["Plane"].data.materials.append(material)
    assert scan(ONE_RAY, head, light=CALIBRATED).intensities == pytest.approx(plain.intensities, rel=1e-6)
    assert names_of(plain) == ["Plane"]


def test_strands_count_by_their_base_color(head) -> None:
    """A curve as thick as a trunk, met in its middle."""
    curves = bpy.data.hair_curves.new("Trunk")
    curves.add_curves([2])
    curves.position_data.foreach_set("vector", np.array([0.0, 5.0, -2.0, 0.0, 5.0, 2.0], np.float32))
    radii = curves.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", np.full(2, 0.5, np.float32))
    hair = simple("ShaderNodeBsdfHairPrincipled")
    hair.node_tree.nodes["Principled Hair BSDF"].parametrization = "COLOR"
    hair.node_tree.nodes["Principled Hair BSDF"].inputs["Color"].default_value = (0.3, 0.3, 0.3, 1.0)
    curves.materials.append(hair)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Trunk", curves))
    cloud = scan(ONE_RAY, head, light=CALIBRATED)
    assert names_of(cloud) == ["Trunk"] and len(cloud.intensities) == 1
    assert 0.0 < cloud.intensities[0] <= 1.0
    assert cloud.intensities[0] == pytest.approx(0.3 * cloud.incidences[0], rel=1e-5)
