"""The shading modes as the command line and the panel name them. Imports nothing, so that both can list them at once.

The treatment of a mode's values on screen and in files:
- a *picture* goes through the scene's view transform (AgX, Filmic, exposure, look), as every render does;
- a *palette* (one colour for each id, a scale of colours for a count) goes through plain sRGB, for any scene,
  so that an id has the same colour in every file;
- *values* (directions, distances) are raw: the measured values are written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Mode:
    """A shading mode.

    name: as `perfect_bvh.render` takes it. label: as users see it. number: the value in .blend files, so
    it never changes. view: the view transform that shows it, None for the scene's own. has_range: its values are
    distances, which an image file of bytes cannot hold unscaled. rays_per_sample: the number of rays of a sample of a
    pixel, without those of light that bounces; has_bounces: whether there is such light. is_noisy: whether its
    light comes from random rays, so that a denoiser is useful.

    The data of the scene that it needs in addition to shapes: normals, at the corners; uvs, of the active map;
    materials: their numbers and viewport colours; offers_grey: those or, by the user's choice, one grey for all;
    shading: materials' surfaces, lights, the world.
    """

    name: str
    number: int
    label: str
    description: str
    view: str | None = None
    has_range: bool = False
    rays_per_sample: int = 1
    has_bounces: bool = False
    is_noisy: bool = False
    normals: bool = False
    uvs: bool = False
    materials: bool = False
    offers_grey: bool = False
    shading: bool = False

    @property
    def word(self) -> str:
        """The word that users type for it, which is the visible one."""
        return self.label.lower()


MODES: tuple[Mode, ...] = (
    Mode(
        "preview",
        0,
        "Lit",
        "The scene with its lights and world, with as many light bounces as its Light Paths allow",
        has_bounces=True,
        is_noisy=True,
        normals=True,
        materials=True,
        shading=True,
    ),
    Mode(
        "clay",
        1,
        "Clay",
        "Soft sky light with ambient occlusion, in the viewport colors of the materials",
        rays_per_sample=3,
        is_noisy=True,
        normals=True,
        offers_grey=True,
    ),
    Mode(
        "matcap",
        9,
        "MatCap",
        "Shape at a glance: shading by the normals relative to the viewer",
        normals=True,
        offers_grey=True,
    ),
    Mode(
        "wireframe",
        2,
        "Wireframe",
        "The edges of the triangles over softly lit surfaces",
        normals=True,
        offers_grey=True,
    ),
    Mode("normal", 3, "Normal", "World-space shading normals, remapped from -1..1 to 0..1", "Raw", normals=True),
    Mode(
        "uv",
        10,
        "UV",
        "UV coordinates of the mesh as red and green; black without a UV map",
        "Raw",
        uvs=True,
    ),
    Mode("depth", 4, "Depth", "Distance along the view axis in world units", "Raw", has_range=True),
    Mode("distance", 5, "Distance", "Distance along the ray in world units", "Raw", has_range=True),
    Mode("instance", 6, "Instance", "One color for each instance", "Standard"),
    Mode("material", 7, "Material", "One color for each material", "Standard", materials=True),
    Mode("cost", 8, "Cost", "Nodes and triangles visited per pixel, on a fixed color scale", "Standard"),
)
MODE_NAMES: tuple[str, ...] = tuple(mode.name for mode in MODES)
DEFAULT_MODE = "preview"


def find_mode(name: str) -> Mode:
    """The mode of this name, or of this word; a ValueError that lists them all if there is none."""
    for mode in MODES:
        if name in (mode.name, mode.word):
            return mode
    raise ValueError(f"unknown mode {name!r}; the modes are {', '.join(mode.word for mode in MODES)}")


def mode_of_render(scene: Any) -> Mode:
    """Returns the mode of renders of a Blender scene."""
    return find_mode(scene.perfect_bvh.mode.lower())
