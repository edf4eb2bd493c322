"""Failure cases as files: the scenes of the add-on's Add Failure Case button, for those without the add-on."""

from __future__ import annotations

import bpy

from .stage import light_world, open_stage

# Those that show something to the eye, or that other programs can be tried on.
NAMES = (
    "teapot_in_stadium",
    "ground_under_gravel",
    "far_clusters",
    "diagonal_sticks",
    "interleaved_instances",
    "skewed_matrices",
    "explosion",
    "twist",
    "equal_counts",
    "topology_on_some_frames",
    "non_finite_vertices",
    "deleted_objects",
)


def make(name: str) -> None:
    """Fills the file with one case. Needs the add-on: its package holds the cases."""
    from perfect_bvh_addon.failure_cases import find_case
    from perfect_bvh_addon.failure_scenes import fill_scene

    case = find_case(name)
    open_stage(case.title)
    light_world((0.6, 0.65, 0.7), 0.6)
    fill_scene(bpy.context.scene, case)
