"""The noise threshold as users set it: properties, panel, command line, and its effect on a render."""

from __future__ import annotations

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from blender.denoised import HEIGHT, SIZE, WIDTH, lit_cube, render  # noqa: E402
from perfect_bvh_addon.cli import build_parser  # noqa: E402
from perfect_bvh_addon.cli.blender import apply_settings  # noqa: E402
from perfect_bvh_addon.image.plan import plan_render  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402
from perfect_bvh_addon.statistics.last_result import statistics_rows  # noqa: E402

COMMAND = ("render", "scene.blend", "-o", "out.png")


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    """A lit cube seen from further away: above the cube only the world is visible."""
    scene = lit_cube()
    scene.camera.location, scene.camera.rotation_euler = (9.0, -9.0, 4.0), (1.309, 0.0, 0.785)
    scene.perfect_bvh.samples, scene.perfect_bvh.use_denoising = 64, False
    return scene


def test_renders_and_viewports_have_thresholds_of_their_own(scene: bpy.types.Scene) -> None:
    for is_viewport, kind, default in ((False, "", 0.01), (True, "viewport_", 0.1)):
        found = read_settings(scene, is_viewport)
        assert (found.noise_threshold, found.min_samples) == (pytest.approx(default), 0)
        setattr(scene.perfect_bvh, f"{kind}noise_threshold", 0.25)
        setattr(scene.perfect_bvh, f"{kind}min_samples", 5)
        found, other = read_settings(scene, is_viewport), read_settings(scene, not is_viewport)
        assert (found.noise_threshold, found.min_samples) == (0.25, 5)
        assert other != found
        sampling = plan_render(scene, found).make_sampling()
        assert sampling is not None
        assert (sampling.size, sampling.threshold, sampling.min_samples) == (SIZE, 0.25, 5)
        setattr(scene.perfect_bvh, f"use_{kind}noise_threshold", False)
        assert read_settings(scene, is_viewport).noise_threshold == 0.0
        assert plan_render(scene, read_settings(scene, is_viewport)).make_sampling() is None


@pytest.mark.parametrize("denoise", [False, True])
def test_a_render_has_fewer_samples_where_that_is_enough(scene: bpy.types.Scene, denoise: bool) -> None:
    settings = scene.perfect_bvh
    settings.use_denoising, settings.use_noise_threshold = denoise, False
    whole = render()
    assert whole.statistics.samples == 64 and whole.statistics.camera_rays == 64 * WIDTH * HEIGHT
    settings.use_noise_threshold = True
    settings.noise_threshold = 0.0
    np.testing.assert_array_equal(render().images["combined"], whole.images["combined"])
    settings.noise_threshold = 0.03
    frame = render()
    assert 16 <= frame.statistics.samples < 64
    assert frame.statistics.camera_rays == pytest.approx(frame.statistics.samples * WIDTH * HEIGHT)
    assert dict(statistics_rows(frame.statistics))["Samples"] == f"{frame.statistics.samples:.4g} per pixel"
    difference = np.abs(frame.images["combined"] - whole.images["combined"])
    assert 0.0 < difference.mean() < 0.02
    assert np.isfinite(frame.images["combined"]).all()


def test_data_is_what_it_was(scene: bpy.types.Scene) -> None:
    scene.perfect_bvh.mode = "NORMAL"
    scene.perfect_bvh.noise_threshold = 1.0
    frame = render()
    assert frame.statistics.samples == 64
    scene.perfect_bvh.use_noise_threshold = False
    np.testing.assert_array_equal(render().images["combined"], frame.images["combined"])


def test_a_border_counts_its_own_pixels(scene: bpy.types.Scene) -> None:
    settings = scene.render
    settings.use_border = True
    settings.border_min_x, settings.border_max_x = 0.25, 0.75
    settings.border_min_y, settings.border_max_y = 0.5, 1.0
    scene.perfect_bvh.noise_threshold = 1.0
    frame = render()
    assert frame.statistics.samples == 16
    assert frame.statistics.camera_rays == 16 * plan_render(scene, read_settings(scene)).pixel_count


def test_the_command_line_sets_it_and_turns_it_off(scene: bpy.types.Scene) -> None:
    settings = scene.perfect_bvh
    settings.noise_threshold, settings.use_noise_threshold = 0.5, False
    apply_settings(scene, build_parser("perfect-bvh").parse_args(COMMAND))
    assert (settings.use_noise_threshold, settings.noise_threshold) == (False, 0.5)
    apply_settings(scene, build_parser("perfect-bvh").parse_args([*COMMAND, "--noise-threshold", "0.125"]))
    assert (settings.use_noise_threshold, settings.noise_threshold) == (True, 0.125)
    apply_settings(scene, build_parser("perfect-bvh").parse_args([*COMMAND, "--noise-threshold", "0"]))
    assert read_settings(scene).noise_threshold == 0.0


@pytest.mark.parametrize("wrong", ["-0.1", "nan", "2", "much"])
def test_the_command_line_refuses_what_makes_no_sense(wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        build_parser("perfect-bvh").parse_args([*COMMAND, f"--noise-threshold={wrong}"])
    assert "--noise-threshold" in capsys.readouterr().err
