"""The panels of settings: every panel can be drawn for a rendered scene, and shows the settings that can be changed."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

from blender.drawn_texts import RecordingLayout, drawn, render_a_cube, shaded_space  # noqa: E402
from perfect_bvh_addon import operators, panels  # noqa: E402
from perfect_bvh_addon.extract.camera import panorama_settings  # noqa: E402
from perfect_bvh_addon.panels import common  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import ENGINE_NAME, read_settings  # noqa: E402
from perfect_bvh_addon.statistics import messages  # noqa: E402
from perfect_bvh_addon.support import files  # noqa: E402


@pytest.fixture(autouse=True)
def rendered(registered: None) -> None:
    render_a_cube()


@pytest.mark.parametrize("panel", panels.CLASSES, ids=lambda panel: panel.__name__)
def test_a_panel_can_be_drawn_after_a_render(panel: type) -> None:
    bpy.context.scene.camera.data.type = "PANO"
    holds_others = any(getattr(other, "bl_parent_id", "") == panel.__name__ for other in panels.CLASSES)
    assert drawn(panel) or holds_others


def test_light_paths_say_where_they_can_be_set(monkeypatch) -> None:
    """Cycles stores them, and Cycles may be disabled."""
    paths, *others = (panel for panel in panels.CLASSES if "_light_paths" in panel.__name__)
    assert drawn(paths) == [] and all(drawn(panel) for panel in others)
    monkeypatch.setattr(panels.render, "light_path_settings", lambda scene: None)
    assert " ".join(drawn(paths)) == panels.render.CYCLES_IS_OFF
    context = SimpleNamespace(engine=ENGINE_NAME, scene=bpy.context.scene)
    assert not any(panel.poll(context) for panel in others)


def test_a_studio_light_can_be_chosen_where_the_world_is_not_shown() -> None:
    panel = panels.viewports.PERFECT_BVH_PT_shading_lighting
    assert drawn(panel) == ["use_scene_lights_render", "use_scene_world_render"]
    shaded_space().shading.use_scene_world_render = False
    names = ["studio_light", "studiolight_rotate_z", "studiolight_intensity", "studiolight_background_alpha"]
    assert set(names) < set(drawn(panel))
    space = shaded_space()
    space.shading.type = "SOLID"
    assert not panel.poll(SimpleNamespace(engine=ENGINE_NAME, space_data=space))


def test_noise_thresholds_have_a_switch_a_value_and_a_least() -> None:
    for kind, panel in (
        ("", panels.render.PERFECT_BVH_PT_sampling_render),
        ("viewport_", panels.render.PERFECT_BVH_PT_sampling_viewport),
    ):
        samples = ["use_render_samples"] if kind else ["samples"]
        least = [] if kind else ["min_samples"]
        names = [f"use_{kind}noise_threshold", f"{kind}noise_threshold", *samples, *least]
        assert drawn(panel)[: len(names)] == names and "viewport_min_samples" not in drawn(panel)
        setattr(bpy.context.scene.perfect_bvh, names[0], False)
        assert drawn(panel)[:3] == names[:3] and "min_samples" not in drawn(panel)


def test_viewports_take_the_samples_of_renders_or_their_own() -> None:
    settings, panel = bpy.context.scene.perfect_bvh, panels.render.PERFECT_BVH_PT_sampling_viewport
    settings.samples = 48
    assert settings.use_render_samples and "viewport_samples" not in drawn(panel)
    settings.use_render_samples = False
    assert settings.viewport_samples == 48 and drawn(panel)[2:4] == ["use_render_samples", "viewport_samples"]
    settings.viewport_samples = 5
    settings.use_render_samples = False
    assert settings.viewport_samples == 5
    settings.use_render_samples = True
    assert settings.viewport_samples == 0 and read_settings(bpy.context.scene, is_viewport=True).samples == 48


def test_a_panorama_can_be_set_up_without_cycles() -> None:
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    settings = panorama_settings(camera)
    settings.panorama_type = "FISHEYE_EQUISOLID"
    assert panels.objects.ONLY_EQUIRECTANGULAR in " ".join(drawn(panels.objects.PERFECT_BVH_PT_panorama))
    settings.panorama_type = "EQUIRECTANGULAR"
    names = {"panorama_type", "latitude_min", "latitude_max", "longitude_min", "longitude_max"}
    assert names == set(drawn(panels.objects.PERFECT_BVH_PT_panorama))
    camera.type = "ORTHO"
    with pytest.raises(AssertionError):
        drawn(panels.objects.PERFECT_BVH_PT_panorama)


def test_the_scan_panel_shows_what_belongs_to_the_sensor() -> None:
    settings = bpy.context.scene.perfect_bvh.scan
    panel = panels.output.PERFECT_BVH_PT_scan
    assert {"width", "height", "sensor", "labels"} <= set(drawn(panel)) and "rate" not in drawn(panel)
    settings.pattern = "LIDAR"
    assert {"elevations", "columns", "rate"} <= set(drawn(panel)) and "width" not in drawn(panel)
    settings.pattern = "spinning-64"
    assert "mount" in drawn(panel)
    messages.add(bpy.context.scene, "Scan", "9 rays", is_note=True)
    assert drawn(panel)[-1] == "9 rays"
    messages.tell(bpy.context.scene, "Scan")
    assert "seed" in drawn(panel) and not {"elevations", "width", "sensor_file"} & set(drawn(panel))
    settings.pattern = "FILE"
    assert "sensor_file" in drawn(panel)


def test_the_scan_panel_shows_what_belongs_to_frames_and_files() -> None:
    settings = bpy.context.scene.perfect_bvh.scan
    panel = panels.output.PERFECT_BVH_PT_scan
    assert not {"frame_start", "steps_per_frame", "folder", "point_column"} & set(drawn(panel))
    settings.frames = "SCENE"
    assert "steps_per_frame" in drawn(panel) and "frame_start" not in drawn(panel)
    settings.frames, settings.use_files, settings.point_color = "RANGE", True, "COLUMN"
    shown = {"frame_start", "frame_end", "folder", "file_format", "frames_per_file", "use_resume", "point_column"}
    assert shown <= set(drawn(panel)) and drawn(panel)[-1] == "Start Scan"
    settings.frames = "CURRENT"
    assert {"folder", "use_resume"} <= set(drawn(panel)) and "frames_per_file" not in drawn(panel)


def test_panels_for_materials_lights_and_the_world_stay_usable() -> None:
    names = {
        panel.__name__
        for panel in panels.objects.shared_panels()
        if "PERFECT_BVH" in panel.COMPAT_ENGINES and panel.__name__ in dir(bpy.types)
    }
    assert names >= {
        "EEVEE_MATERIAL_PT_context_material",
        "DATA_PT_EEVEE_light",
        "DATA_PT_lens",
        "DATA_PT_preview",
        "MATERIAL_PT_preview",
        "RENDER_PT_color_management",
        "WORLD_PT_context_world",
    }
    assert not names & {"RENDER_PT_simplify", "DATA_PT_light", "NODE_DATA_PT_light"}


@pytest.mark.parametrize(("width", "scale", "count"), [(1000, 1.0, 1), (280, 1.0, 2), (280, 2.0, 4), (20, 1.0, 5)])
def test_long_texts_are_broken_where_the_panel_ends(width: int, scale: float, count: int) -> None:
    text = "The native engine could not be loaded: a file"
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=scale))
    lines = common.wrapped(SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences), text)
    assert len(lines) == count
    assert " ".join(lines) == text


def test_a_path_that_is_longer_than_a_line_is_broken() -> None:
    path = "/home/somebody/.config/blender/5.2/scripts/modules"
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    lines = common.wrapped(SimpleNamespace(region=SimpleNamespace(width=220), preferences=preferences), f"Into {path}")
    assert lines[0] == "Into" and "".join(lines[1:]) == path and len(lines) > 2
    assert all(common.text_width(line) <= 220 - common.MARGIN for line in lines)


def test_lines_fit_into_the_narrowest_sidebar() -> None:
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    context = SimpleNamespace(region=SimpleNamespace(width=170), preferences=preferences)
    lines = common.wrapped(context, "Images of the object, category and depth of each pixel", common.TABS)
    assert all(common.text_width(line) <= 170 - common.MARGIN - common.TABS for line in lines)


@pytest.mark.parametrize(("denoiser", "is_built_in"), [("OpenImageDenoise 2.3.3", False), ("Joint Filter", True)])
def test_sampling_says_by_what_is_denoised(monkeypatch, denoiser: str, is_built_in: bool) -> None:
    monkeypatch.setattr(panels.render, "denoiser_in_use", lambda: denoiser)
    told = [" ".join(drawn(panel)) for panel in panels.CLASSES if "_sampling" in panel.__name__]
    assert sum(text.count(panels.render.NO_OIDN) for text in told) == is_built_in
    bpy.context.scene.perfect_bvh.mode = "NORMAL"
    assert drawn(panels.render.PERFECT_BVH_PT_sampling) == []


@pytest.mark.parametrize(
    ("panel", "button", "reason"),
    [
        (panels.output.PERFECT_BVH_PT_scan, "Start Scan", "No sensor: choose a Sensor Object, or add a camera"),
        (panels.output.PERFECT_BVH_PT_label_images, "Start Labelling", "No camera: choose a Camera, or add one"),
        (panels.output.PERFECT_BVH_PT_bake_rays, "Bake", "Nothing selected: select the meshes whose faces get values"),
        (panels.viewports.PERFECT_BVH_PT_walk_ray, "Walk a Ray", "There is no 3D viewport"),
        (panels.reports.PERFECT_BVH_PT_compare, "Compare", "Click an object first"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_grey_main_button_has_its_reason_below_it(panel: type, button: str, reason: str) -> None:
    """Walk a Ray is always grey without windows."""
    bpy.context.scene.camera = None
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = None
    layout = RecordingLayout()
    region, system = SimpleNamespace(width=280), SimpleNamespace(ui_scale=1.0)
    given = {"region": region, "preferences": SimpleNamespace(system=system), "object": None, "mode": "OBJECT"}
    given |= {"scene": bpy.context.scene, "selected_objects": [], "window": None, "space_data": shaded_space()}
    given["view_layer"] = bpy.context.view_layer
    panel.draw(SimpleNamespace(layout=layout, bl_label=panel.bl_label), SimpleNamespace(**given))
    assert f"{button} {reason}" in " ".join(layout.texts)


def test_the_benchmark_and_the_view_say_why_they_are_grey_without_the_engine(monkeypatch) -> None:
    reason = "The native engine could not be loaded: a damaged file"
    monkeypatch.setattr(operators.ticking, "native_error", lambda: reason)
    for panel in (panels.reports.PERFECT_BVH_PT_bench, panels.viewports.PERFECT_BVH_PT_render_view):
        assert reason in " ".join(drawn(panel))


def test_a_command_in_a_message_can_be_copied() -> None:
    command = files.command_in(files.how_to_install("laspy", "lazrs"))
    assert command is not None and command.endswith(" -m pip install laspy lazrs")
    assert files.command_in("Choose a folder for the files") is None
    messages.tell(bpy.context.scene, "Scan", f"LAZ files need laspy. {files.how_to_install('laspy')}", is_error=True)
    assert "perfect_bvh.copy_command" in drawn(panels.output.PERFECT_BVH_PT_scan)
    reports, manager = [], SimpleNamespace(clipboard="")
    pressed = SimpleNamespace(command=command, report=lambda kinds, text: reports.append(text))
    copy = operators.help_buttons.PERFECT_BVH_OT_copy_command.execute
    assert copy(pressed, SimpleNamespace(window_manager=manager)) == {"FINISHED"}
    assert manager.clipboard == command and reports == [f"Copied: {command}"]
