"""The settings of the Bake Rays button: `scene.perfect_bvh.bake`."""

from __future__ import annotations

import bpy

from .bake_choices import BAKE_KINDS, DOMAINS
from .scan_settings import PATH_OPTIONS

_KINDS = [(kind.name, kind.label, kind.description, number) for number, kind in enumerate(BAKE_KINDS)]
_LABELS = {"FACE": "Face", "CORNER": "Face Corner", "POINT": "Vertex"}
_DOMAINS = [(name, label, DOMAINS[name], number) for number, (name, label) in enumerate(_LABELS.items())]


def suggest_zones(settings: PERFECT_BVH_PG_bake, context: bpy.types.Context, text: str) -> list[str]:
    """Names of time zones that Python knows."""
    from zoneinfo import available_timezones

    return sorted(name for name in available_timezones() if text.lower() in name.lower())


def sun_position_of(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """Returns the settings of the add-on Sun Position, which has a place, a date and north; None without it."""
    return getattr(scene, "sun_pos_properties", None)


class PERFECT_BVH_PG_bake(bpy.types.PropertyGroup):
    """Which question rays answer for each face, and where and when the sun is looked for."""

    kind: bpy.props.EnumProperty(
        name="Bake", description="What rays find out about each face", items=_KINDS, default="SUN_HOURS"
    )
    domain: bpy.props.EnumProperty(
        name="Domain", description="Which elements of the meshes get values", items=_DOMAINS, default="FACE"
    )
    light: bpy.props.EnumProperty(
        name="Light",
        description="What is summed over the times at which the sun is visible",
        items=[
            ("HOURS", "Hours", "The time that the sun shines on a face", 0),
            ("WEATHER", "Weather File", "The energy of sun and sky of a typical year, by a weather file (EPW)", 1),
        ],
        default="HOURS",
    )
    weather: bpy.props.StringProperty(
        name="Weather",
        description="A weather file of EnergyPlus (EPW). It has its own place and time zone",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
    period: bpy.props.EnumProperty(
        name="Dates",
        description="On which days the sun is followed",
        items=[
            ("DAY", "Day", "One day of the calendar", 0),
            ("RANGE", "Range", "From one day to another, both included", 1),
            ("YEAR", "Year", "The whole year", 2),
        ],
        default="DAY",
    )
    year: bpy.props.IntProperty(name="Year", description="Calendar year of the dates", default=2026, min=1900, max=2100)
    month: bpy.props.IntProperty(name="Month", description="Month of the first day", default=3, min=1, max=12)
    day: bpy.props.IntProperty(name="Day", description="The first day, within its month", default=21, min=1, max=31)
    month_end: bpy.props.IntProperty(name="Month", description="Month of the last day", default=9, min=1, max=12)
    day_end: bpy.props.IntProperty(
        name="Day", description="The last day, within its month, which is included", default=21, min=1, max=31
    )
    step: bpy.props.IntProperty(
        name="Step",
        description="Minutes from one place of the sun to the next; 0 for 10 on a day, and 60 on more days",
        default=0,
        min=0,
        max=1440,
        subtype="TIME",
    )
    latitude: bpy.props.FloatProperty(
        name="Latitude",
        description="Degrees north of the equator, negative to the south",
        default=52.52,
        min=-90.0,
        max=90.0,
        precision=4,
    )
    longitude: bpy.props.FloatProperty(
        name="Longitude",
        description="Degrees east of Greenwich, negative to the west",
        default=13.4,
        min=-180.0,
        max=180.0,
        precision=4,
    )
    zone: bpy.props.StringProperty(
        name="Time Zone",
        description="Its name, with summer time, or hours from UTC such as +1. The longitude decides if empty",
        default="",
        search=suggest_zones,
        search_options={"SUGGESTION"},
    )
    north: bpy.props.FloatProperty(
        name="North Offset",
        description="Where north is: turned clockwise from +Y, as seen from above",
        default=0.0,
        subtype="ANGLE",
    )
    distance: bpy.props.FloatProperty(
        name="Distance",
        description="How far away another surface still counts",
        default=10.0,
        min=0.001,
        subtype="DISTANCE",
    )
    samples: bpy.props.IntProperty(
        name="Samples",
        description="Rays from each place. Four times as many halve the noise",
        default=256,
        min=1,
        max=1 << 20,
    )
    viewer: bpy.props.PointerProperty(
        name="Seen From",
        description=(
            "Object that looks: a camera, within its frame; a curve, from all its points. The scene's camera if empty"
        ),
        type=bpy.types.Object,
    )
    use_frames: bpy.props.BoolProperty(
        name="Frame Range", description="Look from where it is in each frame of the scene's range", default=False
    )
    table: bpy.props.StringProperty(
        name="Table",
        description="File (CSV or Parquet) that gets the value and the area of each face. None is written if empty",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
