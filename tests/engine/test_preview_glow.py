"""Surfaces that glow, in the preview mode: as bright as physics says, however small, and without specks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from engine.preview_looks import (
    ABOVE,
    BLACK,
    FLOOR,
    SMALL,
    TILTED,
    brightness,
    floor,
    glowing,
    looking,
    made_of,
    quads,
    quick_and_converged,
    unsmoothed,
)
from perfect_bvh import Appearance, Scene


def small_light_over_a_floor() -> Scene:
    """The light has the second bit only, which glowing() hides from the camera."""
    return quads(FLOOR, SMALL, masks=(0b11, 0b10))


def test_emission_is_seen_and_gives_light():
    look = Appearance(**made_of(1, base_colors=(0.0, 0.0, 0.0), emissions=(3.0, 3.0, 3.0)), world=BLACK)
    assert brightness(floor(), look) == pytest.approx(3.0, rel=1e-5)


def test_what_glows_gives_light_without_specks_however_small_it_is():
    """Radiance times the area over the distance squared, over pi; one ray in a thousand would find it by chance."""
    image = unsmoothed(small_light_over_a_floor(), ABOVE, glowing(1000.0), 16)
    places = 5 * math.tan(math.radians(2.5)) * (np.arange(1, 64, 2) / 32 - 1)
    expected = 1000.0 * 0.05**2 / math.pi / (1 + places[:, None] ** 2 + places**2) ** 2
    np.testing.assert_allclose(image, expected, rtol=0.03)


@pytest.mark.parametrize("radiance", [2.0, 20.0], ids=["met by chance", "aimed at"])
@pytest.mark.parametrize("height", [0.003, 0.02, 0.2])
def test_what_glows_is_as_bright_near_by_as_when_it_is_found_by_chance(height, radiance):
    """A square that glows so near that rays find it by themselves."""
    scene = quads(FLOOR, SMALL * (20, 20, height), masks=(0b11, 0b10))
    image = unsmoothed(scene, looking((0, 0, 5), (0, 0, 0), 0.5), glowing(radiance), 64)
    # The view factor of a square seen from below its middle (four corners' closed form).
    x = 0.5 / height
    factor = 4 * x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    assert image.mean() == pytest.approx(radiance * factor, rel=0.01)


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.3), (1.0, 0.6), (0.0, 0.15), (0.0, 0.6)])
def test_what_glows_shines_in_gloss_without_specks_however_small_it_is(metallic, roughness):
    """By the sum of all of it, and pixel by pixel: one ray in hundreds would find it by chance."""
    look = glowing(1000.0, metallics=metallic, roughnesses=roughness, reflectances=0.04)
    image, converged = quick_and_converged(small_light_over_a_floor(), TILTED, look)
    np.testing.assert_allclose(image, converged, rtol=0.25, atol=0.05 * converged.mean())
    assert image.mean() == pytest.approx(converged.mean(), rel=0.01)


def test_what_glows_unseen_by_mirrors_leaves_no_highlight():
    look = glowing(1000.0, metallics=1.0, roughnesses=0.3)
    assert brightness(small_light_over_a_floor(), look) > 0.0
    assert brightness(small_light_over_a_floor(), replace(look, glossy_mask=0b01)) == 0.0


def test_what_glows_unseen_by_light_gives_none():
    look = replace(glowing(1000.0), diffuse_mask=0b01, shadow_mask=0b01)
    assert brightness(small_light_over_a_floor(), look) == 0.0
