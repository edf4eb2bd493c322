"""The pass "vector": the motion in the image of the surface that each pixel shows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from perfect_bvh import Camera, Scene, Shutter

SIZE = (40, 20)
QUAD = [(0, 1, 2), (0, 2, 3)]
# Looks along +Y from the origin: a window of 2 x 1 at a distance of 1, so that a pixel is 1 / 20.
CAMERA = Camera.look_at((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), aspect=2.0, angle=np.pi / 2)
PIXEL = 0.05
WALL = np.array([(-9, 2, -9), (9, 2, -9), (9, 2, 9), (-9, 2, 9)], np.float32)


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> npt.NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def wall(steps: list[npt.NDArray[np.float64]] | None = None) -> Scene:
    """Two metres ahead."""
    scene = Scene()
    instance = scene.add_instance(scene.add_mesh(WALL, QUAD))
    if steps:
        scene.set_instance_motion([instance], np.stack(steps)[:, None])
    scene.commit()
    return scene


def vectors(scene: Scene, shutter: Shutter | None, camera: Camera = CAMERA, **asked: Any) -> npt.NDArray[np.float32]:
    made: npt.NDArray[np.float32] = perfect_bvh.render_passes(
        scene, camera, size=SIZE, passes=("vector",), shutter=shutter, **asked
    )["vector"]
    return made


def test_it_goes_from_before_to_after_to_the_right_and_up() -> None:
    """A wall that has moved by .2 to the right and will by .4 more, which are 2 and 4 pixels; up and down again."""
    scene = wall([moved(-0.2, 0.0, -0.1), moved(), moved(0.4, 0.0, -0.1)])
    found = vectors(scene, Shutter())
    # Where it was seen from here; here seen from where it will be: Blender's signs.
    assert np.allclose(found, [-2.0, -1.0, -4.0, 1.0], atol=1e-4)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_camera_that_moves_makes_still_things_move(projection: Any) -> None:
    cameras = tuple(replace(CAMERA, matrix=moved(x) @ CAMERA.matrix, projection=projection) for x in (-0.2, 0.0, 0.2))
    found = vectors(wall(), Shutter(cameras=cameras), cameras[1])
    pixels = 2.0 if projection == "perspective" else 4.0
    assert np.allclose(found, [pixels, 0.0, pixels, 0.0], atol=1e-4)


def test_zooming_moves_what_is_not_in_the_middle() -> None:
    wide = replace(CAMERA, window=tuple(2.0 * edge for edge in CAMERA.window))
    found = vectors(
        wall(), Shutter(cameras=(wide, replace(CAMERA, window=tuple(1.5 * e for e in CAMERA.window)), CAMERA))
    )
    columns, rows = np.meshgrid(np.arange(SIZE[0]) + 0.5 - SIZE[0] / 2, SIZE[1] / 2 - np.arange(SIZE[1]) - 0.5)
    before, after = 1.5 / 2.0 - 1.0, 1.0 - 1.5
    expected = np.stack([columns * before, rows * before, columns * after, rows * after], axis=-1)
    assert np.allclose(found, expected, atol=1e-4)


def test_vertices_curves_and_points_move() -> None:
    scene = Scene()
    shapes = np.stack([WALL + np.float32([-0.2, 0, 0]), WALL, WALL + np.float32([0.2, 0, 0])])
    mesh = scene.add_mesh(WALL, QUAD)
    scene.add_instance(mesh)
    scene.set_mesh_motion(mesh, shapes)
    curve = np.array([(-2, 1, -0.3), (2, 1, -0.3)], np.float32)
    ball = np.array([(0, 1, 0.3)], np.float32)
    up = np.float32([0, 0, 0.1])
    curves = scene.add_curves(curve, np.full(2, 0.05, np.float32), np.array([0, 2]))
    scene.add_instance(curves)
    scene.set_curves_motion(curves, np.stack([curve, curve + up / 2, curve + up]))
    points = scene.add_points(ball, np.full(1, 0.1, np.float32))
    scene.add_instance(points)
    scene.set_points_motion(points, np.stack([ball - up, ball, ball + up]))
    scene.commit()
    passes = perfect_bvh.render_passes(scene, CAMERA, size=SIZE, passes=("vector", "instance"), shutter=Shutter())
    seen, found = passes["instance"], passes["vector"]
    assert np.allclose(found[seen == 0], [-2, 0, -2, 0], atol=1e-4)
    assert (seen == 1).any() and (seen == 2).any()
    for instance, pixels in ((1, 1.0), (2, 2.0)):
        # A little more than the axis moves: these surfaces are nearer than it.
        assert np.allclose(found[seen == instance], [0, -pixels, 0, -pixels], atol=0.25)


def test_a_panorama_goes_round() -> None:
    """A surface that leaves on one side and comes back on the other has moved by the short way."""
    panorama = replace(CAMERA, projection="equirectangular", window=(-np.pi, np.pi, -np.pi / 2, np.pi / 2))
    behind = np.array([(-2, -2, -9), (2, -2, -9), (2, -2, 9), (-2, -2, 9)], np.float32)
    scene = Scene()
    instance = scene.add_instance(scene.add_mesh(behind, QUAD))
    scene.set_instance_motion([instance], np.stack([moved(-0.5), moved(), moved(0.5)])[:, None])
    scene.commit()
    found = vectors(scene, Shutter(), panorama)
    moving = (found != 0.0).any(axis=2)
    assert moving[:, 0].any() and moving[:, -1].any()
    assert np.abs(found[moving]).max() < SIZE[0] / 8


def test_nothing_moves_where_nothing_is_or_was_in_sight() -> None:
    nothing = Scene()
    nothing.commit()
    assert not vectors(nothing, Shutter()).any()
    assert not vectors(wall([moved(-1.0), moved(1.0)]), None).any()
    behind = vectors(wall([moved(0.0, -4.0, 0.0), moved(), moved(0.1)]), Shutter())
    assert not behind[..., :2].any() and np.allclose(behind[..., 2], -1.0, atol=1e-4)
