"""What tests of scans that become files share: a small scene with a sensor that flies past it, and what came of it."""

from __future__ import annotations

from pathlib import Path

import bpy
from blender.command_lines import save_small_file

SENSOR = 'kind = "spinning"\nelevations = { first = -30, last = 30, count = 9 }\ncolumns = 120\nrate = 12\n'


def save_flight(folder: Path, sensor: str = SENSOR, last_frame: int = 9) -> Path:
    """`small.blend` with an empty, Head, that flies past from frame 1 to the last; beside it `sensor.toml`.

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
    """Of all files of a folder, whatever their names are, by these in their order."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
