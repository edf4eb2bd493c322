"""A cloister's courtyard in the south: architecture, instanced plants and props; the picture of the README."""

from __future__ import annotations

import numpy as np

from ..stage import add_camera, add_light, light_world, open_stage
from .architecture import build_architecture
from .palette import make_palette


def make() -> None:
    open_stage("Courtyard")
    random = np.random.default_rng(2)
    palette = make_palette()
    build_architecture(palette, random)
    light_world((0.36, 0.56, 0.92), 0.45)
    add_light("SUN", "Sun", (8.0, -6.0, 10.0), (0.0, 2.0, 0.0), 5.0, (1.0, 0.88, 0.70), 0.8)
    add_camera((-2.4, -13.2, 3.7), (0.0, 2.5, 3.3), 26.0)
