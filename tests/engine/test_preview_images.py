"""Images and painted colours on surfaces in the preview mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from engine.node_programs import colors_program, image_program
from engine.preview_looks import (
    ABOVE,
    BLACK,
    FLOOR,
    QUAD,
    SIZE,
    WHITE,
    floor,
    looking,
    materials,
    one_material,
    papered,
    quads,
)
from perfect_bvh import Appearance, ImageTexture, MeshAppearance, World, render

SHOWN = (image_program("COLOR"),)


def four_pixels() -> npt.NDArray[np.uint8]:
    """Red at u, v = 0, 0; green to the right, blue above, white across."""
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0, 255), (0, 255, 0, 255), (0, 0, 255, 255), 255
    return pixels


@pytest.mark.parametrize("linear", [False, True])
def test_images_show_the_right_way_up(linear):
    pixels = four_pixels()
    image = ImageTexture(pixels.astype(np.float32) / 255 if linear else pixels, "extend")
    look = papered(image, programs=SHOWN)
    picture = render(quads(FLOOR * 0.02), looking((0, 0, 5), (0, 0, 0), 22.0), "preview", SIZE, 8, look)
    for row, column, color in ((27, 4, (1, 0, 0)), (27, 27, (0, 1, 0)), (4, 4, (0, 0, 1)), (4, 27, (1, 1, 1))):
        assert picture[row, column, :3] == pytest.approx(color, abs=0.05)


@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.9, 1.0])
def test_between_pixels_bytes_are_srgb_and_floats_linear(share):
    """As in Cycles: half way between black and white it is 0.214 of bytes, and 0.5 of floats."""
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 0, :3], pixels[0, 1, :3] = (0, 20, 255), (255, 200, 255)
    stored = (pixels[0, 0, :3] * (1 - share) + pixels[0, 1, :3] * share) / 255
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    place = (0, 0, 0, 0.25 + 0.5 * share, 0, 0, 0, 0.5, 0, 0, 0, 0)
    program = image_program("EMISSION", transform=place)
    for kind, expected in ((pixels, linear), (np.float32(pixels) / np.float32(255), stored)):
        image, black = ImageTexture(kind, "extend"), np.zeros((1, 3), np.float32)
        look = papered(image, base_colors=black, emissions=np.ones((1, 3), np.float32), programs=(program,))
        seen = render(floor(), ABOVE, "preview", SIZE, 1, replace(look, world=BLACK))[16, 16, :3]
        assert seen == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("interpolation", ["linear", "closest"])
def test_linear_bytes_are_the_same_as_their_floats(interpolation):
    """Bit for bit: every value of a byte, and values between pixels."""
    pixels = np.random.default_rng(3).permutation(np.tile(np.arange(256, dtype=np.uint8), 16)).reshape(32, 32, 4)
    floats, black = pixels * np.float32(1.0 / 255.0), np.zeros((1, 3), np.float32)
    seen = []
    for stored in (pixels, floats):
        image = ImageTexture(stored, "mirror", interpolation, is_linear=True)
        program = image_program("EMISSION", transform=(731.3, 211.1, 0, 0.2, 121.2, -811.7, 0, 0.3, 0, 0, 0, 0))
        look = papered(image, base_colors=black, emissions=np.ones((1, 3), np.float32), programs=(program,))
        seen.append(render(floor(), ABOVE, "preview", SIZE, 1, replace(look, world=BLACK)))
    np.testing.assert_array_equal(*seen)
    assert len(np.unique(seen[0][..., 0])) > 100


def test_a_world_may_be_of_linear_bytes():
    pixels = np.random.default_rng(4).integers(0, 256, (16, 32, 4), np.uint8)
    seen = []
    for stored in (pixels, pixels * np.float32(1.0 / 255.0)):
        look = Appearance(images=(ImageTexture(stored, is_linear=True),), world=World((1.0, 1.0, 1.0), image=0))
        seen.append(render(floor(), ABOVE, "preview", SIZE, 2, look))
    np.testing.assert_array_equal(*seen)


def test_a_transform_says_where_an_image_is_looked_up():
    """Turned by a quarter, shrunk and moved: of four pixels the second is seen on all of the floor."""
    program = image_program("COLOR", transform=(0.0, -0.1, 0.0, 0.95, 0.1, 0.0, 0.0, 0.05, 0, 0, 0, 0))
    look = papered(ImageTexture(four_pixels(), "extend"), programs=(program,))
    picture = render(floor(), ABOVE, "preview", SIZE, 4, look)
    assert picture[16, 16, :3] == pytest.approx((0, 1, 0), abs=0.02)


def test_an_image_may_emit():
    """Its colours are the emission, and nothing else is."""
    image = ImageTexture(np.tile(np.float32((0.25, 0.5, 2.0, 1.0)), (2, 2, 1)))
    black, program = np.zeros((1, 3), np.float32), image_program("EMISSION", scale=3.0)
    look = replace(papered(image, base_colors=black, emissions=black, programs=(program,)), world=BLACK)
    seen = render(floor(), ABOVE, "preview", SIZE, 4, look)[16, 16, :3]
    assert seen == pytest.approx((0.75, 1.5, 6.0), rel=1e-5)


def test_a_meshs_own_colors_tint_it():
    colors = np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)], np.float32)
    look = Appearance(
        meshes={0: MeshAppearance(corner_colors=colors[QUAD])},
        instances=one_material(1),
        materials=materials(programs=(colors_program(tint=(1.0, 0.5, 1.0)),)),
        world=WHITE,
    )
    # The middle lies halfway between the first corner and the third.
    assert render(floor(), ABOVE, "preview", SIZE, 8, look)[16, 16, :3] == pytest.approx((0.5, 0, 0.5), abs=0.02)
    bare = replace(look, meshes={})
    assert render(floor(), ABOVE, "preview", SIZE, 8, bare)[16, 16, :3] == pytest.approx((0, 0, 0))
    wrong = replace(look, meshes={0: MeshAppearance(corner_colors=colors[QUAD][:1])})
    with pytest.raises(ValueError, match="corner_colors has 1 rows but the mesh has 2 triangles"):
        render(floor(), ABOVE, "preview", SIZE, 1, wrong)
