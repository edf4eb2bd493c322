"""A block of sea in a wooden tray, with a lighthouse and a boat: topology that changes on every frame.

An ocean modifier shapes a cube's top, geometry nodes square its sides, and a voxel remesh makes of it another mesh,
with other counts, on each frame. Spray is metaballs, which change no less.
"""

from __future__ import annotations

from math import pi, sin
from typing import Any

import bpy
import numpy as np

from .nodes import NodeTree, use_group
from .ocean_props import DEPTH, HALF, ROCK, build_boat, build_buoy, build_lighthouse, build_tray
from .shapes import box
from .stage import (
    add_camera,
    add_light,
    animation_curves,
    light_world,
    make_collection,
    make_mesh,
    open_stage,
    paint,
    place,
    subdivide,
)

FRAMES = 48
VOXEL = 0.079  # no divisor of HALF: voxel corners on the block's sides would cause flaps of doubled faces
BOAT = (-1.35, -0.75)
BUOY = (0.9, -2.3)


def make() -> None:
    open_stage("Ocean", FRAMES)
    random = np.random.default_rng(4)
    sea = build_sea()
    build_lighthouse(random)
    build_tray()
    boat, buoy = build_boat(), build_buoy()
    float_on(sea, {boat: (BOAT, 0.55), buoy: (BUOY, 0.25)})
    build_spray(random)
    light_world((0.50, 0.62, 0.80), 0.6)
    add_light("SUN", "Sun", (-7.0, -5.0, 8.0), (0.0, 0.0, 0.0), 3.6, (1.0, 0.90, 0.76), 1.0)
    add_light("AREA", "Fill", (7.0, -7.0, 4.0), (0.0, 0.0, 0.0), 260.0, (0.75, 0.86, 1.0), 5.0)
    add_light("POINT", "Lamp", (*ROCK, 3.55), (*ROCK, 0.0), 60.0, (1.0, 0.75, 0.35), 0.12)
    add_camera((5.2, -12.4, 5.6), (0.05, -0.1, 0.45), 40.0)


def build_sea() -> Any:
    water = make_collection("Water")
    cube = box((-HALF * 1.06, -HALF * 1.06, -DEPTH), (HALF * 1.06, HALF * 1.06, 0.0))
    item = place("Sea", make_mesh("Sea block", cube, [paint("Sea", (0.03, 0.20, 0.26), 0.18)]), water)
    subdivide(item, 6, simple=True)
    ocean = item.modifiers.new("Ocean", "OCEAN")
    ocean.geometry_mode = "DISPLACE"
    ocean.resolution = ocean.viewport_resolution = 9
    ocean.spatial_size = 9
    ocean.wind_velocity = 5.2
    ocean.wave_scale, ocean.choppiness = 0.5, 1.25
    ocean.wave_scale_min = 0.15
    ocean.wave_alignment, ocean.wave_direction = 0.4, 0.6
    ocean.random_seed = 11
    ocean.filepath = "//cache_ocean"
    for frame, time in ((1, 1.0), (FRAMES + 1, 4.2)):
        ocean.time = time
        ocean.keyframe_insert("time", frame=frame)
    for curve in animation_curves(item):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    use_group(item, square_sides())
    remesh = item.modifiers.new("Remesh", "REMESH")
    remesh.mode, remesh.voxel_size = "VOXEL", VOXEL
    remesh.use_smooth_shade = True
    use_group(item, dark_sides(paint("Sea deep", (0.010, 0.075, 0.115), 0.2)))
    return item


def square_sides() -> Any:
    """Clamps X and Y to the block and lays everything below half its depth on the bottom."""
    tree = NodeTree("Square sides")
    position = tree.add("GeometryNodeInputPosition")
    high = tree.add("ShaderNodeVectorMath", {0: position, 1: (HALF, HALF, 100.0)}, operation="MINIMUM")
    inside = tree.add("ShaderNodeVectorMath", {0: high, 1: (-HALF, -HALF, -100.0)}, operation="MAXIMUM")
    parts = tree.group.nodes.new("ShaderNodeSeparateXYZ")
    tree.group.links.new(inside, parts.inputs[0])
    flat = tree.add("ShaderNodeCombineXYZ", {"X": parts.outputs["X"], "Y": parts.outputs["Y"], "Z": -DEPTH})
    moved = tree.add("GeometryNodeSetPosition", {"Geometry": tree.geometry, "Position": inside})
    height = tree.group.nodes.new("ShaderNodeSeparateXYZ")
    tree.group.links.new(tree.add("GeometryNodeInputPosition"), height.inputs[0])
    is_low = tree.add(
        "FunctionNodeCompare", {0: height.outputs["Z"], 1: -DEPTH / 2}, data_type="FLOAT", operation="LESS_THAN"
    )
    return tree.finish(tree.add("GeometryNodeSetPosition", {"Geometry": moved, "Selection": is_low, "Position": flat}))


def dark_sides(deep: Any) -> Any:
    """Paints the block's cut sides as deep water."""
    tree = NodeTree("Dark sides")
    parts = tree.group.nodes.new("ShaderNodeSeparateXYZ")
    tree.group.links.new(tree.add("GeometryNodeInputNormal"), parts.inputs[0])
    is_side = tree.math("LESS_THAN", parts.outputs["Z"], 0.12)
    return tree.finish(
        tree.add("GeometryNodeSetMaterial", {"Geometry": tree.geometry, "Selection": is_side, "Material": deep})
    )


def float_on(sea: Any, floats: dict[Any, tuple[tuple[float, float], float]]) -> None:
    """Keys floating objects to the water's height and slope under them, every third frame."""
    scene = bpy.context.scene
    for frame in range(1, FRAMES + 1, 3):
        scene.frame_set(frame)
        surface = sea.evaluated_get(bpy.context.evaluated_depsgraph_get())
        for item, ((x, y), reach) in floats.items():
            height = [
                water_height(surface, x + dx, y + dy) for dx, dy in ((reach, 0), (-reach, 0), (0, reach), (0, -reach))
            ]
            item.location = (x, y, sum(height) / 4.0 + 0.06)
            pitch, roll = (height[0] - height[1]) / (2 * reach), (height[3] - height[2]) / (2 * reach)
            item.rotation_euler = (-0.8 * roll, -0.8 * pitch, item.rotation_euler[2])
            item.keyframe_insert("location", frame=frame)
            item.keyframe_insert("rotation_euler", frame=frame)


def water_height(surface: Any, x: float, y: float) -> float:
    hit, point, _, _ = surface.ray_cast((x, y, 5.0), (0.0, 0.0, -1.0))
    if not hit:
        raise ValueError(f"water_height: no water at ({x:g}, {y:g})")
    return float(point[2])


def build_spray(random: np.random.Generator) -> None:
    """Three bursts against the rock: each drop flies on its parabola, and shrinks to nothing before and after."""
    drops = bpy.data.metaballs.new("Spray")
    drops.resolution = drops.render_resolution = 0.045
    drops.threshold = 0.25
    drops.materials.append(paint("Foam", (0.72, 0.84, 0.86), 0.3))
    place("Spray", drops, bpy.data.collections["Water"])
    for number in range(48):
        start = (-6, 10, 25)[number % 3]
        life = int(random.integers(14, 23))
        foot = np.array([ROCK[0] - 0.95, ROCK[1] - 0.75, 0.05]) + random.normal(0.0, 0.2, 3) * (1.0, 1.0, 0.3)
        speed = np.array([-0.25, -0.35, 2.5]) + random.normal(0.0, 0.42, 3) * (1.3, 1.3, 1.0)
        ball = drops.elements.new()
        full = random.uniform(0.07, 0.2)
        for share in (0.0, 0.15, 0.4, 0.7, 1.0):
            frame = start + share * life
            seconds = share * life / 24.0
            ball.co = foot + speed * seconds - np.array([0.0, 0.0, 2.6 * seconds**2])
            ball.radius = full * max(0.02, sin(pi * min(1.0, 0.1 + 0.9 * share)))
            ball.keyframe_insert("co", frame=frame)
            ball.keyframe_insert("radius", frame=frame)
