"""What the button that compares two trees goes by: `scene.perfect_bvh.compare`."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

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
    TreeChoice("AUTO", "Automatic", "What the engine chooses by itself", "auto", 0),
    TreeChoice("MEDIAN", "Median Split", "Halves of equal number, whatever they cost rays", "median", 1),
    TreeChoice("SWEEP", "Full Sweep", "The surface area heuristic at each possible plane of each node", "sweep", 2),
    TreeChoice("BINNED", "Binned", "The surface area heuristic at a fixed number of planes", "binned", 3),
    TreeChoice("SPATIAL", "Spatial Splits", "Cuts long triangles where that is cheaper", "spatial", 4),
    TreeChoice("FAST", "Fast", "The least time to build, over clusters along a curve", "fast", 5),
    TreeChoice("OPTIMIZED", "Optimized", "Binned, then improved by moving nodes to better places", "binned", 6, 100),
    TreeChoice(
        REFITTED, "Refitted", "Built in the first frame of the scene, and refitted to the current one", "auto", 7
    ),
)
_ITEMS = [(choice.identifier, choice.label, choice.description, choice.number) for choice in CHOICES]


def choice_of(identifier: str) -> TreeChoice:
    """By what a property holds."""
    return next(choice for choice in CHOICES if choice.identifier == identifier)


class PERFECT_BVH_PG_compare(bpy.types.PropertyGroup):
    """Which two trees of the active object are compared."""

    left: bpy.props.EnumProperty(
        name="Left", description="How the tree on the left is made", items=_ITEMS, default="MEDIAN"
    )
    right: bpy.props.EnumProperty(
        name="Right", description="How the tree on the right is made", items=_ITEMS, default="BINNED"
    )


CLASSES = (PERFECT_BVH_PG_compare,)
