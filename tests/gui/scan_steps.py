"""The Scan button: stopped by Escape, also while it builds trees, run to its end, undone."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from addon_state import is_working, settings, wait_for_report
from builds import is_building, watch_a_build, with_cloud
from buttons import Button, press
from driver import Step, area_of, check, hover, middle_of, press_key, screenshot, wait_until
from panel_steps import open_sub_panel

ATTRIBUTES = {"distance", "normal", "time", "object_id", "instance_id", "material_id"}


def scans() -> list[bpy.types.Object]:
    return [obj for obj in bpy.context.scene.objects if obj.name.startswith("Scan")]


def press_scan(after: Callable[[], Step]) -> Step:
    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        yield from press(area_of("PROPERTIES"), button)
        yield from after()

    yield from open_sub_panel("Rays", work)


def stop_a_scan() -> Step:
    scan = settings().scan
    scan.width, scan.height = 2000, 2000

    def stop() -> Step:
        yield from wait_until(is_working, "the scan does not begin", 10)
        yield 0.3
        check(is_working(), "4 million rays were cast in half a second")
        screenshot("scanning")
        yield from press_key("Escape")
        yield from wait_until(lambda: not is_working(), "Escape does not stop the scan", 10)

    yield from press_scan(stop)
    yield from wait_for_report("The scan was stopped: nothing was made")
    check(not scans(), "a stopped scan has made an object")

    def stop_at_once() -> Step:
        yield from press_key("Escape")
        yield from wait_until(lambda: not is_working(), "Escape does not stop the scan at its start", 20)

    yield from press_scan(stop_at_once)
    yield 0.5
    check(not scans(), "a scan stopped at its start has made an object")
    scan.width, scan.height = 640, 360


def stop_a_scan_while_it_builds() -> Step:
    def stop() -> Step:
        yield from watch_a_build("scan")
        yield from press_key("Escape")
        yield from wait_until(lambda: not is_working(), "Escape does not stop the build of a scan", 10)
        check(not is_building(), "the build goes on after Escape")

    yield from with_cloud(lambda: press_scan(stop))
    yield from wait_for_report("The scan was stopped: nothing was made")
    check(not scans(), "a scan that was stopped while it built has made an object")


def scan() -> Step:
    def finish() -> Step:
        yield from wait_until(scans, "the scan makes no object", 60)
        yield 0.5
        screenshot("scan")

    yield from press_scan(finish)
    (made,) = scans()
    check(bpy.context.view_layer.objects.active == made, "the points are not the active object")
    check(set(made.data.attributes.keys()) >= ATTRIBUTES, f"attributes: {made.data.attributes.keys()}")
    count = len(made.data.vertices)
    check(count > 1000, f"only {count} points")
    yield from wait_for_report(f"{count:,} points on")
    hover(*middle_of(area_of("VIEW_3D")))
    yield from press_key("ctrl+z")
    yield from wait_until(lambda: not scans(), "undo leaves the points", 10)
    yield from press_key("ctrl+shift+z")
    yield from wait_until(scans, "redo does not bring the points back", 10)
    yield from press_key("ctrl+z")
    yield from wait_until(lambda: not scans(), "the second undo leaves the points", 10)
    check(settings().mode == "PREVIEW", "undoing the scan has undone more than that")
