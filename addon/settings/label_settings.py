"""The settings of the Label Images button: `scene.perfect_bvh.label_images`."""

from __future__ import annotations

from typing import Any

import bpy

from .scan_settings import MOST, PATH_OPTIONS

# The last is a number that files store.
FORMATS = (
    ("png", "PNG", "Images of 16 bits: ids and depth", "NONE", 4),
    ("npz", "NumPy", "One .npz file per frame with all images, masks and names", "NONE", 1),
    ("npy", "NumPy Arrays", "One .npy file per image, which programs can map into memory", "NONE", 2),
    ("exr", "OpenEXR", "One file of layers per frame. Needs the library OpenEXR", "NONE", 8),
)


def _is_camera(_settings: Any, obj: bpy.types.Object) -> bool:
    return obj.type == "CAMERA"


class PERFECT_BVH_PG_label_images(bpy.types.PropertyGroup):
    """Which frames are labelled, with what, and where the files go."""

    camera: bpy.props.PointerProperty(
        name="Camera",
        description="The camera that sees the labels. The scene's camera of each frame if empty",
        type=bpy.types.Object,
        poll=_is_camera,
    )
    frames: bpy.props.EnumProperty(
        name="Frames",
        description="The frames to label",
        items=[
            ("CURRENT", "Current Frame", "The frame that is shown", 0),
            ("SCENE", "Scene Range", "From the scene's first frame to its last one", 1),
            ("RANGE", "Custom Range", "From a frame of your choice to another", 2),
        ],
        default="CURRENT",
    )
    frame_start: bpy.props.IntProperty(
        name="Start", description="The first frame that is labelled", default=1, min=-MOST, max=MOST
    )
    frame_end: bpy.props.IntProperty(
        name="End", description="The last frame that is labelled", default=5, min=-MOST, max=MOST
    )
    use_render_size: bpy.props.BoolProperty(
        name="Render Size", description="Label images have the size of a render", default=True
    )
    width: bpy.props.IntProperty(
        name="Resolution X", description="Width of the images", default=640, min=4, max=65536, subtype="PIXEL"
    )
    height: bpy.props.IntProperty(
        name="Resolution Y", description="Height of the images", default=480, min=4, max=65536, subtype="PIXEL"
    )
    category: bpy.props.StringProperty(
        name="Category",
        description=(
            "The custom property whose value is an object's category, or collection or material. "
            "The object's name if empty"
        ),
        default="",
    )
    layers: bpy.props.IntProperty(
        name="Layers",
        description="Number of the nearest surfaces behind each pixel whose depth and object are stored",
        default=1,
        min=1,
        max=1000,
        soft_max=8,
    )
    formats: bpy.props.EnumProperty(
        name="Formats",
        description="File formats; several can be chosen",
        items=FORMATS,
        default={"png"},
        options={"ENUM_FLAG"},
    )
    use_coco: bpy.props.BoolProperty(
        name="COCO File",
        description="Write one JSON file with all masks and boxes in the format of COCO",
        default=False,
    )
    folder: bpy.props.StringProperty(
        name="Folder", description="Where the files are written", subtype="DIR_PATH", options=PATH_OPTIONS
    )
    use_resume: bpy.props.BoolProperty(
        name="Resume",
        description="Keep complete files that were made with the same settings, and write only the others",
        default=False,
    )
