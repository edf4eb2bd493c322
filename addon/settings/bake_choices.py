"""The kinds of bakes and where their values go, in words, for menus, the command line's help and the bakes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BakeKind:
    """A question that rays answer for each face.

    Attributes:
        name, label, description: As a script, a menu and a tooltip have them.
        columns: The names of the values and their units, the main one first.
        options: The arguments of `bake_rays` that only some kinds have, as the panel shows them.
    """

    name: str
    label: str
    description: str
    columns: tuple[tuple[str, str], ...]
    options: tuple[str, ...] = ()


BAKE_KINDS = (
    BakeKind("SUN_HOURS", "Sun Hours", "How long the sun shines on it on the chosen dates", (("sun_hours", "h"),)),
    BakeKind(
        "SKY_VIEW", "Sky View", "The share of the sky that it sees, 0 to 1", (("sky_view", ""),), ("cosine", "rays")
    ),
    BakeKind(
        "AMBIENT_OCCLUSION",
        "Ambient Occlusion",
        "How open it is to its surroundings: 1 where nothing is near",
        (("ambient_occlusion", ""),),
        ("distance", "falloff", "rays"),
    ),
    BakeKind(
        "THICKNESS",
        "Thickness",
        "How thick the solid is below it",
        (("thickness", "units"),),
        ("method", "angle", "rays"),
    ),
    BakeKind(
        "EXPOSURE",
        "Exposure",
        "The share of a camera's frames or a curve's points that see it; also the nearest distance and smallest angle",
        (("exposure", ""), ("nearest_distance", "units"), ("smallest_angle", "rad")),
        ("viewers",),
    ),
)
KINDS = {kind.name: kind for kind in BAKE_KINDS}
DOMAINS = {
    "FACE": "One value per face, at its center",
    "CORNER": "One value per face corner",
    "POINT": "One value per vertex, the mean of its corners",
    "TEXEL": "One value per pixel of an image, by the UV map",
}
METHODS = {
    "CONE": "The mean distance to the opposite side, over a cone of rays",
    "SPHERE": "The diameter of the largest sphere inside that touches the surface there",
}
