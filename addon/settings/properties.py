"""Properties as rows of a table: label, tooltip, default, and for numbers the least and the largest value.

Further arguments are those of `bpy.props`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

# Blender warns of paths that begin with // where a property does not say that it takes them; older ones do not ask.
_KNOWS_RELATIVE_PATHS = "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
_PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if _KNOWS_RELATIVE_PATHS else set()
MOST_FRAME = 1_048_574  # as Blender has it
MOST_WHOLE, MOST_NUMBER = 2**31 - 1, 3.4028234e38


def choice(label: str, tooltip: str, items: Sequence[Any], default: Any, **how: Any) -> Any:
    return bpy.props.EnumProperty(name=label, description=tooltip, items=items, default=default, **how)


def whole(label: str, tooltip: str, default: int, least: int, most: int = MOST_WHOLE, **how: Any) -> Any:
    return bpy.props.IntProperty(name=label, description=tooltip, default=default, min=least, max=most, **how)


def number(label: str, tooltip: str, default: float, least: float, most: float = MOST_NUMBER, **how: Any) -> Any:
    return bpy.props.FloatProperty(name=label, description=tooltip, default=default, min=least, max=most, **how)


def switch(label: str, tooltip: str, default: bool = False, **how: Any) -> Any:
    return bpy.props.BoolProperty(name=label, description=tooltip, default=default, **how)


def text(label: str, tooltip: str, default: str = "", **how: Any) -> Any:
    return bpy.props.StringProperty(name=label, description=tooltip, default=default, **how)


def path(label: str, tooltip: str, subtype: str = "FILE_PATH") -> Any:
    return bpy.props.StringProperty(name=label, description=tooltip, subtype=subtype, options=_PATH_OPTIONS)


def pointer(label: str, tooltip: str, kind: Any, **how: Any) -> Any:
    return bpy.props.PointerProperty(name=label, description=tooltip, type=kind, **how)


def frame_menu(tooltip: str, current: str, **how: Any) -> Any:
    """Makes a menu of frames. current: what it does at the current frame."""
    items = [
        ("CURRENT", "Current Frame", current, 0),
        ("SCENE", "Scene Range", "From the scene's first frame to its last one", 1),
        ("RANGE", "Custom Range", "From a frame of your choice to another", 2),
    ]
    return bpy.props.EnumProperty(name="Frames", description=tooltip, items=items, **how)
