"""Brightness of lights in the preview mode, compared with physics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from engine.preview_looks import (
    ABOVE,
    BLACK,
    DIRECT,
    PLAIN,
    QUAD,
    ROOF,
    TILTED,
    brightness,
    floor,
    lights,
    looking,
    made_of,
    materials,
    quads,
    quick_and_converged,
    square,
    two_materials,
)
from perfect_bvh import Appearance, Camera, MeshAppearance, Scene, render


@pytest.mark.parametrize("count", [1, 9], ids=["each light", "some lights"])
@pytest.mark.parametrize(
    ("kind", "size", "expected"),
    [
        (0, (0.0, 0.0), 100 / (4 * math.pi) / 4 / math.pi),  # P / 4 pi over the distance squared, over pi
        (0, (0.1, 0.0), 100 / (4 * math.pi) / 4 / math.pi),
        (1, (0.01, 0.0), 100 / math.pi),
        (2, (0.0, 0.0), 100 / (4 * math.pi) / 4 / math.pi),
        (3, (0.2, 0.2), 100 / math.pi / 4 / math.pi),  # P / (pi A), seen under A / d^2
        (4, (0.2, 0.2), 100 / math.pi / 4 / math.pi),
    ],
)
def test_lights_shine_as_blender_means_them(kind, size, expected, count):
    look = Appearance(lights=lights(kind, power=100 / count, size=size, count=count), world=BLACK)
    assert brightness(floor(), look) == pytest.approx(PLAIN * expected, rel=0.02)


def test_a_spot_lights_its_cone_only():
    scene = floor()
    narrow = lights(2, position=(3, 0, 2), cone=(math.radians(60), 0.1))
    assert brightness(scene, Appearance(lights=narrow, world=BLACK)) == 0.0
    wide = lights(2, position=(3, 0, 2), cone=(math.radians(140), 0.0))
    assert brightness(scene, Appearance(lights=wide, world=BLACK)) > 0.01


def test_the_back_of_an_area_light_is_dark():
    below = lights(3, position=(0, 0, -1), size=(1.0, 1.0))
    assert brightness(floor(), Appearance(lights=below, world=BLACK)) == 0.0


def test_what_is_in_the_way_throws_a_shadow():
    from_the_side = looking((0, -5, 0.4), (0, 0, 0), 3.0)
    look = Appearance(lights=lights(1, power=math.pi), world=BLACK)
    assert brightness(floor(ROOF), look, from_the_side, light_paths=DIRECT) < 0.05
    assert 0.05 < brightness(floor(ROOF), look, from_the_side) < 0.5 * PLAIN  # the light that the floor throws there
    assert brightness(floor(), look, from_the_side) == pytest.approx(PLAIN, rel=0.01)


@pytest.mark.parametrize("kind", [3, 4], ids=["rectangle", "ellipse"])
@pytest.mark.parametrize("spread", [0.02, 0.4, 1.5, 3.0])
def test_a_grid_before_an_area_light_gathers_its_light_and_keeps_its_watts(kind, spread):
    """All light of a small lamp falls on the floor below it: the same sum for every spread, on a smaller spot."""
    lamp = replace(lights(kind, power=1.0, size=(0.001, 0.001)), cones=np.array([(spread, 0.0)], np.float32))
    reach = 2.0 * math.tan(spread / 2) * 1.1  # the lamp is two above the floor
    wide = Camera.look_at((0, 0, 50), (0, 0, 0), up=(0, 1, 0), angle=2 * math.atan(reach / 50), aspect=1.0)
    look = Appearance(lights=lamp, world=BLACK)
    image = render(floor(), wide, "preview", (128, 128), 16, look)[..., 1]
    area = (2 * reach / 128) ** 2
    assert image.sum() * area * math.pi == pytest.approx(PLAIN, rel=0.03)
    assert image[0, 0] == 0.0


@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_highlights_are_what_a_mirror_would_show_of_the_light(roughness):
    """A square light, and an emissive square of the same radiance, seen in a metal floor: two ways to one number."""
    camera = looking((0, -4, 3), (0, 0, 0), 8.0)
    power = 200.0
    light = lights(3, position=(0, 4, 3), power=power, size=(2.0, 2.0))
    metal = made_of(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=roughness)
    by_light = brightness(floor(), Appearance(**metal, lights=light, world=BLACK), camera, samples=256)

    square = np.array([(-1, 3, 3), (1, 3, 3), (1, 5, 3), (-1, 5, 3)], np.float64)
    emissive = materials(
        2,
        base_colors=np.array([(1, 1, 1), (0, 0, 0)], np.float32),
        emissions=np.array([(0, 0, 0), (power / math.pi / 4,) * 3], np.float32),
        metallics=np.array([1, 0], np.float32),
        roughnesses=np.array([roughness, 1], np.float32),
    )
    look = Appearance(instances=two_materials(), materials=emissive, world=BLACK)
    by_mirror = brightness(floor(square), look, camera, samples=1024)
    assert by_light > 0.5
    assert by_mirror == pytest.approx(by_light, rel=0.05)


@pytest.mark.parametrize(("kind", "size"), [(0, (0.5, 0.0)), (3, (1.5, 1.0)), (4, (1.5, 1.0))])
@pytest.mark.parametrize("count", [1, 6], ids=["each is asked", "some are picked"])
def test_large_lights_shine_in_smooth_metal_without_specks(kind, size, count):
    metal = made_of(1, base_colors=(0.9, 0.9, 0.9), metallics=1.0, roughnesses=0.2)
    look = Appearance(**metal, lights=lights(kind, position=(0, 1, 2), size=size, count=count), world=BLACK)
    image, converged = quick_and_converged(floor(), TILTED, look)
    assert np.abs(image - converged).max() < 0.35 * converged.max()
    assert math.sqrt(((image - converged) ** 2).mean()) < 0.13 * converged.mean()
    assert image.mean() == pytest.approx(converged.mean(), rel=0.01)


def test_without_lights_and_world_the_studio_shines():
    assert 0.1 < brightness(floor(), Appearance()) < 1.0


@pytest.mark.parametrize("below", [5, 15, 30], ids="{} degrees below".format)
@pytest.mark.parametrize("tilt", [40, 60, 75], ids="{} degrees off".format)
def test_corner_normals_far_off_their_triangle_are_lit_from_below_it(tilt, below):
    """A square whose normals all lean towards +X, and a sun there, below the square.

    The surface that they suggest rises to the square's edge, so that nothing hides the sun: the light there is the
    cosine of the angle between the normals and the sun.
    """
    scene = quads(square(1.0, 0.0))
    lean, sink = math.radians(tilt), math.radians(below)
    normals = np.broadcast_to(np.array([math.sin(lean), 0.0, math.cos(lean)], np.float32), (2, 3, 3))
    axes = np.array(
        [[(math.sin(sink), 0, math.cos(sink)), (0, 1, 0), (math.cos(sink), 0, -math.sin(sink))]], np.float32
    )
    sun = replace(lights(1, power=math.pi), axes=axes)
    look = Appearance(meshes={0: MeshAppearance(corner_normals=normals.copy())}, lights=sun, world=BLACK)
    expected = PLAIN * math.cos(math.pi / 2 - lean + sink)
    assert brightness(scene, look, looking((0, 0, 5), (0, 0, 0), 20.0)) == pytest.approx(max(expected, 0.0), abs=1e-3)


def test_ribbons_closer_than_their_width_do_not_darken_each_other() -> None:
    """A mesh that is as close does; so does a ribbon farther off."""
    look = Appearance(lights=lights(0, position=(0, 10, 3), power=1000.0), world=BLACK)

    def middle(*more: tuple[float, float], wall: bool = False) -> float:
        scene = Scene()
        for y, z in ((0.0, 0.0), *more):
            curve = scene.add_curves([(-2, y, z), (2, y, z)], 0.1, [0, 2], shape="ribbon")
            scene.add_instance(curve)
        if wall:
            scene.add_instance(scene.add_mesh([(-2, 0.12, -1), (2, 0.12, -1), (2, 0.12, 1), (-2, 0.12, 1)], QUAD))
        scene.commit()
        image = render(scene, ABOVE, "preview", (33, 33), 1, look, light_paths=DIRECT)
        return float(image[16, 16, 0])

    alone = middle()
    assert alone > 0.01
    assert middle((0.144, 0.043)) == pytest.approx(alone, rel=1e-3)
    assert middle((0.48, 0.144)) == 0.0
    assert middle(wall=True) == 0.0
    assert middle((0.05, 0.015), wall=True) == 0.0
