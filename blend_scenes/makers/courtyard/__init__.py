"""A cloister's courtyard in the south: architecture, instanced plants and props; the picture of the README."""

from __future__ import annotations

import numpy as np

from ..stage import add_camera, add_light, instance, light_world, open_stage
from .architecture import build_architecture
from .fountain import build_fountain
from .palette import make_palette
from .plants import build_climber, make_plants, set_out_plants
from .props import build_props, make_lantern
from .wing import BAY, BAY_LINE, BAYS, SPRING, WALK_WALL


def make() -> None:
    open_stage("Courtyard", exposure=0.35)
    random = np.random.default_rng(2)
    palette = make_palette()
    wing = build_architecture(palette, random)
    plants = make_plants(palette, random)
    lantern = make_lantern(palette)
    for bay in range(BAYS):
        x = -BAY_LINE + BAY * (bay + 0.5)
        instance(f"Lantern {bay}", lantern, wing, (x, BAY_LINE, SPRING + BAY / 2 - 0.21))
        if bay != 2:
            instance(f"Window box {bay}", plants["window box"], wing, (x, WALK_WALL - 0.02, 5.12))
    build_fountain(palette, random, (0.1, 0.4, 0.0))
    set_out_plants(plants, random)
    build_climber(palette, random, BAY_LINE + 0.3)
    build_props(palette, random)
    light_world((0.36, 0.56, 0.92), 0.45)
    add_light("SUN", "Sun", (8.0, -6.0, 10.0), (0.0, 2.0, 0.0), 5.0, (1.0, 0.88, 0.70), 0.8)
    add_light("AREA", "Glow from the walk", (0.0, 7.6, 3.4), (0.0, 7.4, 0.0), 60.0, (1.0, 0.72, 0.42), 2.5)
    add_light("POINT", "Lamp at the stairs", (5.6, 3.2, 4.6), (5.6, 3.2, 0.0), 40.0, (1.0, 0.70, 0.38), 0.1)
    add_camera((-2.4, -13.2, 3.7), (0.0, 2.5, 3.3), 26.0)
