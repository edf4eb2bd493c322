"""Denoised renders: when, with what, what scripts and compositors get, and what happens when denoising fails."""

from __future__ import annotations

import gc
import itertools
import tempfile
import weakref
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from oracles.cycles import preserved, write_multilayer  # noqa: E402
from oracles.exr import read_exr  # noqa: E402
from perfect_bvh import _oidn  # noqa: E402
from perfect_bvh.denoise import DenoiseQuality, Prefilter, denoise  # noqa: E402
from perfect_bvh_addon.engine import RenderJob, attend  # noqa: E402
from perfect_bvh_addon.image import denoising  # noqa: E402
from perfect_bvh_addon.image.denoising import ImageDenoiser  # noqa: E402
from perfect_bvh_addon.image.plan import GUIDES, NOISY, RenderPlan, plan_render, plan_view  # noqa: E402
from perfect_bvh_addon.image.still import Frame  # noqa: E402
from perfect_bvh_addon.live.scene_sync import SceneSync  # noqa: E402
from perfect_bvh_addon.settings import denoisers  # noqa: E402
from perfect_bvh_addon.settings.denoisers import denoiser_in_use, denoiser_libraries  # noqa: E402
from perfect_bvh_addon.settings.modes import MODE_NAMES, MODES  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402
from perfect_bvh_addon.statistics.summary import statistics_rows  # noqa: E402

SIZE = WIDTH, HEIGHT = 96, 54


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    """A cube on a floor under a lamp, seen obliquely, in few samples."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 1.0))
    bpy.ops.object.light_add(type="POINT", location=(3.0, -4.0, 5.0))
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 500.0, 1.0
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (7.0, -7.0, 5.0), (1.109, 0.0, 0.785)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.perfect_bvh.samples = 2
    return scene


def render(job: RenderJob | None = None) -> Frame:
    with attend(job or RenderJob()) as attended:
        bpy.ops.render.render()
    assert attended.frame is not None
    return attended.frame


def combined(scene: bpy.types.Scene, **settings: object) -> np.ndarray:
    """Of a render with other settings."""
    with preserved(*((scene.perfect_bvh, name, value) for name, value in settings.items())):
        return render().images["combined"]


def ask_for_data(scene: bpy.types.Scene) -> None:
    scene.view_layers[0].cycles.denoising_store_passes = True


# When ----------------------------------------------------------------------------------------------------------------


def expect(
    images: Mapping[str, np.ndarray], noise: Mapping[str, np.ndarray] | None, quality: DenoiseQuality = "fast"
) -> np.ndarray:
    """What is to come of a traced image."""
    color, *guides = (images[name] for name in GUIDES)
    prefilter: Prefilter = "fast" if quality == "fast" else "none"
    clean = denoise(color, *guides, quality=quality, prefilter=prefilter)
    if noise is None:
        return clean
    with_noise, without = (
        denoise(image, *guides, quality="fast", prefilter=prefilter) for image in (color, color - noise[NOISY])
    )
    return perfect_bvh.restore_detail(images["combined"], noise["combined"], clean, with_noise - without, *guides)


def trace(scene: bpy.types.Scene) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The images of a render before they are denoised, and their noise."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plan = plan_render(scene, read_settings(scene))
    sync = SceneSync(attributes=plan.attributes)
    sync.update(depsgraph)
    noise: dict[str, np.ndarray] = {}
    *_, (_, images) = perfect_bvh.render_progressively(
        sync.scene,
        sync.camera,
        mode=plan.settings.mode,
        size=plan.size,
        samples=plan.samples,
        appearance=sync.appearance,
        passes=("combined", *GUIDES),
        sampling=plan.make_sampling(),
        noise=noise,
        **plan.options,
    )
    return images, noise


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
        np.testing.assert_allclose(made[surely, 3], alpha, atol=0.02)
    assert not made[made[..., 3] == 0.0].any()
    assert made[..., 3].min() >= 0.0 and made[..., 3].max() <= 1.0


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


# Failures ------------------------------------------------------------------------------------------------------------


class Failing:
    """In place of a denoiser."""

    complaints = ()
    name = "Failing"

    def __init__(self, problem: BaseException, at_once: bool) -> None:
        self._problem, self._at_once = problem, at_once

    def __call__(self, *_: object, **__: object) -> Failing:
        if self._at_once:
            raise self._problem
        return self

    def denoise(self, *_: object, **__: object) -> np.ndarray:
        raise self._problem


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (perfect_bvh.EngineError("it is broken"), "it is broken"),
        (MemoryError(), "there is no memory left"),
        (ValueError("no"), "no"),
    ],
)
def test_a_failure_leaves_the_raw_image_and_says_so(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, problem: BaseException, reason: str, at_once: bool
) -> None:
    ask_for_data(scene)  # so that pixels share no samples here either
    raw = combined(scene, use_denoising=False)
    monkeypatch.setattr(perfect_bvh, "Denoiser", Failing(problem, at_once))
    frame = render()
    np.testing.assert_array_equal(frame.images["combined"], raw)
    assert frame.statistics.denoiser is None
    assert frame.statistics.complaints == (f"The image is not denoised: {reason}",)


def test_too_little_memory_is_found_before(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(denoising, "MOST_BYTES", 1 << 60)
    monkeypatch.setattr(denoising, "BYTES_A_PIXEL", 1 << 50)
    (complaint,) = render().statistics.complaints
    assert complaint.startswith("The image is not denoised: Denoising it needs about") and "are free" in complaint


def test_a_library_that_is_there_and_does_not_work_is_told_of(
    scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    broken = tmp_path / "libOpenImageDenoise.so.2"
    broken.write_text("no library")
    monkeypatch.setattr(denoising, "denoiser_libraries", lambda: (broken,))
    frame = render()
    (complaint,) = frame.statistics.complaints
    assert complaint.startswith(f"{frame.statistics.denoiser} denoises in place of another: ")
    assert str(broken) in complaint


def test_a_render_is_cancelled_while_it_is_denoised(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perfect_bvh, "Denoiser", Failing(perfect_bvh.Cancelled("cancelled"), False))
    job = RenderJob()
    with attend(job):
        bpy.ops.render.render()
    assert job.is_cancelled and job.frame is None


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
    monkeypatch.setattr(denoisers.bpy.utils, "resource_path", lambda _: str(tmp_path / "5.0"))
    monkeypatch.setattr(denoisers.sys, "platform", system)
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


def test_one_denoiser_serves_a_view_as_it_gets_better(scene: bpy.types.Scene) -> None:
    plan: RenderPlan = plan_view(read_settings(scene, is_viewport=True), SIZE)
    assert plan.is_denoised
    images, noise = trace(scene)
    viewer = ImageDenoiser(plan)
    for known in (None, noise, None):
        result = viewer.denoise(images, known)
        np.testing.assert_array_equal(result.image, expect(images, known))
        assert result.name == denoiser_in_use() and result.complaint is None


# Sampling ------------------------------------------------------------------------------------------------------------


def test_viewports_and_renders_have_samples_and_switches_of_their_own(scene: bpy.types.Scene) -> None:
    settings = scene.perfect_bvh
    settings.samples, settings.viewport_samples, settings.time_limit = 7, 5, 3.0
    settings.use_denoising, settings.use_viewport_denoising = True, False
    still, view = read_settings(scene), read_settings(scene, is_viewport=True)
    assert (still.samples, still.denoise, still.time_limit) == (7, True, 3.0)
    assert (view.samples, view.denoise, view.time_limit) == (5, False, 0.0)


def test_a_viewport_of_an_older_file_takes_as_many_samples_as_it_did(scene: bpy.types.Scene) -> None:
    """There was one number for both: where the viewport has none of its own, that holds."""
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
    from perfect_bvh_addon.cli import build_parser
    from perfect_bvh_addon.cli.blender import apply_settings

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
    from perfect_bvh_addon.cli import build_parser

    with pytest.raises(SystemExit):
        build_parser("perfect-bvh").parse_args(["render", "scene.blend", "-o", "out.png", *itertools.chain(wrong)])
