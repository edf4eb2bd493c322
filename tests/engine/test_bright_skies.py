"""Bright regions of a world's image are found once if the image cannot change, and at every render if it can."""

from __future__ import annotations

import gc

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from perfect_bvh import Appearance, Camera, ImageTexture, Scene, World, _render_arguments

Floats = npt.NDArray[np.float32]


def sun_at(column: int) -> Floats:
    """(32, 64, 4): a dim sky with one bright pixel above the horizon."""
    pixels = np.full((32, 64, 4), 0.1, np.float32)
    pixels[28, column] = 5000.0
    return pixels


def closed(pixels: Floats) -> Floats:
    pixels.flags.writeable = False
    return pixels


def show(pixels: Floats) -> Floats:
    """A floor under it, seen from above."""
    scene = Scene()
    corners = np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], np.float32)
    scene.add_instance(scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)))
    scene.commit()
    matrix = np.eye(4)
    matrix[2, 3] = 5.0
    camera = Camera(matrix, window=(-0.5, 0.5, -0.5, 0.5))
    look = Appearance(images=(ImageTexture(pixels),), world=World((1.0, 1.0, 1.0), image=0))
    return np.asarray(perfect_bvh.render(scene, camera, "preview", (16, 16), 4, look))


def test_the_picture_is_the_same_whether_it_is_kept_or_not() -> None:
    image = closed(sun_at(10))
    first, again = show(image), show(image)
    assert np.array_equal(first, show(sun_at(10))) and np.array_equal(first, again)


def test_it_is_found_once_and_forgotten_with_the_image(monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    make = _render_arguments._core.make_bright_sky
    monkeypatch.setattr(_render_arguments._core, "make_bright_sky", lambda *given: made.append(1) or make(*given))
    before = len(_render_arguments._found)
    image = closed(sun_at(10))
    show(image), show(image)
    assert len(made) == 1 and len(_render_arguments._found) == before + 1
    del image
    gc.collect()
    assert len(_render_arguments._found) == before


def test_what_is_written_into_an_image_is_seen() -> None:
    image = sun_at(10)
    show(image)
    image[...] = sun_at(40)
    assert np.array_equal(show(image), show(closed(sun_at(40))))


def test_a_view_of_writable_memory_is_not_kept() -> None:
    memory = sun_at(10)
    view = memory[:]
    view.flags.writeable = False
    show(view)
    memory[...] = sun_at(40)
    assert np.array_equal(show(view), show(sun_at(40)))
