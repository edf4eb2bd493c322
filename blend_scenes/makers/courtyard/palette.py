"""The courtyard's colours: warm plaster, worn stone, terracotta, faded wood, with blue and magenta against them."""

from __future__ import annotations

from typing import Any

from ..stage import Colour, paint

Palette = dict[str, Any]

COLOURS: dict[str, Colour] = {
    "plaster": (0.78, 0.60, 0.38),
    "plaster light": (0.80, 0.70, 0.54),
    "plaster rose": (0.70, 0.38, 0.26),
    "stone": (0.62, 0.56, 0.46),
    "stone light": (0.74, 0.70, 0.61),
    "stone dark": (0.36, 0.33, 0.29),
    "paving warm": (0.52, 0.43, 0.33),
    "paving cool": (0.43, 0.41, 0.38),
    "paving light": (0.60, 0.53, 0.43),
    "tile red": (0.56, 0.17, 0.075),
    "tile orange": (0.66, 0.25, 0.11),
    "tile brown": (0.40, 0.13, 0.07),
    "terracotta": (0.58, 0.22, 0.11),
    "wood dark": (0.15, 0.075, 0.035),
    "wood": (0.33, 0.18, 0.085),
    "shutter": (0.10, 0.25, 0.27),
    "glass": (0.07, 0.11, 0.15),
    "iron": (0.045, 0.045, 0.05),
    "brass": (0.62, 0.42, 0.13),
    "leaf": (0.13, 0.27, 0.055),
    "leaf light": (0.25, 0.38, 0.09),
    "leaf dark": (0.05, 0.13, 0.045),
    "agave": (0.20, 0.34, 0.25),
    "lemon": (0.85, 0.62, 0.04),
    "bougainvillea": (0.66, 0.04, 0.22),
    "lavender": (0.30, 0.19, 0.52),
    "bark": (0.16, 0.11, 0.075),
    "soil": (0.08, 0.05, 0.035),
    "water": (0.12, 0.33, 0.38),
    "spray": (0.55, 0.72, 0.76),
    "cloth": (0.72, 0.12, 0.08),
    "cloth light": (0.80, 0.74, 0.62),
    "rope": (0.42, 0.33, 0.20),
    "feather": (0.33, 0.34, 0.38),
    "feather light": (0.66, 0.66, 0.68),
}


def make_palette() -> Palette:
    """One material for each colour, and the emissive bulbs."""
    palette = {name: paint(name, colour) for name, colour in COLOURS.items()}
    palette["brass"] = paint("brass polished", COLOURS["brass"], 0.35, 1.0)
    palette["water"] = paint("water still", COLOURS["water"], 0.08)
    palette["bulb"] = paint("bulb", (0.95, 0.72, 0.34), 0.4, emission=6.0)
    return palette
