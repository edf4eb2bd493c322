"""The losses of a usual method and of this engine on each failure case: counted, never timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from makers.zoo import FailureCase

from . import losses_of_answers as answers
from . import losses_of_edits as edits
from . import losses_of_work as work
from .loss import Loss


@dataclass(frozen=True)
class Measure:
    """method: the usual one, in words. take: measures its and this engine's losses."""

    method: str
    take: Callable[[FailureCase], Loss]


MEASURES: dict[str, Measure] = {
    "teapot_in_stadium": Measure("median splits", work.median_splits),
    "ground_under_gravel": Measure("median splits", work.median_splits),
    "far_clusters": Measure("median splits", work.median_splits),
    "nested_boxes": Measure("splits at the middle, a stack of 64", work.stack_entries),
    "diagonal_sticks": Measure("the best of all object splits", work.object_splits),
    "hair_in_wind": Measure("the best of all object splits", work.object_splits),
    "grazed_slivers": Measure("Möller-Trumbore in float32", answers.grazed),
    "interleaved_instances": Measure("a flat list of instances", work.flat_list),
    "skewed_matrices": Measure("normals by the matrix, rays by its inverse", answers.usual_matrices),
    "explosion": Measure("refit only", work.refit_only),
    "shuffle": Measure("refit only", work.refit_only),
    "twist": Measure("refit only", work.refit_only),
    "born_in_a_point": Measure("refit only", work.refit_only),
    "long_refit_chain": Measure("refit only", work.refit_only),
    "skinned_walk": Measure("refit only", work.refit_only),
    "crumpled_cloth": Measure("refit only", work.refit_only),
    "equal_counts": Measure("refit if the counts are equal", edits.refit_at_equal_counts),
    "topology_on_some_frames": Measure("refit if the counts are equal", edits.refit_at_equal_counts),
    "identical_centroids": Measure("splits at the middle", work.largest_leaf),
    "few_triangles": Measure("halve until one is left", work.endless_splits),
    "flat_boxes": Measure("a slab test with inverses", answers.usual_slabs),
    "axis_parallel_rays": Measure("a slab test with inverses", answers.usual_slabs),
    "edges_and_vertices": Measure("Möller-Trumbore in float32", answers.leaks),
    "exact_edges": Measure("a watertight test in float32", answers.lost_outlines),
    "extreme_magnitudes": Measure("Möller-Trumbore, epsilon 1e-8", answers.usual_test),
    "large_ground": Measure("Möller-Trumbore in float32", answers.distances),
    "small_triangles": Measure("Möller-Trumbore, epsilon 1e-8", answers.usual_test),
    "non_finite_vertices": Measure("a root box by min and max", answers.poisoned_root),
    "incoherent_packets": Measure("packets of 16 in a frustum", answers.frustum_packets),
    "other_instruction_set": Measure("the same code with and without fma", answers.other_rounding),
    "own_ancestor": Measure("reinsertion at random", work.rings),
    "deleted_objects": Measure("a list of updates that names no deletion", edits.never_deleted),
    "stopped_halfway": Measure("trees exchanged one by one", edits.stopped_halfway),
    "edited_while_traced": Measure("one tree, edited in place", edits.edited_in_place),
    "one_frame_late": Measure("trees of the frame before", edits.frame_before),
}


@cache
def measure(case: FailureCase) -> Loss:
    """The losses on a case; the same numbers in every run on one instruction set."""
    return MEASURES[case.name].take(case)
