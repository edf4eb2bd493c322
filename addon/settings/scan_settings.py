"""The settings of the Scan button: `scene.perfect_bvh.scan`."""

from __future__ import annotations

import bpy

from .scan_choices import CLOUD_FORMATS, items, sensor_items

# Blender warns of paths that begin with // where a property does not say that it takes them; older ones do not ask.
_KNOWS_RELATIVE_PATHS = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if _KNOWS_RELATIVE_PATHS else set()
# Which frames, as two switches keep it: files had the first one alone.
FRAMES = ("CURRENT", "SCENE", "RANGE")
MOST = 1_048_574  # frames, as Blender has it


def _get_frames(settings: PERFECT_BVH_PG_scan) -> int:
    return 0 if not settings.use_frame_range else 2 if settings.use_own_range else 1


def _set_frames(settings: PERFECT_BVH_PG_scan, number: int) -> None:
    settings.use_frame_range, settings.use_own_range = number > 0, number == 2


def suggest_columns(settings: PERFECT_BVH_PG_scan, context: bpy.types.Context, text: str) -> list[str]:
    """Attributes of the points of scans, and labels that the next one is to have."""
    clouds = [cloud.attributes for cloud in (*bpy.data.pointclouds, *bpy.data.meshes) if "object_names" in cloud]
    names = {found.name for attributes in clouds for found in attributes if not found.name.startswith(".")}
    names |= set(label_names(settings))
    return sorted(name for name in names if text.lower() in name.lower())


def label_names(settings: PERFECT_BVH_PG_scan) -> tuple[str, ...]:
    """Returns the names of the requested further columns."""
    return tuple(name.strip() for name in settings.labels.split(",") if name.strip())


class PERFECT_BVH_PG_scan(bpy.types.PropertyGroup):
    """What the Scan button casts, from where, and what it makes of it."""

    pattern: bpy.props.EnumProperty(
        name="Sensor",
        description="The rays to cast: those of a camera, of a LiDAR with your own numbers, or of a known sensor",
        items=[
            ("CAMERA", "Camera Grid", "One ray through the center of each pixel of the camera's image", 0),
            (
                "LIDAR",
                "Custom Spinning LiDAR",
                "A column of beams that rotates about the sensor's axis, with your own numbers",
                1,
            ),
            *sensor_items(),
            ("FILE", "From File...", "Your own sensor, described by a TOML file", 2),
        ],
        default="CAMERA",
    )
    sensor_file: bpy.props.StringProperty(
        name="Sensor File",
        description="The TOML file that describes the sensor, in the format of the included sensors",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
    sensor: bpy.props.PointerProperty(
        name="Sensor Object",
        description=(
            "Object on which the sensor is mounted; the camera of each frame if empty. A camera looks along its own -Z "
            "with +Y up, anything else along +Y with +Z up"
        ),
        type=bpy.types.Object,
    )
    mount: bpy.props.EnumProperty(
        name="Mount",
        description="Whether the rays can hit the mount: the sensor's object, its children and their instances",
        items=[
            ("AUTO", "Automatic", "Exclude the mount if the sensor is within the bounds of its object's mesh"),
            ("EXCLUDE", "Exclude", "The rays pass through the object and its children"),
            ("SCAN", "Scan", "The rays hit the object and its children like all other objects"),
        ],
        default="AUTO",
    )
    width: bpy.props.IntProperty(
        name="Resolution X", description="Number of rays in a row", default=640, min=1, max=65536, subtype="PIXEL"
    )
    height: bpy.props.IntProperty(
        name="Resolution Y",
        description="Number of rows of rays",
        default=360,
        min=1,
        max=65536,
        subtype="PIXEL",
    )
    elevations: bpy.props.StringProperty(
        name="Elevations",
        description="Elevation of each line in degrees, separated by commas; lowest:highest:count for even steps",
        default="-15:15:16",
    )
    columns: bpy.props.IntProperty(
        name="Columns", description="Number of measurements of all lines per turn", default=1800, min=1, max=1 << 20
    )
    rate: bpy.props.FloatProperty(
        name="Rate",
        description="Turns of the sensor per second",
        default=10.0,
        min=0.01,
        soft_max=100.0,
        max=10000.0,
    )
    max_distance: bpy.props.FloatProperty(
        name="Range",
        description="Largest distance that the sensor can measure",
        default=100.0,
        min=0.001,
        subtype="DISTANCE",
    )
    seed: bpy.props.IntProperty(
        name="Noise Seed",
        description="Seed of the sensor's noise and dropout: the same seed gives the same points",
        default=0,
        min=0,
    )
    labels: bpy.props.StringProperty(
        name="Labels",
        description=(
            "Further attributes of the points, separated by commas: custom properties by name, of objects, instancers, "
            "data or materials; or object, instancer, material, collection"
        ),
        default="",
    )
    use_frame_range: bpy.props.BoolProperty(
        name="Frame Range", description="Scan a range of frames instead of the current one", default=False
    )
    use_own_range: bpy.props.BoolProperty(
        name="Own Range", description="Scan your own range instead of the scene's range", default=False
    )
    frames: bpy.props.EnumProperty(
        name="Frames",
        description="The frames to scan",
        items=[
            ("CURRENT", "Current Frame", "One whole sweep of the sensor, with the scene at the current frame", 0),
            ("SCENE", "Scene Range", "From the scene's first frame to its last one", 1),
            ("RANGE", "Custom Range", "From a frame of your choice to another", 2),
        ],
        get=_get_frames,
        set=_set_frames,
        options=set(),
    )
    frame_start: bpy.props.IntProperty(
        name="Start", description="The first frame that is scanned", default=1, min=-MOST, max=MOST
    )
    frame_end: bpy.props.IntProperty(
        name="End", description="The last frame that is scanned", default=24, min=-MOST, max=MOST
    )
    use_viewport: bpy.props.BoolProperty(
        name="As in Viewports",
        description=(
            "Scan the objects, collections, modifier levels and particles that viewports show, instead of a render's"
        ),
        default=False,
    )
    steps_per_frame: bpy.props.IntProperty(
        name="Steps per Frame",
        description=(
            "Time samples of each frame, at which the scene is evaluated. Between two of them a LiDAR and all objects "
            "move in straight lines and turn evenly, so that each ray sees them at its own time. A camera makes a "
            "separate image at each"
        ),
        default=1,
        min=1,
        max=1000,
    )
    use_points: bpy.props.BoolProperty(
        name="Add Point Cloud",
        description="Add the points to the scene as an object. The points of many frames need much memory",
        default=True,
    )
    point_color: bpy.props.EnumProperty(
        name="Color",
        description="Meaning of the points' colors",
        items=items(),
        default="DISTANCE",
    )
    point_column: bpy.props.StringProperty(
        name="Column",
        description="The attribute of the points to show: a label, or any other",
        search=suggest_columns,
        search_options={"SUGGESTION"},
    )
    use_files: bpy.props.BoolProperty(
        name="Write Files", description="Write the points to files, several frames per file", default=False
    )
    folder: bpy.props.StringProperty(
        name="Folder",
        description="Folder of the files: for each chunk of frames one with points and one that describes them",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
    )
    file_format: bpy.props.EnumProperty(
        name="Format",
        description="File format of the points",
        items=[(one.name, one.label, one.description, number) for number, one in enumerate(CLOUD_FORMATS)],
        default="npz",
    )
    category: bpy.props.StringProperty(
        name="Category",
        description=(
            "The custom property whose value is the class of an object's 3D box; objects without it have no box. "
            "The object's name if empty"
        ),
        default="",
    )
    use_boxes: bpy.props.BoolProperty(
        name="3D Boxes",
        description="Also write the 3D box of each object in reach, its number of points and its visible share",
        default=False,
    )
    frames_per_file: bpy.props.IntProperty(
        name="Frames per File",
        description="Maximum number of frames in a file. A scan that is stopped loses no more than one file",
        default=10,
        min=1,
        max=1_000_000,
    )
    use_resume: bpy.props.BoolProperty(
        name="Resume",
        description="Keep complete files, and scan only missing or damaged ones",
        default=True,
    )
