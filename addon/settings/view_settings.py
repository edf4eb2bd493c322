"""What viewports are set to: overlays, and the trees that are compared."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .preferences import redraw_for_setting
from .properties import choice, switch, whole

# Which boxes a 3D viewport shows: `space.shading.perfect_bvh.overlay`, which is saved with the screen.


class PERFECT_BVH_PG_overlay(bpy.types.PropertyGroup):
    """Which boxes of the trees are drawn in a 3D viewport."""

    show_top_level: switch("Top Level", "Draw the boxes of the BVH over all instances", update=redraw_for_setting)
    show_active: switch(
        "Active Object", "Draw the boxes of the BVH over the active object's triangles", update=redraw_for_setting
    )
    level: whole(
        "Level",
        "Depth in the BVH: 0 is the box around everything, and each box contains up to eight others. "
        "Leaves, the boxes of triangles, that end above are drawn as well",
        *(2, 0, 64),
        soft_max=12,
        update=redraw_for_setting,
    )
    use_all_to_level: switch("Show Parent Levels", "Draw the boxes above the level as well", update=redraw_for_setting)
    color_by: choice(
        "Color",
        "Meaning of the boxes' colors",
        [
            ("LEVEL", "Level", "Depth of a box in the BVH", 0),
            ("OVERLAP", "Overlap", "Overlap with sibling boxes: blue none, red all of the box", 1),
            (
                "COST",
                "Cost",
                "Expected visits and tests of a ray in a box: blue least, red most. The sum is the SAH, the cost by "
                "the surface area heuristic",
                2,
            ),
        ],
        "LEVEL",
        update=redraw_for_setting,
    )
    use_in_front: switch("In Front", "Draw boxes in front of everything else", update=redraw_for_setting)


# Tree settings -------------------------------------------------------------------------------------------------------
# The settings of the button that compares two trees: `scene.perfect_bvh.compare`.


REFITTED = "REFITTED"


@dataclass(frozen=True, slots=True)
class TreeChoice:
    """A way to come by a tree. builder, optimize: as in `perfect_bvh.BuildConfig`. number: which files keep."""

    identifier: str
    label: str
    description: str
    builder: str
    number: int
    optimize: int = 0


CHOICES = (
    TreeChoice("AUTO", "Automatic", "The engine's choice", "auto", 0),
    TreeChoice("MEDIAN", "Median Split", "Two halves of equal count, regardless of the cost for rays", "median", 1),
    TreeChoice(
        "SWEEP",
        "Full Sweep",
        "The surface area heuristic (SAH), the expected cost of a ray, at every possible plane of each node",
        "sweep",
        2,
    ),
    TreeChoice(
        "BINNED",
        "Binned",
        "The surface area heuristic (SAH), the expected cost of a ray, at a fixed number of planes",
        "binned",
        3,
    ),
    TreeChoice("SPATIAL", "Spatial Splits", "Cuts long triangles where that is cheaper", "spatial", 4),
    TreeChoice("FAST", "Fast", "The shortest build time, by clustering along a space-filling curve", "fast", 5),
    TreeChoice("OPTIMIZED", "Optimized", "Binned, then improved by moving nodes to better positions", "binned", 6, 100),
    TreeChoice(
        REFITTED, "Refitted", "Built in the first frame of the scene, and refitted to the current one", "auto", 7
    ),
)
_ITEMS = [(choice.identifier, choice.label, choice.description, choice.number) for choice in CHOICES]


def choice_of(identifier: str) -> TreeChoice:
    """Returns the choice for a property's value."""
    return next(choice for choice in CHOICES if choice.identifier == identifier)


def choice_of_builder(builder: str) -> TreeChoice:
    """The first that is made by a builder, as `BuildConfig` names it."""
    return next(choice for choice in CHOICES if choice.builder == builder)


class PERFECT_BVH_PG_compare(bpy.types.PropertyGroup):
    """Which two trees of the active object are compared."""

    left: choice("Left", "Builder of the BVH on the left", _ITEMS, "MEDIAN")
    right: choice("Right", "Builder of the BVH on the right", _ITEMS, "BINNED")


CLASSES = (PERFECT_BVH_PG_compare,)
