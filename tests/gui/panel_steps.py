"""Every button of every panel, pressed with the mouse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import bpy
from addon_state import MODULE, close_image_windows, is_working, module, settings
from buttons import (
    COLUMN,
    HEADER_HEIGHT,
    STEP,
    Button,
    button_under_mouse,
    change,
    find_and_press,
    header_height,
    leave,
    list_buttons,
    press,
    toggle_panel,
    with_panel_open,
)
from drawn import drawn, note_pressed, pressed
from driver import Step, StepError, at_rest, check, redrawn, screenshot, wait_until
from gates import gate_of_steps
from hands import click, handled, hover, press_here, press_key, set_viewport_size
from panels import (
    PANELS,
    change_all,
    close_the_open_one,
    header_of,
    main_buttons,
    open_panel,
    open_sidebar,
)
from places import area_of, main_area, middle_of, panel_region, region_of
from studies import FIRST_HEADER, close_study, open_study, with_study
from tree_steps import press_in_sidebar

MAIN_BUTTONS = [
    "render.engine",
    "perfect_bvh.mode",
    "perfect_bvh.preview",
    "perfect_bvh.preview_percentage",
]
HEADER_CHECKBOX_OF_PANEL = 0.13
SWITCHES = 0.44  # of the region's width: the switches next to the values that they turn on
ROW_AND_GAP = 26  # from the middle of a button to that of the next group


def enable() -> Step:
    check(not hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is enabled already")
    bpy.ops.preferences.addon_enable(module=MODULE)
    yield from redrawn()
    check(hasattr(bpy.types.Scene, "perfect_bvh"), "the add-on is not enabled")
    check(module("settings.preferences").native_error() is None, module("settings.preferences").native_error())
    scene = bpy.context.scene
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 270, 100
    check(settings().mode == "PREVIEW", f"the default mode is {settings().mode}")
    settings().samples = 2
    area_of("PROPERTIES").spaces.active.context = "RENDER"
    # Without a graphics card a 3D viewport takes most of the time: there is none while only panels are tried.
    main_area().type = "TEXT_EDITOR"
    yield from set_viewport_size(960, 860)
    hover(*middle_of(main_area()))
    yield from press_here()  # Blender swallows the first click
    yield from close_the_open_one()


def press_the_main_panels_buttons() -> Step:
    area = area_of("PROPERTIES")
    buttons = yield from main_buttons()
    check(list(buttons)[: len(MAIN_BUTTONS)] == MAIN_BUTTONS, f"the panel's buttons are {list(buttons)}")
    yield from change(area, buttons["perfect_bvh.preview_percentage"], settings(), "50")
    yield from press(area, buttons["perfect_bvh.mode"])
    screenshot("menu_of_modes")
    yield from press_key("Escape")
    yield from change(area, buttons["perfect_bvh.mode"], settings())
    settings().mode = "CLAY"
    yield from at_rest(area)
    buttons = yield from main_buttons()
    screenshot("clay")
    yield from change(area, buttons["perfect_bvh.use_material_colors"], settings())
    yield from change(area, buttons["perfect_bvh.ao_distance"], settings())
    settings().mode = "NORMAL"
    area.tag_redraw()
    yield from at_rest(area)
    screenshot("hint_about_the_view")
    yield from find_and_press(area, "view_settings.view_transform")
    yield from press_key("Escape")
    settings().mode = "PREVIEW"
    area.tag_redraw()
    yield from at_rest(area)


def press_sampling_film_and_performance() -> Step:
    render = bpy.context.scene.render
    sampling = {"viewport_samples": "3", "samples": "4", "min_samples": "7", "time_limit": "9"}
    switches = dict.fromkeys(("use_render_samples", "use_denoising", "use_viewport_denoising"))
    settings().viewport_samples = 7  # different from the render's samples
    for kind, text in (("", "0.05"), ("viewport_", "0.5")):
        sampling[f"{kind}noise_threshold"] = text
    yield from open_panel("Sampling", change_all(settings(), sampling | switches))
    yield from open_panel("Sampling", switch_thresholds)
    yield from open_panel("Sampling", change_the_seed)
    settings().time_limit, settings().viewport_samples = 0.0, 0
    yield from open_panel("Film", change_all(render, {"film_transparent": None}))
    yield from open_panel("Performance", change_all(render, {"threads_mode": None, "use_persistent_data": None}))
    render.threads_mode = "FIXED"
    yield from open_panel("Performance", change_all(render, {"threads": None}))
    render.threads_mode = "AUTO"
    screen = bpy.context.screen
    yield from open_panel("Performance", change_all(screen, {"perfect_bvh_open_rendered": None}))
    screen.perfect_bvh_open_rendered = False


def change_the_seed(buttons: list[Button]) -> Step:
    """In Advanced."""
    yield from work_below(buttons, 0, change_all(settings(), {"seed": "5"}))


def work_below(buttons: list[Button], number: int, work: Callable[[list[Button]], Step]) -> Step:
    """Open the number-th of the closed panels that follow these buttons, and do something in it."""
    last = min(buttons, key=lambda button: button.y)
    yield from with_panel_open(area_of("PROPERTIES"), header_height(last, number), work)


def press_light_paths() -> Step:
    cycles = bpy.context.scene.cycles
    bounces = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "transparent_max_bounces")
    clamps = {"sample_clamp_direct": "3", "sample_clamp_indirect": "4"}
    caustics = {"blur_glossy": "0.5", "caustics_reflective": None, "caustics_refractive": None}

    def work(buttons: list[Button]) -> Step:
        yield from change_all(cycles, dict.fromkeys(bounces, "2"))(buttons)
        yield from work_below(buttons, 0, change_all(cycles, clamps))
        yield from work_below(buttons, 1, change_all(cycles, caustics))

    yield from open_panel("Light Paths", work)


def press_curves() -> Step:
    curves = bpy.context.scene.cycles_curves
    curves.shape = "RIBBONS"  # which alone have subdivisions
    yield from open_panel("Curves", change_all(curves, {"subdivisions": "4", "shape": None}))


def switch_thresholds(buttons: list[Button]) -> Step:
    """Their switches are left of the values."""
    area, top = area_of("PROPERTIES"), max(button.y for button in buttons)
    found = yield from list_buttons(area, top=top + STEP, column=SWITCHES)
    names = ("use_noise_threshold", "use_viewport_noise_threshold")
    yield from change_all(settings(), dict.fromkeys(names))(found)


def fill_in_the_scan_panel() -> Step:
    scan = settings().scan
    camera_fields = {"pattern": None, "sensor": None, "width": "64", "height": "48", "frames": None}
    camera_fields |= {"labels": "collection", "point_color": None, "use_points": None, "use_files": None}
    yield from open_sidebar("Scan", change_all(scan, camera_fields, "VIEW_3D"))
    scan.pattern, scan.frames, scan.use_files = "LIDAR", "RANGE", True
    lidar_fields = {"elevations": "0:10:5", "columns": "100", "rate": "5", "max_distance": "20"}
    lidar_fields |= {"frame_start": "2", "frame_end": "9", "steps_per_frame": "3"}
    file_fields = {"folder": "/tmp/points", "file_format": None, "frames_per_file": "4", "use_resume": None}
    yield from open_sidebar("Scan into Files", change_all(scan, lidar_fields | file_fields, "VIEW_3D"))
    scan.pattern, scan.frames, scan.use_files, scan.folder = "CAMERA", "CURRENT", False, ""
    scan.labels = ""
    scan.use_points = scan.use_resume = True


def find_the_manual() -> Step:
    """The question mark in the header of a panel opens a page that is on the disk, which needs no network."""

    def work(_: list[Button]) -> Step:
        area = area_of("VIEW_3D")
        region = panel_region(area)
        for column in range(96, 60, -1):
            hover(region.x + region.width * column / 100, region.y + region.height - FIRST_HEADER)
            yield from handled()
            found = button_under_mouse(area) or ""
            if "perfect_bvh.open_manual" in found:
                break
        else:
            raise StepError("the header of Scan has no button that opens the manual")
        path = url2pathname(urlsplit(found.split('"')[1]).path)
        check(Path(path).is_file(), f"{found} opens nothing")
        screenshot("manual")

    yield from open_sidebar("Manual", work)


def press_simplify() -> Step:
    """Blender's own settings, in a panel of the add-on's."""
    area, render = area_of("PROPERTIES"), bpy.context.scene.render
    y = yield from header_of(PANELS.index("Simplify"))
    yield from change(area, Button("render.use_simplify", y, HEADER_CHECKBOX_OF_PANEL), render)
    render.use_simplify = True

    def press_all(buttons: list[Button]) -> Step:
        names = [button.what.rpartition(".")[2] for button in buttons if "simplify" in button.what]
        check(len(names) >= 2, f"Simplify has {names}")
        for name in names:
            is_share = render.bl_rna.properties[name].type == "FLOAT"
            yield from change_all(render, {name: "0.5" if is_share else None})(buttons)

    def work(buttons: list[Button]) -> Step:
        screenshot("panel_simplify")
        viewport = y - HEADER_HEIGHT
        yield from press_all(buttons)
        yield from leave(area)
        yield from toggle_panel(area, viewport)
        yield from press_all((yield from list_buttons(area, top=viewport - HEADER_HEIGHT / 2)))
        yield from leave(area)
        yield from toggle_panel(area, viewport)

    yield from with_panel_open(area, y, work)
    render.use_simplify = False


def bench() -> Step:
    """Measured until there is something to see, ended with Escape: a table in the panel, and charts with matplotlib."""

    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.bench(" in button.what]
        with gate_of_steps(module("bench.measurements").SceneBench) as gate:
            gate.hold_when(lambda measurement, _: len(measurement.figures.get("builders", ())) == 4)
            yield from press(area_of("VIEW_3D"), button)
            yield from gate.wait("a measurement")
            check(is_working(), "a measurement that is held has ended")
            screenshot("benching")
            yield from press_key("Escape")
            last_results, uid = module("bench.results").last_results, bpy.context.scene.session_uid
            yield from wait_until(lambda: last_results(uid) is not None, "Escape shows no table")
        results = last_results(uid)
        check(len(results.table) == 4, f"of four builders the table has {results.table}")
        check(results.can_draw == ("Perfect BVH Bench" in bpy.data.images), "charts are where matplotlib is not")
        yield from at_rest(area_of("VIEW_3D"))
        screenshot("bench")
        yield from close_image_windows()

    yield from with_study("Benchmark", work)
    check(not is_working(), "the measurement goes on")


def follow_the_benchmarks_advice() -> Step:
    """The button below the table, there if a builder is better, sets the two of Compare. Clocks do not decide that."""
    results, compare = module("bench.results"), settings().compare
    before, uid = (compare.left, compare.right), bpy.context.scene.session_uid
    measured = results.last_results(uid)
    check(measured is not None, "there is no measurement, which an earlier step makes")
    results.remember(uid, replace(measured, better="sweep"))
    compare.left = compare.right = "BINNED"

    area = main_area()
    kind, area.type = area.type, "VIEW_3D"
    yield from redrawn()
    yield from open_study(area, "Benchmark")
    screenshot("bench_advice")
    yield from press_in_sidebar(area, "perfect_bvh.compare_advised")
    chosen = lambda: (compare.left, compare.right)  # noqa: E731
    yield from wait_until(lambda: chosen() == ("AUTO", "SWEEP"), f"Compare has {chosen()}")
    yield from close_study(area, "Benchmark")
    area.type = kind
    results.remember(uid, measured)
    compare.left, compare.right = before


def press_the_panorama() -> Step:
    """The camera's own panel, which Blender shows with Cycles only."""
    area, scene, layer = area_of("PROPERTIES"), bpy.context.scene, bpy.context.view_layer
    before, layer.objects.active = layer.objects.active, scene.camera
    camera = scene.camera.data
    camera.type = "PANO"
    area.tag_redraw()
    yield from redrawn()
    area.spaces.active.context = "DATA"
    yield from redrawn()
    camera.panorama_type = "EQUIRECTANGULAR"
    yield from at_rest(area)
    buttons = yield from list_buttons(area)
    screenshot("panel_panorama")
    degrees = {"latitude_min": "10", "latitude_max": "20", "longitude_min": "30", "longitude_max": "40"}
    yield from change_all(camera, degrees | {"panorama_type": None})(buttons)
    camera.panorama_type = "FISHEYE_EQUISOLID"
    area.tag_redraw()
    yield from at_rest(area)
    screenshot("panel_of_another_panorama")
    camera.panorama_type, camera.type = "EQUIRECTANGULAR", "PERSP"
    area.spaces.active.context = "RENDER"
    layer.objects.active = before
    yield from at_rest(area)


def every_button_was_pressed() -> Step:
    """Check that every button that the add-on's panels have drawn in this run was pressed."""
    yield 0.1
    check(len(drawn) > 40, f"the panels draw {sorted(drawn)} only")
    check(drawn <= pressed, f"never pressed: {sorted(drawn - pressed)}")


def show_the_viewport() -> Step:
    main_area().type = "VIEW_3D"
    yield from redrawn()
    bpy.ops.ed.undo_push(message="start")


def is_set(owner: object, name: str, value: object) -> bool:
    return getattr(owner, name) == value


def press_denoising_data(area: bpy.types.Area, buttons: list[Button]) -> Step:
    """On, and off again. The button has no data path because Cycles has the property: it is the row below the last."""
    above = next(button for button in buttons if button.what.endswith("use_pass_material_index"))
    region, switches = region_of(area), bpy.context.view_layer.cycles
    for wanted in (True, False):
        yield from click(region.x + region.width * COLUMN, above.y - ROW_AND_GAP)
        is_pressed = partial(is_set, switches, "denoising_store_passes", wanted)
        yield from wait_until(is_pressed, "Denoising Data cannot be pressed")
    note_pressed("cycles.denoising_store_passes")


def choose_passes() -> Step:
    area, layer = area_of("PROPERTIES"), bpy.context.view_layer
    area.spaces.active.context = "VIEW_LAYER"
    yield from at_rest(area)
    buttons = yield from list_buttons(area)
    if not any("use_pass_z" in button.what for button in buttons):
        (last,) = [button for button in buttons if button.what.endswith("use")] or buttons[-1:]
        yield from toggle_panel(area, header_height(last, 0))
        buttons = yield from list_buttons(area)
    names = ("use_pass_z", "use_pass_normal", "use_pass_vector", "use_pass_object_index", "use_pass_material_index")
    yield from change_all(layer, dict.fromkeys(names))(buttons)
    screenshot("passes")
    yield from press_denoising_data(area, buttons)
    area.spaces.active.context = "RENDER"
    yield from at_rest(area)
