"""Twenty thousand people in a round stadium: geometry-nodes instances of a few meshes, some of them moving.

The file holds the seats of one sector; an array turns them round the bowl, geometry nodes seat a figure on each and
lift those whom the wave passes: it goes round once in 48 frames.
"""

from __future__ import annotations

from math import cos, pi, sin
from typing import Any

import bpy
import numpy as np

from .nodes import NodeTree, add_attribute, use_group
from .shapes import Points, Shape, box, joined, lathe, shape, tube
from .stage import (
    add_camera,
    add_light,
    instance,
    light_world,
    make_collection,
    make_mesh,
    make_profile,
    open_stage,
    paint,
    place,
    repeat,
    spin,
)

FRAMES = 48
SECTORS, SEATS = 20, 1000
ROWS = 44
FIRST_RADIUS, ROW_DEPTH, ROW_RISE = 21.0, 0.92, 0.42
AISLE = 1.3
SHIRTS = [(0.66, 0.06, 0.05), (0.80, 0.66, 0.50), (0.07, 0.20, 0.46), (0.85, 0.52, 0.06), (0.12, 0.36, 0.26)]


def make() -> None:
    open_stage("Crowd", FRAMES)
    random = np.random.default_rng(20000)
    figures = make_figures(random)
    seat_crowd(figures, random)
    build_bowl()
    build_pitch(figures, random)
    build_flags()
    light_world((0.42, 0.60, 0.90), 0.55)
    add_light("SUN", "Sun", (-30.0, -22.0, 40.0), (0.0, 0.0, 0.0), 4.6, (1.0, 0.91, 0.78), 0.6)
    add_light("AREA", "Floodlight", (0.0, 40.0, 34.0), (0.0, 0.0, 0.0), 9000.0, (0.85, 0.92, 1.0), 8.0)
    add_camera((-8.6, -47.5, 18.7), (1.2, 4.0, 4.6), 24.0, 400.0)


# People --------------------------------------------------------------------------------------------------------------


def make_figures(random: np.random.Generator) -> Any:
    """One figure for each shirt, in different poses, in a collection that only the nodes show."""
    figures = make_collection("Figures", instanced=True)
    skins = [paint(f"Skin {k}", colour, 0.6) for k, colour in enumerate([(0.60, 0.36, 0.24), (0.26, 0.135, 0.08)])]
    hairs = [paint(f"Hair {k}", colour, 0.7) for k, colour in enumerate([(0.05, 0.03, 0.02), (0.36, 0.20, 0.07)])]
    trousers = [paint(f"Trousers {k}", colour) for k, colour in enumerate([(0.06, 0.075, 0.12), (0.22, 0.19, 0.15)])]
    poses = [(0.25, 0.25), (2.75, 2.75), (0.15, 0.9), (0.2, 2.6), (2.2, 2.9)]
    for number, (shirt, arms) in enumerate(zip(SHIRTS, poses, strict=True)):
        materials = [paint(f"Shirt {number}", shirt), trousers[number % 2], skins[number // 2 % 2], hairs[number % 2]]
        place(f"Figure {number}", make_mesh(f"Figure {number}", figure(*arms), materials, 50.0), figures)
    return figures


def figure(left: float, right: float) -> Shape:
    """A person 1.7 m tall who faces -Y; the angles lift the arms. Slots: shirt, trousers, skin, hair."""
    legs = [
        lathe([(0.05, 0.0), (0.065, 0.4), (0.085, 0.85)], 5).moved(side * 0.085, 0.0, 0.0).painted(1)
        for side in (-1, 1)
    ]
    torso = lathe([(0.0, 0.8), (0.155, 0.8), (0.165, 1.0), (0.2, 1.3), (0.16, 1.42), (0.05, 1.46)], 8).scaled(
        1.0, 0.68, 1.0
    )
    head = lathe([(0.0, 1.42), (0.075, 1.46), (0.105, 1.56), (0.09, 1.65), (0.0, 1.7)], 7).painted(2)
    hair = lathe([(0.112, 1.575), (0.1, 1.66), (0.05, 1.715), (0.0, 1.72)], 7).moved(0.0, 0.018, 0.0).painted(3)
    arms = []
    for side, lift in ((-1, left), (1, right)):
        shoulder = np.array([side * 0.185, 0.0, 1.37])
        elbow = shoulder + 0.29 * np.array([side * sin(lift) * 0.9, -0.12, -cos(lift)])
        hand = elbow + 0.28 * np.array([side * sin(lift) * 0.35, -0.45, -cos(lift * 1.02)])
        arms.append(tube([shoulder, elbow], [0.06, 0.05], 5))
        arms.append(tube([elbow, hand], [0.046, 0.038], 5).painted(2))
    shoes = [box((s * 0.085 - 0.05, -0.16, 0.0), (s * 0.085 + 0.05, 0.06, 0.07)).painted(3) for s in (-1, 1)]
    return joined([*legs, torso, head, hair, *arms, *shoes])


def sector_seats(random: np.random.Generator) -> Points:
    """(SEATS, 3) feet of those who sit in the sector about the +X axis, row by row, the same share for each metre."""
    radii = FIRST_RADIUS + ROW_DEPTH * (np.arange(ROWS) + 0.45)
    arcs = radii * (2.0 * pi / SECTORS) - AISLE
    ends = np.round(np.cumsum(arcs) / arcs.sum() * SEATS).astype(int)
    points = []
    for row, (count, radius, arc) in enumerate(zip(np.diff(ends, prepend=0), radii, arcs, strict=True)):
        along = ((np.arange(count) + 0.5) / count - 0.5) * arc + random.normal(0.0, 0.07, count)
        depth = radius + random.normal(0.0, 0.07, count)
        points.append(
            np.column_stack(
                [depth * np.cos(along / radius), depth * np.sin(along / radius), np.full(count, row_height(row))]
            )
        )
    return np.concatenate(points)


def row_height(row: int) -> float:
    return 1.6 + ROW_RISE * row


def seat_crowd(figures: Any, random: np.random.Generator) -> None:
    crowd = make_collection("Crowd")
    mesh = bpy.data.meshes.new("Seats of a sector")
    mesh.from_pydata(sector_seats(random), [], [])
    add_attribute(mesh, "kind", "INT", random.integers(0, len(SHIRTS), SEATS).astype(np.int32))
    add_attribute(mesh, "yaw", "FLOAT", random.normal(0.0, 0.25, SEATS).astype(np.float32))
    add_attribute(mesh, "size", "FLOAT", random.uniform(0.88, 1.08, SEATS).astype(np.float32))
    item = place("Crowd", mesh, crowd)
    turned = place("Turn of a sector", None, crowd, turn=(0.0, 0.0, 360.0 / SECTORS))
    array = repeat(item, SECTORS, (0.0, 0.0, 0.0))
    array.use_object_offset, array.offset_object = True, turned
    use_group(item, crowd_group(figures))


def crowd_group(figures: Any) -> Any:
    tree = NodeTree("Crowd")
    position = tree.group.nodes.new("ShaderNodeSeparateXYZ")
    tree.group.links.new(tree.add("GeometryNodeInputPosition"), position.inputs[0])
    angle = tree.math("ARCTAN2", position.outputs["Y"], position.outputs["X"])
    wave = tree.math("MULTIPLY", tree.math("SUBTRACT", tree.frame(), 1.0), 2.0 * pi / FRAMES)
    # The wave passes where the cosine of the angle to its crest is above 0.92: an eighth of the bowl.
    crest = tree.math("COSINE", tree.math("SUBTRACT", tree.math("SUBTRACT", angle, 2.0), wave))
    lift = tree.math("MULTIPLY", tree.math("MAXIMUM", tree.math("SUBTRACT", crest, 0.92), 0.0), 0.9 / 0.08)
    up = tree.add("ShaderNodeCombineXYZ", {"Z": lift})
    points = tree.add("GeometryNodeSetPosition", {"Geometry": tree.geometry, "Offset": up})
    yaw = tree.math("ADD", tree.math("SUBTRACT", angle, pi / 2.0), tree.attribute("yaw"))
    turn = tree.add("FunctionNodeEulerToRotation", {0: tree.add("ShaderNodeCombineXYZ", {"Z": yaw})})
    sector = tree.math("FLOOR", tree.math("DIVIDE", tree.add("GeometryNodeInputIndex"), float(SEATS)))
    # Each sector shifts the shirts, by a step that its number scrambles, so that no pattern repeats round the bowl.
    shirt = tree.math(
        "MODULO",
        tree.math("ADD", tree.attribute("kind", "INT"), tree.math("MULTIPLY", sector, sector)),
        float(len(SHIRTS)),
    )
    source = tree.add(
        "GeometryNodeCollectionInfo", {"Collection": figures, "Separate Children": True, "Reset Children": True}
    )
    seats = {"Points": points, "Instance": source, "Pick Instance": True, "Instance Index": shirt}
    seats |= {"Rotation": turn, "Scale": tree.attribute("size")}
    return tree.finish(tree.add("GeometryNodeInstanceOnPoints", seats))


# The stadium ---------------------------------------------------------------------------------------------------------


def build_bowl() -> None:
    """Terraces, the wall behind them, stairs in the aisles: profiles turned about the middle."""
    bowl = make_collection("Stadium")
    concrete, wall_paint = paint("Concrete", (0.46, 0.45, 0.43)), paint("Parapet", (0.66, 0.62, 0.55))
    last = FIRST_RADIUS + ROWS * ROW_DEPTH
    profile = [(FIRST_RADIUS - 0.9, 0.0), (FIRST_RADIUS - 0.9, 1.0)]
    for row in range(ROWS):
        inner = FIRST_RADIUS + row * ROW_DEPTH
        profile += [
            (inner, row_height(row) - ROW_RISE if row else 1.0),
            (inner, row_height(row)),
            (inner + ROW_DEPTH, row_height(row)),
        ]
    top = row_height(ROWS)
    terraces = place("Terraces", make_profile("Terraces", dedupe(profile), concrete), bowl)
    spin(terraces, 120)
    parapet = [
        (last, top - ROW_RISE),
        (last, top + 1.1),
        (last + 0.5, top + 1.1),
        (last + 0.9, top - 2.0),
        (last + 6.0, 0.0),
    ]
    spin(place("Parapet", make_profile("Parapet", parapet, wall_paint), bowl), 120)
    rail = [
        (FIRST_RADIUS - 0.98, 0.0),
        (FIRST_RADIUS - 0.98, 1.12),
        (FIRST_RADIUS - 0.84, 1.12),
        (FIRST_RADIUS - 0.84, 0.9),
    ]
    spin(place("Boards", make_profile("Boards", rail, paint("Boards", (0.07, 0.16, 0.32))), bowl), 120)
    build_stairs(bowl, paint("Stairs", (0.60, 0.53, 0.32)))
    hills = [(last + 5.0, -0.2), (90.0, 0.2), (140.0, 5.0), (210.0, 15.0), (300.0, 9.0)]
    spin(place("Hills", make_profile("Hills", hills, paint("Hills", (0.20, 0.30, 0.12))), bowl), 60)


def dedupe(profile: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """A profile without points that repeat the one before."""
    return [point for k, point in enumerate(profile) if k == 0 or point != profile[k - 1]]


def build_stairs(bowl: Any, colour: Any) -> None:
    """Two steps for each row, in the aisle between two sectors; an array turns the flight round the bowl."""
    low = (FIRST_RADIUS - ROW_DEPTH / 2, -0.5, 0.7 + ROW_RISE / 2)
    tread = make_mesh("Step", box(low, (FIRST_RADIUS, 0.5, 1.0 + ROW_RISE / 2)), [colour])
    step = place("Stairs", tread, bowl, turn=(0.0, 0.0, 180.0 / SECTORS))
    repeat(step, ROWS * 2, (ROW_DEPTH / 2, 0.0, ROW_RISE / 2)).name = "Flight"
    turned = place("Turn of an aisle", None, bowl, turn=(0.0, 0.0, 540.0 / SECTORS))
    array = repeat(step, SECTORS, (0.0, 0.0, 0.0))
    array.use_object_offset, array.offset_object = True, turned


def build_pitch(figures: Any, random: np.random.Generator) -> None:
    """Grass mown in stripes, lines, goals, two teams and a ball on the run."""
    field = make_collection("Pitch")
    grass = [paint("Grass", (0.10, 0.27, 0.05)), paint("Grass mown", (0.15, 0.34, 0.07))]
    stripes = [box((-15.0 + 3.0 * k, -10.0, -0.1), (-12.0 + 3.0 * k, 10.0, 0.0)).painted(k % 2) for k in range(10)]
    place("Pitch", make_mesh("Pitch", joined(stripes), grass), field)
    disc = lathe([(FIRST_RADIUS, -0.02), (0.0, -0.02)], 90)
    place("Track", make_mesh("Track", disc, [paint("Track", (0.50, 0.17, 0.09))]), field)
    white = paint("White", (0.85, 0.85, 0.82))
    lines = [box((-14.0, y - 0.08, 0.0), (14.0, y + 0.08, 0.012)) for y in (-9.0, 9.0)]
    lines += [box((x - 0.08, -8.92, 0.0), (x + 0.08, 8.92, 0.012)) for x in (-14.0, 0.0, 14.0)]
    ring = lathe([(2.9, 0.0), (2.9, 0.014), (2.74, 0.014), (2.74, 0.0)][::1], 48)
    place("Lines", make_mesh("Lines", joined([*lines, ring]), [white]), field)
    goal = joined(
        [
            tube([(0, -1.8, 0), (0, -1.8, 1.9), (0, 1.8, 1.9), (0, 1.8, 0)], 0.07, 6),
            tube([(0, -1.8, 1.9), (1.1, -1.8, 0.0)], 0.03, 5),
            tube([(0, 1.8, 1.9), (1.1, 1.8, 0.0)], 0.03, 5),
        ]
    )
    mesh = make_mesh("Goal", goal, [white])
    place("Goal right", mesh, field, (14.0, 0.0, 0.0))
    place("Goal left", mesh, field, (-14.0, 0.0, 0.0), (0.0, 0.0, 180.0))
    ball = place("Ball", make_mesh("Ball", sphere(0.16), [white], 180.0), field)
    run(ball, np.array([-3.0, -1.2, 0.16]), np.array([5.6, 2.0, 0.0]), spins=-18.0)
    for number in range(16):
        mesh = bpy.data.meshes[f"Figure {0 if number % 2 else 2}"]
        start = np.array([*random.uniform((-12.0, -8.0), (12.0, 8.0)), 0.0])
        player = place(f"Player {number}", mesh, field)
        way = (np.array([3.0, 0.5, 0.0]) - start) * random.uniform(0.12, 0.34)
        player.rotation_euler[2] = float(np.arctan2(way[0], -way[1]))
        run(player, start, way)


def sphere(radius: float) -> Shape:
    angles = np.linspace(-pi / 2, pi / 2, 11)
    return lathe([(max(0.0, radius * cos(a)) if abs(a) < 1.57 else 0.0, radius * sin(a)) for a in angles], 16)


def run(item: Any, start: Points, way: Points, spins: float = 0.0) -> None:
    """A straight way over the 48 frames, rolling if it spins (radians about Y)."""
    for frame, share in ((1, 0.0), (FRAMES, 1.0)):
        item.location = start + way * share
        item.keyframe_insert("location", frame=frame)
        if spins:
            item.rotation_euler[1] = -spins * share
            item.keyframe_insert("rotation_euler", index=1, frame=frame)


def build_flags() -> None:
    """Flags on the parapet, instances of one collection whose cloth ripples: one mesh deforms, twenty show it."""
    flags = make_collection("Flags")
    flag = make_collection("Flag", instanced=True)
    pole = lathe([(0.09, 0.0), (0.06, 7.0), (0.12, 7.05), (0.0, 7.2)], 8)
    place("Pole", make_mesh("Pole", pole, [paint("Pole", (0.75, 0.73, 0.70))]), flag)
    columns, rows = 16, 5
    xs, zs = np.meshgrid(np.linspace(0.0, 3.4, columns + 1), np.linspace(4.9, 6.9, rows + 1))
    faces = [
        (r * (columns + 1) + c, r * (columns + 1) + c + 1, (r + 1) * (columns + 1) + c + 1, (r + 1) * (columns + 1) + c)
        for r in range(rows)
        for c in range(columns)
    ]
    cloth = shape(np.column_stack([xs.ravel(), np.zeros(xs.size), zs.ravel()]), faces)
    cloth = Shape(cloth.vertices, cloth.faces, [0 if face[0] // (columns + 1) < 2 else 1 for face in cloth.faces])
    item = place(
        "Cloth",
        make_mesh("Flag cloth", cloth, [paint("Flag red", SHIRTS[0]), paint("Flag gold", SHIRTS[3])], 180.0),
        flag,
    )
    item.modifiers.new("Smooth", "SUBSURF").levels = 1
    use_group(item, ripple_group())
    last, top = FIRST_RADIUS + ROWS * ROW_DEPTH, row_height(ROWS) + 1.1
    for k in range(SECTORS):
        a = 2.0 * pi * (k + 0.5) / SECTORS
        instance(f"Flag {k}", flag, flags, (cos(a) * (last + 0.25), sin(a) * (last + 0.25), top), 15.0)


def ripple_group() -> Any:
    """A wave along X that grows away from the pole and comes round in 24 frames."""
    tree = NodeTree("Ripple")
    position = tree.group.nodes.new("ShaderNodeSeparateXYZ")
    tree.group.links.new(tree.add("GeometryNodeInputPosition"), position.inputs[0])
    along = position.outputs["X"]
    beat = tree.math("MULTIPLY", tree.frame(), 2.0 * pi / 24.0)
    phase = tree.math("SUBTRACT", tree.math("MULTIPLY", along, 3.1), beat)
    sway = tree.math("MULTIPLY", tree.math("SINE", phase), tree.math("MULTIPLY", along, 0.11))
    offset = tree.add("ShaderNodeCombineXYZ", {"Y": sway})
    return tree.finish(tree.add("GeometryNodeSetPosition", {"Geometry": tree.geometry, "Offset": offset}))
