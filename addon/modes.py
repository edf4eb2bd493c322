"""The shading modes as the command line and the panel name them. Imports nothing, so that both can list them at once.

A *colour* mode is a picture: files and the Image Editor show it through the scene's view transform (AgX,
Filmic, exposure, look). A *data* mode is a code that a reader decodes (a direction, a distance, an id, a
count): its values are shown and written raw, so that equal values are equal colours in every file.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mode:
    """name: as `perfect_bvh.render` and the command line take it. is_data: its values bypass the view transform."""

    name: str
    label: str
    description: str
    is_data: bool


MODES: tuple[Mode, ...] = (
    Mode("clay", "Clay", "Soft sky light with ambient occlusion, in the viewport colours of the materials", False),
    Mode("wireframe", "Wireframe", "Clay with the edges of the triangles drawn over it", False),
    Mode("normal", "Normal", "World-space shading normals, from -1..1 to 0..1", True),
    Mode("depth", "Depth", "Distance along the view axis, from near (white) to far (black)", True),
    Mode("instance", "Instance", "One colour for each instance", True),
    Mode("material", "Material", "The flat viewport colour of each material", True),
    Mode("cost", "Cost", "Nodes and triangles visited for each pixel, on one fixed colour scale", True),
)
MODE_NAMES: tuple[str, ...] = tuple(mode.name for mode in MODES)
DEFAULT_MODE = "clay"


def find_mode(name: str) -> Mode:
    """The mode called `name`; a ValueError that lists them all if there is none."""
    for mode in MODES:
        if mode.name == name:
            return mode
    raise ValueError(f"unknown mode {name!r}; the modes are {', '.join(MODE_NAMES)}")
