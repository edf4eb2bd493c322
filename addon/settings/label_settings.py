"""The settings of the Label Images button: `scene.perfect_bvh.label_images`."""

from __future__ import annotations

from typing import Any

import bpy

from .properties import MOST_FRAME, choice, frame_menu, path, pointer, switch, text, whole

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

    camera: pointer(
        "Camera",
        "The camera that sees the labels. The scene's camera of each frame if empty",
        bpy.types.Object,
        poll=_is_camera,
    )
    frames: frame_menu("The frames to label", "The frame that is shown", default="CURRENT")
    frame_start: whole("Start", "The first frame that is labelled", 1, -MOST_FRAME, MOST_FRAME)
    frame_end: whole("End", "The last frame that is labelled", 5, -MOST_FRAME, MOST_FRAME)
    use_render_size: switch("Render Size", "Label images have the size of a render", True)
    width: whole("Resolution X", "Width of the images", 640, 4, 65536, subtype="PIXEL")
    height: whole("Resolution Y", "Height of the images", 480, 4, 65536, subtype="PIXEL")
    category: text(
        "Category",
        "The custom property whose value is an object's category, or collection or material. "
        "The object's name if empty",
    )
    layers: whole(
        "Layers",
        "Number of the nearest surfaces behind each pixel whose depth and object are stored",
        *(1, 1, 1000),
        soft_max=8,
    )
    formats: choice("Formats", "File formats; several can be chosen", FORMATS, {"png"}, options={"ENUM_FLAG"})
    use_coco: switch("COCO File", "Write one JSON file with all masks and boxes in the format of COCO")
    folder: path("Folder", "Where the files are written", "DIR_PATH")
    use_resume: switch("Resume", "Keep complete files that were made with the same settings, and write only the others")
