"""Calls of previews: the same pixels for any number of threads, and which looks are refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from engine.node_programs import image_program
from engine.preview_looks import ABOVE, ROOF, SIZE, floor, lights, made_of, materials, sun_in_the_sky
from perfect_bvh import Appearance, FinishTable, HairTable, ImageTexture, LightTable, World, render


def test_pixels_do_not_depend_on_threads():
    look = Appearance(lights=lights(3, size=(1.0, 2.0), count=6), world=World((0.1, 0.2, 0.3)))
    sunny = replace(sun_in_the_sky(0.5)[0], **made_of(2, base_colors=(0.8, 0.7, 0.6), metallics=1.0, roughnesses=0.3))
    for lit in (look, sunny):
        images = [render(floor(ROOF), ABOVE, "preview", (70, 50), 2, lit, threads=threads) for threads in (1, 2, 3)]
        assert np.array_equal(images[0], images[1])
        assert np.array_equal(images[0], images[2])


@pytest.mark.parametrize(
    ("look", "message"),
    [
        (Appearance(images=(ImageTexture(np.zeros((2, 2, 3), np.uint8)),)), r"images\[0\].pixels must have shape"),
        (Appearance(images=(ImageTexture(np.zeros((2, 2, 4))),)), r"images\[0\].pixels must be uint8 .* got float64"),
        (
            Appearance(images=(ImageTexture(np.zeros((2, 2, 4), np.uint8), interpolation="cubic"),)),  # type: ignore[arg-type]
            r"images\[0\].interpolation must be",
        ),
        (
            Appearance(materials=materials(programs=(3,))),
            r"materials.programs\[0\] must be a perfect_bvh.NodeProgram, got",
        ),
        (Appearance(world=World(image=0)), "world.image is 0 but there are 0 images"),
        (Appearance(backdrop=World(image=2)), "backdrop.image is 2 but there are 0 images"),
        (Appearance(world=World((math.nan, 0, 0))), "world.color must be three numbers"),
        (
            Appearance(materials=materials(programs=(image_program("COLOR", image=3),))),
            "materials.programs: instruction 1 refers to an image that does not exist",
        ),
        (Appearance(materials=materials(alphas=np.zeros(2, np.float32))), "materials.alphas has 2 rows"),
        (Appearance(plain_reflectance=1.5), "plain_reflectance must be .*, got 1.5"),
        (Appearance(plain_reflectance=math.nan), "plain_reflectance must be .*, got nan"),
        (Appearance(pass_alpha_threshold=1.5), "pass_alpha_threshold must be .*, got 1.5"),
        (Appearance(lights=lights(5)), "lights.kinds must be 0 to 4 .*, got 5"),
        (Appearance(lights=lights(0, power=math.inf)), "lights.powers must be finite, got inf"),
        (Appearance(lights=LightTable(kinds=np.zeros(1, np.int32))), "lights.positions must have a row for each"),
        (Appearance(hair=HairTable(surfaces=np.zeros(1, np.float32))), "hair.fibers must have a row for each"),
        (
            Appearance(materials=materials(hairs=np.zeros(1, np.int32))),
            "materials.hairs refers to row 0 but hair has 0",
        ),
        (
            Appearance(materials=materials(finishes=np.zeros(1, np.int32))),
            "materials.finishes refers to row 0 but finish has 0",
        ),
        (Appearance(finish=FinishTable(coats=np.full(1, 1.5, np.float32))), "finish.coats must be 0 to 1"),
        (Appearance(finish=FinishTable(stretches=np.zeros(1, np.float32))), "finish.stretches must be 0.01 to 100"),
        (Appearance(finish=FinishTable(rotations=np.full(1, math.nan, np.float32))), "finish.rotations must be"),
        (
            Appearance(finish=FinishTable(np.zeros((2, 3), np.float32), coats=np.zeros(1, np.float32))),
            "finish.coats has 1 rows, another column 2",
        ),
    ],
)
def test_bad_looks_are_refused(look, message):
    with pytest.raises(ValueError, match=f"render: appearance.{message}"):
        render(floor(), ABOVE, "preview", SIZE, 1, look)
