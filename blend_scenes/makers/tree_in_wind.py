"""An autumn tree on a hill that sways in gusts: its mesh deforms on every frame and never changes its topology.

The file holds a skeleton of poly-lines and the places of twigs. Geometry nodes skin the one and set leaves on the
other; a lattice with two shape keys bends it all.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, pi, sin
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from .nodes import NodeTree, add_attribute, use_group
from .shapes import Points, Shape, joined, shape
from .stage import (
    add_camera,
    add_light,
    light_world,
    make_collection,
    make_mesh,
    open_stage,
    paint,
    place,
)
from .tree_land import build_hill

FRAMES = 48
WIDTH, HEIGHT = 9.0, 7.4  # of the lattice, metres


@dataclass(slots=True)
class Skeleton:
    """Poly-lines of the branches, with a radius a point, and twigs: where they sit and where they point."""

    points: list[Points] = field(default_factory=list)
    radii: list[float] = field(default_factory=list)
    edges: list[tuple[int, int]] = field(default_factory=list)
    twigs: list[tuple[Points, Points]] = field(default_factory=list)


def make() -> None:
    open_stage("Tree in wind", FRAMES)
    random = np.random.default_rng(48)
    tree = build_tree(random)
    tree.modifiers.new("Wind", "LATTICE").object = build_wind()
    blow_leaves(random)
    build_hill(random)
    light_world((0.40, 0.58, 0.88), 0.5)
    add_light("SUN", "Sun", (-6.0, -7.0, 9.0), (0.0, 0.0, 3.0), 4.5, (1.0, 0.90, 0.75), 1.0)
    add_light("AREA", "Sky bounce", (8.0, -4.0, 6.0), (0.0, 0.0, 4.0), 120.0, (0.75, 0.86, 1.0), 5.0)
    add_camera((-2.3, -15.2, 2.1), (1.0, 0.0, 3.75), 34.0)


def grow(
    tree: Skeleton, random: np.random.Generator, start: Points, way: Points, length: float, radius: float, level: int
) -> None:
    """One branch and its twigs and leaves. level counts down; twigs sit on levels 1 and 0."""
    steps = (4, 5, 7, 10)[level]
    first = len(tree.points)
    at, heading = start, way / np.linalg.norm(way)
    lift = (0.02, 0.07, 0.09, 0.03)[level]
    places = []
    for step in range(steps + 1):
        tree.points.append(at)
        tree.radii.append(radius * (1.0 - 0.75 * step / steps) + 0.004)
        places.append((at, heading))
        heading = heading + random.normal(0.0, 0.10, 3) + np.array([0.0, 0.0, lift])
        heading /= np.linalg.norm(heading)
        at = at + heading * (length / steps)
    tree.edges += [(first + k, first + k + 1) for k in range(steps)]
    if level == 0:
        tree.twigs += [(place_, twig_way(random, way_)) for place_, way_ in places[1:]]
        return
    tree.twigs += [(place_, twig_way(random, way_)) for place_, way_ in places[2:] if level == 1]
    sprout(tree, random, places, length, radius, level)


def sprout(
    tree: Skeleton,
    random: np.random.Generator,
    places: list[tuple[Points, Points]],
    length: float,
    radius: float,
    level: int,
) -> None:
    """The side branches of a branch, round it by the golden angle."""
    count, low = ((0, 0.0), (5, 0.25), (7, 0.28), (9, 0.36))[level]
    spin = random.uniform(0.0, 2.0 * pi)
    for k in range(count):
        along = low + (1.0 - low) * (k + 0.6) / count
        at, heading = places[min(len(places) - 1, int(along * (len(places) - 1) + 0.5))]
        side = np.cross(heading, (0.3, 0.2, 1.0))
        side /= np.linalg.norm(side)
        other = np.cross(heading, side)
        turn = spin + 2.39996 * k
        angle = random.normal(0.95, 0.10) * (1.12 - 0.45 * along)
        way = heading * cos(angle) + (side * cos(turn) + other * sin(turn)) * sin(angle)
        share = (0.72 - 0.30 * along) * random.uniform(0.85, 1.1)
        grow(tree, random, at, way, length * share, radius * (0.62 - 0.3 * along), level - 1)


def twig_way(random: np.random.Generator, heading: Points) -> Points:
    way = heading + random.normal(0.0, 0.55, 3) + np.array([0.0, 0.0, 0.1])
    return way / np.linalg.norm(way)


def build_tree(random: np.random.Generator) -> Any:
    tree = Skeleton()
    grow(tree, random, np.array([0.0, 0.0, -0.15]), np.array([0.06, -0.02, 1.0]), 5.4, 0.30, 3)
    bones, twigs = len(tree.points), len(tree.twigs)
    mesh = bpy.data.meshes.new("Tree skeleton")
    mesh.from_pydata(np.array(tree.points + [at for at, _ in tree.twigs]), tree.edges, [])
    turns = [Vector(way).to_track_quat("Y", "Z").to_euler() for _, way in tree.twigs]
    add_attribute(mesh, "radius", "FLOAT", np.array(tree.radii + [0.0] * twigs, np.float32))
    add_attribute(mesh, "is_twig", "BOOLEAN", np.arange(bones + twigs) >= bones)
    add_attribute(mesh, "turn", "FLOAT_VECTOR", np.array([(0.0, 0.0, 0.0)] * bones + turns, np.float32).ravel())
    add_attribute(mesh, "kind", "INT", np.concatenate([np.zeros(bones), random.integers(0, 4, twigs)]).astype(np.int32))
    mesh.update()
    item = place("Tree", mesh, make_collection("Tree"))
    use_group(item, foliage_group(make_twigs(random), paint("Bark", (0.17, 0.115, 0.085), 0.9)))
    return item


def make_twigs(random: np.random.Generator) -> Any:
    """Four twigs in the colours of autumn, in a collection that only the nodes show."""
    twigs = make_collection("Twigs", instanced=True)
    colours = [(0.72, 0.20, 0.03), (0.78, 0.37, 0.04), (0.50, 0.09, 0.03), (0.74, 0.50, 0.08)]
    for number, colour in enumerate(colours):
        mesh = make_mesh(f"Twig {number}", twig(random), [paint(f"Leaves {number}", colour, 0.6)], 180.0)
        place(f"Twig {number}", mesh, twigs)
    return twigs


def twig(random: np.random.Generator, leaves: int = 7) -> Shape:
    """Leaves along +Y, left and right in turn, each folded along its midrib and drooping."""
    parts = []
    for k in range(leaves):
        length = 0.215 * random.uniform(0.8, 1.15)
        half = length * 0.34
        rows = [(0.0, 0.0), (half * 0.9, 0.35), (half * 0.85, 0.6), (0.0, 1.0)]
        vertices = []
        for reach, t in rows:
            y, droop = length * t, -0.32 * length * t * t
            vertices += [(-reach, y, droop + reach * 0.35), (0.0, y, droop), (reach, y, droop + reach * 0.35)]
        blade = shape(
            [vertices[k] for k in (1, 3, 4, 5, 6, 7, 8, 10)],
            [(0, 2, 1), (0, 3, 2), (1, 2, 5, 4), (2, 3, 6, 5), (4, 5, 7), (5, 6, 7)],
        )
        side = (1 if k % 2 else -1) * random.uniform(0.6, 1.1)
        blade = blade.turned_y(random.normal(0.0, 0.5)).turned_z(-side).turned_x(random.normal(0.0, 0.3))
        parts.append(blade.moved(y=0.42 * k / leaves))
    return joined(parts)


def foliage_group(twigs: Any, bark: Any) -> Any:
    """Skin the poly-lines, set twigs that flutter on the loose points, and make one mesh of it."""
    tree = NodeTree("Foliage")
    radius = tree.attribute("radius")
    lines = tree.add("GeometryNodeMeshToCurve", {0: tree.geometry})
    lines = tree.add("GeometryNodeSetCurveRadius", {"Curve": lines, "Radius": radius})
    circle = tree.add("GeometryNodeCurvePrimitiveCircle", {"Resolution": 6, "Radius": 1.0})
    skin_inputs = {"Curve": lines, "Profile Curve": circle, "Fill Caps": True}
    if bpy.app.version >= (5, 0, 0):
        skin_inputs["Scale"] = radius  # before 5.0 the curve's radius was taken without asking
    skin = tree.add("GeometryNodeCurveToMesh", skin_inputs)
    skin = tree.add("GeometryNodeSetMaterial", {"Geometry": skin, "Material": bark})
    beat = tree.math("MULTIPLY", tree.frame(), 2.0 * pi / 12.0)
    flutter = tree.math("SINE", tree.math("ADD", beat, tree.math("MULTIPLY", tree.add("GeometryNodeInputIndex"), 2.4)))
    swing = tree.add(
        "ShaderNodeCombineXYZ", {"X": tree.math("MULTIPLY", flutter, 0.16), "Y": tree.math("MULTIPLY", flutter, 0.3)}
    )
    turn = tree.add("FunctionNodeEulerToRotation", {0: tree.attribute("turn", "FLOAT_VECTOR")})
    turn = tree.add(
        "FunctionNodeRotateRotation",
        {0: turn, 1: tree.add("FunctionNodeEulerToRotation", {0: swing})},
        rotation_space="LOCAL",
    )
    source = tree.add(
        "GeometryNodeCollectionInfo", {"Collection": twigs, "Separate Children": True, "Reset Children": True}
    )
    sites = {"Points": tree.geometry, "Selection": tree.attribute("is_twig", "BOOLEAN"), "Instance": source}
    sites |= {"Pick Instance": True, "Instance Index": tree.attribute("kind", "INT"), "Rotation": turn}
    leaves = tree.add("GeometryNodeRealizeInstances", {0: tree.add("GeometryNodeInstanceOnPoints", sites)})
    both = tree.group.nodes.new("GeometryNodeJoinGeometry")
    for part in (leaves, skin):
        tree.group.links.new(part, both.inputs[0])
    return tree.finish(both.outputs[0])


def build_wind() -> Any:
    """A lattice round the tree; its keys lean it to +X and sway it to and fro along Y."""
    data = bpy.data.lattices.new("Wind")
    data.points_u, data.points_v, data.points_w = 3, 3, 7
    scale = (WIDTH / 2.0, WIDTH / 2.0, HEIGHT / 6.0)  # its points lie one unit apart
    lattice = place("Wind", data, make_collection("Wind"), (0.0, 0.0, HEIGHT / 2), size=scale)
    lattice.hide_render = True
    lattice.shape_key_add(name="Still")
    for name, angle, axis in (("Lean", 0.62, 0), ("Sway", 0.34, 1)):
        key = lattice.shape_key_add(name=name)
        for point, moved in zip(data.points, key.data, strict=True):
            metres = np.array(point.co) * scale + (0.0, 0.0, HEIGHT / 2)
            moved.co = (arched(metres, angle, axis) - (0.0, 0.0, HEIGHT / 2)) / scale
    for frame in range(1, FRAMES + 2, 3):
        t = 2.0 * pi * (frame - 1) / FRAMES
        gust = 0.52 + 0.36 * sin(t - 0.8) + 0.14 * sin(3.0 * t)
        for name, value in (("Lean", gust), ("Sway", 0.55 * sin(2.0 * t) + 0.25 * cos(3.0 * t))):
            key = data.shape_keys.key_blocks[name]
            key.slider_min, key.value = -1.0, value
            key.keyframe_insert("value", frame=frame)
    return lattice


def arched(point: Points, angle: float, axis: int) -> Points:
    """A point (metres) as the tree bends towards an axis: upright at the foot, by `angle` radians at the top."""
    heights = np.linspace(0.0, point[2], 33)
    turns = angle * (heights / HEIGHT) ** 1.4
    bent = point.copy()
    rise = np.diff(heights)
    middles = (turns[1:] + turns[:-1]) / 2
    bent[axis] = np.sin(middles) @ rise + point[axis] * cos(turns[-1])
    bent[2] = np.cos(middles) @ rise - point[axis] * sin(turns[-1])
    return bent


def blow_leaves(random: np.random.Generator) -> None:
    """Leaves torn off: each flies down the wind on a straight, tumbling way."""
    air = make_collection("Flying leaves")
    meshes = [
        make_mesh(f"Flying leaf {k}", twig(random, 1), [bpy.data.materials[f"Leaves {k}"]], 180.0) for k in range(4)
    ]
    for number in range(22):
        start = np.array([0.8, 0.0, 4.2]) + random.normal(0.0, 1.0, 3) * (2.6, 1.2, 1.3)
        travel = np.array([4.6, -0.6, -0.9]) + random.normal(0.0, 0.5, 3)
        tumble = random.uniform(-5.0, 5.0, 3)
        leaf = place(f"Flying leaf {number}", meshes[number % 4], air)
        for frame in (1, 16, 32, FRAMES):
            t = (frame - 1) / (FRAMES - 1)
            leaf.location = start + travel * t + (0.0, 0.0, 0.25 * sin(9.0 * t + number))
            leaf.rotation_euler = tumble * t
            leaf.keyframe_insert("location", frame=frame)
            leaf.keyframe_insert("rotation_euler", frame=frame)
