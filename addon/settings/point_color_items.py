"""What colors of a scan's points can mean, as the items of a menu; their numbers are what .blend files keep."""

from __future__ import annotations

from typing import NamedTuple

OTHER = "COLUMN"


class PointColor(NamedTuple):
    """An item. column: the points' attribute that is shown. scale: how its values become colors.

    scale is "near" (even ratios along a ramp, yellow to violet), "ramp" (even steps along it), "ids" (a color for
    each), "grey" (black to white), "normal" (directions as red, green and blue), or "height" (the ramp, of the third
    number).
    """

    identifier: str
    label: str
    description: str
    number: int
    column: str
    scale: str


POINT_COLORS = (
    PointColor("DISTANCE", "Distance", "How far away the sensor was: yellow near, violet far", 0, "distance", "near"),
    PointColor("HEIGHT", "Height", "How high the point lies: yellow low, violet high", 3, "position", "height"),
    PointColor("OBJECT", "Object", "Which object was met", 1, "object_id", "ids"),
    PointColor(
        "INSTANCE", "Instance", "Which instance was met, of what is shown several times", 4, "instance_id", "ids"
    ),
    PointColor("MATERIAL", "Material", "Which material was met; grey where there is none", 5, "material_id", "ids"),
    PointColor(
        "INTENSITY",
        "Intensity",
        "How much light comes back; without a sensor's light that of the material's viewport color",
        2,
        "intensity",
        "grey",
    ),
    PointColor(
        "INCIDENCE", "Incidence", "How rays met surfaces: yellow grazing, violet head on", 6, "incidence", "ramp"
    ),
    PointColor("NORMAL", "Normal", "Where the surface faces: X as red, Y as green, Z as blue", 7, "normal", "normal"),
    PointColor("TIME", "Time", "When the ray was cast: yellow first, violet last", 8, "time", "ramp"),
    PointColor("RING", "Ring", "Which line of a LiDAR, or row of a picture: yellow the first", 9, "ring", "ramp"),
    PointColor("RETURN", "Return", "Which echo of its beam the point is, by a color for each", 11, "return_id", "ids"),
    PointColor("RETURNS", "Returns", "How many echoes of its beam were kept", 12, "return_count", "ids"),
)


def items() -> list[tuple[str, str, str, int]]:
    """For a property. The last one is for columns that a scan was asked for by name."""
    found = [(color.identifier, color.label, color.description, color.number) for color in POINT_COLORS]
    return [*found, (OTHER, "Other Column", "Any attribute of the points, by its name", 10)]


def find_color(identifier: str) -> PointColor:
    """The item of that identifier, which is not OTHER."""
    return next(color for color in POINT_COLORS if color.identifier == identifier)
