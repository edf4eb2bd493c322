"""Shared helpers for tests of drives: a small street with a sensor and a camera that go through it, and its file."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import numpy as np
import pytest

SENSOR = 'kind = "spinning"\nelevations = { first = -20, last = 8, count = 24 }\ncolumns = 500\nrate = 10\n'
WIDTH, HEIGHT = 240, 135


def save_drive(folder: Path) -> Path:
    """Save a file of three frames, and `sensor.toml` next to it; the file is open afterwards.

    The sensor's mount, Ego, goes ahead and turns; the camera is on it. Cars and a walker have a class, the ground and a
    wall, which hides most of the car Half and all of the car Hidden, have none.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 3, 10
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.world = bpy.data.worlds.new("World")
    bpy.ops.mesh.primitive_plane_add(size=80.0)
    bpy.context.object.name = "Ground"
    add_box("Wall", (3.0, 14.0, 1.5), (3.0, 0.3, 3.0))
    add_box("Car ahead", (-1.0, 12.0, 0.8), (1.8, 4.2, 1.6), 0.4, "Car")
    add_box("Half", (2.5, 18.0, 0.8), (1.8, 4.2, 1.6), -0.2, "Car")
    add_box("Hidden", (5.0, 19.0, 0.5), (0.6, 0.6, 0.6), 0.0, "Car")
    add_box("Aside", (-4.5, 5.0, 0.8), (1.8, 4.2, 1.6), 0.1, "Car")
    add_box("Behind", (1.0, -9.0, 0.8), (1.8, 4.2, 1.6), 0.0, "Car")
    walker = add_box("Walker", (2.0, 8.0, 0.9), (0.5, 0.4, 1.8), 1.2, "On foot")
    ego = bpy.data.objects.new("Ego", None)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler, camera.parent = (0.1, 0.6, -0.2), (np.pi / 2, 0.0, 0.0), ego
    for thing in (ego, camera):
        scene.collection.objects.link(thing)
    scene.camera, camera.data.lens = camera, 24.0
    for frame, share in ((1, 0.0), (3, 1.0)):
        walker.location.x = 2.0 - share
        ego.location, ego.rotation_euler = (0.2 * share, 1.0 * share, 1.7), (0.0, 0.0, 0.1 * share)
        walker.keyframe_insert("location", frame=frame)
        ego.keyframe_insert("location", frame=frame)
        ego.keyframe_insert("rotation_euler", frame=frame)
    (folder / "sensor.toml").write_text(SENSOR)
    path = folder / "drive.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def add_box(name: str, place: tuple[float, ...], size: tuple[float, ...], turn: float = 0.0, kind: str = "") -> Any:
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place, rotation=(0.0, 0.0, turn), scale=size)
    made = bpy.context.object
    made.name = name
    if kind:
        made["class"] = kind
    return made


def asked(path: Path, folder: Path, kind: str, *more: object) -> tuple[object, ...]:
    """Return the arguments of a scan of three frames."""
    sensor = path.parent / "sensor.toml"
    common = ("scan", path, "-o", folder, "--sensor", sensor, "--on", "Ego", "--format", kind, "-q")
    return (*common, *(() if "--frames" in more else ("--frames", "1-3")), *more)


def pykitti(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Import pykitti; for its labels of tracking, which are not read here, it imports OpenCV and pandas."""
    for name in ("cv2", "pandas"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    return pytest.importorskip("pykitti", reason="pykitti is not installed: pip install '.[test]'")
