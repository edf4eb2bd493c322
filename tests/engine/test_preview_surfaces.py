"""Reflection of surfaces in the preview mode: metal, plastic, glass, and partly transparent ones."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from engine.preview_looks import (
    ABOVE,
    ASIDE,
    BLACK,
    DIRECT,
    FLOOR,
    PLAIN,
    ROOF,
    SIZE,
    WHITE,
    brightness,
    floor,
    lights,
    looking,
    made_of,
    one_material,
    quads,
    square,
)
from perfect_bvh import Appearance, LightPaths, World, render, render_passes


def test_a_smooth_metal_is_a_coloured_mirror():
    """A floor of gold below an emissive ceiling, which the camera sees in it alone."""
    gold = (0.9, 0.6, 0.2)
    look = made_of(1, base_colors=gold, metallics=1.0, roughnesses=0.0)
    world = World((0.3, 0.5, 0.7))
    image = render(floor(), ABOVE, "preview", SIZE, 8, Appearance(**look, world=world))
    np.testing.assert_allclose(image[8:24, 8:24, :3].mean(axis=(0, 1)), np.multiply(gold, world.color), rtol=0.02)


@pytest.mark.parametrize(("roughness", "least"), [(0.0, 0.995), (0.3, 0.98), (0.6, 0.98), (1.0, 0.98)])
def test_a_white_metal_gives_back_no_more_than_it_gets(roughness, least):
    """In a white furnace, from above and aside. Light between its facets is not lost."""
    look = made_of(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=roughness)
    for camera, lost in ((ABOVE, 0.0), (ASIDE, 0.12)):
        seen = brightness(floor(), Appearance(**look, world=WHITE), camera, samples=64)
        assert least - lost <= seen <= 1.03


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.9])
@pytest.mark.parametrize("transmission", [0.0, 1.0])
def test_plastic_and_glass_give_back_no_more_than_they_get(roughness, transmission):
    look = made_of(1, base_colors=(1.0, 1.0, 1.0), reflectances=0.04, roughnesses=roughness, transmissions=transmission)
    for camera in (ABOVE, ASIDE):
        seen = brightness(floor(), Appearance(**look, world=WHITE), camera, samples=64)
        assert 0.97 <= seen <= 1.02


def test_what_has_no_material_mirrors_as_a_material_of_roughness_a_half_does():
    plain = render(floor(), ASIDE, "preview", SIZE, 4, Appearance(world=WHITE, plain_reflectance=0.3))
    look = made_of(1, base_colors=(PLAIN, PLAIN, PLAIN), reflectances=0.3, roughnesses=0.5)
    np.testing.assert_array_equal(plain, render(floor(), ASIDE, "preview", SIZE, 4, Appearance(**look, world=WHITE)))
    assert plain[..., :3].mean() > brightness(floor(), Appearance(world=WHITE), ASIDE)


@pytest.mark.parametrize(("power", "expected"), [(1.0, 0.25), (0.5, 0.5), (0.0, 1.0)])
def test_a_metal_has_its_colour_times_the_base_colour_to_a_power(power, expected):
    """In a white furnace, from above: the metal's own colour times a power of the base colour."""
    metal = {"metallics": 1.0, "roughnesses": 0.1, "metal_colors": (0.5, 0.5, 0.5), "metal_powers": power}
    look = Appearance(**made_of(1, base_colors=(0.25, 0.25, 0.25), **metal), world=WHITE)
    assert brightness(floor(), look, ABOVE, samples=64) == pytest.approx(0.5 * expected, rel=0.02)


def test_glass_bends_light_and_keeps_that_of_points_away():
    pane = square(3.0, 1.0)
    clear = made_of(1, base_colors=(1.0, 1.0, 1.0), reflectances=0.04, roughnesses=0.0, transmissions=1.0)
    table = replace(one_material(2), slot_offsets=np.array([0, 0, 1], np.int32))  # the floor has none
    look = Appearance(**{**clear, "instances": table}, lights=lights(1, power=math.pi), world=BLACK)
    aside = looking((0, -5, 5), (0, 0, 0), 5.0)  # no highlight comes here
    assert brightness(floor(pane), look, aside, light_paths=LightPaths(max_bounces=1)) < 0.01

    look = Appearance(**clear, world=WHITE, film_transparent=True)
    image = render(quads(pane), ABOVE, "preview", SIZE, 4, look)
    np.testing.assert_allclose(image[10:20, 10:20], 1.0, atol=0.015)  # it is there, and shows refracted light


@pytest.mark.parametrize(("alpha", "through"), [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0)])
def test_transparent_surfaces_let_light_and_looks_through(alpha, through):
    """A sun, a half transparent pane that is dark itself, a bright floor that its material does not reach."""
    pane = {**made_of(1, base_colors=(0.0, 0.0, 0.0), alphas=alpha)}
    pane["instances"] = replace(pane["instances"], ids=np.array([1], np.int32))
    look = Appearance(**pane, lights=lights(1, power=math.pi), world=BLACK)
    above = brightness(floor(square(50.0, 1.0)), look)  # the light comes through the pane, and is seen through it again
    assert above == pytest.approx(PLAIN * through * through, abs=0.03)


@pytest.mark.parametrize(("bounces", "is_lit"), [(2, False), (3, False), (5, False), (6, True)])
def test_a_shadow_ray_passes_only_as_many_surfaces_as_its_path_has_left(bounces, is_lit):
    """Three clear panes over a floor: a path passes them on its way to the floor, and again towards the sun."""
    panes = made_of(3, base_colors=(0.0, 0.0, 0.0), alphas=0.0)
    panes["instances"] = replace(panes["instances"], ids=np.array([1, 2, 3], np.int32))
    look = Appearance(**panes, lights=lights(1, power=math.pi), world=BLACK)
    scene = floor(*(square(50.0, height) for height in (1.0, 1.1, 1.2)))
    seen = brightness(scene, look, light_paths=LightPaths(transparent_bounces=bounces))
    assert seen == pytest.approx(PLAIN * is_lit, abs=0.03)


def test_mirrored_rays_pass_by_what_they_must_not_see():
    scene = quads(FLOOR, square(50.0, 9.0), masks=(0xFFFFFFFF, 0b10))
    mirror = made_of(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=0.0)
    look = Appearance(**mirror, world=WHITE, camera_mask=0b01, glossy_mask=0b01)
    assert brightness(scene, look) == pytest.approx(1.0, rel=5e-3)
    assert brightness(scene, replace(look, glossy_mask=0b10)) < 0.6


def test_light_bounces_off_what_is_held_out_of_the_image():
    """A red wall next to a floor colours it whether the camera sees the wall or it is a hole."""
    wall = np.array([(1, -50, 0), (1, 50, 0), (1, 50, 50), (1, -50, 50)], np.float64)
    scene = floor(wall)
    red = made_of(2, base_colors=(1.0, 0.0, 0.0))
    images = []
    for is_held_out in (False, True):
        table = replace(red["instances"], holdout=np.array([False, is_held_out]))
        look = Appearance(instances=table, materials=red["materials"], world=WHITE)
        images.append(render(scene, ABOVE, "preview", SIZE, 8, look))
    np.testing.assert_array_equal(images[0], images[1])  # the camera looks past the wall


@pytest.mark.parametrize(("share", "alpha"), [(1.0, 1.0), (0.5, 1.0), (1.0, 0.5), (0.25, 0.5)])
def test_a_material_cuts_as_much_of_a_hole_as_it_says(share, alpha):
    """A black pane before a bright floor hides it in proportion to its alpha, even where it is a hole."""
    cut = made_of(1, base_colors=(0.0, 0.0, 0.0), alphas=alpha, holdouts=share)
    cut["instances"] = replace(cut["instances"], ids=np.array([1], np.int32))
    image = render(floor(square(50.0, 1.0)), ABOVE, "preview", SIZE, 4, Appearance(**cut, world=WHITE))
    np.testing.assert_allclose(image[12:20, 12:20, 3], 1.0 - share * alpha, atol=1e-5)
    without = made_of(1, base_colors=(0.0, 0.0, 0.0), alphas=alpha)
    without["instances"] = cut["instances"]
    plain = render(floor(square(50.0, 1.0)), ABOVE, "preview", SIZE, 4, Appearance(**without, world=WHITE))
    np.testing.assert_allclose(image[12:20, 12:20, :3], plain[12:20, 12:20, :3], atol=1e-5)


def test_a_hole_is_no_surface_to_passes():
    cut = made_of(1, holdouts=1.0)
    asked = {"mode": "preview", "size": SIZE, "samples": 2, "passes": ("depth",)}
    passes = render_passes(floor(), ABOVE, appearance=Appearance(**cut), **asked)
    assert (passes["depth"] >= 1e10).all()


@pytest.mark.parametrize("film_transparent", [False, True])
def test_a_catcher_shows_the_shadow_alone(film_transparent):
    """That of a roof under a sun straight above, seen from the side and from below the roof's edge."""
    look = Appearance(
        lights=lights(1, power=math.pi),
        world=BLACK,
        backdrop=World((0.5, 0.25, 0.125)),
        catcher_mask=0b10,
        film_transparent=film_transparent,
    )
    scene = quads(FLOOR, ROOF, masks=(0b11, 0b01))
    image = render(scene, ASIDE, "preview", SIZE, 4, look, light_paths=DIRECT)
    lit, dark = image[28:], image[15:17, 12:20]
    np.testing.assert_array_equal(
        lit.reshape(-1, 4), [(0, 0, 0, 0) if film_transparent else (0.5, 0.25, 0.125, 1)] * 128
    )
    assert (dark[..., 3] > 0.9).all()
    assert (dark[..., :3] < 0.05).all()
    plain = render(scene, ASIDE, "preview", SIZE, 4, replace(look, catcher_mask=0))
    assert plain[28:, :, 0].min() > 0.7, "a floor as any other"
