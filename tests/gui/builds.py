"""Slow tree builds in the tested Blender: a mesh for them, and whether Blender responds during the build."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import bpy
from addon_state import measured, module, settings
from driver import Step, check, redrawn, screenshot, wait_until
from gates import Gate, always, gate_of_builds

sys.path.append(str(Path(__file__).parents[1] / "blender"))

from clouds import add_cloud

TRIANGLES = 1_000_000
ANSWERS = 3


def is_building() -> bool:
    return any(thread.name == module("support.background_work").THREAD_NAME for thread in threading.enumerate())


def with_cloud(work: Callable[[Gate], Step]) -> Step:
    """Do something in the scene with a mesh whose tree build is slow, and is held as soon as it begins.

    Mesh and gate are gone afterwards.
    """
    samples, settings().samples = settings().samples, 256  # enough rays to make a tree worth its time
    active = bpy.context.view_layer.objects.active
    with gate_of_builds() as gate:
        gate.hold_when(always)
        made = add_cloud(TRIANGLES)
        made.display_type = "BOUNDS"  # without a graphics card the wait would be for Blender's own drawing
        yield from redrawn()
        yield from work(gate)
    settings().samples = samples
    mesh = made.data
    bpy.data.objects.remove(made)
    bpy.data.meshes.remove(mesh)
    bpy.context.view_layer.objects.active = active
    yield from redrawn()


def watch_a_build(name: str, gate: Gate) -> Step:
    """Wait for a build to begin, and see that Blender answers a few times before it ends. It is still held then."""
    yield from wait_until(is_building, f"{name}: no tree is built")
    longest, last, answers = 0.0, time.monotonic(), 0
    held = gate.wait(f"{name}: a build")
    while answers < ANSWERS:
        yield next(held, 0.02)
        now = time.monotonic()
        longest, last = max(longest, now - last), now
        answers += gate.is_holding
        check(is_building(), f"{name}: the build was over after {answers} answers: make the mesh larger")
    measured[f"longest silence during a build, {name}, ms"] = 1e3 * longest
    print(f"{name}: {ANSWERS} answers during a build, the last after {1e3 * longest:.0f} ms at most", flush=True)
    screenshot(f"building_{name}")
