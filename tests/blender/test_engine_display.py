"""Pixels in files: pictures go through the scene's view transform, palettes are sRGB, values are unchanged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from oracles.exr import read_exr

bpy = pytest.importorskip("bpy")

from oracles.png import read_png  # noqa: E402
from perfect_bvh_addon.image.saving import fixed_output, save_image  # noqa: E402
from perfect_bvh_addon.settings.modes import find_mode  # noqa: E402

PICTURE, PALETTE, VALUES = find_mode("clay"), find_mode("instance"), find_mode("normal")


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context.scene


@pytest.fixture
def ramp() -> npt.NDArray[np.float32]:
    """(2, 5, 4): a grey ramp above an opaque, a half transparent and clear pixels, with associated alpha."""
    pixels = np.zeros((2, 5, 4), np.float32)
    pixels[0, :, :3] = np.linspace(0.0, 1.0, 5)[:, None]
    pixels[0, :, 3] = 1.0
    pixels[1, 0] = 1.0
    pixels[1, 1] = (0.25, 0.125, 0.0, 0.5)
    return pixels


def srgb(linear: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_values_are_saved_raw_whatever_the_scene_looks_like(scene, ramp, tmp_path: Path) -> None:
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.exposure = 2.0
    scene.view_settings.gamma = 1.5
    save_image(tmp_path / "data.png", ramp, scene, VALUES)
    np.testing.assert_array_equal(read_png(tmp_path / "data.png")[0, :, 0], [0, 64, 128, 191, 255])


def test_a_palette_is_plain_srgb_whatever_the_scene_looks_like(scene, ramp, tmp_path: Path) -> None:
    scene.view_settings.view_transform = "Filmic"
    scene.view_settings.exposure = 2.0
    save_image(tmp_path / "palette.png", ramp, scene, PALETTE)
    expected = np.rint(srgb(ramp[0, :, 0]) * 255)
    np.testing.assert_array_equal(read_png(tmp_path / "palette.png")[0, :, 0], expected)


def test_a_picture_follows_the_view_transform(scene, ramp, tmp_path: Path) -> None:
    scene.view_settings.view_transform = "Standard"
    scene.render.dither_intensity = 0.0
    save_image(tmp_path / "standard.png", ramp, scene, PICTURE)
    expected = np.rint(srgb(ramp[0, :, 0]) * 255)
    np.testing.assert_array_equal(read_png(tmp_path / "standard.png")[0, :, 0], expected)
    scene.view_settings.exposure = -1.0
    save_image(tmp_path / "darker.png", ramp, scene, PICTURE)
    expected = np.rint(srgb(ramp[0, :, 0] / 2) * 255)
    np.testing.assert_array_equal(read_png(tmp_path / "darker.png")[0, :, 0], expected)


def test_the_first_row_is_on_top_and_alpha_is_kept_for_a_transparent_film(scene, ramp, tmp_path: Path) -> None:
    scene.render.film_transparent = True
    save_image(tmp_path / "alpha.png", ramp, scene, VALUES)
    pixels = read_png(tmp_path / "alpha.png")
    assert pixels.shape == (2, 5, 4)
    np.testing.assert_array_equal(pixels[0, :, 3], 255)
    np.testing.assert_array_equal(pixels[1], [[255] * 4, [128, 64, 0, 128], [0] * 4, [0] * 4, [0] * 4])


def test_openexr_keeps_the_values(scene, ramp, tmp_path: Path) -> None:
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.exr_codec = "NONE"
    values = ramp * np.float32(1000.125)
    values[..., 3] = ramp[..., 3]
    save_image(tmp_path / "values.exr", values, scene, PICTURE)
    planes = read_exr(tmp_path / "values.exr")
    np.testing.assert_array_equal(np.stack([planes[channel] for channel in "RGBA"], axis=-1), values)


def test_saving_leaves_the_scene_as_it_was(scene, ramp, tmp_path: Path) -> None:
    def state() -> tuple[object, ...]:
        settings = scene.render.image_settings
        view = scene.view_settings
        return (
            settings.file_format,
            settings.color_mode,
            settings.color_depth,
            settings.color_management,
            scene.render.dither_intensity,
            view.view_transform,
            view.look,
            view.exposure,
            len(bpy.data.images),
        )

    scene.view_settings.look = "AgX - Punchy"
    scene.render.image_settings.file_format = "TIFF"
    scene.render.image_settings.color_depth = "16"
    before = state()
    for mode in (PICTURE, PALETTE, VALUES):
        save_image(tmp_path / "image.png", ramp, scene, mode)
    assert state() == before


def test_an_output_that_overrides_its_own_colours_is_respected(scene) -> None:
    settings = scene.render.image_settings
    settings.color_management = "OVERRIDE"
    settings.view_settings.view_transform = "Filmic"
    with fixed_output(scene, "Raw"):
        assert settings.view_settings.view_transform == "Filmic"
    assert settings.color_management == "OVERRIDE"


def test_an_unwritable_file_is_an_os_error(scene, ramp, tmp_path: Path) -> None:
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(OSError, match=r"taken\.png"):
        save_image(tmp_path / "taken.png", ramp, scene, PICTURE)
