"""Windows, shutters and doors, as shapes about x = 0 that face -Y."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import numpy as np

from ..shapes import Shape, box, joined, lathe


def window_frame(width: float, height: float) -> Shape:
    """A casement of two by three panes about x = 0; slots: wood, glass."""
    half, bar = width / 2, 0.035
    uprights = [box((x - bar, -0.04, 0.0), (x + bar, 0.04, height)) for x in (-half + bar, 0.0, half - bar)]
    rails = [
        box((-half, -0.03, z - bar * 0.7), (half, 0.03, z + bar * 0.7)) for z in np.linspace(0.03, height - 0.03, 4)
    ]
    pane = box((-half, 0.0, 0.0), (half, 0.02, height)).painted(1)
    return joined([*uprights, *rails, pane])


def shutter(width: float, height: float) -> Shape:
    """A louvred leaf, hinged at x = 0 and reaching to +X."""
    frame = [box((0.0, -0.02, 0.0), (0.05, 0.02, height)), box((width - 0.05, -0.02, 0.0), (width, 0.02, height))]
    frame += [box((0.05, -0.02, z), (width - 0.05, 0.02, z + 0.06)) for z in (0.0, height / 2 - 0.03, height - 0.06)]
    slats = []
    for z in np.arange(0.09, height - 0.07, 0.075):
        if abs(z - height / 2) > 0.06:
            slats.append(box((0.05, -0.006, -0.035), (width - 0.05, 0.006, 0.035)).turned_x(0.6).moved(z=float(z)))
    return joined(frame + slats)


def door(width: float, height: float) -> Shape:
    """A planked double door in a stone surround about x = 0; slots: wood, iron, stone."""
    edges = np.linspace(-width / 2, width / 2, 9)
    planks = [box((a + 0.008, 0.0, 0.0), (b - 0.008, 0.06, height)) for a, b in pairwise(edges)]
    back = box((-width / 2, 0.05, 0.0), (width / 2, 0.055, height))
    bands = [
        box((s - 0.5, -0.015, z), (s + 0.5, 0.01, z + 0.07)).painted(1) for s in (0.0,) for z in (0.35, height - 0.5)
    ]
    ring = lathe([(0.04, -0.012), (0.055, 0.0), (0.04, 0.012)], 12).turned_x(pi / 2).moved(0.12, -0.03, 1.0).painted(1)
    half = width / 2
    jambs = [box((x, -0.16, 0.0), (x + 0.18, 0.0, height)).painted(2) for x in (-half - 0.16, half - 0.02)]
    lintel = box((-half - 0.24, -0.18, height), (half + 0.24, 0.0, height + 0.22)).painted(2)
    return joined([*planks, back, *bands, ring, *jambs, lintel])
