"""Denoised renders: the conditions, the guides, the data for scripts and compositors, and the library."""

from __future__ import annotations

import gc
import tempfile
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from blender.denoised import HEIGHT, SIZE, WIDTH, ask_for_data, combined, expect, lit_cube, render, trace  # noqa: E402
from oracles.cycles import write_multilayer  # noqa: E402
from oracles.exr import read_exr  # noqa: E402
from perfect_bvh import _oidn  # noqa: E402
from perfect_bvh.denoise import DenoiseQuality, denoise  # noqa: E402
from perfect_bvh_addon.image import denoising  # noqa: E402
from perfect_bvh_addon.image.denoising import ImageDenoiser  # noqa: E402
from perfect_bvh_addon.image.plan import GUIDES, NOISY, RenderPlan, plan_render, plan_view  # noqa: E402
from perfect_bvh_addon.settings import preferences  # noqa: E402
from perfect_bvh_addon.settings.modes import MODE_NAMES, MODES  # noqa: E402
from perfect_bvh_addon.settings.preferences import denoiser_in_use, denoiser_libraries  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402
from perfect_bvh_addon.statistics.last_result import statistics_rows  # noqa: E402


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    return lit_cube()


@pytest.mark.parametrize(("samples", "quality"), [(1, "fast"), (2, "fast"), (15, "fast"), (16, "high")])
def test_renders_are_denoised_unless_told_otherwise(
    scene: bpy.types.Scene, samples: int, quality: DenoiseQuality
) -> None:
    ask_for_data(scene)
    scene.perfect_bvh.samples = samples
    frame = render()
    assert set(frame.images) == {"combined", *GUIDES}
    images, noise = trace(scene)
    for name in GUIDES:
        np.testing.assert_array_equal(frame.images[name], images[name])
    np.testing.assert_array_equal(frame.images["combined"], expect(images, noise if samples > 1 else None, quality))
    assert frame.statistics.denoiser == denoiser_in_use() and frame.statistics.denoise_milliseconds > 0.0
    assert not frame.statistics.complaints
    assert "Denoise" in dict(statistics_rows(frame.statistics))


def test_without_it_the_image_is_the_renderer_s_for_any_threads(scene: bpy.types.Scene) -> None:
    scene.perfect_bvh.use_denoising = False
    scene.render.threads_mode = "FIXED"
    images = []
    for threads in (1, 3):
        scene.render.threads = threads
        frame = render()
        assert frame.statistics.denoiser is None and "Denoise" not in dict(statistics_rows(frame.statistics))
        images.append(frame.images["combined"])
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize("mode", [mode.name for mode in MODES if not mode.is_noisy])
def test_what_has_no_noise_is_never_denoised(scene: bpy.types.Scene, mode: str) -> None:
    scene.perfect_bvh.mode = mode.upper()
    frame = render()
    assert frame.statistics.denoiser is None
    np.testing.assert_array_equal(combined(scene, use_denoising=False), frame.images["combined"])


def test_data_is_no_noise() -> None:
    assert {mode.name for mode in MODES if mode.is_noisy} == {"preview", "clay"}
    assert not any(mode.is_noisy and mode.view is not None for mode in MODES) and len(MODES) == len(MODE_NAMES)


def test_a_border_is_denoised_alone(scene: bpy.types.Scene) -> None:
    ask_for_data(scene)
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.3, 0.71
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 0.9
    frame = render()
    left, right, bottom, top = plan_render(scene, read_settings(scene)).window
    part = slice(HEIGHT - top, HEIGHT - bottom), slice(left, right)
    images, noise = ({name: array[part] for name, array in made.items()} for made in trace(scene))
    np.testing.assert_array_equal(frame.images["combined"][part], expect(images, noise))
    outside = np.ones((HEIGHT, WIDTH), bool)
    outside[part] = False
    assert not frame.images["combined"][outside].any()


def test_what_is_opaque_or_not_there_stays_so(scene: bpy.types.Scene) -> None:
    scene.render.film_transparent = True
    scene.view_layers[0].objects["Plane"].hide_render = True
    made = render().images["combined"]
    raw = combined(scene, use_denoising=False)
    for alpha in (0.0, 1.0):
        surely = raw[..., 3] == alpha
        assert surely.any()
        np.testing.assert_allclose(made[surely, 3], alpha, atol=0.03)  # its samples are others
    assert not made[made[..., 3] == 0.0].any()
    assert made[..., 3].min() >= 0.0 and made[..., 3].max() <= 1.0


@pytest.mark.parametrize("blur", ["motion", "lens"])
def test_what_is_blurred_keeps_no_grain(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, blur: str) -> None:
    """Where guides are noisy themselves, the result is nearer to the converged image than with the raw guides."""
    cube, plane = bpy.data.objects["Cube"], bpy.data.objects["Plane"]
    for obj, color in ((cube, (0.8, 0.2, 0.05, 1.0)), (plane, (0.1, 0.4, 0.6, 1.0))):
        material = bpy.data.materials.new(obj.name)
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
        obj.data.materials.append(material)
    if blur == "motion":
        for frame, x in ((0, -1.5), (2, 1.5)):
            cube.location.x = x
            cube.keyframe_insert("location", frame=frame)
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
        scene.frame_set(1)
    else:
        lens = scene.camera.data.dof
        lens.use_dof, lens.focus_distance, lens.aperture_fstop = True, 4.0, 0.05
    few = {"samples": 16, "use_noise_threshold": False}
    truth = combined(scene, samples=512, use_noise_threshold=False, use_denoising=False)
    made = combined(scene, **few)
    monkeypatch.setattr(denoising, "BLURRED", "none")
    grainy = combined(scene, **few)

    def error(image: np.ndarray) -> float:
        return float(np.sqrt(np.mean((image[..., :3] - truth[..., :3]) ** 2)))

    assert error(made) < error(grainy)


def test_one_denoiser_serves_a_view_as_it_gets_better(scene: bpy.types.Scene) -> None:
    plan: RenderPlan = plan_view(read_settings(scene, is_viewport=True), SIZE)
    assert plan.is_denoised
    images, noise = trace(scene)
    viewer = ImageDenoiser(plan)
    for known in (None, noise, None):
        result = viewer.denoise(images, known)
        np.testing.assert_array_equal(result.image, expect(images, known))
        assert result.name == denoiser_in_use() and result.complaint is None


# Compositing ---------------------------------------------------------------------------------------------------------


def test_compositors_get_what_denoisers_need_under_cycles_names(scene: bpy.types.Scene) -> None:
    ask_for_data(scene)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "passes.exr"
        write_multilayer(path, scene, "PERFECT_BVH", is_denoised=True)
        planes = read_exr(path)
    images = render().images
    for name, source, channels in (
        ("Combined", "combined", "RGBA"),
        ("Noisy Image", NOISY, "RGBA"),
        ("Denoising Albedo", "denoising_albedo", "RGB"),
        ("Denoising Normal", "denoising_normal", "XYZ"),
    ):
        stack = np.stack([planes[f"{scene.view_layers[0].name}.{name}.{channel}"] for channel in channels], axis=-1)
        np.testing.assert_array_equal(stack, images[source])


def test_guides_are_traced_for_those_who_ask_alone(scene: bpy.types.Scene) -> None:
    scene.perfect_bvh.use_denoising = False
    plan = plan_render(scene, read_settings(scene))
    assert plan.traced_passes == ()
    assert plan_render(scene, read_settings(scene), GUIDES).traced_passes == GUIDES


# Libraries -----------------------------------------------------------------------------------------------------------


def test_blender_s_library_is_where_it_is_looked_for() -> None:
    assert all(path.exists() for path in denoiser_libraries())
    assert denoiser_in_use() == perfect_bvh.denoiser_name(denoiser_libraries())


@pytest.mark.parametrize(
    ("system", "places"),
    [
        ("linux", ["lib/libOpenImageDenoise.so.2"]),
        ("win32", ["blender.shared/OpenImageDenoise.dll"]),
        ("win32", ["OpenImageDenoise.dll"]),
        ("darwin", ["lib/libOpenImageDenoise.dylib"]),
        ("darwin", []),
        ("freebsd14", []),
    ],
)
def test_blender_s_library_is_found_where_each_system_s_blender_has_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, system: str, places: list[str]
) -> None:
    for place in places:
        (tmp_path / place).parent.mkdir(exist_ok=True)
        (tmp_path / place).touch()
    monkeypatch.setattr(preferences.bpy.utils, "resource_path", lambda _: str(tmp_path / "5.0"))
    monkeypatch.setattr(preferences.sys, "platform", system)
    assert denoiser_libraries() == tuple(tmp_path / place for place in places)


def test_the_memory_of_a_denoiser_goes_with_it_and_waits_for_no_collector(monkeypatch: pytest.MonkeyPatch) -> None:
    filters: list[weakref.ref[_oidn.Filter]] = []
    make = _oidn.Filter.__init__

    def note(made: _oidn.Filter, *given: Any, **switches: bool) -> None:
        filters.append(weakref.ref(made))
        make(made, *given, **switches)

    monkeypatch.setattr(_oidn.Filter, "__init__", note)
    image = np.ones((32, 32, 3), np.float32)
    gc.disable()
    try:
        denoise(image, image, backend="oidn", libraries=denoiser_libraries())
        assert [made() for made in filters] == [None, None]
    finally:
        gc.enable()
