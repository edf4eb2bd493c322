"""A sheep: balls that melt into a body, wool that nodes curl out of it, a face, legs, and a fringe to be combed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import bpy
import numpy as np

from .meadow_plants import strew
from .nodes import NodeTree, use_group
from .shapes import Points, Shape, ball, joined, tube
from .stage import make_mesh, paint, place

# Middles and radii of the body's balls, metres; the sheep's feet are at z = 0, and it looks along -X.
BODY = (
    ((-0.22, 0.0, 0.62), 0.36),
    ((0.06, 0.0, 0.62), 0.38),
    ((0.32, 0.0, 0.61), 0.36),
    ((-0.44, 0.0, 0.80), 0.22),
    ((0.05, 0.13, 0.58), 0.28),
    ((0.05, -0.13, 0.58), 0.28),
    ((0.56, 0.0, 0.66), 0.13),
)
HEAD = (-0.66, 0.0, 0.90)
FRINGE_STRANDS, FRINGE_POINTS = 150, 6


@dataclass(frozen=True, slots=True)
class Build:
    """The build of one sheep. wool, head: relative length and size, as multiples of a ewe's. density: of curls."""

    name: str
    size: float = 1.0
    wool: float = 1.0
    head: float = 1.0
    density: float = 6800.0  # on a square metre of the skin of a sheep of size 1


def build_sheep(
    herd: Any, random: np.random.Generator, wool: Any, build: Build, at: tuple[float, float], turn: float
) -> None:
    """One sheep, turned by degrees about Z; its parts follow its body."""
    name, size = build.name, build.size
    skin = bpy.data.materials.get("Face") or paint("Face", (0.055, 0.045, 0.042), 0.6)
    body = place(f"{name} body", make_body(f"{name} body", wool), herd, (*at, 0.0), (0.0, 0.0, turn), size)
    coat = place(f"{name} wool", bpy.data.hair_curves.new(f"{name} wool"), herd, parent=body)
    use_group(coat, wool_group(body, wool, build))
    limbs = place(f"{name} limbs", make_mesh(f"{name} limbs", limbs_of(build.head), [skin], 180.0), herd, parent=body)
    limbs.modifiers.new("Subdivision", "SUBSURF").levels = 1
    limbs.modifiers["Subdivision"].render_levels = 1
    white = bpy.data.materials.get("Eye") or paint("Eye", (0.75, 0.58, 0.22), 0.25)
    place(f"{name} eyes", make_mesh(f"{name} eyes", eyes(build.head), [white], 180.0), herd, parent=body)
    place(f"{name} fringe", make_fringe(f"{name} fringe", random, wool, build), herd, parent=body)


def make_body(name: str, wool: Any) -> Any:
    """Metaballs, melted at once: the file keeps their surface, which is the same in every version."""
    balls = bpy.data.metaballs.new("Body")
    balls.resolution = balls.render_resolution = 0.075
    balls.threshold = 0.42
    for middle, radius in BODY:
        element = balls.elements.new()
        element.co, element.radius = middle, radius * 1.45
    holder = place("Body", balls, bpy.context.scene.collection)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(holder.evaluated_get(depsgraph))
    bpy.data.objects.remove(holder)
    bpy.data.metaballs.remove(balls)
    mesh.name = name
    mesh.materials.clear()
    mesh.materials.append(wool)
    mesh.shade_smooth()
    return mesh


def wool_group(body: Any, wool: Any, build: Build) -> Any:
    """A curl on each of the points strewn over the skin, combed down and backward."""
    tree = NodeTree(f"{build.name} wool")
    strewn = strew(tree, body, build.density, 3)
    curl = tree.add(
        "GeometryNodeCurveSpiral",
        {"Resolution": 8, "Rotations": 1.6, "Start Radius": 0.003, "End Radius": 0.0135, "Height": 0.062 * build.wool},
    )
    spin = {0: (-0.5, -0.5, 0.0), 1: (0.5, 0.5, 6.28), "Seed": 4}
    turn = tree.add("FunctionNodeRandomValue", spin, 0, data_type="FLOAT_VECTOR")
    turn = tree.add(
        "FunctionNodeRotateRotation",
        {0: strewn.outputs["Rotation"], 1: tree.add("FunctionNodeEulerToRotation", {0: turn})},
        rotation_space="LOCAL",
    )
    size = tree.add("FunctionNodeRandomValue", {2: 0.65, 3: 1.15, "Seed": 5}, 1, data_type="FLOAT")
    sites = {"Points": strewn.outputs["Points"], "Instance": curl, "Rotation": turn, "Scale": size}
    curls = tree.add("GeometryNodeRealizeInstances", {0: tree.add("GeometryNodeInstanceOnPoints", sites)})
    along = tree.add("GeometryNodeSplineParameter")
    combed = tree.add("GeometryNodeSetPosition", {"Geometry": curls, "Offset": comb(tree, along, 0.085 * build.wool)})
    taper = tree.math("SUBTRACT", 1.0, tree.math("MULTIPLY", along, 0.55))
    thick = {"Curve": combed, "Radius": tree.math("MULTIPLY", taper, 0.0026)}
    curls = tree.add("GeometryNodeSetCurveRadius", thick)
    return tree.finish(tree.add("GeometryNodeSetMaterial", {"Geometry": curls, "Material": wool}))


def comb(tree: NodeTree, along: Any, reach: float) -> Any:
    """Tips hang, and lie in locks: strands near one another go the same way."""
    place_ = tree.add("GeometryNodeInputPosition")
    lock = tree.add("ShaderNodeTexNoise", {"Vector": place_, "Scale": 7.0, "Detail": 1.0}, "Color")
    way = tree.add("ShaderNodeVectorMath", {0: lock, 1: (0.42, 0.5, 0.78)}, operation="SUBTRACT")
    far = tree.math("MULTIPLY", tree.math("POWER", along, 1.5), reach)
    return tree.add("ShaderNodeVectorMath", {0: way, "Scale": far}, operation="SCALE")


def make_fringe(name: str, random: np.random.Generator, wool: Any, build: Build) -> Any:
    """Hair curves on the forehead, stored in the file, not generated by nodes."""
    data = bpy.data.hair_curves.new(name)
    data.add_curves([FRINGE_POINTS] * FRINGE_STRANDS)
    turn, tilt = random.uniform(0.0, 2.0 * pi, FRINGE_STRANDS), np.sqrt(random.uniform(0.0, 1.0, FRINGE_STRANDS)) * 1.15
    way = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], axis=1)
    root = np.array(HEAD) + build.head * ((0.035, 0.0, 0.055) + way * (0.075, 0.068, 0.055))
    step = np.linspace(0.0, 1.0, FRINGE_POINTS)
    length = random.uniform(0.05, 0.085, FRINGE_STRANDS)
    curl = 0.009 * np.stack(
        [np.cos(5.0 * step + 9.0 * turn[:, None]), np.sin(5.0 * step + 9.0 * turn[:, None])], axis=2
    )
    points = root[:, None] + way[:, None] * (length[:, None] * step)[..., None]
    points[..., :2] += curl * step[:, None]
    points[..., 0] -= 0.03 * step**2
    points[..., 2] -= 0.035 * step**2
    data.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    radii = np.tile(0.0021 * (1.0 - 0.6 * step), FRINGE_STRANDS).astype(np.float32)
    data.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", radii)
    data.materials.append(wool)
    return data


def limbs_of(head: float) -> Shape:
    """Head, ears and legs. head: size as a multiple of a ewe's."""
    nose = [(-0.60, 0.0, 0.93), (-0.67, 0.0, 0.915), (-0.755, 0.0, 0.855), (-0.815, 0.0, 0.805), (-0.84, 0.0, 0.785)]
    parts = [tube(about_head(nose, head), head * np.array([0.07, 0.098, 0.085, 0.062, 0.028]), 12)]
    for side in (-1.0, 1.0):
        ear = [(-0.63, 0.07 * side, 0.945), (-0.635, 0.13 * side, 0.945), (-0.65, 0.19 * side, 0.915)]
        ear.append((-0.655, 0.235 * side, 0.875))
        parts.append(tube(about_head(ear, head), head * np.array([0.02, 0.036, 0.034, 0.008]), 8))
        for x, z in ((-0.24, 0.5), (0.33, 0.5)):
            foot = [
                (x, 0.15 * side, z),
                (x + 0.015, 0.15 * side, 0.25),
                (x, 0.15 * side, 0.06),
                (x - 0.02, 0.15 * side, 0.0),
            ]
            parts.append(tube(np.array(foot), np.array([0.075, 0.05, 0.042, 0.052]), 8))
    return joined(parts)


def eyes(head: float) -> Shape:
    places = about_head([(-0.715, 0.074, 0.912), (-0.715, -0.074, 0.912)], head)
    return joined(ball(middle, 0.017 * head) for middle in places)


def about_head(points: Sequence[Sequence[float]], size: float) -> Points:
    """Points of a ewe's head, for one of another size."""
    return np.asarray(np.array(HEAD) + size * (np.array(points) - HEAD))
