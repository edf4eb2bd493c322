"""The first words of each file's text: the steps to take, and the result to see."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Do:
    """words: begin with the button or key to press. mode: as scenes keep it. state: on which to open; None: the last.

    script: whether the text is a script, of the case's name in scripts/.
    """

    words: str
    mode: str = "COST"
    state: int | None = None
    script: bool = False


_PLAY = "Press Space to play, with the mouse over the picture on the left:"
_PLAN = (
    "In the sidebar of the view (N), tab Perfect BVH, What Was Updated says of each frame whether its tree was "
    "refitted or rebuilt, and why."
)

DO: dict[str, Do] = {
    "teapot_in_stadium": Do("On the left: a fine ball that stands in a hall a thousand times as wide."),
    "ground_under_gravel": Do("On the left: gravel that lies on two triangles as large as all of it."),
    "far_clusters": Do("On the left: a swarm of small triangles; one of large ones is a thousand units away."),
    "nested_boxes": Do("On the left: boxes of triangles about one corner, each half as wide as the last."),
    "diagonal_sticks": Do("On the left: straws that lie aslant through one another."),
    "hair_in_wind": Do("On the left: two thousand hairs, all blown the same way."),
    "grazed_slivers": Do(
        "On the left: triangles up to 100,000 times as long as they are wide. Those rays fail that graze them.",
        "NORMAL",
    ),
    "interleaved_instances": Do("On the left: balls that reach deep into their neighbours."),
    "skewed_matrices": Do(
        "On the left: balls and sheets that are stretched, mirrored, sheared, flattened and shrunk.", "NORMAL"
    ),
    "explosion": Do(f"{_PLAY} loose triangles fly apart. {_PLAN}"),
    "shuffle": Do(f"{_PLAY} loose triangles change places. {_PLAN}"),
    "twist": Do(f"{_PLAY} a ball's upper end is turned once round. {_PLAN}"),
    "born_in_a_point": Do(f"{_PLAY} from a single point a ball unfolds, and grows. {_PLAN}"),
    "long_refit_chain": Do(f"{_PLAY} loose triangles drift and never come back. {_PLAN}"),
    "skinned_walk": Do(f"{_PLAY} a crowd in one mesh walks apart. {_PLAN}"),
    "crumpled_cloth": Do(f"{_PLAY} a cloth is folded again and again. {_PLAN}"),
    "equal_counts": Do(
        f"{_PLAY} on frame 9 every square is cut along its other diagonal, on frame 17 triangles are "
        "renumbered as well. No count changes.",
        "WIREFRAME",
        1,
    ),
    "topology_on_some_frames": Do(
        f"{_PLAY} a ball grows; on the frames 17 and 33 its triangles are dealt out anew.", "WIREFRAME", 2
    ),
    "identical_centroids": Do("On the left: triangles of many sizes whose boxes all have the same centre."),
    "few_triangles": Do(f"{_PLAY} there is no triangle, then one, up to five.", "WIREFRAME"),
    "flat_boxes": Do("On the left: sheets in the coordinate planes, whose boxes have no thickness.", "NORMAL"),
    "axis_parallel_rays": Do(
        "On the left: a ball in a room. Those rays fail that run along an axis, from a wall's own plane.",
        "NORMAL",
    ),
    "edges_and_vertices": Do(
        "On the left: a closed ball by its edges. Those rays fail that run from inside through an edge.",
        "WIREFRAME",
    ),
    "exact_edges": Do(
        "On the left: a box by its edges. Those rays fail that come from outside, exactly through an edge or a corner.",
        "WIREFRAME",
    ),
    "extreme_magnitudes": Do(
        f"{_PLAY} the same ball in sizes of 1, 1e-6, 1e8 and 1e11, then a million units from zero. "
        "The camera keeps in step, so that all pictures should be alike.",
        "NORMAL",
    ),
    "large_ground": Do(
        "On the left: balls that are sunk half-way into a ground of two triangles, 100 kilometres wide.", "NORMAL"
    ),
    "small_triangles": Do("On the left: a ball that is a thousandth of a unit wide.", "NORMAL"),
    "non_finite_vertices": Do(
        "On the left: a ball of which four vertices are not numbers. The triangles at those are left out; "
        "Statistics in the Render properties says how many.",
        "WIREFRAME",
    ),
    "incoherent_packets": Do("On the left: a ball in a cloud of loose triangles, which parts packets of rays."),
    "other_instruction_set": Do(
        "On the left: a ball; on another processor the picture is the same, bit by bit.", "NORMAL"
    ),
    "own_ancestor": Do("On the left: swarms of very different sizes, where an optimiser moves many nodes."),
    "deleted_objects": Do(
        f"{_PLAY} balls are hidden, then others go and copies come, then all are back.", "INSTANCE", 1
    ),
    "stopped_halfway": Do(
        "Press Run Script (Alt P, with the mouse over this text), with Perfect BVH enabled: a build is stopped, and "
        "what it leaves is asked. The balls of frame 1 become heaps on frame 9.",
        "INSTANCE",
        1,
        script=True,
    ),
    "edited_while_traced": Do(
        "Press Run Script (Alt P, with the mouse over this text), with Perfect BVH enabled: one batch is asked in "
        "halves, with an edit between them.",
        "INSTANCE",
        0,
        script=True,
    ),
    "one_frame_late": Do(
        "Press Run Script (Alt P, with the mouse over this text), with Perfect BVH enabled: rays are cast before and "
        "after a change of the frame.",
        "INSTANCE",
        4,
        script=True,
    ),
}

# Cases that have a picture of the usual method next to them.
PICTURED = frozenset(
    {
        "teapot_in_stadium",
        "ground_under_gravel",
        "far_clusters",
        "explosion",
        "shuffle",
        "twist",
        "born_in_a_point",
        "long_refit_chain",
        "skinned_walk",
        "crumpled_cloth",
        "equal_counts",
        "grazed_slivers",
        "extreme_magnitudes",
        "large_ground",
        "small_triangles",
        "flat_boxes",
        "non_finite_vertices",
        "skewed_matrices",
        "deleted_objects",
        "stopped_halfway",
        "one_frame_late",
    }
)
