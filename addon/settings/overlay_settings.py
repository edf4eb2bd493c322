"""Which boxes 3D viewports show: `scene.perfect_bvh.overlay`."""

from __future__ import annotations

import bpy

from .editors import redraw_for_setting


class PERFECT_BVH_PG_overlay(bpy.types.PropertyGroup):
    """Which boxes of the trees are drawn in 3D viewports."""

    show_top_level: bpy.props.BoolProperty(
        name="Top Level", description="Draw the tree over all instances", default=False, update=redraw_for_setting
    )
    show_active: bpy.props.BoolProperty(
        name="Active Object",
        description="Draw the tree over the active object's triangles",
        default=False,
        update=redraw_for_setting,
    )
    level: bpy.props.IntProperty(
        name="Level",
        description=(
            "Depth in the tree; 0 is the box around everything, and each box holds up to eight others. "
            "Leaves that end above are drawn as well"
        ),
        default=2,
        min=0,
        soft_max=12,
        max=64,
        update=redraw_for_setting,
    )
    use_all_to_level: bpy.props.BoolProperty(
        name="All to Level",
        description="Draw the nodes above the level as well",
        default=False,
        update=redraw_for_setting,
    )
    color_by: bpy.props.EnumProperty(
        name="Color",
        description="What the colors of the boxes mean",
        items=[
            ("LEVEL", "Level", "How deep in the tree a box is", 0),
            ("OVERLAP", "Overlap", "How much of a box its siblings cover as well: blue none, red all of it", 1),
            ("COST", "Cost", "What a random ray spends on a box: blue least, red most", 2),
        ],
        default="LEVEL",
        update=redraw_for_setting,
    )
    use_in_front: bpy.props.BoolProperty(
        name="In Front",
        description="Draw boxes in front of everything else",
        default=False,
        update=redraw_for_setting,
    )
