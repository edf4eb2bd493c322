"""The Scan button: stopped by Escape, also while it builds trees, run to its end, undone."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import bpy
from addon_state import forget_reports, is_working, module, settings, wait_for_report
from builds import is_building, watch_a_build, with_cloud
from buttons import Button, find_and_press, press
from driver import Step, area_pixels, at_rest, check, redrawn, screenshot, wait_until
from gates import Gate, always, gate_of_steps
from hands import hover, press_key
from panels import open_sidebar
from places import area_of, middle_of

COLUMN_OF_REFRESH = 0.83  # of the sidebar's width
ATTRIBUTES = {"distance", "normal", "time", "object_id", "instance_id", "material_id", "ring", "intensity", "Color"}


def scans() -> list[bpy.types.Object]:
    return [obj for obj in bpy.context.scene.objects if obj.name.startswith("Scan")]


def was_stopped(what: str) -> Step:
    """Check that the user has stopped it, and that it has left nothing."""
    yield from wait_until(lambda: not is_working(), f"Escape does not stop {what}")
    yield from wait_for_report("Scan canceled: nothing was written")
    check(not scans(), f"{what} was stopped, but has made an object")


def press_scan(after: Callable[[], Step]) -> Step:
    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        forget_reports()
        yield from press(area_of("VIEW_3D"), button)
        yield from after()

    yield from open_sidebar("Scan", work)


def add_a_sensor() -> Step:
    """Use the button behind the sensor's object; its lines are drawn while it is selected."""
    scan, cursor, area = settings().scan, bpy.context.scene.cursor, area_of("VIEW_3D")
    before, place = scan.pattern, tuple(cursor.location)
    scan.pattern, cursor.location = "LIDAR", (0.0, 0.0, 2.0)
    scan.max_distance = 6.0

    def work(buttons: list[Button]) -> Step:
        yield from find_and_press(area_of("VIEW_3D"), "perfect_bvh.add_sensor", COLUMN_OF_REFRESH)
        yield from wait_until(lambda: scan.sensor is not None, "no sensor was added")

    yield from open_sidebar("Add Sensor", work)
    sensor = scan.sensor
    check(tuple(sensor.location) == (0.0, 0.0, 2.0) and sensor.select_get(), "it is not at the cursor, or not selected")
    yield from at_rest(area)
    seen = area_pixels(area)
    screenshot("a_sensor")
    sensor.select_set(False)
    area.tag_redraw()
    yield from redrawn()
    check((area_pixels(area) != seen).mean() > 0.002, "the lines of a sensor are not drawn")
    bpy.data.objects.remove(sensor)
    scan.pattern, cursor.location = before, place
    scan.max_distance = 100.0
    yield from redrawn()


def scan_to_ply() -> Step:
    """A file for other programs, which an ordinary Blender writes without a library."""
    scan, folder = settings().scan, Path(tempfile.mkdtemp())
    scan.width, scan.height, scan.use_points, scan.use_files = 64, 48, False, True
    scan.folder, scan.file_format = str(folder), "ply"

    def finish() -> Step:
        yield from wait_until(lambda: not is_working(), "the scan does not end")
        yield from wait_for_report("Wrote 1 file with ")

    yield from press_scan(finish)
    (made,) = folder.glob("*.ply")
    check(made.read_bytes().startswith(b"ply\nformat binary_little_endian"), f"{made} is no PLY file")
    shutil.rmtree(folder)
    scan.width, scan.height, scan.use_points, scan.use_files = 640, 360, True, False
    scan.folder, scan.file_format = "", "npz"


def color_points_anew() -> Step:
    """Use the small button behind the list of colors."""

    def work(_: list[Button]) -> Step:
        area = area_of("VIEW_3D")
        forget_reports()
        yield from find_and_press(area, "perfect_bvh.color_points", COLUMN_OF_REFRESH)
        yield from wait_for_report("Recolored 1 point cloud")

    yield from open_sidebar("Scan", work)


def stop_a_scan() -> Step:
    scan = settings().scan
    scan.width, scan.height = 2000, 2000

    def stop(gate: Gate) -> Step:
        gate.hold_when(lambda _, share: share > 0.1)
        yield from gate.wait("a scan of 4 million rays")
        check(is_working(), "a scan that is held has ended")
        screenshot("scanning")
        yield from press_key("Escape")
        yield from was_stopped("the scan")

    def stop_at_once(gate: Gate) -> Step:
        gate.hold_when(always)
        yield from press_key("Escape")
        yield from was_stopped("the scan at its start")

    with gate_of_steps(module("scanning.scan").Scanner) as gate:
        yield from press_scan(lambda: stop(gate))
        yield from press_scan(lambda: stop_at_once(gate))
    scan.width, scan.height = 640, 360


def stop_a_scan_while_it_builds() -> Step:
    def stop(gate: Gate) -> Step:
        yield from watch_a_build("scan", gate)
        yield from press_key("Escape")
        yield from was_stopped("the build of a scan")
        yield from wait_until(lambda: not is_building(), "the build goes on after Escape")

    yield from with_cloud(lambda gate: press_scan(lambda: stop(gate)))


def scan() -> Step:
    def finish() -> Step:
        yield from wait_until(scans, "the scan makes no object")
        yield from redrawn()
        screenshot("scan")

    active = bpy.context.view_layer.objects.active
    yield from press_scan(finish)
    (made,) = scans()
    check(made.type == "POINTCLOUD", f"the points are a {made.type}")
    check(bpy.context.view_layer.objects.active == active, "the points have become the active object")
    check(not made.select_get(), "the points are selected")
    check(set(made.data.attributes.keys()) >= ATTRIBUTES, f"attributes: {made.data.attributes.keys()}")
    count = len(made.data.points)
    check(count > 1000, f"only {count} points")
    yield from wait_for_report(f"{count:,} points on")
    yield from color_points_anew()
    hover(*middle_of(area_of("VIEW_3D")))
    yield from press_key("ctrl+z", "ctrl+z")  # the color, then the points
    yield from wait_until(lambda: not scans(), "undo leaves the points")
    yield from press_key("ctrl+shift+z")
    yield from wait_until(scans, "redo does not bring the points back")
    yield from press_key("ctrl+z")
    yield from wait_until(lambda: not scans(), "the second undo leaves the points")
    check(settings().mode == "PREVIEW", "undoing the scan has undone more than that")
