"""The settings of the Bake Sun, Sky and Thickness button: `scene.perfect_bvh.bake`."""

from __future__ import annotations

import math

import bpy

from .bake_choices import BAKE_KINDS, DOMAINS, KINDS, METHODS
from .properties import choice, number, path, pointer, switch, text, whole

_KINDS = [(kind.name, kind.label, kind.description, number) for number, kind in enumerate(BAKE_KINDS)]
_LABELS = ("Face", "Face Corner", "Vertex", "Image")
_DOMAINS = [
    (name, label, DOMAINS[name], number) for number, (name, label) in enumerate(zip(DOMAINS, _LABELS, strict=True))
]
_METHODS = [(name, name.title(), description, number) for number, (name, description) in enumerate(METHODS.items())]
_LIGHTS = [
    ("HOURS", "Hours of Sun", "The time that the sun shines on a face", 0),
    ("WEATHER", "Energy (Weather File)", "The energy of sun and sky of a typical year, by a weather file (EPW)", 1),
]
_PERIODS = [
    ("DAY", "Day", "One day of the calendar", 0),
    ("RANGE", "Range", "From one day to another, both included", 1),
    ("YEAR", "Year", "The whole year", 2),
]
_WIDEST = math.radians(89.0)  # the nearest float to 90 degrees is more


def suggest_zones(settings: PERFECT_BVH_PG_bake, context: bpy.types.Context, text: str) -> list[str]:
    """Names of time zones that Python knows."""
    from zoneinfo import available_timezones

    return sorted(name for name in available_timezones() if text.lower() in name.lower())


def sun_position_of(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """Returns the settings of the add-on Sun Position, which has a place, a date and north; None without it."""
    return getattr(scene, "sun_pos_properties", None)


def options_of(settings: PERFECT_BVH_PG_bake) -> tuple[str, ...]:
    """Returns the names of the settings that the chosen kind has for itself."""
    is_sphere = settings.kind == "THICKNESS" and settings.method == "SPHERE"
    return ("method",) if is_sphere else KINDS[settings.kind].options


class PERFECT_BVH_PG_bake(bpy.types.PropertyGroup):
    """Which question rays answer for each face, and where and when the sun is looked for."""

    kind: choice("Bake", "What rays find out about each face", _KINDS, "SUN_HOURS")
    domain: choice("Domain", "Which elements of the meshes get values", _DOMAINS, "FACE")
    # Sun
    light: choice("Measure", "What is summed over the times at which the sun is visible", _LIGHTS, "HOURS")
    weather: path("Weather", "A weather file of EnergyPlus (EPW). It has its own place and time zone")
    period: choice("Dates", "On which days the sun is followed", _PERIODS, "DAY")
    year: whole("Year", "Calendar year of the dates", 2026, 1900, 2100)
    month: whole("Month", "Month of the first day", 3, 1, 12)
    day: whole("Day", "The first day, within its month", 21, 1, 31)
    month_end: whole("Month", "Month of the last day", 9, 1, 12)
    day_end: whole("Day", "The last day, within its month, which is included", 21, 1, 31)
    step: whole(
        "Step",
        "Minutes between two positions of the sun. 0: 10 for one day, 60 for more",
        *(0, 0, 1440),
        subtype="TIME",
    )
    latitude: number("Latitude", "Degrees north of the equator, negative to the south", 52.52, -90, 90, precision=4)
    longitude: number("Longitude", "Degrees east of Greenwich, negative to the west", 13.4, -180, 180, precision=4)
    zone: text(
        "Time Zone",
        "Its name, with summer time, or hours from UTC such as +1. The longitude decides if empty",
        search=suggest_zones,
        search_options={"SUGGESTION"},
    )
    north: bpy.props.FloatProperty(
        name="North Offset", description="Where north is: turned clockwise from +Y, as seen from above", subtype="ANGLE"
    )
    # Other kinds, by the names that `bake_rays` has for them
    cosine: switch(
        "Cosine", "Weight the sky as diffuse light, by the cosine to the normal; else all of it evenly", True
    )
    distance: number("Distance", "How far away another surface still counts", 10.0, 0.001, 1e9, subtype="DISTANCE")
    falloff: number(
        "Falloff", "How fast surfaces count less with their distance; 0: all within it count fully", 0.0, 0.0, 100.0
    )
    method: choice("Method", "How the thickness is measured", _METHODS, "CONE")
    angle: number("Angle", "Half the opening of the cone of rays", math.radians(30.0), 0.0, _WIDEST, subtype="ANGLE")
    rays: whole("Samples", "Rays for each value. Four times as many halve the noise", 256, 1, 1 << 20)
    viewers: pointer(
        "Seen From",
        "Object that looks: a camera, within its frame; a curve, from all its points. The scene's camera if empty",
        bpy.types.Object,
    )
    use_frames: switch("Frame Range", "Look from where it is in each frame of the scene's range", False)
    # Images
    uv_map: text("UV Map", "Name of the UV map that places the pixels. Each mesh's active one if empty")
    width: whole("Width", "Horizontal resolution of each mesh's image", 1024, 1, 32768, subtype="PIXEL")
    height: whole("Height", "Vertical resolution of each mesh's image", 1024, 1, 32768, subtype="PIXEL")
    margin: whole("Margin", "Extends the values beyond the edges of the UV map", 16, 0, 32767, subtype="PIXEL")
    table: path(
        "Write Table To", "File (CSV or Parquet) that gets each value, and the area of each face. None if empty"
    )
