"""Users' mistakes and failures around Blender: users see a message, and nothing is lost."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Sequence

import bpy
import numpy as np
from addon_state import (
    events,
    finished,
    forget_reports,
    image,
    is_working,
    module,
    settings,
    wait_for_report,
)
from buttons import Button, point_at, press
from driver import Step, at_rest, check, redrawn, screenshot, wait_until
from gates import Gate, always, gate_of_steps
from hands import click, handled, hover, press_key, type_text
from panels import open_panel, open_sidebar
from places import area_of, context_of, front_window, main_area, middle_of
from scan_steps import scans

RENDER_MENU = (125, 14)  # from the upper left
LONG_SCAN = 16  # frames
FIRST_PIECE = "points_0001-0001.npz"
SMALL_DISK = "/tmp/small_disk"


def type_zeros() -> Step:
    """A field takes the least that makes sense instead, and shows it."""
    before = settings().samples

    def work(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if button.what == "perfect_bvh.samples"]
        yield from point_at(area_of("PROPERTIES"), button)
        yield from press_key("Return")
        yield from type_text("0")
        yield from press_key("Return")
        yield from wait_until(lambda: settings().samples == 1, f"0 samples became {settings().samples}")

    yield from open_panel("Sampling", work)
    settings().samples = before
    yield from redrawn()


def copy_nothing() -> Step:
    """Copy and paste in a Rendered viewport without a selected object: Blender says so, and the image stays."""
    area, layer = area_of("VIEW_3D"), bpy.context.view_layer
    selected = [obj for obj in layer.objects if obj.select_get()]
    with bpy.context.temp_override(**context_of(area)):
        bpy.ops.object.select_all(action="DESELECT")
    yield from finished("nothing selected")
    names, before = set(bpy.data.objects.keys()), image()
    forget_reports()
    hover(*middle_of(area))
    yield from press_key("ctrl+c")
    yield from wait_for_report("No objects selected to copy")
    yield from finished("nothing copied")
    check(set(bpy.data.objects.keys()) == names, "copying nothing makes objects")
    check(np.array_equal(image(), before), "copying nothing changes the image")
    for obj in selected:
        obj.select_set(True)
    yield from redrawn()


# Renders -------------------------------------------------------------------------------------------------------------


def render_and_wait(entry: str = "r") -> Step:
    """Use the menu, as Blender hides reports of scripts' operators. entry: the letter that chooses it there.

    The image replaces the largest area.
    """
    bpy.context.preferences.view.render_display_type = "AREA"
    forget_reports()
    events.clear()
    yield from click(RENDER_MENU[0], front_window().height - RENDER_MENU[1])
    yield from press_key(entry)
    yield from wait_until(lambda: {"render_complete", "render_cancel"} & set(events), "the render does not end")
    yield from wait_until(lambda: not bpy.app.is_job_running("RENDER"), "the render's job does not end")
    yield from at_rest(area_of("PROPERTIES"))


def dismiss_error() -> Step:
    """Move the mouse away from the error, which is shown below the mouse until then."""
    yield from press_key("Escape")
    hover(*middle_of(main_area()))
    yield from handled()


def close_image(kind: str) -> Step:
    """Also checks the panels that show it. kind: of the area that the image replaces."""
    yield from dismiss_error()
    module("statistics.last_result").forget()
    area_of("PROPERTIES").tag_redraw()
    main_area().type = kind
    bpy.context.preferences.view.render_display_type = "WINDOW"
    yield from redrawn()


def render_what_does_not_fit() -> Step:
    render = bpy.context.scene.render
    size = render.resolution_x, render.resolution_y
    render.resolution_x = render.resolution_y = 65536
    yield from render_and_wait()
    yield from wait_for_report("An image of 65,536 x 65,536 pixels needs about")
    screenshot("render_that_does_not_fit")
    render.resolution_x, render.resolution_y = size
    yield from close_image("TEXT_EDITOR")


def render_what_is_broken() -> Step:
    """A texture whose file is missing, and a vertex that is not finite: both are named, and the rest is rendered."""
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
    yield from wait_for_report("paint: it could not be loaded from")
    yield from wait_for_report("Broken: left out 1 triangle with a vertex that is not finite")
    screenshot("render_of_what_is_broken")
    yield from close_image("TEXT_EDITOR")
    for owner, found in (("objects", broken), ("meshes", mesh), ("images", node.image), ("materials", material)):
        getattr(bpy.data, owner).remove(found)
    yield from redrawn()


def render_into_nowhere() -> Step:
    """An animation into a folder that cannot be made ends with its first frame."""
    scene = bpy.context.scene
    before, scene.render.filepath = scene.render.filepath, "/proc/nowhere/image_"
    frame = scene.frame_current
    yield from render_and_wait("a")
    yield from wait_for_report("/proc/nowhere")
    screenshot("render_into_nowhere")
    check(scene.frame_current == frame, f"the frame is {scene.frame_current}, not {frame} as before")
    scene.render.filepath = before
    yield from close_image("TEXT_EDITOR")


# Scans ---------------------------------------------------------------------------------------------------------------


def with_scan_button(work: Callable[[Button], Step]) -> Step:
    def find(buttons: list[Button]) -> Step:
        (button,) = [button for button in buttons if "perfect_bvh.scan(" in button.what]
        yield from work(button)

    yield from open_sidebar("Scan", find)


def mount(*options: str) -> None:
    subprocess.run(["mount", *options, SMALL_DISK], check=True)


def points_of(scan: bpy.types.Object) -> Sequence[object]:
    """Return the points of a point cloud, or of a mesh in an older Blender."""
    return scan.data.points if hasattr(scan.data, "points") else scan.data.vertices


def scan_onto_bad_disks() -> Step:
    """One that may only be read is named before the work; on one that is full the points are kept, and no half file."""
    scan = settings().scan
    size = scan.width, scan.height
    scan.use_files, scan.folder, scan.width, scan.height = True, SMALL_DISK, 200, 100
    os.makedirs(SMALL_DISK, exist_ok=True)
    mount("-t", "tmpfs", "-o", "size=64k,ro", "tmpfs")

    def work(button: Button) -> Step:
        area = area_of("VIEW_3D")
        forget_reports()
        yield from press(area, button)
        yield from wait_for_report(f"Cannot write into {SMALL_DISK}: Read-only file system")
        yield from redrawn()
        screenshot("scan_onto_a_disk_to_read")
        check(not scans() and not is_working(), "a scan whose file cannot be written has begun")
        yield from dismiss_error()
        mount("-o", "remount,rw,size=64k")
        yield from press(area, button)
        yield from wait_for_report(f"Cannot write {SMALL_DISK}/{FIRST_PIECE}: No space left on device")
        yield from redrawn()
        screenshot("scan_onto_a_full_disk")
        check([len(points_of(made)) > 1000 for made in scans()] == [True], "the points are lost with their file")
        check(not os.listdir(SMALL_DISK), f"on the full disk: {os.listdir(SMALL_DISK)}")
        yield from dismiss_error()

    try:
        yield from with_scan_button(work)
    finally:
        subprocess.run(["umount", SMALL_DISK], check=True)
    scan.use_files, scan.folder, scan.width, scan.height = False, "", *size
    for made in scans():
        bpy.data.batch_remove([made.data])
    bpy.ops.ed.undo_push(message="bad disks")
    yield from redrawn()


def set_up_a_long_scan() -> Step:
    """Set up a scan by a LiDAR over many frames, each of which Blender has to evaluate."""
    bpy.ops.object.empty_add(location=(0.0, -6.0, 2.0))
    sensor, scan = bpy.context.object, settings().scan
    sensor.name = "Sensor"
    scan.sensor, scan.pattern, scan.use_frame_range, scan.columns = sensor, "LIDAR", True, 200
    bpy.context.scene.frame_end = LONG_SCAN
    bpy.ops.ed.undo_push(message="a sensor")
    yield from redrawn()


def scan_to_frame(gate: Gate, frame: int) -> Step:
    """Until the frames before are scanned, to whose last step Blender is in this one: it is where a stretch ends."""
    gate.hold_when(lambda _, share: share >= (frame - 1) / LONG_SCAN)
    yield from gate.wait(f"the scan of frame {frame}")
    check(is_working(), "a scan that is held has ended")
    check(bpy.context.scene.frame_current == frame, f"the scan is in frame {bpy.context.scene.frame_current}")


def start_a_long_scan(button: Button, gate: Gate) -> Step:
    gate.hold_when(always)
    yield from press(area_of("VIEW_3D"), button)
    yield from scan_to_frame(gate, 3)
    hover(*middle_of(area_of("VIEW_3D")))
    yield from handled()


def has(name: str) -> bool:
    return name in bpy.context.view_layer.objects


def delete(name: str) -> Step:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == name)
    yield from press_key("Delete")
    yield from wait_until(lambda: not has(name), f"{name} is not deleted")


def undo_until_it_is_there(name: str) -> Step:
    yield from press_key("ctrl+z")
    yield from wait_until(lambda: has(name), f"undo brings no {name} back")


def delete_and_undo_while_scanning() -> Step:
    """Delete with the keyboard: deleting the sensor ends its scan; deleting a scanned object does not."""
    frame, last = bpy.context.scene.frame_current, bpy.context.scene.frame_end
    yield from set_up_a_long_scan()

    def work(button: Button, gate: Gate) -> Step:
        yield from start_a_long_scan(button, gate)
        yield from delete("Sensor")
        gate.open()
        yield from wait_for_report("The sensor 'Sensor' was deleted during the scan")
        yield from wait_until(lambda: not is_working(), "a scan goes on without its sensor")
        screenshot("sensor_deleted_while_scanning")
        check(not scans(), "a scan without its sensor has made an object")
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
        yield from wait_until(lambda: not is_working(), "the scan does not end")
        check([len(points_of(made)) > 1000 for made in scans()] == [True], f"the scan has made {scans()}")
        check(bpy.context.scene.frame_current == frame, "the frame of before does not come back")
        check(has("Hill") and has("Sensor"), "the scan has taken more than it has given")

    with gate_of_steps(module("scanning.scan").Scanner) as gate:
        yield from with_scan_button(lambda button: work(button, gate))
    scan = settings().scan
    scan.sensor, scan.pattern, scan.use_frame_range = None, "CAMERA", False
    bpy.context.scene.frame_end = last
    for obj in (*scans(), bpy.data.objects["Sensor"]):
        bpy.data.objects.remove(obj)
    bpy.ops.ed.undo_push(message="long scans")
    yield from redrawn()
