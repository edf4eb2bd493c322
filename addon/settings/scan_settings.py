"""The settings of the Scan button: `scene.perfect_bvh.scan`."""

from __future__ import annotations

import bpy

from .properties import MOST_FRAME, choice, frame_menu, number, path, pointer, switch, text, whole
from .scan_choices import CLOUD_FORMATS, items, sensor_items


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

    pattern: choice(
        "Sensor",
        "The rays to cast: those of a camera, of a LiDAR with your own numbers, or of a known sensor",
        [
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
        "CAMERA",
    )
    sensor_file: path("Sensor File", "The TOML file that describes the sensor, in the format of the included sensors")
    sensor: pointer(
        "Sensor Object",
        "Object on which the sensor is mounted; the camera of each frame if empty. A camera looks along its own -Z "
        "with +Y up, anything else along +Y with +Z up",
        bpy.types.Object,
    )
    mount: choice(
        "Mount",
        "Whether the rays can hit the mount: the sensor's object, its children and their instances",
        [
            ("AUTO", "Automatic", "Exclude the mount if the sensor is within the bounds of its object's mesh"),
            ("EXCLUDE", "Exclude", "The rays pass through the object and its children"),
            ("SCAN", "Scan", "The rays hit the object and its children like all other objects"),
        ],
        "AUTO",
    )
    width: whole("Resolution X", "Number of rays in a row", 640, 1, 65536, subtype="PIXEL")
    height: whole("Resolution Y", "Number of rows of rays", 360, 1, 65536, subtype="PIXEL")
    elevations: text(
        "Elevations",
        "Elevation of each line in degrees, separated by commas; lowest:highest:count for even steps",
        "-15:15:16",
    )
    columns: whole("Columns", "Number of measurements of each line per turn", 1800, 1, 1 << 20)
    rate: number("Rate", "Turns of the sensor per second", 10.0, 0.01, 10000.0, soft_max=100.0)
    max_distance: number("Range", "Largest distance that the sensor can measure", 100.0, 0.001, subtype="DISTANCE")
    seed: whole("Noise Seed", "Seed of the sensor's noise and dropout: the same seed gives the same points", 0, 0)
    labels: text(
        "Labels",
        "Further attributes of the points, separated by commas: custom properties by name, of objects, instancers, "
        "data or materials; or object, instancer, material, collection",
    )
    use_frame_range: switch("Frame Range", "Scan a range of frames instead of the current one")
    use_own_range: switch("Own Range", "Scan your own range instead of the scene's range")
    frames: frame_menu(
        "The frames to scan",
        "One whole sweep of the sensor, with the scene at the current frame",
        get=_get_frames,
        set=_set_frames,
        options=set(),
    )
    frame_start: whole("Start", "The first frame that is scanned", 1, -MOST_FRAME, MOST_FRAME)
    frame_end: whole("End", "The last frame that is scanned", 24, -MOST_FRAME, MOST_FRAME)
    use_viewport: switch(
        "As in Viewports",
        "Scan the objects, collections, modifier levels and particles that viewports show, instead of a render's",
    )
    steps_per_frame: whole(
        "Steps per Frame",
        "Time samples of each frame, at which the scene is evaluated. Between two of them a LiDAR and all objects "
        "move in straight lines and turn evenly, so that each ray sees them at its own time. A camera makes a "
        "separate image at each",
        *(1, 1, 1000),
    )
    use_points: switch(
        "Add Point Cloud", "Add the points to the scene as an object. The points of many frames need much memory", True
    )
    point_color: choice("Color", "Meaning of the points' colors", items(), "DISTANCE")
    point_column: text(
        "Column",
        "The attribute of the points to show: a label, or any other",
        search=suggest_columns,
        search_options={"SUGGESTION"},
    )
    use_files: switch("Write Files", "Write the points to files, several frames per file")
    folder: path(
        "Folder",
        "Folder of the files: for each chunk of frames one with points and one that describes them",
        "DIR_PATH",
    )
    file_format: choice(
        "Format",
        "File format of the points",
        [(one.name, one.label, one.description, number) for number, one in enumerate(CLOUD_FORMATS)],
        "npz",
    )
    category: text(
        "Category",
        "The custom property whose value is the class of an object's 3D box; objects without it have no box. "
        "The object's name if empty",
    )
    use_boxes: switch(
        "3D Boxes", "Also write the 3D box of each object in reach, its number of points and its visible share"
    )
    frames_per_file: whole(
        "Frames per File",
        "Maximum number of frames in a file. A scan that is stopped loses no more than one file",
        *(10, 1, 1_000_000),
    )
    use_resume: switch("Resume", "Keep complete files, and scan only missing or damaged ones", True)
