"""Things that people left in the court: benches, a table, barrels, jars, lanterns, a sign, bulbs on a cord, pigeons."""

from __future__ import annotations

from math import cos, cosh, pi, sin
from typing import Any

import bpy
import numpy as np

from ..shapes import Points, Shape, box, joined, lathe, prism, rounded, tube
from ..stage import (
    Place,
    bevel,
    instance,
    make_collection,
    make_curve,
    make_mesh,
    make_profile,
    make_text,
    place,
    repeat,
    spin,
    subdivide,
)
from .palette import Palette


def make_lantern(palette: Palette) -> Any:
    """A collection: a lantern on a chain, hung from its origin."""
    lantern = make_collection("Lantern", instanced=True)
    drop = 0.42
    frame = [lathe([(0.13, -0.05), (0.15, -0.03), (0.1, 0.06), (0.03, 0.1), (0.0, 0.1)], 6).moved(z=-drop)]
    frame += [lathe([(0.0, -0.03), (0.09, -0.02), (0.09, 0.0), (0.0, 0.01)], 6).moved(z=-drop - 0.36)]
    for k in range(6):
        a = k * pi / 3
        bar = tube(
            [(0.08 * cos(a), 0.08 * sin(a), -drop - 0.36), (0.13 * cos(a), 0.13 * sin(a), -drop - 0.04)], 0.008, 4
        )
        frame.append(bar)
    place("Lantern frame", make_mesh("Lantern frame", joined(frame), [palette["iron"]]), lantern)
    flame = lathe(rounded([(0.0, -0.3), (0.04, -0.24), (0.045, -0.16), (0.0, -0.06)], 3), 10).moved(z=-drop)
    place("Lantern flame", make_mesh("Lantern flame", flame, [palette["bulb"]], 180.0), lantern)
    link = make_curve(
        "Chain", [[(0.0, 0.0, 0.03), (0.004, 0.0, -0.2), (0.0, 0.0, -drop + 0.1)]], 0.008, palette["iron"], 1
    )
    place("Chain", link, lantern)
    return lantern


def build_props(palette: Palette, random: np.random.Generator) -> None:
    props = make_collection("Props")
    bench = make_bench(palette)
    instance("Bench back", bench, props, (0.1, 5.15, 0.0), 180.0)
    instance("Bench left", bench, props, (-5.05, 0.75, 0.0), 90.0)
    build_storage(props, palette)
    build_table(props, palette, random)
    build_sign(props, palette)
    build_cord(props, palette, "front", (-5.6, 4.0, 3.95), (6.5, 3.0, 4.9), 15)
    build_cord(props, palette, "back", (-5.6, -1.5, 3.95), (6.5, 4.6, 4.9), 17)
    build_pigeons(props, palette, random)


def make_bench(palette: Palette) -> Any:
    """A collection: slats on two iron legs, 1.6 m along X, facing +Y."""
    bench = make_collection("Bench", instanced=True)
    slat = make_mesh("Slat", box((-0.8, 0.0, 0.0), (0.8, 0.085, 0.03)), [palette["wood"]])
    seat = place("Seat", slat, bench, (0.0, -0.2, 0.44))
    bevel(seat, 0.008)
    repeat(seat, 4, (0.0, 0.1, 0.0))
    back = place("Back", slat, bench, (0.0, -0.24, 0.56), (80.0, 0.0, 0.0))
    bevel(back, 0.008)
    repeat(back, 3, (0.0, 0.125, 0.0))
    leg = [(0.22, 0.0), (0.2, 0.25), (0.17, 0.42), (-0.18, 0.42), (-0.23, 0.2), (-0.26, 0.0)]
    iron = joined(
        [tube([(x, y, z) for y, z in leg], 0.018, 6) for x in (-0.62, 0.62)]
        + [tube([(x, -0.18, 0.42), (x, -0.24, 0.6), (x, -0.3, 0.95)], 0.018, 6) for x in (-0.62, 0.62)]
    )
    place("Bench iron", make_mesh("Bench iron", iron, [palette["iron"]], 50.0), bench)
    return bench


def build_storage(props: Any, palette: Palette) -> None:
    """Barrels, crates and jars at the foot of the stairs' side wall."""
    staves = lathe(rounded([(0.26, 0.0), (0.315, 0.22), (0.33, 0.42), (0.315, 0.62), (0.26, 0.84)], 3), 20)
    lid = lathe([(0.25, 0.81), (0.0, 0.81)], 20)
    hoops = [
        lathe([(r, z - 0.025), (r + 0.012, z - 0.025), (r + 0.012, z + 0.025), (r, z + 0.025)], 20).painted(1)
        for r, z in ((0.279, 0.06), (0.315, 0.24), (0.315, 0.6), (0.279, 0.78))
    ]
    barrel = make_mesh("Barrel", joined([staves, lid, *hoops]), [palette["wood"], palette["iron"]])
    for number, (x, y, turn) in enumerate(((4.75, 1.45, 0.0), (4.7, 2.2, 40.0), (4.05, 1.95, 75.0))):
        place(f"Barrel {number}", barrel, props, (x, y, 0.0), (0.0, 0.0, turn))
    jar = rounded(
        [(0.0, 0.0), (0.13, 0.0), (0.24, 0.3), (0.27, 0.52), (0.18, 0.76), (0.1, 0.86), (0.12, 0.95), (0.09, 0.94)], 4
    )
    jar_mesh = make_profile("Jar", jar, palette["terracotta"])
    for number, (x, y, size) in enumerate(((4.85, -0.9, 1.0), (4.6, -0.35, 0.8))):
        spin(place(f"Jar {number}", jar_mesh, props, (x, y, 0.0), (0.0, 0.0, 30.0 * number), size), 28, 60.0)
    crate_mesh = make_mesh("Crate", crate(), [palette["rope"]])
    for number, (at, turn) in enumerate(
        (((4.6, 0.55, 0.0), 8.0), ((4.62, 0.55, 0.36), -12.0), ((3.95, 0.8, 0.0), 31.0))
    ):
        bevel(place(f"Crate {number}", crate_mesh, props, at, (0.0, 0.0, turn)), 0.005, 1)


def crate() -> Shape:
    """An open crate of slats, 0.6 by 0.45 by 0.35 m."""
    long, wide, high = 0.3, 0.225, 0.35
    posts = [
        box((x - 0.02, y - 0.02, 0.0), (x + 0.02, y + 0.02, high))
        for x in (-long + 0.03, long - 0.03)
        for y in (-wide + 0.03, wide - 0.03)
    ]
    slats = []
    for z in (0.02, 0.135, 0.25):
        for side in (-1, 1):
            y, x = side * wide, side * long
            slats.append(box((-long, min(y, y - side * 0.012), z), (long, max(y, y - side * 0.012), z + 0.085)))
            slats.append(
                box((min(x, x - side * 0.012), -wide + 0.013, z), (max(x, x - side * 0.012), wide - 0.013, z + 0.085))
            )
    floor = box((-long + 0.013, -wide + 0.013, 0.02), (long - 0.013, wide - 0.013, 0.03))
    return joined([*posts, *slats, floor])


def build_table(props: Any, palette: Palette, random: np.random.Generator) -> None:
    """A round table with a cloth, a jug and lemons, and two stools."""
    at = (2.55, -3.6)
    stand = lathe([(0.3, 0.0), (0.3, 0.02), (0.06, 0.06), (0.035, 0.12), (0.03, 0.68), (0.1, 0.72), (0.0, 0.72)], 16)
    place("Table stand", make_mesh("Table stand", stand, [palette["iron"]]), props, (*at, 0.0))
    cloth = place(
        "Table cloth", make_mesh("Table cloth", draped(0.55, 0.3), [palette["cloth"]], 180.0), props, (*at, 0.745)
    )
    subdivide(cloth, 1)
    jug = rounded(
        [(0.0, 0.0), (0.07, 0.0), (0.1, 0.09), (0.055, 0.2), (0.05, 0.24), (0.07, 0.28), (0.055, 0.27), (0.04, 0.2)], 3
    )
    handle = tube([(0.055, 0.0, 0.24), (0.13, 0.0, 0.23), (0.135, 0.0, 0.15), (0.09, 0.0, 0.1)], 0.012, 6)
    where, turn = (at[0] - 0.12, at[1] + 0.1, 0.752), (0.0, 0.0, -35.0)
    spin(place("Jug", make_profile("Jug", jug, palette["shutter"]), props, where, turn), 18, 60.0)
    place("Jug handle", make_mesh("Jug handle", handle, [palette["shutter"]], 60.0), props, where, turn)
    plate = lathe([(0.0, 0.0), (0.09, 0.0), (0.16, 0.025), (0.155, 0.03), (0.09, 0.01), (0.0, 0.01)], 20)
    place("Plate", make_mesh("Plate", plate, [palette["cloth light"]]), props, (at[0] + 0.16, at[1] - 0.08, 0.752))
    fruit = lathe(
        [(0.0, -0.06), (0.025, -0.045), (0.043, -0.02), (0.046, 0.0), (0.043, 0.02), (0.025, 0.045), (0.0, 0.06)], 12
    )
    mesh = make_mesh("Lemon on table", fruit, [palette["lemon"]], 180.0)
    for number, (x, y, z) in enumerate(
        ((0.0, -0.055, 0.06), (0.055, 0.03, 0.06), (-0.045, 0.035, 0.06), (0.0, 0.0, 0.125))
    ):
        turn = (80.0, 0.0, float(random.uniform(0.0, 180.0)))
        place(f"Lemon on table {number}", mesh, props, (at[0] + 0.16 + x, at[1] - 0.08 + y, 0.752 + z), turn)
    stool = make_stool(palette)
    instance("Stool 0", stool, props, (at[0] - 0.85, at[1] + 0.35, 0.0), 20.0)
    instance("Stool 1", stool, props, (at[0] + 0.55, at[1] + 0.8, 0.0), 70.0)


def make_stool(palette: Palette) -> Any:
    stool = make_collection("Stool", instanced=True)
    seat = lathe([(0.0, 0.42), (0.18, 0.42), (0.19, 0.44), (0.18, 0.465), (0.0, 0.46)], 24)
    legs = [
        tube([(0.19 * cos(a), 0.19 * sin(a), 0.0), (0.12 * cos(a), 0.12 * sin(a), 0.43)], [0.016, 0.022], 8)
        for a in np.arange(4) * pi / 2
    ]
    ring = tube([(0.155 * cos(a), 0.155 * sin(a), 0.18) for a in np.linspace(0.0, 2.0 * pi, 17)], 0.01, 6)
    place("Stool wood", make_mesh("Stool wood", joined([seat, *legs, ring]), [palette["wood"]]), stool)
    return stool


def draped(radius: float, drop: float) -> Shape:
    """A round cloth whose hem falls in folds."""
    rings = []
    for t in np.linspace(0.0, 1.0, 8)[1:]:
        out = min(1.0, t / 0.6)
        down = max(0.0, (t - 0.6) / 0.4)
        rings.append((radius * out, -drop * down, down))
    disc = lathe([*[(r + 0.001 * k, z) for k, (r, z, _) in enumerate(rings[::-1])], (0.0, 0.0)], 48)
    vertices = disc.vertices.copy()
    angle = np.arctan2(vertices[:, 1], vertices[:, 0])
    hang = np.clip(-vertices[:, 2] / drop, 0.0, 1.0)
    fold = 1.0 + hang * (0.10 * np.sin(8.0 * angle) + 0.06)
    vertices[:, :2] *= fold[:, None]
    vertices[:, 2] += 0.04 * hang * np.sin(8.0 * angle + 1.0)
    return Shape(vertices, disc.faces, disc.slots)


def build_sign(props: Any, palette: Palette) -> None:
    """The inn's sign on an iron bracket at the small house's corner: a text object, scrolls as curves."""
    sign = place("Sign", None, props, (6.45, 2.35, 3.62))
    panel = prism(
        [(-1.55, -0.3), (-0.1, -0.3), (-0.1, 0.3), (-0.45, 0.36), (-0.825, 0.42), (-1.2, 0.36), (-1.55, 0.3)], 0.05
    )
    item = place(
        "Sign board",
        make_mesh("Sign board", panel, [palette["wood dark"]], 30.0),
        props,
        (0.0, -0.02, 0.0),
        parent=sign,
    )
    bevel(item, 0.012)
    text = make_text("Sign text", "al Raggio", 0.34, 0.012, palette["brass"])
    place("Sign text", text, props, (-0.825, -0.03, 0.0), (90.0, 0.0, 0.0), parent=sign)
    arm = [(0.05, 0.0, 0.62), (-0.8, 0.0, 0.64), (-1.62, 0.0, 0.62)]
    scroll = [
        (-0.55 + 0.2 * (1 - t) * cos(7.5 * t + 2.2), 0.0, 0.86 + 0.2 * (1 - t) * sin(7.5 * t + 2.2))
        for t in np.linspace(0.0, 0.85, 12)
    ]
    brace = [(0.05, 0.0, 1.15), (-0.3, 0.0, 1.12), *scroll]
    links = [[(x, 0.0, 0.63), (x, 0.0, 0.28)] for x in (-1.35, -0.3)]
    iron = make_curve("Sign iron", [arm, brace, *links], 0.016, palette["iron"])
    place("Sign iron", iron, props, (0.0, 0.0, 0.0), parent=sign)


def build_cord(props: Any, palette: Palette, name: str, start: Place, end: Place, count: int) -> None:
    """Bulbs on a hanging cord (a catenary), as linked duplicates of one mesh."""
    points = catenary(np.array(start), np.array(end), 0.8, count * 2 + 1)
    place(f"Cord {name}", make_curve(f"Cord {name}", [list(points)], 0.009, palette["iron"], 1), props)
    bulb = bulb_mesh(palette)
    for number, point in enumerate(points[1:-1:2]):
        place(f"Bulb {name} {number}", bulb, props, point)


def catenary(start: Points, end: Points, sag: float, count: int) -> Points:
    """(count, 3) points of a cord between two places; its middle hangs `sag` below the straight line."""
    t = np.linspace(0.0, 1.0, count)
    points = start + np.outer(t, end - start)
    hang = np.array([cosh(2.4 * (u - 0.5)) for u in t])
    points[:, 2] -= sag * (hang[0] - hang) / (hang[0] - 1.0)
    return points


def bulb_mesh(palette: Palette) -> Any:
    existing = bpy.data.meshes.get("Bulb")
    if existing:
        return existing
    glass = lathe(rounded([(0.0, -0.15), (0.04, -0.13), (0.05, -0.095), (0.028, -0.05)], 3), 12)
    cap = lathe([(0.028, -0.055), (0.028, 0.0), (0.0, 0.012)], 10).painted(1)
    return make_mesh("Bulb", joined([glass, cap]), [palette["bulb"], palette["iron"]], 50.0)


def build_pigeons(props: Any, palette: Palette, random: np.random.Generator) -> None:
    mesh = make_mesh("Pigeon", pigeon(), [palette["feather"], palette["feather light"], palette["terracotta"]], 180.0)
    ground = [
        (1.0, -1.9, 0.0),
        (1.35, -1.6, 0.0),
        (0.55, -2.3, 0.0),
        (-1.6, -2.6, 0.0),
        (-1.9, -2.2, 0.0),
        (1.2, 0.1, 0.84),
    ]
    for number, at in enumerate([*ground, (-1.06, 0.3, 0.84), (6.7, -1.0, 3.2), (6.75, -0.7, 3.2)]):
        item = place(f"Pigeon {number}", mesh, props, at, (0.0, 0.0, float(random.uniform(0.0, 360.0))))
        subdivide(item, 1)


def pigeon() -> Shape:
    """A bird along +X, feet at the origin; slots: grey, pale, feet."""
    body = lathe(
        [(0.0, -0.2), (0.028, -0.16), (0.05, -0.08), (0.065, 0.0), (0.055, 0.07), (0.03, 0.11), (0.0, 0.12)], 10
    )
    body = body.turned_y(pi / 2 - 0.35).moved(0.0, 0.0, 0.11)
    neck = lathe([(0.0, -0.04), (0.042, 0.0), (0.03, 0.06), (0.032, 0.09), (0.02, 0.12), (0.0, 0.125)], 10)
    neck = neck.turned_y(0.25).moved(0.07, 0.0, 0.14).painted(1)
    beak = lathe([(0.01, 0.0), (0.006, 0.02), (0.0, 0.035)], 6).turned_y(pi / 2).moved(0.118, 0.0, 0.235).painted(2)
    legs = [tube([(0.01, y, 0.0), (0.0, y, 0.07)], 0.006, 4).painted(2) for y in (-0.02, 0.02)]
    return joined([body, neck, beak, *legs])
