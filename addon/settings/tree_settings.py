"""What the buttons that look into trees go by: `scene.perfect_bvh.compare` and `scene.perfect_bvh.decay`."""

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


class PERFECT_BVH_PG_decay(bpy.types.PropertyGroup):
    """Over which frames, and of what, trees are followed."""

    subject: bpy.props.EnumProperty(
        name="Of",
        description="Whose trees are measured",
        items=[
            ("OBJECT", "Active Object", "The tree of the active object, and what a random ray through it costs", 0),
            ("SCENE", "Whole Scene", "All trees, and what rays from all around meet in them", 1),
        ],
        default="OBJECT",
    )
    use_custom_range: bpy.props.BoolProperty(
        name="Custom Range", description="Measure other frames than the scene's frame range", default=False
    )
    frame_start: bpy.props.IntProperty(name="Start", description="First frame to measure", default=1, min=0)
    frame_end: bpy.props.IntProperty(name="End", description="Last frame to measure", default=48, min=0)
    expected_rays: bpy.props.IntProperty(
        name="Rays per Frame",
        description="How many rays each frame casts: the more there are, the sooner Governed builds a new tree",
        default=100_000,
        min=1,
        soft_max=100_000_000,
        max=2_000_000_000,
    )


def frames_of(scene: bpy.types.Scene) -> range:
    """Which are to be followed; the preview range if the scene plays that. Empty if the end is before the start."""
    decay = scene.perfect_bvh.decay
    if decay.use_custom_range:
        return range(decay.frame_start, decay.frame_end + 1)
    if scene.use_preview_range:
        return range(scene.frame_preview_start, scene.frame_preview_end + 1)
    return range(scene.frame_start, scene.frame_end + 1, scene.frame_step)


CLASSES = (PERFECT_BVH_PG_compare, PERFECT_BVH_PG_decay)
