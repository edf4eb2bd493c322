"""Samples, seeds and time limits, in settings and on the command line."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.denoised import HEIGHT, WIDTH, combined, lit_cube, render  # noqa: E402
from perfect_bvh_addon.cli import build_parser  # noqa: E402
from perfect_bvh_addon.cli.blender import apply_settings  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    return lit_cube()


def test_viewports_and_renders_have_samples_and_switches_of_their_own(scene: bpy.types.Scene) -> None:
    settings = scene.perfect_bvh
    settings.samples, settings.viewport_samples, settings.time_limit = 7, 5, 3.0
    settings.use_denoising, settings.use_viewport_denoising = True, False
    still, view = read_settings(scene), read_settings(scene, is_viewport=True)
    assert (still.samples, still.denoise, still.time_limit) == (7, True, 3.0)
    assert (view.samples, view.denoise, view.time_limit) == (5, False, 0.0)


def test_a_viewport_of_an_older_file_takes_as_many_samples_as_it_did(scene: bpy.types.Scene) -> None:
    """Older files have one number for both. It applies if the viewport's own number is not set."""
    scene.perfect_bvh.samples = 48
    assert read_settings(scene, is_viewport=True).samples == read_settings(scene).samples == 48


def test_another_seed_gives_another_noise(scene: bpy.types.Scene) -> None:
    scene.perfect_bvh.use_denoising = False
    first, again, other = (combined(scene, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3


def test_a_time_limit_leaves_the_first_sample(scene: bpy.types.Scene) -> None:
    scene.perfect_bvh.use_denoising, scene.perfect_bvh.samples = False, 4096
    first = combined(scene, time_limit=1e-6)
    scene.perfect_bvh.time_limit = 1e-5
    frame = render()
    np.testing.assert_array_equal(frame.images["combined"], first)
    assert frame.statistics.camera_rays == WIDTH * HEIGHT


def test_a_time_limit_that_is_long_enough_changes_nothing(scene: bpy.types.Scene) -> None:
    np.testing.assert_array_equal(combined(scene, time_limit=1e6), combined(scene))


def test_the_command_line_says_as_much(scene: bpy.types.Scene) -> None:
    command = ["render", "scene.blend", "-o", "out.png"]
    settings = scene.perfect_bvh
    settings.use_denoising, settings.time_limit, settings.seed = False, 4.0, 9
    apply_settings(scene, build_parser("perfect-bvh").parse_args(command))
    assert (settings.use_denoising, settings.time_limit, settings.seed) == (False, 4.0, 9)
    apply_settings(
        scene, build_parser("perfect-bvh").parse_args([*command, "--denoise", "--time-limit", "0", "--seed", "0"])
    )
    assert (settings.use_denoising, settings.time_limit, settings.seed) == (True, 0.0, 0)
    apply_settings(scene, build_parser("perfect-bvh").parse_args([*command, "--no-denoise"]))
    assert not settings.use_denoising


@pytest.mark.parametrize("wrong", [("--time-limit", "-1"), ("--time-limit", "nan"), ("--seed", "-1"), ("--seed", "x")])
def test_the_command_line_refuses_what_makes_no_sense(wrong: tuple[str, str]) -> None:
    with pytest.raises(SystemExit):
        build_parser("perfect-bvh").parse_args(["render", "scene.blend", "-o", "out.png", *wrong])
