"""What the Scan button goes by: `scene.perfect_bvh.scan`."""

from __future__ import annotations

import bpy

# Blender warns of paths that begin with // where a property does not say that it takes them; older ones do not ask.
_KNOWS_RELATIVE_PATHS = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if _KNOWS_RELATIVE_PATHS else set()


class PERFECT_BVH_PG_scan(bpy.types.PropertyGroup):
    """What the Scan button casts, from where, and what it makes of it."""

    pattern: bpy.props.EnumProperty(
        name="Pattern",
        description="Which rays the sensor casts",
        items=[
            ("CAMERA", "Camera Grid", "One ray through the center of each pixel of the camera's picture", 0),
            ("LIDAR", "Spinning LiDAR", "Several lines, one above the other, that turn about the sensor's axis", 1),
        ],
        default="CAMERA",
    )
    sensor: bpy.props.PointerProperty(
        name="Sensor",
        description=(
            "Object that casts the rays; the active camera if empty. A camera looks along its own -Z with +Y up, "
            "anything else along +Y with +Z up"
        ),
        type=bpy.types.Object,
    )
    width: bpy.props.IntProperty(
        name="Resolution X", description="How many rays are in a row", default=640, min=1, max=65536, subtype="PIXEL"
    )
    height: bpy.props.IntProperty(
        name="Resolution Y",
        description="How many rows of rays there are",
        default=360,
        min=1,
        max=65536,
        subtype="PIXEL",
    )
    elevations: bpy.props.StringProperty(
        name="Elevations",
        description="Degrees above the horizon of each line, with commas between; lowest:highest:count for even steps",
        default="-15:15:16",
    )
    columns: bpy.props.IntProperty(
        name="Columns", description="How often all lines are measured in one turn", default=1800, min=1, max=1 << 20
    )
    rate: bpy.props.FloatProperty(
        name="Rate",
        description="How often the sensor turns in a second",
        default=10.0,
        min=0.01,
        soft_max=100.0,
        max=10000.0,
    )
    max_distance: bpy.props.FloatProperty(
        name="Range", description="How far the sensor can measure", default=100.0, min=0.001, subtype="DISTANCE"
    )
    use_frame_range: bpy.props.BoolProperty(
        name="Frame Range", description="Scan the scene's frame range instead of the current frame", default=False
    )
    steps_per_frame: bpy.props.IntProperty(
        name="Steps per Frame",
        description=(
            "How many key moments each frame has, at which the scene is evaluated. Between two of them a LiDAR and all "
            "that moves go in straight lines and turn evenly, so that each ray meets things where they are at its own "
            "time; a camera makes a picture of each"
        ),
        default=1,
        min=1,
        max=1000,
    )
    point_color: bpy.props.EnumProperty(
        name="Color",
        description="What the colors of the points mean",
        items=[
            ("DISTANCE", "Distance", "How far away the sensor was: yellow near, violet far", 0),
            ("OBJECT", "Object", "Which object was met", 1),
            (
                "INTENSITY",
                "Intensity",
                "How much comes back: the viewport color of the material, darker where rays graze it",
                2,
            ),
        ],
        default="DISTANCE",
    )
    labels: bpy.props.StringProperty(
        name="Labels",
        description=(
            "Further attributes of the points, with commas between: custom properties by name, of objects, instancers, "
            "data or materials; or object, instancer, material, collection"
        ),
        default="",
    )
    filepath: bpy.props.StringProperty(
        name="File",
        description="Also write the points into this .npz file; none if empty",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
