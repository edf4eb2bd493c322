"""Worlds in the preview mode: even, an image with a sun in it, a backdrop; and objects that block their light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from engine.preview_looks import (
    ABOVE,
    FLOOR,
    PLAIN,
    ROOF,
    SIZE,
    WHITE,
    brightness,
    floor,
    looking,
    made_of,
    noisy,
    quads,
    square,
    sun_in_the_sky,
)
from perfect_bvh import Appearance, ImageTexture, World, render


def test_an_even_world_lights_an_open_floor_evenly():
    assert brightness(floor(), Appearance(world=World((0.5, 0.5, 0.5)))) == pytest.approx(PLAIN * 0.5, rel=1e-3)


@pytest.mark.parametrize(("mask", "is_open"), [(0b01, False), (0b10, True)])
def test_what_rays_for_the_sky_pass_by_keeps_no_light_away(mask, is_open):
    scene = quads(FLOOR, square(50.0, 9.0), masks=(0xFFFFFFFF, mask))
    look = Appearance(world=WHITE, diffuse_mask=0b01, shadow_mask=0b10, camera_mask=0b01)
    seen = brightness(scene, look)
    assert seen == pytest.approx(PLAIN, rel=1e-3) if is_open else seen < 0.5 * PLAIN


def test_the_worlds_image_lies_round_the_scene_as_in_blender():
    """U runs from -X over +Y, +X and -Y to -X again: 0.25 is +Y, and 0.5 is +X."""
    pixels = np.zeros((16, 32, 4), np.float32)
    for quarter, color in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0))):
        pixels[:, quarter * 8 : quarter * 8 + 8, :3] = color
    look = Appearance(images=(ImageTexture(pixels),), world=World((1.0, 1.0, 1.0), image=0))
    for towards, u in (((1, 1, 0), 0.375), ((-1, 1, 0), 0.125), ((1, -1, 0), 0.625), ((-1, -1, 0), 0.875)):
        seen = render(quads(), looking((0, 0, 0), towards, 5.0), "preview", SIZE, 1, look)[16, 16, :3]
        assert seen == pytest.approx(pixels[8, int(u * 32), :3])


@pytest.mark.parametrize("rotation", [0.0, 1.0, -2.5])
@pytest.mark.parametrize(
    "columns",
    [
        {"base_colors": (0.8, 0.8, 0.8)},
        {"base_colors": (0.8, 0.8, 0.8), "metallics": 1.0, "roughnesses": 0.5},
        {"base_colors": (0.3, 0.3, 0.3), "reflectances": 0.04, "roughnesses": 0.6},
    ],
    ids=["diffuse", "metal", "plastic"],
)
def test_a_sun_in_the_worlds_image_shines_as_a_light_would(rotation, columns):
    """With its shadow and its highlight, and without specks: a ray in ten thousand would find it by chance."""
    camera = looking((0, -9, 7), (0, 0, 0), 40.0)
    look = made_of(2, **columns)
    by_image, by_light = (noisy(floor(ROOF), camera, replace(lit, **look), 64) for lit in sun_in_the_sky(rotation))
    assert np.abs(by_image - by_light).mean() < 0.03 * by_light.mean()
    assert np.abs(by_image - by_light).max() < 0.3 * by_light.max()


def test_a_sun_in_the_worlds_image_lights_what_light_bounces_off():
    """A ceiling over a floor in the sun: all its light has bounced, and none of it where the floor is in shadow."""
    ceiling = square(3.0, 2.0)
    camera = looking((0, -6, 0.5), (0, 0, 2), 8.0)
    by_image, by_light = (brightness(floor(ceiling), lit, camera, samples=64) for lit in sun_in_the_sky(0.5))
    assert by_image == pytest.approx(by_light, rel=0.05)


def test_a_backdrop_is_seen_and_lights_nothing():
    look = Appearance(world=World((0.5, 0.5, 0.5)), backdrop=World((0.0, 1.0, 0.0)))
    image = render(quads(FLOOR * 0.004), looking((0, 0, 5), (0, 0, 0), 10.0), "preview", SIZE, 16, look)
    assert image[16, 16, :3] == pytest.approx((0.4, 0.4, 0.4), rel=0.01)
    assert image[1, 1, :3] == pytest.approx((0.0, 1.0, 0.0))


def test_the_film_may_be_transparent():
    look = Appearance(world=WHITE, film_transparent=True)
    assert not render(quads(), ABOVE, "preview", SIZE, 1, look).any()
