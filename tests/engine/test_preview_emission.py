"""Emissive surfaces, in the preview mode: as bright as physics says, however small, and without specks."""

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
    emissive,
    floor,
    looking,
    made_of,
    noisy,
    quads,
    quick_and_converged,
)
from perfect_bvh import Appearance, Scene


def small_light_over_a_floor() -> Scene:
    """The light has the second bit only, which emissive() hides from the camera."""
    return quads(FLOOR, SMALL, masks=(0b11, 0b10))


def test_emission_is_seen_and_gives_light():
    look = Appearance(**made_of(1, base_colors=(0.0, 0.0, 0.0), emissions=(3.0, 3.0, 3.0)), world=BLACK)
    assert brightness(floor(), look) == pytest.approx(3.0, rel=1e-5)


def test_an_emitter_lights_without_fireflies_however_small_it_is():
    """Radiance times the area over the distance squared, over pi; one ray in a thousand would find it by chance."""
    image = noisy(small_light_over_a_floor(), ABOVE, emissive(1000.0), 32)
    places = 5 * math.tan(math.radians(2.5)) * (np.arange(1, 64, 2) / 32 - 1)
    expected = 1000.0 * 0.05**2 / math.pi / (1 + places[:, None] ** 2 + places**2) ** 2
    np.testing.assert_allclose(image, expected, rtol=0.03)


@pytest.mark.parametrize("radiance", [2.0, 20.0], ids=["met by chance", "aimed at"])
@pytest.mark.parametrize("height", [0.003, 0.02, 0.2])
def test_a_near_emitter_is_as_bright_sampled_as_hit_by_chance(height, radiance):
    """An emissive square so near that rays find it by themselves."""
    scene = quads(FLOOR, SMALL * (20, 20, height), masks=(0b11, 0b10))
    image = noisy(scene, looking((0, 0, 5), (0, 0, 0), 0.5), emissive(radiance), 64)
    # The view factor of a square seen from below its middle (four corners' closed form).
    x = 0.5 / height
    factor = 4 * x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    assert image.mean() == pytest.approx(radiance * factor, rel=0.01)


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.3), (1.0, 0.6), (0.0, 0.15), (0.0, 0.6)])
def test_an_emitter_has_a_highlight_without_fireflies_however_small_it_is(metallic, roughness):
    """By the sum of all of it, and pixel by pixel: one ray in hundreds would find it by chance."""
    look = emissive(1000.0, metallics=metallic, roughnesses=roughness, reflectances=0.04)
    image, converged = quick_and_converged(small_light_over_a_floor(), TILTED, look)
    np.testing.assert_allclose(image, converged, rtol=0.25, atol=0.05 * converged.mean())
    assert image.mean() == pytest.approx(converged.mean(), rel=0.01)


def test_an_emitter_invisible_to_glossy_rays_leaves_no_highlight():
    look = emissive(1000.0, metallics=1.0, roughnesses=0.3)
    assert brightness(small_light_over_a_floor(), look) > 0.0
    assert brightness(small_light_over_a_floor(), replace(look, glossy_mask=0b01)) == 0.0


def test_an_emitter_invisible_to_diffuse_rays_gives_no_light():
    look = replace(emissive(1000.0), diffuse_mask=0b01, shadow_mask=0b01)
    assert brightness(small_light_over_a_floor(), look) == 0.0
