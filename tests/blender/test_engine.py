"""The render engine, headless: passes, borders, film, animation, cancelling, and errors."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from blender.long_builds import HALF, Gate  # noqa: E402
from oracles.cycles import Passes, preserved, render_passes  # noqa: E402
from oracles.png import read_png  # noqa: E402
from perfect_bvh_addon import engine  # noqa: E402
from perfect_bvh_addon.engine import RenderJob, attend  # noqa: E402
from perfect_bvh_addon.extract import camera  # noqa: E402
from perfect_bvh_addon.extract.camera import border_pixels, panorama_settings  # noqa: E402
from perfect_bvh_addon.image import still  # noqa: E402
from perfect_bvh_addon.image.progressive import SHOW_SECONDS  # noqa: E402
from perfect_bvh_addon.statistics import last_result  # noqa: E402

BACKGROUND_DEPTH = 1e10


@pytest.fixture
def scene(registered: None) -> bpy.types.Scene:
    """A floor of 8 units and a cube of 2 on it, seen obliquely; pass indices 3 and 7, a red material on the cube."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.context.object.pass_index = 3
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 1.0))
    cube = bpy.context.object
    cube.name, cube.pass_index = "Cube", 7
    material = bpy.data.materials.new("Red")
    material.diffuse_color, material.pass_index = (0.8, 0.05, 0.05, 1.0), 5
    cube.data.materials.append(material)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (7.0, -7.0, 5.0), (1.109, 0.0, 0.785)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 96, 54, 100
    scene.perfect_bvh.samples, scene.perfect_bvh.mode = 1, "CLAY"
    return scene


def render(job: RenderJob | None = None, **arguments: object) -> RenderJob:
    with attend(job or RenderJob()) as attended:
        bpy.ops.render.render(**arguments)
    return attended


@contextmanager
def rendering_to(scene: bpy.types.Scene, path: Path, file_format: str = "PNG") -> Iterator[None]:
    with preserved((scene.render, "filepath", str(path)), (scene.render.image_settings, "file_format", file_format)):
        yield


def middle(image: np.ndarray) -> np.ndarray:
    return image[image.shape[0] // 2, image.shape[1] // 2]


# Passes ------------------------------------------------------------------------------------------------------------


def test_every_pass_arrives_in_blender_as_it_was_traced(scene) -> None:
    with attend(RenderJob()) as job:
        passes = render_passes(scene, "PERFECT_BVH")
    images = job.frame.images
    for name in ("combined", "depth", "normal", "object_index", "material_index"):
        np.testing.assert_array_equal(getattr(passes, name), images[name].reshape(getattr(passes, name).shape), name)


def test_passes_hold_what_the_scene_holds(scene) -> None:
    passes = render_passes(scene, "PERFECT_BVH")
    assert set(np.unique(passes.object_index)) == {0.0, 3.0, 7.0}
    assert set(np.unique(passes.material_index)) == {0.0, 5.0}
    assert middle(passes.object_index) == 7.0
    background = passes.object_index == 0.0
    assert background[0].any()
    np.testing.assert_array_equal(passes.depth[background], np.float32(BACKGROUND_DEPTH))
    assert passes.depth[~background].max() < 20.0
    floor = passes.object_index == 3.0
    np.testing.assert_allclose(passes.normal[floor], np.broadcast_to([0.0, 0.0, 1.0], (floor.sum(), 3)), atol=1e-6)
    np.testing.assert_array_equal(passes.normal[background], 0.0)
    red = middle(passes.combined)
    assert red[0] > 2 * red[1]


def test_only_enabled_passes_are_traced(scene) -> None:
    scene.view_layers[0].use_pass_z = True
    assert set(render().frame.images) == {"combined", "depth"}


def test_each_view_layer_is_rendered_with_its_own_objects(scene) -> None:
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    cube = bpy.data.objects["Cube"]
    scene.collection.objects.unlink(cube)
    hidden.objects.link(cube)
    second = scene.view_layers.new("Second")
    second.layer_collection.children["Hidden"].exclude = True
    for view_layer in scene.view_layers:
        view_layer.use_pass_object_index = True
    seen = []
    for view_layer in scene.view_layers:
        for other in scene.view_layers:
            other.use = other == view_layer
        seen.append(set(np.unique(render().frame.images["object_index"])))
    assert seen == [{0.0, 3.0, 7.0}, {0.0, 3.0}]


# Film --------------------------------------------------------------------------------------------------------------


def test_a_border_is_cut_out_of_the_same_image(scene) -> None:
    whole = render_passes(scene, "PERFECT_BVH")
    render_settings = scene.render
    render_settings.use_border = True
    render_settings.border_min_x, render_settings.border_max_x = 0.3, 0.71
    render_settings.border_min_y, render_settings.border_max_y = 0.25, 0.9
    left, right, bottom, top = border_pixels((0.3, 0.71, 0.25, 0.9), (96, 54))
    rows, columns = slice(54 - top, 54 - bottom), slice(left, right)
    framed = render_passes(scene, "PERFECT_BVH")
    assert framed.depth.shape == whole.depth.shape
    np.testing.assert_array_equal(framed.depth[rows, columns], whole.depth[rows, columns])
    np.testing.assert_array_equal(framed.combined[rows, columns], whole.combined[rows, columns])
    outside = np.ones(framed.depth.shape, bool)
    outside[rows, columns] = False
    np.testing.assert_array_equal(framed.combined[outside], 0.0)

    render_settings.use_crop_to_border = True
    cropped = render_passes(scene, "PERFECT_BVH")
    np.testing.assert_array_equal(cropped.depth, whole.depth[rows, columns])


def test_a_transparent_film_has_no_background(scene) -> None:
    scene.render.film_transparent = True
    passes = render_passes(scene, "PERFECT_BVH")
    hit = passes.depth < BACKGROUND_DEPTH
    np.testing.assert_array_equal(passes.combined[..., 3], hit.astype(np.float32))
    np.testing.assert_array_equal(passes.combined[~hit], 0.0)
    scene.render.film_transparent = False
    np.testing.assert_array_equal(render_passes(scene, "PERFECT_BVH").combined[..., 3], 1.0)


def test_files_of_a_data_mode_bypass_the_view_transform(scene, tmp_path: Path) -> None:
    scene.perfect_bvh.mode = "NORMAL"
    scene.view_settings.exposure = 3.0
    with rendering_to(scene, tmp_path / "normal.png"):
        job = render(write_still=True)
    expected = np.rint(np.clip(job.frame.images["combined"][..., :3], 0.0, 1.0) * 255)
    np.testing.assert_allclose(read_png(tmp_path / "normal.png")[..., :3], expected, atol=1.0)
    assert scene.render.image_settings.color_management == "FOLLOW_SCENE"
    assert scene.render.dither_intensity == 1.0


# Animation ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("use_persistent_data", [False, True])
def test_an_animation_follows_the_frames(scene, tmp_path: Path, use_persistent_data: bool) -> None:
    cube = bpy.data.objects["Cube"]
    for frame, height in ((1, 1.0), (4, 4.0)):
        cube.location.z = height
        cube.keyframe_insert("location", index=2, frame=frame)
    scene.frame_start, scene.frame_end = 1, 4
    scene.render.use_persistent_data = use_persistent_data
    scene.view_layers[0].use_pass_z = True
    with rendering_to(scene, tmp_path / "frame_"):
        render(animation=True)
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files] == [f"frame_{frame:04d}.png" for frame in (1, 2, 3, 4)]
    animated = [read_png(file) for file in files]
    scene.render.use_persistent_data = False
    for frame, image in zip((1, 2, 3, 4), animated, strict=True):
        scene.frame_set(frame)
        with rendering_to(scene, tmp_path / "single.png"):
            render(write_still=True)
        np.testing.assert_array_equal(read_png(tmp_path / "single.png"), image)
    assert not np.array_equal(animated[0], animated[3])


def test_a_moved_object_is_not_built_again(scene) -> None:
    render()
    bpy.data.objects["Cube"].location.x = 1.0
    report = render().frame.statistics.report
    assert {change.name: change.action for change in report.objects} == {"Cube": "moved", "Plane": "kept"}
    assert report.commit.meshes == ()


@pytest.mark.parametrize(
    ("seconds_between", "writes"),
    [(SHOW_SECONDS, 5), (0.0, 2)],  # after 1, 2, 4 and 5 samples and at the end; after the first one and at the end
    ids=["slow", "quick"],
)
def test_rounds_that_a_window_shows_do_not_change_the_image(scene, monkeypatch, seconds_between, writes) -> None:
    scene.perfect_bvh.samples = 5
    updates: list[object] = []
    clock = itertools.count(0.0, seconds_between)
    monkeypatch.setattr(engine, "SHOWS_ROUNDS", True)
    monkeypatch.setattr(engine, "Throttle", partial(engine.Throttle, clock=lambda: next(clock)))
    monkeypatch.setattr(engine, "write_passes", count_calls(engine.write_passes, updates))
    shown = render_passes(scene, "PERFECT_BVH")
    monkeypatch.undo()
    assert len(updates) == writes
    silent = render_passes(scene, "PERFECT_BVH")
    for name in Passes.__slots__:
        np.testing.assert_array_equal(getattr(shown, name), getattr(silent, name))


def count_calls(function: Callable[..., None], calls: list[object]) -> Callable[..., None]:
    def counted(*arguments: object) -> None:
        calls.append(arguments)
        function(*arguments)

    return counted


@pytest.mark.parametrize("file_format", ["PNG", "OPEN_EXR_MULTILAYER"])
def test_stereoscopy_renders(scene, tmp_path: Path, file_format: str) -> None:
    scene.render.use_multiview = True
    if file_format == "OPEN_EXR_MULTILAYER" and hasattr(scene.render.image_settings, "media_type"):
        scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    with rendering_to(scene, tmp_path / "stereo_", file_format):
        assert render(write_still=True).frame is not None
    assert list(tmp_path.iterdir())


@pytest.mark.parametrize("views_format", ["STEREO_3D", "MULTIVIEW"])
def test_a_scene_without_an_eye_in_use_is_refused(scene, views_format: str) -> None:
    scene.render.use_multiview, scene.render.views_format = True, views_format
    for view in scene.render.views:
        view.use = False
    with pytest.raises(RuntimeError, match='No active view found in scene "Scene"'):
        bpy.ops.render.render()
    scene.render.views[-1].use = True
    assert render().frame is not None


# Cancel and errors -------------------------------------------------------------------------------------------------


def test_progress_rises_to_one_and_cancel_stops(scene) -> None:
    scene.perfect_bvh.samples = 64
    seen: list[float] = []

    def watch(done: float) -> bool:
        seen.append(done)
        return True

    job = render(RenderJob(progress=watch))
    assert not job.is_cancelled
    assert seen == sorted(seen)
    assert 0.0 <= seen[0] < 1.0
    assert seen[-1] == 1.0

    calls: list[float] = []

    def stop(done: float) -> bool:
        calls.append(done)
        return len(calls) < 2

    cancelled = render(RenderJob(progress=stop))
    assert cancelled.is_cancelled
    assert cancelled.frame is None
    assert len(calls) < len(seen)
    assert render().frame is not None


def test_a_render_says_what_it_does(scene, monkeypatch) -> None:
    """Each stage is reported at least once, in order, and the bar moves during denoising."""
    told: list[str] = []
    moments: list[float] = []
    monkeypatch.setattr(engine, "STATUS_SECONDS", 0.0)
    monkeypatch.setattr(engine.RenderStatus, "_send", lambda self, text: told.append(text))
    scene.perfect_bvh.samples, scene.perfect_bvh.use_noise_threshold = 4, False
    commit = perfect_bvh.Scene.commit

    def commit_slowly(scene: perfect_bvh.Scene, expected_rays: int, *, progress: Callable[[float], bool]) -> object:
        assert progress(HALF)  # small trees are built before the engine would say anything
        return commit(scene, expected_rays, progress=progress)

    monkeypatch.setattr(perfect_bvh.Scene, "commit", commit_slowly)
    assert render(RenderJob(progress=lambda done: moments.append(done) is None)).frame is not None
    stages = [text.rpartition(" | ")[2] for text in told]
    kinds = list(dict.fromkeys(stage.split()[0] for stage in stages))
    assert kinds == ["Reading", "Building", "Sample", "Denoising"]
    assert "Building BVHs 50%" in stages and "Sample 4/4" in stages
    assert all(re.match(r"Time: 00:\d\d\.\d\d \| ", text) for text in told)
    assert re.search(r"\| Remaining: \d\d:\d\d\.\d\d \| Mem: [\d.]+ (KiB|MiB) \| Denoising$", told[-1])
    assert any(still.TRACED <= done < 1.0 for done in moments)


def test_a_render_works_out_its_size_once(scene, monkeypatch) -> None:
    asked: list[tuple[int, int]] = []
    resolution = camera._resolution
    monkeypatch.setattr(camera, "_resolution", lambda render: asked.append(resolution(render)) or asked[-1])
    assert render().frame is not None
    assert asked == [(96, 54)]


def test_a_build_can_be_cancelled(scene, monkeypatch) -> None:
    gate = Gate(monkeypatch)
    asked: list[float] = []

    def stop(done: float) -> bool:
        asked.append(done)
        return False

    job = render(RenderJob(progress=stop))
    assert job.is_cancelled
    assert job.frame is None
    assert asked == [HALF * still.BUILT]
    gate.open()
    assert render().frame.statistics.report.finishes_earlier_update


@pytest.mark.parametrize("file_format", ["PNG", "OPEN_EXR_MULTILAYER"])
def test_an_error_reaches_the_script_and_blender_survives(scene, tmp_path: Path, monkeypatch, file_format) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise ValueError("the scene is upside down")

    monkeypatch.setattr(engine, "render_frame", fail)
    settings = scene.render.image_settings
    if file_format == "OPEN_EXR_MULTILAYER" and hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    with rendering_to(scene, tmp_path / "image", file_format), pytest.raises(RuntimeError, match="upside down"):
        bpy.ops.render.render(write_still=True)
    monkeypatch.undo()
    assert render().frame is not None


def test_a_scene_without_a_camera_is_refused_by_blender(scene) -> None:
    scene.camera = None
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.render.render()


def test_a_camera_that_cannot_be_rendered_is_named_with_the_way_out(scene) -> None:
    camera = scene.camera.data
    camera.type = "PANO"
    panorama_settings(camera).panorama_type = "FISHEYE_EQUISOLID"
    with pytest.raises(
        RuntimeError, match=r"'Camera.*' cannot be a Fisheye Equisolid panorama: choose Equirectangular as its Panorama"
    ):
        bpy.ops.render.render()


def test_an_empty_scene_is_all_background(scene) -> None:
    for name in ("Cube", "Plane"):
        bpy.data.objects.remove(bpy.data.objects[name])
    passes = render_passes(scene, "PERFECT_BVH")
    np.testing.assert_array_equal(passes.depth, np.float32(BACKGROUND_DEPTH))
    np.testing.assert_array_equal(passes.object_index, 0.0)


def test_settings_are_saved_in_the_file(scene, tmp_path: Path) -> None:
    scene.perfect_bvh.mode = "COST"
    scene.perfect_bvh.samples = 77
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert bpy.context.scene.perfect_bvh.mode == "PREVIEW"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    assert (bpy.context.scene.perfect_bvh.mode, bpy.context.scene.perfect_bvh.samples) == ("COST", 77)


def test_statistics_are_shown_after_a_render(scene) -> None:
    assert last_result.last_statistics(scene) is None
    render()
    statistics = last_result.last_statistics(scene)
    assert statistics.size == (96, 54)
    assert statistics.camera_rays == 96 * 54
    assert statistics.rays_per_second > 0.0
