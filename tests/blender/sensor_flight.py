"""Shared helpers for tests of scans that write files: a small scene with a sensor that flies past it, and the files."""

from __future__ import annotations

from pathlib import Path

import bpy
from blender.command_lines import save_small_file

SENSOR = 'kind = "spinning"\nelevations = { first = -30, last = 30, count = 9 }\ncolumns = 120\nrate = 12\n'


def save_flight(folder: Path, sensor: str = SENSOR, last_frame: int = 9) -> Path:
    """Save `small.blend` with an empty, Head, that flies past from frame 1 to the last, and `sensor.toml` next to it.

    The file is open afterwards.
    """
    path = folder / "small.blend"
    save_small_file(path)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    head = bpy.data.objects.new("Head", None)
    bpy.context.scene.collection.objects.link(head)
    for frame, x in ((1, -2.0), (last_frame, 2.0)):
        head.location = (x, -3.0, 1.0)
        head.keyframe_insert("location", frame=frame)
    bpy.ops.wm.save_mainfile()
    (folder / "sensor.toml").write_text(sensor)
    return path


def contents(folder: Path) -> dict[str, bytes]:
    """Read all files of a folder: their bytes by name, in the order of the names."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
