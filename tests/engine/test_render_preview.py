"""The preview mode where its light is known from physics, and what materials do to it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from perfect_bvh import (
    Appearance,
    Camera,
    ImageTexture,
    InstanceTable,
    LightTable,
    MaterialTable,
    MeshAppearance,
    Scene,
    World,
    render,
)

SIZE = (32, 32)
FLOOR = np.array([(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)], np.float64)
QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
DOWN = np.eye(3, dtype=np.float32)  # shines along -z
BLACK = World()
ASIDE = Camera.look_at((0, -30, 3), (0, 0, 0), angle=0.05, aspect=1.0)
ABOVE = Camera.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0), angle=math.radians(5), aspect=1.0)


def floor(*more: np.ndarray) -> Scene:
    scene = Scene()
    for positions in (FLOOR, *more):
        scene.add_instance(scene.add_mesh(positions, QUAD))
    scene.commit()
    return scene


def lights(kind: int, position=(0, 0, 2), power=100.0, size=(0.0, 0.0), cone=(math.pi, 0.0), count=1) -> LightTable:
    def rows(value, dtype):
        return np.repeat(np.asarray(value, dtype)[None], count, axis=0)

    return LightTable(
        kinds=rows(kind, np.int32),
        positions=rows(position, np.float64),
        axes=rows(DOWN, np.float32),
        powers=rows((power,) * 3, np.float32),
        sizes=rows(size, np.float32),
        cones=rows(cone, np.float32),
        casts_shadow=rows(True, np.bool_),
    )


def materials(**columns) -> MaterialTable:
    return MaterialTable(np.ones((1, 4), np.float32), np.zeros(1, np.int32), **columns)


def one_material(instances: int) -> InstanceTable:
    return InstanceTable(
        ids=np.arange(instances, dtype=np.int32),
        slot_offsets=np.arange(instances + 1, dtype=np.int32),
        slot_materials=np.zeros(instances, np.int32),
        object_indices=np.zeros(instances, np.int32),
        holdout=np.zeros(instances, np.bool_),
    )


def brightness(scene: Scene, appearance: Appearance, camera: Camera = ABOVE, samples: int = 16) -> float:
    image = render(scene, camera, "preview", SIZE, samples, appearance)
    assert np.isfinite(image).all()
    return float(image[12:20, 12:20, 1].mean())


PLAIN = 0.8  # what a surface without a material gives back


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


def test_an_even_world_lights_an_open_floor_evenly():
    assert brightness(floor(), Appearance(world=World((0.5, 0.5, 0.5)))) == pytest.approx(PLAIN * 0.5, rel=1e-3)


def test_what_is_in_the_way_throws_a_shadow():
    roof = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], np.float64)
    from_the_side = Camera.look_at((0, -5, 0.4), (0, 0, 0), angle=math.radians(3), aspect=1.0)
    look = Appearance(lights=lights(1, power=math.pi), world=BLACK)
    assert brightness(floor(roof), look, from_the_side) < 0.05
    assert brightness(floor(), look, from_the_side) == pytest.approx(PLAIN, rel=0.01)


@pytest.mark.parametrize(("alpha", "through"), [(1.0, 0.0), (0.5, 0.5), (0.0, 1.0)])
def test_transparent_surfaces_let_light_and_looks_through(alpha, through):
    """A sun, a half transparent pane that is dark itself, a bright floor that its material does not reach."""
    pane = np.array([(-50, -50, 1), (50, -50, 1), (50, 50, 1), (-50, 50, 1)], np.float64)
    scene = floor(pane)
    table = InstanceTable(
        ids=np.array([1], np.int32),
        slot_offsets=np.array([0, 1], np.int32),
        slot_materials=np.zeros(1, np.int32),
        object_indices=np.zeros(1, np.int32),
        holdout=np.zeros(1, np.bool_),
    )
    look = Appearance(
        instances=table,
        materials=materials(base_colors=np.zeros((1, 3), np.float32), alphas=np.array([alpha], np.float32)),
        lights=lights(1, power=math.pi),
        world=BLACK,
    )
    above = brightness(scene, look)  # the floor's light comes through the pane, and is seen through it again
    assert above == pytest.approx(PLAIN * through * through, abs=0.03)


def shiny(count: int, **columns) -> dict:
    rows = {name: np.array([value], np.float32) for name, value in columns.items()}
    return {"instances": one_material(count), "materials": materials(**rows)}


def test_a_smooth_metal_is_a_coloured_mirror():
    """A floor of gold below a glowing ceiling, which the camera sees in it alone."""
    gold = (0.9, 0.6, 0.2)
    look = shiny(1, base_colors=gold, metallics=1.0, roughnesses=0.0)
    world = World((0.3, 0.5, 0.7))
    image = render(floor(), ABOVE, "preview", SIZE, 8, Appearance(**look, world=world))
    np.testing.assert_allclose(image[8:24, 8:24, :3].mean(axis=(0, 1)), np.multiply(gold, world.color), rtol=0.02)


@pytest.mark.parametrize(("roughness", "least"), [(0.0, 0.995), (0.3, 0.98), (0.6, 0.95), (1.0, 0.5)])
def test_a_white_metal_gives_back_no_more_than_it_gets(roughness, least):
    """In a white furnace, from above and aside. A very rough one is too dark: it loses what bounces inside."""
    look = shiny(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=roughness)
    for camera, lost in ((ABOVE, 0.0), (ASIDE, 0.12)):
        seen = brightness(floor(), Appearance(**look, world=World((1.0, 1.0, 1.0))), camera, samples=64)
        assert least - lost <= seen <= 1.03


@pytest.mark.parametrize("roughness", [0.05, 0.3, 0.9])
@pytest.mark.parametrize("transmission", [0.0, 1.0])
def test_plastic_and_glass_give_back_no_more_than_they_get(roughness, transmission):
    look = shiny(1, base_colors=(1.0, 1.0, 1.0), reflectances=0.04, roughnesses=roughness, transmissions=transmission)
    white = World((1.0, 1.0, 1.0))
    for camera in (ABOVE, ASIDE):
        seen = brightness(floor(), Appearance(**look, world=white), camera, samples=64)
        assert 0.9 <= seen <= 1.001


@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_highlights_are_what_a_mirror_would_show_of_the_light(roughness):
    """A square light, and a glowing square of the same radiance, seen in a metal floor: two ways to one number."""
    camera = Camera.look_at((0, -4, 3), (0, 0, 0), angle=math.radians(8), aspect=1.0)
    square = np.array([(-1, 3, 3), (1, 3, 3), (1, 5, 3), (-1, 5, 3)], np.float64)
    power = 200.0
    light = lights(3, position=(0, 4, 3), power=power, size=(2.0, 2.0))
    metal = shiny(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=roughness)
    by_light = brightness(floor(), Appearance(**metal, lights=light, world=BLACK), camera, samples=256)

    table = replace(one_material(2), slot_materials=np.array([0, 1], np.int32))
    glowing = MaterialTable(
        np.ones((2, 4), np.float32),
        np.zeros(2, np.int32),
        base_colors=np.array([(1, 1, 1), (0, 0, 0)], np.float32),
        emissions=np.array([(0, 0, 0), (power / math.pi / 4,) * 3], np.float32),
        metallics=np.array([1, 0], np.float32),
        roughnesses=np.array([roughness, 1], np.float32),
    )
    look = Appearance(instances=table, materials=glowing, world=BLACK)
    by_mirror = brightness(floor(square), look, camera, samples=1024)
    assert by_light > 0.5
    assert by_mirror == pytest.approx(by_light, rel=0.05)


def test_glass_is_seen_through_and_throws_a_light_shadow():
    pane = np.array([(-3, -3, 1), (3, -3, 1), (3, 3, 1), (-3, 3, 1)], np.float64)
    sun = Appearance(lights=lights(1, power=math.pi), world=BLACK)
    table = replace(one_material(2), slot_offsets=np.array([0, 0, 1], np.int32))  # the floor has none
    clear = materials(
        base_colors=np.ones((1, 3), np.float32),
        reflectances=np.array([0.04], np.float32),
        roughnesses=np.zeros(1, np.float32),
        transmissions=np.ones(1, np.float32),
    )
    aside = Camera.look_at((0, -5, 5), (0, 0, 0), angle=math.radians(5), aspect=1.0)  # no highlight comes here
    seen = brightness(floor(pane), replace(sun, instances=table, materials=clear), aside)
    assert seen == pytest.approx(PLAIN * 0.6 * 0.96, rel=0.03)
    alone = Scene()
    alone.add_instance(alone.add_mesh(pane, QUAD))
    alone.commit()
    look = Appearance(instances=one_material(1), materials=clear, world=World((1, 1, 1)), film_transparent=True)
    image = render(alone, ABOVE, "preview", SIZE, 4, look)
    np.testing.assert_allclose(image[10:20, 10:20], 0.04, atol=0.015)  # what it mirrors, and that much of it is there


def test_mirrored_rays_pass_by_what_they_must_not_see():
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR, QUAD))
    scene.add_instance(scene.add_mesh(FLOOR + (0, 0, 9), QUAD), mask=0b10)
    scene.commit()
    mirror = shiny(1, base_colors=(1.0, 1.0, 1.0), metallics=1.0, roughnesses=0.0)
    look = Appearance(**mirror, world=World((1, 1, 1)), camera_mask=0b01, glossy_mask=0b01)
    assert brightness(scene, look) == pytest.approx(1.0, rel=5e-3)
    assert brightness(scene, replace(look, glossy_mask=0b10)) < 0.6


def test_light_bounces_off_what_is_held_out_of_the_image():
    """A red wall beside a floor colours it whether the wall itself is seen or is a hole."""
    wall = np.array([(1, -50, 0), (1, 50, 0), (1, 50, 50), (1, -50, 50)], np.float64)
    scene = floor(wall)
    look = materials(base_colors=np.array([(1.0, 0.0, 0.0)], np.float32))
    table = one_material(2)
    plain, held_out = (
        Appearance(
            instances=replace(table, holdout=np.array([False, is_held_out])), materials=look, world=World((1, 1, 1))
        )
        for is_held_out in (False, True)
    )
    images = [render(scene, ABOVE, "preview", SIZE, 8, look) for look in (plain, held_out)]
    np.testing.assert_array_equal(images[0], images[1])  # the camera looks past the wall


@pytest.mark.parametrize(("mask", "is_open"), [(0b01, False), (0b10, True)])
def test_what_rays_for_the_sky_pass_by_keeps_no_light_away(mask, is_open):
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR, QUAD))
    scene.add_instance(scene.add_mesh(FLOOR + (0, 0, 9), QUAD), mask=mask)
    scene.commit()
    look = Appearance(world=World((1, 1, 1)), diffuse_mask=0b01, shadow_mask=0b10, camera_mask=0b01)
    seen = brightness(scene, look)
    assert seen == pytest.approx(PLAIN, rel=1e-3) if is_open else seen < 0.5 * PLAIN


def test_emission_is_seen_and_gives_light():
    look = Appearance(
        instances=one_material(1),
        materials=materials(base_colors=np.zeros((1, 3), np.float32), emissions=np.full((1, 3), 3.0, np.float32)),
        world=BLACK,
    )
    assert brightness(floor(), look) == pytest.approx(3.0, rel=1e-5)


SMALL = np.array([(-0.025, -0.025, 1), (0.025, -0.025, 1), (0.025, 0.025, 1), (-0.025, 0.025, 1)], np.float64)


def glowing(radiance: float) -> Appearance:
    """A floor that gives back everything, and a black square that glows; nothing else shines."""
    return Appearance(
        instances=replace(one_material(2), slot_materials=np.array([0, 1], np.int32)),
        materials=MaterialTable(
            np.ones((2, 4), np.float32),
            np.zeros(2, np.int32),
            base_colors=np.array([(1, 1, 1), (0, 0, 0)], np.float32),
            emissions=np.array([(0, 0, 0), (radiance,) * 3], np.float32),
        ),
        world=BLACK,
        camera_mask=0b01,
    )


def small_light_over(floor_mask: int = 0b11, light_mask: int = 0b10) -> Scene:
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR, QUAD), mask=floor_mask)
    scene.add_instance(scene.add_mesh(SMALL, QUAD), mask=light_mask)
    scene.commit()
    return scene


def test_what_glows_gives_light_without_specks_however_small_it_is():
    """Radiance times the area over the distance squared, over pi; one ray in a thousand would find it by chance."""
    image = render(small_light_over(), ABOVE, "preview", SIZE, 16, glowing(1000.0), smooth=False)[..., 1]
    places = 5 * math.tan(math.radians(2.5)) * (np.arange(1, 64, 2) / 32 - 1)
    expected = 1000.0 * 0.05**2 / math.pi / (1 + places[:, None] ** 2 + places**2) ** 2
    np.testing.assert_allclose(image, expected, rtol=0.03)


@pytest.mark.parametrize("radiance", [2.0, 20.0], ids=["met by chance", "aimed at"])
@pytest.mark.parametrize("height", [0.003, 0.02, 0.2])
def test_what_glows_is_as_bright_near_by_as_when_it_is_found_by_chance(height, radiance):
    """A square that glows so near that rays find it by themselves."""
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR, QUAD), mask=0b11)
    scene.add_instance(scene.add_mesh(SMALL * (20, 20, height), QUAD), mask=0b10)
    scene.commit()
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0), angle=math.radians(0.5), aspect=1.0)
    image = render(scene, camera, "preview", SIZE, 64, glowing(radiance), smooth=False)[..., 1]
    # The view factor of a square seen from below its middle (four corners' closed form).
    x = 0.5 / height
    factor = 4 * x / math.sqrt(1 + x * x) * math.atan(x / math.sqrt(1 + x * x)) / math.pi
    assert image.mean() == pytest.approx(radiance * factor, rel=0.01)


@pytest.mark.parametrize(("metallic", "roughness"), [(1.0, 0.3), (1.0, 0.6), (0.0, 0.15), (0.0, 0.6)])
def test_what_glows_shines_in_gloss_without_specks_however_small_it_is(metallic, roughness):
    """By the sum of all of it, and pixel by pixel: one ray in hundreds would find it by chance."""
    look = glowing(1000.0)
    glossy = replace(
        look.materials,
        metallics=np.array([metallic, 0.0], np.float32),
        roughnesses=np.array([roughness, 1.0], np.float32),
        reflectances=np.array([0.04, 0.0], np.float32),
    )
    look = replace(look, materials=glossy)
    camera = Camera.look_at((0, -4, 3), (0, -0.5, 0), angle=math.radians(16), aspect=1.0)
    image, converged = (
        render(small_light_over(), camera, "preview", SIZE, samples, look, smooth=False, seed=seed)[..., 1]
        for samples, seed in ((16, 1), (512, 2))
    )
    np.testing.assert_allclose(image, converged, rtol=0.25, atol=0.05 * converged.mean())
    assert image.mean() == pytest.approx(converged.mean(), rel=0.01)


def test_what_glows_unseen_by_mirrors_leaves_no_highlight():
    look = glowing(1000.0)
    metal = replace(look.materials, metallics=np.ones(2, np.float32), roughnesses=np.full(2, 0.3, np.float32))
    assert brightness(small_light_over(), replace(look, materials=metal, glossy_mask=0b01)) == 0.0


@pytest.mark.parametrize(("kind", "size"), [(0, (0.5, 0.0)), (3, (1.5, 1.0)), (4, (1.5, 1.0))])
@pytest.mark.parametrize("count", [1, 6], ids=["each is asked", "some are picked"])
def test_large_lights_shine_in_smooth_metal_without_specks(kind, size, count):
    camera = Camera.look_at((0, -4, 3), (0, -0.5, 0), angle=math.radians(16), aspect=1.0)
    metal = shiny(1, base_colors=(0.9, 0.9, 0.9), metallics=1.0, roughnesses=0.2)
    look = Appearance(**metal, lights=lights(kind, position=(0, 1, 2), size=size, count=count), world=BLACK)
    image, converged = (
        render(floor(), camera, "preview", SIZE, samples, look, smooth=False, seed=seed)[..., 1]
        for samples, seed in ((16, 1), (512, 2))
    )
    assert np.abs(image - converged).max() < 0.35 * converged.max()
    assert math.sqrt(((image - converged) ** 2).mean()) < 0.12 * converged.mean()
    assert image.mean() == pytest.approx(converged.mean(), rel=0.01)


def test_what_glows_unseen_by_light_gives_none():
    look = replace(glowing(1000.0), diffuse_mask=0b01, shadow_mask=0b01)
    assert brightness(small_light_over(), look) == 0.0


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("linear", [False, True])
def test_images_show_the_right_way_up(linear, smooth):
    """Four pixels: red at u, v = 0, 0; green to the right, blue above, white across."""
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255), 255
    image = ImageTexture(pixels.astype(np.float32) / 255 if linear else pixels, "extend")
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR * 0.02, QUAD))
    scene.commit()
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    look = Appearance(
        meshes={0: MeshAppearance(corner_uvs=corners[QUAD])},
        instances=one_material(1),
        materials=materials(color_images=np.zeros(1, np.int32)),
        images=(image,),
        world=World((1.0, 1.0, 1.0)),
    )
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0), angle=math.radians(22), aspect=1.0)
    picture = render(scene, camera, "preview", SIZE, 8, look, smooth=smooth)
    for row, column, color in ((27, 4, (1, 0, 0)), (27, 27, (0, 1, 0)), (4, 4, (0, 0, 1)), (4, 27, (1, 1, 1))):
        assert picture[row, column, :3] == pytest.approx(color, abs=0.05)


def test_a_uv_transform_says_where_an_image_is_looked_up():
    """Turned by a quarter, shrunk and moved: of four pixels the second is seen on all of the floor."""
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255), 255
    image = ImageTexture(pixels, "extend", ((0.0, -0.1, 0.95), (0.1, 0.0, 0.05)))
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    look = Appearance(
        meshes={0: MeshAppearance(corner_uvs=corners[QUAD])},
        instances=one_material(1),
        materials=materials(color_images=np.zeros(1, np.int32)),
        images=(image,),
        world=World((1.0, 1.0, 1.0)),
    )
    picture = render(floor(), ABOVE, "preview", SIZE, 4, look)[16, 16, :3]
    assert picture == pytest.approx((0, 1, 0), abs=0.02)


def test_an_image_may_glow():
    """Its colours multiply the emission, and nothing else does."""
    pixels = np.tile(np.float32((0.25, 0.5, 2.0, 1.0)), (2, 2, 1))
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    look = Appearance(
        meshes={0: MeshAppearance(corner_uvs=corners[QUAD])},
        instances=one_material(1),
        materials=materials(
            base_colors=np.zeros((1, 3), np.float32),
            emissions=np.full((1, 3), 3.0, np.float32),
            emission_images=np.zeros(1, np.int32),
        ),
        images=(ImageTexture(pixels),),
        world=BLACK,
    )
    seen = render(floor(), ABOVE, "preview", SIZE, 4, look)[16, 16, :3]
    assert seen == pytest.approx((0.75, 1.5, 6.0), rel=1e-5)


def test_a_meshs_own_colors_tint_it():
    colors = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)], np.float32)
    look = Appearance(
        meshes={0: MeshAppearance(corner_colors=colors[QUAD])},
        instances=one_material(1),
        materials=materials(base_colors=np.array([(1.0, 0.5, 1.0)], np.float32), tinted=np.ones(1, np.bool_)),
        world=World((1.0, 1.0, 1.0)),
    )
    # The middle lies halfway between the first corner and the third.
    assert render(floor(), ABOVE, "preview", SIZE, 8, look)[16, 16, :3] == pytest.approx((0.5, 0, 0.5), abs=0.02)
    bare = replace(look, meshes={})
    assert render(floor(), ABOVE, "preview", SIZE, 8, bare)[16, 16, :3] == pytest.approx((0.8, 0.4, 0.8), abs=0.02)
    wrong = replace(look, meshes={0: MeshAppearance(corner_colors=colors[QUAD][:1])})
    with pytest.raises(ValueError, match="corner_colors has 1 rows but the mesh has 2 triangles"):
        render(floor(), ABOVE, "preview", SIZE, 1, wrong)


@pytest.mark.parametrize("kind", [3, 4], ids=["rectangle", "ellipse"])
@pytest.mark.parametrize("spread", [0.02, 0.4, 1.5, 3.0])
def test_a_grid_before_an_area_light_gathers_its_light_and_keeps_its_watts(kind, spread):
    """All light of a small lamp falls on the floor below it: the same sum whatever the spread, on a smaller spot."""

    def lit(angle: float) -> np.ndarray:
        lamp = replace(lights(kind, power=1.0, size=(0.001, 0.001)), cones=np.array([(angle, 0.0)], np.float32))
        wide = Camera.look_at((0, 0, 50), (0, 0, 0), up=(0, 1, 0), angle=2 * math.atan(reach / 50), aspect=1.0)
        look = Appearance(lights=lamp, world=BLACK)
        return render(floor(), wide, "preview", (128, 128), 16, look, smooth=False)[..., 1]

    reach = 2.0 * math.tan(spread / 2) * 1.1  # the lamp is two above the floor
    image = lit(spread)
    area = (2 * reach / 128) ** 2
    assert image.sum() * area * math.pi == pytest.approx(PLAIN, rel=0.03)
    assert image[0, 0] == 0.0


def test_the_worlds_image_lies_round_the_scene_as_in_blender():
    """U runs from -X over -Y ... to -X again: (0.5, 0.5) is +X, 0.25 is +Y."""
    pixels = np.zeros((16, 32, 4), np.float32)
    for quarter, color in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0))):
        pixels[:, quarter * 8 : quarter * 8 + 8, :3] = color
    look = Appearance(images=(ImageTexture(pixels),), world=World((1.0, 1.0, 1.0), image=0))
    scene = Scene()
    scene.commit()
    for towards, u in (((1, 1, 0), 0.375), ((-1, 1, 0), 0.125), ((1, -1, 0), 0.625), ((-1, -1, 0), 0.875)):
        camera = Camera.look_at((0, 0, 0), towards, angle=math.radians(5), aspect=1.0)
        seen = render(scene, camera, "preview", SIZE, 1, look)[16, 16, :3]
        assert seen == pytest.approx(pixels[8, int(u * 32), :3])


def sun_in_the_sky(rotation: float) -> tuple[Appearance, Appearance]:
    """A sun in a dim sky's image, and the same sun as a light under a sky as dim."""
    wide, high, radiance, sky = 256, 128, 5000.0, 0.05
    pixels = np.full((high, wide, 4), sky, np.float32)
    rows, columns = np.s_[90:93], np.s_[40:43]
    pixels[rows, columns, :3] = radiance
    azimuth = (0.5 - 41.5 / wide) * 2 * math.pi - rotation
    height = (91.5 / high - 0.5) * math.pi
    towards = np.array(
        (math.cos(height) * math.cos(azimuth), math.cos(height) * math.sin(azimuth), math.sin(height)), np.float32
    )
    side = np.array((-math.sin(azimuth), math.cos(azimuth), 0.0), np.float32)
    angle = 3 * 2 * math.pi / wide * math.cos(height) * 3 * math.pi / high
    sun = replace(
        lights(1, power=radiance * angle, size=(2 * math.sqrt(angle / math.pi), 0.0)),
        axes=np.stack([side, np.cross(towards, side), towards])[None].astype(np.float32),
    )
    around = Appearance(images=(ImageTexture(pixels),), world=World((1, 1, 1), image=0, rotation=rotation))
    return around, Appearance(lights=sun, world=World((sky,) * 3))


@pytest.mark.parametrize("rotation", [0.0, 1.0, -2.5])
@pytest.mark.parametrize(
    "columns",
    [
        {"base_colors": (0.8, 0.8, 0.8)},
        {"base_colors": (0.8, 0.8, 0.8), "metallics": 1.0, "roughnesses": 0.5},
        {"base_colors": (0.3, 0.3, 0.3), "reflectances": 0.04, "roughnesses": 0.6},
    ],
    ids=["matt", "metal", "plastic"],
)
def test_a_sun_in_the_worlds_image_shines_as_a_light_would(rotation, columns):
    """With its shadow and its highlight, and without specks: a ray in ten thousand would find it by chance."""
    roof = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], np.float64)
    camera = Camera.look_at((0, -9, 7), (0, 0, 0), angle=math.radians(40), aspect=1.0)
    look = shiny(2, **columns)
    by_image, by_light = (
        render(floor(roof), camera, "preview", SIZE, 64, replace(lit, **look), smooth=False)[..., 1]
        for lit in sun_in_the_sky(rotation)
    )
    assert np.abs(by_image - by_light).mean() < 0.03 * by_light.mean()
    assert np.abs(by_image - by_light).max() < 0.3 * by_light.max()


def test_a_sun_in_the_worlds_image_lights_what_light_bounces_off():
    """A ceiling over a floor in the sun: all its light has bounced, and none of it where the floor is in shadow."""
    roof = np.array([(-3, -3, 2), (3, -3, 2), (3, 3, 2), (-3, 3, 2)], np.float64)
    camera = Camera.look_at((0, -6, 0.5), (0, 0, 2), angle=math.radians(8), aspect=1.0)
    by_image, by_light = (brightness(floor(roof), lit, camera, samples=64) for lit in sun_in_the_sky(0.5))
    assert by_image == pytest.approx(by_light, rel=0.05)


def test_a_backdrop_is_seen_and_lights_nothing():
    look = Appearance(world=World((0.5, 0.5, 0.5)), backdrop=World((0.0, 1.0, 0.0)))
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR * 0.004, QUAD))
    scene.commit()
    camera = Camera.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0), angle=math.radians(10), aspect=1.0)
    image = render(scene, camera, "preview", SIZE, 16, look)
    assert image[16, 16, :3] == pytest.approx((0.4, 0.4, 0.4), rel=0.01)
    assert image[1, 1, :3] == pytest.approx((0.0, 1.0, 0.0))


def test_without_lights_and_world_the_studio_shines():
    assert 0.1 < brightness(floor(), Appearance()) < 1.0


def test_the_film_may_be_transparent():
    scene = Scene()
    scene.commit()
    look = Appearance(world=World((1.0, 1.0, 1.0)), film_transparent=True)
    assert not render(scene, ABOVE, "preview", SIZE, 1, look).any()


def test_pixels_do_not_depend_on_threads():
    roof = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], np.float64)
    look = Appearance(lights=lights(3, size=(1.0, 2.0), count=6), world=World((0.1, 0.2, 0.3)))
    sunny = replace(sun_in_the_sky(0.5)[0], **shiny(2, base_colors=(0.8, 0.7, 0.6), metallics=1.0, roughnesses=0.3))
    for lit in (look, sunny):
        images = [render(floor(roof), ABOVE, "preview", (70, 50), 2, lit, threads=threads) for threads in (1, 2, 3)]
        assert np.array_equal(images[0], images[1])
        assert np.array_equal(images[0], images[2])


@pytest.mark.parametrize(
    ("look", "message"),
    [
        (Appearance(images=(ImageTexture(np.zeros((2, 2, 3), np.uint8)),)), r"images\[0\].pixels must have shape"),
        (Appearance(images=(ImageTexture(np.zeros((2, 2, 4))),)), r"images\[0\].pixels must be uint8 .* got float64"),
        (
            Appearance(images=(ImageTexture(np.zeros((2, 2, 4), np.uint8), uv_transform=((1, 0), (0, 1))),)),
            r"images\[0\].uv_transform must be two rows of three numbers",
        ),
        (
            Appearance(materials=materials(emission_images=np.array([3], np.int32))),
            "materials.emission_images refers to",
        ),
        (Appearance(world=World(image=0)), "world.image is 0 but there are 0 images"),
        (Appearance(backdrop=World(image=2)), "backdrop.image is 2 but there are 0 images"),
        (Appearance(world=World((math.nan, 0, 0))), "world.color must be three numbers"),
        (
            Appearance(materials=materials(color_images=np.array([3], np.int32))),
            "materials.color_images refers to",
        ),
        (Appearance(materials=materials(alphas=np.zeros(2, np.float32))), "materials.alphas has 2 rows"),
        (Appearance(lights=lights(5)), "lights.kinds must be 0 to 4 .*, got 5"),
        (Appearance(lights=lights(0, power=math.inf)), "lights.powers must be finite, got inf"),
        (Appearance(lights=LightTable(kinds=np.zeros(1, np.int32))), "lights.positions must have a row for each"),
    ],
)
def test_bad_looks_are_refused(look, message):
    with pytest.raises(ValueError, match=f"render: appearance.{message}"):
        render(floor(), ABOVE, "preview", SIZE, 1, look)
