"""Shared helpers of the command line's tests: calls of it in this process, and a small file for it."""

from __future__ import annotations

from pathlib import Path

import bpy
from perfect_bvh_addon import unregister
from perfect_bvh_addon.cli import build_parser, main
from perfect_bvh_addon.cli.commands import run_bench
from perfect_bvh_addon.cli.render import run_render


def run(*arguments: object) -> int:
    """Run `perfect-bvh` with these arguments; return its exit status."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as stop:  # argparse's own errors
        return stop.code
    finally:
        unregister()


def run_command(*arguments: object) -> int:
    """Run `render` or `bench` in the same way, but raise errors instead of printing them."""
    parsed = build_parser("perfect-bvh").parse_args([str(argument) for argument in arguments])
    return {"render": run_render, "bench": run_bench}[parsed.command](parsed)


def save_small_file(path: Path) -> None:
    """Save a file of two frames: a moving cube and a bending sheet, 64 x 36 pixels."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=20, y_subdivisions=20, size=6.0)
    sheet = bpy.context.object
    sheet.name = sheet.data.name = "Sheet"
    sheet.shape_key_add(name="Basis")
    bent = sheet.shape_key_add(name="Bent")
    for point in bent.data:
        point.co.z = 0.1 * point.co.x**2
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 1.5))
    cube = bpy.context.object
    for frame in (1, 2):
        bent.value = cube.location.x = frame - 1.0
        bent.keyframe_insert("value", frame=frame)
        cube.keyframe_insert("location", frame=frame)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (5.0, -5.0, 5.0), (0.96, 0.0, 0.785)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 128, 72, 50
    scene.render.image_settings.exr_codec = "NONE"  # as the tests' reader wants it
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
