"""What users do by mistake, and what can fail around Blender, as they see it: a message, and nothing lost."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable

import bpy
from addon_state import is_working, module, reported, settings, wait_for_report
from buttons import Button, point_at, press
from driver import (
    Step,
    area_of,
    check,
    click,
    front_window,
    hover,
    main_area,
    middle_of,
    press_key,
    screenshot,
    type_text,
    wait_until,
)
from gates import ScanGate, scan_gate
from panel_steps import main_buttons, open_sub_panel
from scan_steps import scans

RENDER_MENU = (125, 14)  # from the upper left
LONG_SCAN = 16  # frames
SMALL_DISK = "/tmp/small_disk"


def type_zeros() -> Step:
    """A field takes the least that makes sense instead, and shows it."""
    before = settings().samples
    buttons = yield from main_buttons()
    yield from point_at(area_of("PROPERTIES"), buttons["perfect_bvh.samples"])
    yield from press_key("Return")
    yield from type_text("0")
    yield from press_key("Return")
    yield from wait_until(lambda: settings().samples == 1, f"0 samples became {settings().samples}", 5)
    settings().samples = before
    yield 0.2


# Renders -------------------------------------------------------------------------------------------------------------


def render_and_wait(entry: str = "r") -> Step:
    """By the menu, since what a script's operators report is not shown. entry: the letter that chooses it there.

    The image takes the place of the largest area.
    """
    bpy.context.preferences.view.render_display_type = "AREA"
    yield from click(RENDER_MENU[0], front_window().height - RENDER_MENU[1])
    yield from press_key(entry)
    yield 0.5
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render does not end", 60)
    yield 1.0


def dismiss_error() -> Step:
    """It is shown below the mouse until that goes away."""
    yield from press_key("Escape")
    hover(*middle_of(main_area()))
    yield 0.3


def close_image(kind: str) -> Step:
    """And the panels that tell of it. kind: of the area in whose place the image is."""
    yield from dismiss_error()
    module("latest").forget()
    area_of("PROPERTIES").tag_redraw()
    main_area().type = kind
    bpy.context.preferences.view.render_display_type = "WINDOW"
    yield 0.3


def render_what_does_not_fit() -> Step:
    render = bpy.context.scene.render
    size = render.resolution_x, render.resolution_y
    render.resolution_x = render.resolution_y = 65536
    yield from render_and_wait()
    screenshot("render_that_does_not_fit")
    check(reported("An image of 65,536 x 65,536 pixels needs about"), "a render that does not fit is not refused")
    render.resolution_x, render.resolution_y = size
    yield from close_image("TEXT_EDITOR")


def render_what_is_broken() -> Step:
    """A texture whose file is gone, and a vertex that is nowhere: both are named, and the rest is rendered."""
    material = bpy.data.materials.new("painted")
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("paint", 4, 4)
    node.image.source, node.image.filepath = "FILE", "/tmp/gone.png"
    principled = material.node_tree.nodes["Principled BSDF"]
    material.node_tree.links.new(node.outputs[0], principled.inputs["Base Color"])
    mesh = bpy.data.meshes.new("broken")
    mesh.from_pydata([(0, 0, 0), (4, 0, 0), (0, 4, 0), (float("nan"), 0, 4)], [], [(0, 1, 2), (0, 1, 3)])
    mesh.materials.append(material)
    broken = bpy.data.objects.new("Broken", mesh)
    bpy.context.scene.collection.objects.link(broken)
    yield from render_and_wait()
    screenshot("render_of_what_is_broken")
    for text in (
        "image 'paint' could not be loaded from",
        "Broken: left out 1 triangle with a vertex that is not finite",
    ):
        check(reported(text), f"no report of {text!r}")
    yield from close_image("TEXT_EDITOR")
    for owner, found in (("objects", broken), ("meshes", mesh), ("images", node.image), ("materials", material)):
        getattr(bpy.data, owner).remove(found)
    yield 0.3


def render_into_nowhere() -> Step:
    """An animation into a folder that cannot be made ends with its first frame."""
    scene = bpy.context.scene
    before, scene.render.filepath = scene.render.filepath, "/proc/nowhere/image_"
    frame = scene.frame_current
    yield from render_and_wait("a")
    screenshot("render_into_nowhere")
    check(reported("/proc/nowhere"), "the folder that cannot be made is not named")
    check(scene.frame_current == frame, f"the frame is {scene.frame_current}, not {frame} as before")
    scene.render.filepath = before
    yield from close_image("TEXT_EDITOR")


# Scans ---------------------------------------------------------------------------------------------------------------


def with_scan_button(work: Callable[[Button], Step]) -> Step:
    def find(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        yield from work(button)

    yield from open_sub_panel("Rays", find)


def mount(*options: str) -> None:
    subprocess.run(["mount", *options, SMALL_DISK], check=True)


def scan_onto_bad_disks() -> Step:
    """One that may only be read is named before the work; on one that is full the points are kept, and no half file."""
    scan = settings().scan
    size = scan.width, scan.height
    scan.filepath, scan.width, scan.height = f"{SMALL_DISK}/points.npz", 200, 100
    os.makedirs(SMALL_DISK, exist_ok=True)
    mount("-t", "tmpfs", "-o", "size=64k,ro", "tmpfs")

    def work(button: Button) -> Step:
        area = area_of("PROPERTIES")
        yield from press(area, button)
        yield from wait_for_report(f"Cannot write {SMALL_DISK}/points.npz: Read-only file system")
        screenshot("scan_onto_a_disk_to_read")
        check(not scans() and not is_working(), "a scan whose file cannot be written has begun")
        yield from dismiss_error()
        mount("-o", "remount,rw,size=64k")
        yield from press(area, button)
        yield from wait_for_report(f"cannot write {SMALL_DISK}/points.npz: No space left on device", 30)
        yield 0.5
        screenshot("scan_onto_a_full_disk")
        check(len(scans()) == 1 and len(scans()[0].data.vertices) > 1000, "the points are lost with their file")
        check(not os.listdir(SMALL_DISK), f"on the full disk: {os.listdir(SMALL_DISK)}")
        yield from dismiss_error()

    try:
        yield from with_scan_button(work)
    finally:
        subprocess.run(["umount", SMALL_DISK], check=True)
    scan.filepath, scan.width, scan.height = "", *size
    for made in scans():
        bpy.data.meshes.remove(made.data)
    bpy.ops.ed.undo_push(message="bad disks")
    yield 0.3


def set_up_a_long_scan() -> Step:
    """By a LiDAR over many frames, each of which Blender has to evaluate."""
    bpy.ops.object.empty_add(location=(0.0, -6.0, 2.0))
    sensor, scan = bpy.context.object, settings().scan
    sensor.name = "Sensor"
    scan.sensor, scan.pattern, scan.use_frame_range, scan.columns = sensor, "LIDAR", True, 200
    bpy.context.scene.frame_end = LONG_SCAN
    bpy.ops.ed.undo_push(message="a sensor")
    yield 0.3


def scan_to_frame(gate: ScanGate, frame: int) -> Step:
    gate.set_to(frame / LONG_SCAN)
    yield from gate.wait(f"the scan to frame {frame}")
    check(bpy.context.scene.frame_current == frame, f"the scan is in frame {bpy.context.scene.frame_current}")


def start_a_long_scan(button: Button, gate: ScanGate) -> Step:
    gate.set_to(0.0)
    yield from press(area_of("PROPERTIES"), button)
    yield from scan_to_frame(gate, 3)
    hover(*middle_of(area_of("VIEW_3D")))


def has(name: str) -> bool:
    return name in bpy.context.view_layer.objects


def delete(name: str) -> Step:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == name)
    yield from press_key("Delete")
    yield from wait_until(lambda: not has(name), f"{name} is not deleted", 10)


def undo_until_it_is_there(name: str) -> Step:
    yield from press_key("ctrl+z")
    yield from wait_until(lambda: has(name), f"undo brings no {name} back", 10)


def delete_and_undo_while_scanning() -> Step:
    """With the keyboard: the sensor, whose scan ends; something that is scanned, which leaves the scan to go on."""
    frame, last = bpy.context.scene.frame_current, bpy.context.scene.frame_end
    yield from set_up_a_long_scan()

    def work(button: Button, gate: ScanGate) -> Step:
        yield from start_a_long_scan(button, gate)
        yield from delete("Sensor")
        gate.open()
        yield from wait_for_report("The sensor 'Sensor' was deleted during the scan", 20)
        yield 0.5
        screenshot("sensor_deleted_while_scanning")
        check(not is_working() and not scans(), "a scan goes on without its sensor")
        check(bpy.context.scene.frame_current == frame, "the frame of before does not come back")
        yield from dismiss_error()
        yield from undo_until_it_is_there("Sensor")
        yield from start_a_long_scan(button, gate)
        yield from delete("Hill")
        yield from scan_to_frame(gate, 6)
        check(not has("Hill"), "the scan brings back what was deleted")
        yield from undo_until_it_is_there("Hill")
        yield from scan_to_frame(gate, 9)
        screenshot("undone_while_scanning")
        gate.open()
        yield from wait_until(lambda: not is_working(), "the scan does not end", 90)
        check(len(scans()) == 1 and len(scans()[0].data.vertices) > 1000, f"the scan has made {scans()}")
        check(bpy.context.scene.frame_current == frame, "the frame of before does not come back")
        check(has("Hill") and has("Sensor"), "the scan has taken more than it has given")

    with scan_gate() as gate:
        yield from with_scan_button(lambda button: work(button, gate))
    scan = settings().scan
    scan.sensor, scan.pattern, scan.use_frame_range = None, "CAMERA", False
    bpy.context.scene.frame_end = last
    for obj in (*scans(), bpy.data.objects["Sensor"]):
        bpy.data.objects.remove(obj)
    bpy.ops.ed.undo_push(message="long scans")
    yield 0.3
