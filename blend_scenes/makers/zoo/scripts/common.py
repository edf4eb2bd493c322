import importlib

import bpy
import numpy as np


def find_addon():
    """The add-on's package, whatever Blender calls it."""
    panel = getattr(bpy.types, "PERFECT_BVH_PT_render", None)
    if panel is None:
        raise RuntimeError("Enable Perfect BVH in the preferences, then run this script again")
    return importlib.import_module(panel.__module__.partition(".panels")[0])


def camera_rays(rows=90, columns=160):
    """Origins and directions (rows * columns, 3) through the scene's camera."""
    scene = bpy.context.scene
    matrix = np.array(scene.camera.matrix_world)
    top_right, _, bottom_left, top_left = map(np.array, scene.camera.data.view_frame(scene=scene))
    right, down = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    across = right.reshape(-1, 1) * (top_right - top_left)
    within = top_left + across + down.reshape(-1, 1) * (bottom_left - top_left)
    directions = within @ matrix[:3, :3].T
    return np.broadcast_to(matrix[:3, 3], directions.shape).copy(), directions


def evaluated():
    """What Blender has evaluated of the frame that is set."""
    return bpy.context.evaluated_depsgraph_get()


def tell(*lines):
    """Print the lines, and show them in this Text Editor; the list in its header leads back to this script."""
    answers = bpy.data.texts.get("Answers") or bpy.data.texts.new("Answers")
    answers.from_string("\n\n".join(lines) + "\n")
    print(answers.as_string())
    space = bpy.context.space_data
    if space is not None and space.type == "TEXT_EDITOR":
        space.text = answers
