"""The meadow's plants: grass that sways, flowers, and a tree as a scanner would see it."""

from __future__ import annotations

from math import cos, sin
from typing import Any

import bpy
import numpy as np

from .nodes import NodeTree, use_group
from .shapes import Points, ball, grid, joined, shape, tube
from .stage import make_collection, make_mesh, paint, place

BLADE_POINTS = 5
# Of each kind of grass: its name, its colour, blades on a square metre near the camera, their length and radius.
GRASSES = (
    ("Fresh grass", (0.19, 0.36, 0.045), 1500.0, 0.115, 0.0021),
    ("Young grass", (0.33, 0.46, 0.075), 900.0, 0.145, 0.0017),
    ("Dry grass", (0.56, 0.47, 0.17), 220.0, 0.19, 0.0012),
)


def meadow_height(x: Points, y: Points) -> Points:
    """The height of the ground: level where the sheep are, hilly beyond."""
    away = 1.0 - np.exp(-(x * x + y * y) / 30.0)
    return away * (0.22 * np.sin(0.33 * x + 0.8) * np.sin(0.27 * y + 0.4) + 0.012 * np.maximum(0.0, y))


def build_lawn() -> None:
    """Three grasses over one another, so that the lawn is of many greens."""
    lawn = make_collection("Lawn")
    bed = place("Bed", make_bed(), lawn)
    bed.hide_render = bed.hide_viewport = True  # the nodes read it
    for number, (name, colour, density, length, radius) in enumerate(GRASSES):
        item = place(name, bpy.data.hair_curves.new(name), lawn)
        use_group(item, lawn_group(bed, name, paint(name, colour, 0.55), density, length, radius, number))


def make_bed() -> Any:
    """The ground that the camera sees, with a density that falls off with the distance; no ray meets it itself."""
    sheet = grid(36, 44, 9.0, 11.0)
    x, y = sheet.vertices[:, 0] * (1.0 + 0.08 * (sheet.vertices[:, 1] + 5.5)), sheet.vertices[:, 1] + 2.1
    form = shape(np.column_stack([x, y, meadow_height(x, y)]), sheet.faces)
    mesh = make_mesh("Bed", form, [], 180.0)
    away = np.hypot(x + 0.55, y + 4.1)
    share = np.clip(1.25 - away / 9.5, 0.10, 1.0) * (away < 11.0) * (np.abs(x + 0.4) < 0.75 + 0.62 * (y + 4.1))
    mesh.attributes.new("density", "FLOAT", "POINT").data.foreach_set("value", share.astype(np.float32))
    return mesh


def lawn_group(bed: Any, name: str, material: Any, density: float, length: float, radius: float, seed: int) -> Any:
    tree = NodeTree(name)
    points = strew(tree, bed, tree.math("MULTIPLY", tree.attribute("density"), density), seed).outputs["Points"]
    blades = stand_on(tree, points, length, seed)
    along = tree.add("GeometryNodeSplineParameter")
    bent = tree.add("GeometryNodeSetPosition", {"Geometry": blades, "Offset": sway(tree, along, length)})
    taper = tree.math("POWER", tree.math("SUBTRACT", 1.0, along), 0.6)
    round_ = tree.add("GeometryNodeSetCurveRadius", {"Curve": bent, "Radius": tree.math("MULTIPLY", taper, radius)})
    return tree.finish(tree.add("GeometryNodeSetMaterial", {"Geometry": round_, "Material": material}))


def strew(tree: NodeTree, source: Any, density: Any, seed: int) -> Any:
    """The node that strews points over an object's mesh, which its own space is that of."""
    surface = tree.add("GeometryNodeObjectInfo", {"Object": source}, "Geometry")
    node = tree.group.nodes.new("GeometryNodeDistributePointsOnFaces")
    tree.group.links.new(surface, node.inputs["Mesh"])
    if isinstance(density, bpy.types.NodeSocket):
        tree.group.links.new(density, node.inputs["Density"])
    else:
        node.inputs["Density"].default_value = density
    node.inputs["Seed"].default_value = seed
    return node


def stand_on(tree: NodeTree, points: Any, length: float, seed: int) -> Any:
    """Straight curves upward from points, each with a random lean and length."""
    line = tree.add("GeometryNodeCurvePrimitiveLine", {"End": (0.0, 0.0, length)})
    line = tree.add("GeometryNodeResampleCurve", {"Curve": line, "Count": BLADE_POINTS})
    tilt = tree.add(
        "FunctionNodeRandomValue",
        {0: (-0.42, -0.42, 0.0), 1: (0.42, 0.42, 6.28), "Seed": seed + 11},
        0,
        data_type="FLOAT_VECTOR",
    )
    turn = tree.add("FunctionNodeEulerToRotation", {0: tilt})
    size = tree.add("FunctionNodeRandomValue", {2: 0.45, 3: 1.15, "Seed": seed + 23}, 1, data_type="FLOAT")
    sites = {"Points": points, "Instance": line, "Rotation": turn, "Scale": size}
    return tree.add("GeometryNodeRealizeInstances", {0: tree.add("GeometryNodeInstanceOnPoints", sites)})


def sway(tree: NodeTree, along: Any, length: float, strength: float = 1.0) -> Any:
    """How far the wind moves a point of a blade: gusts that travel over the meadow, more to the tip."""
    place_ = tree.add("GeometryNodeInputPosition")
    drift = tree.math("MULTIPLY", tree.frame(), -0.055)
    moved = tree.add("ShaderNodeCombineXYZ", {"X": drift, "Y": tree.math("MULTIPLY", drift, 0.4)})
    gust_at = tree.add("ShaderNodeVectorMath", {0: place_, 1: moved}, operation="ADD")
    gusts = tree.add("ShaderNodeTexNoise", {"Vector": gust_at, "Scale": 0.9, "Detail": 1.0}, "Fac")
    flutter = tree.add("ShaderNodeTexNoise", {"Vector": gust_at, "Scale": 14.0, "Detail": 0.0}, "Fac")
    bend = tree.math("MULTIPLY", tree.math("POWER", along, 1.8), length * strength)
    push = tree.math("ADD", tree.math("MULTIPLY", gusts, 1.3), tree.math("MULTIPLY", flutter, 0.5))
    side = tree.math("MULTIPLY", tree.math("SUBTRACT", flutter, 0.5), 1.1)
    reach = tree.math("MULTIPLY", bend, push)
    parts = {"X": reach, "Y": tree.math("MULTIPLY", bend, side), "Z": tree.math("MULTIPLY", reach, -0.42)}
    return tree.add("ShaderNodeCombineXYZ", parts)


def build_flowers() -> None:
    """Stalks with a ball on top: each a point, which sways with its stalk."""
    meadow = bpy.data.collections["Lawn"]
    stalk = paint("Stalk", (0.22, 0.36, 0.09), 0.6)
    bed = bpy.data.objects["Bed"]
    kinds = (("Dandelions", (0.93, 0.58, 0.02), 5.0, 0.15, 0.0135), ("Daisies", (0.90, 0.88, 0.84), 7.0, 0.12, 0.0095))
    kinds += (("Clover", (0.66, 0.20, 0.42), 4.0, 0.14, 0.0115),)
    for number, (name, colour, density, length, size) in enumerate(kinds):
        item = place(name, bpy.data.hair_curves.new(name), meadow)
        use_group(item, flower_group(bed, name, stalk, paint(name, colour, 0.6), density, length, size, 100 + number))


def flower_group(
    bed: Any, name: str, stalk: Any, head: Any, density: float, length: float, size: float, seed: int
) -> Any:
    tree = NodeTree(name)
    points = strew(tree, bed, tree.math("MULTIPLY", tree.attribute("density"), density), seed).outputs["Points"]
    stalks = stand_on(tree, points, length, seed)
    along = tree.add("GeometryNodeSplineParameter")
    bent = tree.add("GeometryNodeSetPosition", {"Geometry": stalks, "Offset": sway(tree, along, length, 0.5)})
    thin = tree.add("GeometryNodeSetCurveRadius", {"Curve": bent, "Radius": 0.0016})
    tips = tree.add("GeometryNodeCurveToPoints", {"Curve": bent}, mode="EVALUATED")
    last = tree.add(
        "GeometryNodeDeleteGeometry",
        {
            "Geometry": tips,
            "Selection": tree.add(
                "FunctionNodeCompare",
                {
                    0: tree.math("MODULO", tree.add("GeometryNodeInputIndex"), float(BLADE_POINTS)),
                    1: BLADE_POINTS - 1.5,
                },
                operation="LESS_THAN",
            ),
        },
        domain="POINT",
    )
    balls = tree.add("GeometryNodeSetPointRadius", {"Points": last, "Radius": size})
    painted = [
        tree.add("GeometryNodeSetMaterial", {"Geometry": part, "Material": material})
        for part, material in ((thin, stalk), (balls, head))
    ]
    both = tree.group.nodes.new("GeometryNodeJoinGeometry")
    for part in painted:
        tree.group.links.new(part, both.inputs[0])
    return tree.finish(both.outputs[0])


# The scanned tree ----------------------------------------------------------------------------------------------------


def build_tree(random: np.random.Generator, at: tuple[float, float]) -> None:
    """A blossoming tree as a scanner leaves it: points on its bark and in its crown, some colours apart."""
    scans = make_collection("Scanned tree")
    foot = (*at, float(meadow_height(np.array(at[0]), np.array(at[1]))))
    bark, ends = branches(random)
    item = place("Scanned bark", make_mesh("Branches", bark, [], 180.0), scans, foot)
    use_group(
        item, scan_group("Scanned bark", paint("Bark points", (0.20, 0.125, 0.08), 0.8), 5200.0, 0.0062, 0.004, 7)
    )
    crown = joined(puff(random, end) for end in ends)
    mesh = make_mesh("Crown", crown, [], 180.0)
    colours = ((0.86, 0.42, 0.50), (0.92, 0.64, 0.68), (0.66, 0.24, 0.34), (0.36, 0.42, 0.12))
    for number, colour in enumerate(colours):
        name = f"Scanned blossom {number}"
        leaf = place(name, mesh, scans, foot)
        density = (330.0, 330.0, 190.0, 120.0)[number]
        use_group(leaf, scan_group(name, paint(name, colour, 0.7), density, 0.0115, 0.12, 20 + number))


def branches(random: np.random.Generator) -> tuple[Any, list[Points]]:
    """Tubes of a trunk and its limbs, and where they end."""
    tubes, ends = [], []

    def grow(start: Points, way: Points, length: float, radius: float, level: int) -> None:
        path, heading = [start], way / np.linalg.norm(way)
        for _ in range(5):
            heading = heading + random.normal(0.0, 0.12, 3) + (0.0, 0.0, 0.05)
            heading /= np.linalg.norm(heading)
            path.append(path[-1] + heading * length / 5)
        tubes.append(tube(np.array(path), radius * np.linspace(1.0, 0.45, 6), 7))
        if level == 0:
            ends.append(path[-1])
            return
        for k in range(4 if level == 2 else 3):
            turn = 2.4 * k + random.uniform(0.0, 0.7)
            lean = random.uniform(0.55, 0.95)
            out = np.array([cos(turn) * sin(lean), sin(turn) * sin(lean), cos(lean)])
            grow(path[-1 - k % 2], 0.45 * heading + out, length * random.uniform(0.58, 0.74), radius * 0.5, level - 1)

    grow(np.array([0.0, 0.0, -0.05]), np.array([-0.06, 0.0, 1.0]), 1.25, 0.115, 2)
    return joined(tubes), ends


def puff(random: np.random.Generator, middle: Points) -> Any:
    """A coarse ball round the end of a limb, in and about which points are strewn."""
    return ball(middle, random.uniform(0.24, 0.40) * np.array([1.15, 1.15, 0.85]), rings=5, sides=8)


def scan_group(name: str, material: Any, density: float, radius: float, noise: float, seed: int) -> Any:
    """Points on a surface, each off it by some noise, as a scanner measures it; the surface itself is not shown."""
    tree = NodeTree(name)
    points = tree.add("GeometryNodeDistributePointsOnFaces", {"Mesh": tree.geometry, "Density": density, "Seed": seed})
    spread = {0: (-noise,) * 3, 1: (noise,) * 3, "Seed": seed + 1}
    off = tree.add("FunctionNodeRandomValue", spread, 0, data_type="FLOAT_VECTOR")
    points = tree.add("GeometryNodeSetPosition", {"Geometry": points, "Offset": off})
    size = tree.add("FunctionNodeRandomValue", {2: radius * 0.6, 3: radius, "Seed": seed + 2}, 1, data_type="FLOAT")
    balls = tree.add("GeometryNodeSetPointRadius", {"Points": points, "Radius": size})
    return tree.finish(tree.add("GeometryNodeSetMaterial", {"Geometry": balls, "Material": material}))
