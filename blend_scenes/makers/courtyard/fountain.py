"""The fountain in the middle of the court: stone, rippled water, falling jets (curves), splashes (metaballs)."""

from __future__ import annotations

from math import cos, exp, pi, sin
from typing import Any

import bpy
import numpy as np

from ..shapes import Shape, lathe, prism, rounded
from ..stage import bevel, make_collection, make_curve, make_mesh, make_profile, place, repeat, spin
from .palette import Palette

JETS = 8
WATER = 0.66
BOWL_WATER = 1.63
LANDING = 0.98


def build_fountain(palette: Palette, random: np.random.Generator, at: tuple[float, float, float]) -> None:
    fountain = make_collection("Fountain")
    centre = place("Fountain", None, fountain, at)
    build_stone(fountain, palette, centre)
    for name, rings in (
        ("Pool", rippled(WATER, 1.3, 26.0, 0.014, 26)),
        ("Bowl water", rippled(BOWL_WATER, 0.6, 40.0, 0.008, 12)),
    ):
        water = make_profile(name, rings, palette["water"])
        spin(place(name, water, fountain, parent=centre), 40, 180.0)
    jets = [jet(k * 2.0 * pi / JETS + pi / JETS) for k in range(JETS)]
    curve = make_curve("Jets", jets, 0.016, palette["spray"])
    place("Jets", curve, fountain, parent=centre)
    build_splashes(fountain, palette, random, centre)


def build_stone(fountain: Any, palette: Palette, centre: Any) -> None:
    pale, stone = palette["stone light"], palette["stone"]
    wedge_angle = 2.0 * pi / 32
    wedge = ring_wedge(2.02, 2.5, wedge_angle, 0.03)
    paving = place("Ring of wedges", make_mesh("Wedge", wedge, [palette["paving light"]]), fountain, parent=centre)
    bevel(paving, 0.012, 1)
    turned = place("Turn of one wedge", None, fountain, turn=(0.0, 0.0, 360.0 / 32), parent=centre)
    array = repeat(paving, 32, (0.0, 0.0, 0.0))
    array.use_object_offset, array.offset_object = True, turned
    step = [(0.0, 0.0), (2.0, 0.0), (2.0, 0.14), (0.0, 0.14)]
    bevel(place("Step", make_mesh("Step", lathe(step, 8, pi / 8), [stone]), fountain, parent=centre), 0.025)
    profile = [(1.0, 0.13), (1.62, 0.13), (1.62, 0.22), (1.5, 0.3), (1.46, 0.62), (1.56, 0.7), (1.6, 0.74)]
    profile += [(1.6, 0.84), (1.36, 0.84), (1.3, 0.78), (1.27, 0.4), (0.0, 0.36)]
    basin = place("Basin", make_mesh("Basin", lathe(profile, 8, pi / 8), [pale], 20.0), fountain, parent=centre)
    bevel(basin, 0.018)
    profile = [(0.34, 0.3), (0.36, 0.5), (0.3, 0.62), (0.2, 0.72), (0.16, 0.84), (0.2, 0.98), (0.22, 1.08)]
    profile += [(0.14, 1.22), (0.13, 1.34), (0.24, 1.4), (0.5, 1.5), (0.66, 1.6), (0.7, 1.66), (0.67, 1.69)]
    profile += [(0.62, 1.65), (0.45, 1.55), (0.1, 1.5), (0.09, 1.6), (0.13, 1.7), (0.1, 1.8), (0.06, 1.86)]
    profile += [(0.1, 1.92), (0.13, 2.0), (0.1, 2.1), (0.03, 2.17), (0.0, 2.18)]
    spin(place("Bowl", make_profile("Bowl", rounded(profile, 3), pale), fountain, parent=centre), 40, 50.0)


def ring_wedge(inner: float, outer: float, angle: float, height: float) -> Shape:
    """One stone of a ring about Z, a little narrower than its angle."""
    half = angle / 2 - 0.005
    corners = [(r * cos(a), r * sin(a)) for r, a in ((inner, -half), (outer, -half), (outer, half), (inner, half))]
    stone = prism(corners, 1.0)
    # A prism lies in XZ and is drawn out along +Y; laid down, its depth points up.
    return stone.turned_x(-pi / 2).scaled(1.0, 1.0, height).turned(np.diag([1.0, -1.0, -1.0])).moved(z=height)


def rippled(level: float, radius: float, waves: float, height: float, rings: int) -> list[tuple[float, float]]:
    """The profile of a disc of water, from its edge inwards: rings that fade from where the jets fall."""
    profile = [(radius, level)]
    for r in np.linspace(radius * 0.97, 0.02, rings):
        profile.append((float(r), level + height * cos(waves * r) * exp(-1.5 * abs(r - radius * 0.7))))
    return [*profile, (0.0, level)]


def jet(angle: float) -> list[tuple[float, float, float]]:
    """A thread of water from the bowl's rim to the basin."""
    points = []
    for t in np.linspace(0.0, 1.0, 6):
        out = 0.69 + (LANDING - 0.69) * t
        points.append((out * cos(angle), out * sin(angle), 1.69 + 0.06 * t - (1.75 - WATER) * t * t))
    return points


def build_splashes(fountain: Any, palette: Palette, random: np.random.Generator, centre: Any) -> None:
    """Where each jet falls, a few drops melt into one another; at the top, a bubbling head."""
    drops = bpy.data.metaballs.new("Splashes")
    drops.resolution = drops.render_resolution = 0.03
    drops.threshold = 0.3
    drops.materials.append(palette["spray"])
    for k in range(JETS):
        angle = k * 2.0 * pi / JETS + pi / JETS
        foot = np.array([LANDING * cos(angle), LANDING * sin(angle), WATER])
        for _ in range(5):
            ball = drops.elements.new()
            ball.co = foot + random.normal(0.0, 0.05, 3) * (1.0, 1.0, 0.5)
            ball.radius = random.uniform(0.05, 0.1)
    for _ in range(6):
        ball = drops.elements.new()
        ball.co = np.array([0.0, 0.0, 2.18]) + random.normal(0.0, 0.03, 3) * (1.3, 1.3, 1.4)
        ball.radius = random.uniform(0.06, 0.09)
    place("Splashes", drops, fountain, parent=centre)
