"""Uv maps and colours by name, and images of several tiles, in the mode "preview"."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from engine.node_programs import colors_program, image_program
from perfect_bvh import Camera, Scene, render
from perfect_bvh.appearance import Appearance, ImageTexture, InstanceTable, MaterialTable, MeshAppearance, World
from perfect_bvh.nodes import NodeBuilder

FLOOR = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
SIZE = (32, 32)
ABOVE = Camera.look_at((0, 0, 5), (0, 0, 0), up=(0, 1, 0), angle=math.radians(22), aspect=1.0)
BLACK = np.zeros((1, 3), np.float32)


def corners(*places: tuple[float, ...]) -> Any:
    """Returns the corners of the floor's two triangles from its four corners."""
    return np.float32(places)[QUAD]


def plain(*color: float, size: tuple[int, int] = (2, 2)) -> Any:
    return np.tile(np.float32((*color, 1.0)), (*size, 1))


def floor_with(**fields: Any) -> Appearance:
    """A floor of one material that emits the first image."""
    table = MaterialTable(
        np.ones((1, 4), np.float32),
        np.zeros(1, np.int32),
        base_colors=BLACK,
        emissions=np.ones((1, 3), np.float32),
        programs=(image_program("EMISSION"),),
    )
    instances = InstanceTable(
        ids=np.zeros(1, np.int32),
        slot_offsets=np.array([0, 1], np.int32),
        slot_materials=np.zeros(1, np.int32),
        object_indices=np.zeros(1, np.int32),
        holdout=np.zeros(1, np.bool_),
    )
    return Appearance(**{"instances": instances, "materials": table, "world": World(), **fields})


def picture(look: Appearance) -> Any:
    scene = Scene()
    scene.add_instance(scene.add_mesh(FLOOR, QUAD))
    scene.commit()
    return render(scene, ABOVE, "preview", SIZE, 4, look)[..., :3]


def test_each_image_is_looked_up_in_its_own_map():
    """One has its left half seen, the other its upper one."""
    halves = np.zeros((2, 2, 4), np.float32)
    halves[:, 0] = (1, 0, 0, 1)
    halves[:, 1] = (0, 1, 0, 1)
    left = corners((0.2, 0), (0.2, 0), (0.2, 1), (0.2, 1))
    right = corners((0.8, 0), (0.8, 0), (0.8, 1), (0.8, 1))
    mesh = MeshAppearance(corner_uvs=left, named_uvs={"b": right, "unused": right, "a": left})
    for name, expected in (("", (1, 0, 0)), ("a", (1, 0, 0)), ("b", (0, 1, 0)), ("none", (1, 0, 0))):
        materials = replace(floor_with().materials, programs=(image_program("EMISSION", layer=name),))
        look = floor_with(meshes={0: mesh}, images=(ImageTexture(halves, "extend"),), materials=materials)
        assert picture(look)[16, 16] == pytest.approx(expected, abs=1e-5), name
    nodes = NodeBuilder()
    shown = [nodes.add("image", nodes.add("input", mode="UV", layer=name), mode="FLAT", numbers=[0]) for name in "ba"]
    materials = replace(floor_with().materials, programs=(nodes.program(EMISSION=shown[0], COLOR=shown[1]),))
    image = (ImageTexture(halves, "extend"),)
    look = floor_with(meshes={0: mesh}, images=image, materials=materials, world=World((0.5, 0.5, 0.5)))
    assert picture(look)[16, 16] == pytest.approx((0.5, 1, 0), abs=0.02)


def test_each_material_is_tinted_with_the_colors_that_it_names():
    red, blue = (np.tile(np.float32(color), (2, 3, 1)) for color in ((1, 0, 0), (0, 0, 1)))
    mesh = MeshAppearance(corner_colors=red, named_colors={"blue": blue})
    for name, expected in (("", (1, 0, 0)), ("blue", (0, 0, 1)), ("none", (0, 0, 0)), (None, (1, 1, 1))):
        program = None if name is None else colors_program(name)
        materials = MaterialTable(np.ones((1, 4), np.float32), np.zeros(1, np.int32), programs=(program,))
        look = floor_with(meshes={0: mesh}, materials=materials, world=World((1.0, 1.0, 1.0)))
        assert picture(look)[16, 16] == pytest.approx(expected, abs=0.02), name


TILES = {1001: plain(1, 0, 0), 1002: plain(0, 1, 0, size=(3, 1)), 1022: plain(0, 0, 1)}
MAGENTA = (1, 0, 1)


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((0.5, 0.5), (1, 0, 0)),
        ((1.5, 0.5), (0, 1, 0)),
        ((1.5, 2.5), (0, 0, 1)),
        ((0.5, 1.5), MAGENTA),
        ((2.5, 0.5), MAGENTA),
        ((1.5, 3.5), MAGENTA),
        ((10.5, 0.5), MAGENTA),
        ((-0.5, 0.5), (1, 0, 0)),
        ((0.5, -0.5), (1, 0, 0)),
        ((-1.5, 0.5), MAGENTA),
        ((1e30, math.nan), MAGENTA),
    ],
)
def test_a_place_shows_the_tile_that_lies_there(place, expected):
    mesh = MeshAppearance(corner_uvs=corners(place, place, place, place))
    look = floor_with(meshes={0: mesh}, images=(ImageTexture(plain(0.5, 0.5, 0.5), tiles=TILES),))
    assert picture(look)[16, 16] == pytest.approx(expected, abs=1e-5)


def test_layers_and_tiles_are_checked():
    bad = [
        (
            ImageTexture(plain(1, 1, 1), tiles={1000: plain(1, 1, 1)}),
            "a key of .*tiles must be an integer from 1001 to",
        ),
        (ImageTexture(plain(1, 1, 1), tiles={1001: np.zeros((2, 2))}), r"tiles\[1001\] must have shape"),
    ]
    for image, message in bad:
        with pytest.raises(ValueError, match=message):
            picture(floor_with(images=(image,)))
    short = MeshAppearance(named_uvs={"map": np.zeros((1, 3, 2), np.float32)})
    materials = replace(floor_with().materials, programs=(image_program("EMISSION", layer="map"),))
    with pytest.raises(ValueError, match="corner_uvs has 1 rows but the mesh has 2 triangles"):
        picture(floor_with(meshes={0: short}, images=(ImageTexture(plain(1, 1, 1)),), materials=materials))
