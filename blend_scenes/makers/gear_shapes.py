"""Involute gears, shafts, bearings and a fan's blade as shapes, with their axes along Y."""

from __future__ import annotations

from math import acos, cos, pi, radians, sin, tan

import numpy as np

from .shapes import Points, Shape, joined, lathe, prism, shape

MODULE = 0.1  # pitch diameter over the number of teeth, metres
PRESSURE = radians(20.0)


def gear_outline(teeth: int, grow: float = 0.0, depth: float = 1.2, steps: int = 4) -> Points:
    """(P, 2) outline, counter-clockwise, of an involute gear; a tooth's middle lies at angle 0.

    grow: metres by which the gap to a partner widens; negative for the hole of a ring, whose teeth are gaps.
    depth: how far the gaps reach inside the pitch circle, in modules.
    """
    pitch = MODULE * teeth / 2.0
    base, tip, root = pitch * cos(PRESSURE), pitch + MODULE - grow, pitch - depth * MODULE - grow
    half_at_pitch = pi / (2.0 * teeth) - 0.5 * grow / pitch
    involute_at_pitch = tan(PRESSURE) - PRESSURE
    flank = []
    for radius in np.linspace(max(base, root), tip, steps):
        roll = acos(min(1.0, base / radius))
        flank.append((radius, half_at_pitch + involute_at_pitch - (tan(roll) - roll)))
    if root < base:
        flank.insert(0, (root, flank[0][1] + 0.02))
    one = [(r, -angle) for r, angle in flank] + [(r, angle) for r, angle in reversed(flank)]
    points = []
    for tooth in range(teeth):
        middle = 2.0 * pi * tooth / teeth
        points += [(r * cos(middle + angle), r * sin(middle + angle)) for r, angle in one]
    return np.array(points)


def annulus(outer: Points, inner: Points, depth: float) -> Shape:
    """A plate in XZ between two outlines of as many points each, drawn out along Y about y = 0."""
    count = len(outer)
    rings = []
    for y, outline in ((-depth / 2, outer), (-depth / 2, inner), (depth / 2, outer), (depth / 2, inner)):
        rings.append(np.column_stack([outline[:, 0], np.full(count, y), outline[:, 1]]))
    faces = []
    near_out, near_in, far_out, far_in = (k * count for k in range(4))
    for k in range(count):
        j = (k + 1) % count
        faces.append((near_out + k, near_out + j, near_in + j, near_in + k))
        faces.append((far_out + j, far_out + k, far_in + k, far_in + j))
        faces.append((near_out + j, near_out + k, far_out + k, far_out + j))
        faces.append((near_in + k, near_in + j, far_in + j, far_in + k))
    return shape(np.concatenate(rings), faces)


def circle_like(outline: Points, radius: float) -> Points:
    """A circle with a point for each of an outline's, at the same angles."""
    return outline * (radius / np.linalg.norm(outline, axis=1, keepdims=True))


def axle(radius: float, start: float, end: float, segments: int = 32) -> Shape:
    """A shaft along Y between two depths, with chamfered ends."""
    chamfer = radius * 0.15
    profile = [(0.0, -end), (radius - chamfer, -end), (radius, -end + chamfer), (radius, -start - chamfer)]
    profile += [(radius - chamfer, -start), (0.0, -start)]
    return lathe(profile, segments).turned_x(pi / 2)


def wheel(teeth: int, depth: float, hub: float, spokes: int) -> Shape:
    """A gear with a rim, a hub and spokes, or a solid web (spokes = 0). Slot 0 throughout."""
    outline = gear_outline(teeth, 0.006)
    rim = MODULE * teeth / 2.0 - 2.4 * MODULE
    inner = circle_like(outline, rim if spokes else hub)
    parts = [annulus(outline, inner, depth), axle(hub, -depth * 0.7, depth * 0.7)]
    for k in range(spokes):
        bar = prism(
            [(-0.09, 0.0), (0.09, 0.0), (0.06, rim + 0.03 - hub * 0.8), (-0.06, rim + 0.03 - hub * 0.8)], depth * 0.55
        )
        parts.append(bar.moved(0.0, -depth * 0.275, hub * 0.8).turned_y(2.0 * pi * k / spokes))
    return joined(parts)


def fan_blade() -> Shape:
    """A twisted blade along +Z with some thickness."""
    rows = 8
    vertices = []
    for k in range(rows):
        t = k / (rows - 1)
        half = 0.10 + 0.16 * sin(pi * min(1.0, 0.15 + 0.75 * t))
        pitch = radians(52.0 - 30.0 * t)
        high = 0.15 + 0.72 * t
        for side, lift in ((-1, 0.0), (0, 0.022), (1, 0.0), (0, -0.022)):
            x, y = side * half, lift
            vertices.append((x * cos(pitch) - y * sin(pitch), x * sin(pitch) + y * cos(pitch), high))
    quads = [
        (4 * k + c, 4 * k + (c + 1) % 4, 4 * k + 4 + (c + 1) % 4, 4 * k + 4 + c)
        for k in range(rows - 1)
        for c in range(4)
    ]
    ends = [(3, 2, 1, 0), tuple(4 * (rows - 1) + c for c in range(4))]
    return shape(vertices, [face[::-1] for face in [*quads, *ends]])


def bearing(height: float) -> Shape:
    """A pillar that holds a shaft at a height, with a round head."""
    arc = [(0.3 * cos(a), height + 0.3 * sin(a)) for a in np.linspace(-0.5, pi + 0.5, 18)]
    outline = [(-0.45, 0.0), (0.45, 0.0), (0.45, 0.12), (0.2, 0.3), *arc, (-0.2, 0.3), (-0.45, 0.12)]
    return prism(outline, 0.2).moved(y=-0.1)
