"""What a commit did, and how large and how good the trees are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

# refitted: new boxes, the same tree. rotated, partly_rebuilt: refitted, then restructured where motion had degraded
# it.
# kept: nothing was done, though a new tree was weighed.
MeshAction = Literal["built", "refitted", "rotated", "partly_rebuilt", "rebuilt", "kept"]


@dataclass(frozen=True, slots=True)
class Alternative:
    """What could have been done about a mesh, and what that was expected to cost on one thread.

    Attributes:
        builder: Of the tree that would be built; "" where none would.
        trace_milliseconds: Of the rays that were expected; None if their number is unknown.
    """

    action: MeshAction
    builder: str
    update_milliseconds: float
    trace_milliseconds: float | None


@dataclass(frozen=True, slots=True)
class MeshReport:
    """One mesh that a commit worked on, and why it did what it did: a row of the governor's ledger.

    Attributes:
        usage: Its class, as `Scene.add_mesh` was told.
        reason: A sentence.
        alternatives: What the engine chose from; empty where there was no choice.
        expected_rays: How many were expected to meet the mesh's box, None if unknown.
        node_visits, leaf_visits: What a random ray that meets the box is expected to visit of the tree that is traced
            now.
        builder: What made the tree (now, or before it was refitted; or will make it), as in `BuildConfig`.
        milliseconds: Of one mesh, on however many threads; then of its stages, 0 for those that did not run: building
            the binary tree, improving it by reinsertion, collapsing it into the wide tree that rays are traced through;
            or refitting that (also where it was then found too slow to trace) and restructuring it by rotations or by
            rebuilding parts of it
        restructured_share: Which share of its leaves those parts have.
        fresh_cost, refitted_cost, cost: Visits to nodes that a ray through the mesh's box is expected to make: in the
            tree when it was built, in that tree refitted (both 0 where no refit was tried), and in the one that the
            mesh has now.
        kind: "triangles", "curves" or "points"
        triangle_count: Of curves, their segments, or of points those.
        byte_count: Of the geometry, its tree and what refits go by. Besides, as long as a mesh deforms in every commit,
            the memory of its last tree but one is kept for the next.
    """

    mesh_id: int
    usage: str
    action: MeshAction
    reason: str
    alternatives: tuple[Alternative, ...]
    expected_rays: float | None
    node_visits: float
    leaf_visits: float
    builder: str
    milliseconds: float
    build_milliseconds: float
    optimize_milliseconds: float
    refit_milliseconds: float
    restructure_milliseconds: float
    restructured_share: float
    fresh_cost: float
    refitted_cost: float
    cost: float
    collapse_milliseconds: float
    kind: str
    triangle_count: int
    byte_count: int

    @classmethod
    def from_core(cls, values: dict[str, Any]) -> MeshReport:
        """From the native module's dictionary."""
        alternatives = tuple(Alternative(**row) for row in values.pop("alternatives"))
        return cls(alternatives=alternatives, **values)


@dataclass(frozen=True, slots=True)
class TopLevelReport:
    """The tree over the instances, and the stages of making it; 0 where one did not run.

    Attributes:
        is_refitted: Whether the last tree got new boxes, and no other was built.
        reason: Why it was refitted, built or kept.
        builder: "agglomerative" where joining its upper parts pair by pair made it cheaper, else what made it:
            "binned", or "fast" where rays are few for so many instances; "" over nothing.
        placing_milliseconds: Of inverse transforms and world boxes.
        refit_milliseconds: Also where its result was then rejected.
        build_milliseconds: Of the binary tree.
        clustering_milliseconds: Of its upper part.
        collapse_milliseconds: Of making the tree that rays are traced through.
    """

    is_refitted: bool
    reason: str
    builder: str
    placing_milliseconds: float
    refit_milliseconds: float
    build_milliseconds: float
    clustering_milliseconds: float
    collapse_milliseconds: float

    @property
    def stages(self) -> dict[str, float]:
        """Milliseconds of each stage: placing, refit, build, clustering, collapse."""
        names = ("placing", "refit", "build", "clustering", "collapse")
        return {name: getattr(self, f"{name}_milliseconds") for name in names}


@dataclass(frozen=True, slots=True)
class CommitReport:
    """meshes: those that were not kept. resting: those kept in trees degraded by motion ("governed" only), and why.

    Attributes:
        kept_count: All that were kept, resting or not.
        baked_count: Instances whose transform has no usable inverse.
        byte_count: Of the whole committed scene.
        generation: Of the snapshot, counted from 1.
    """

    meshes: tuple[MeshReport, ...]
    resting: tuple[MeshReport, ...]
    kept_count: int
    instance_count: int
    baked_count: int
    mesh_milliseconds: float
    top_level_milliseconds: float
    top_level: TopLevelReport
    milliseconds: float
    byte_count: int
    generation: int

    @classmethod
    def from_core(cls, values: dict[str, Any]) -> CommitReport:
        """From the native module's dictionary."""
        meshes, resting = (
            tuple(MeshReport.from_core(row) for row in values.pop(name)) for name in ("meshes", "resting")
        )
        top_level = TopLevelReport(**values.pop("top_level"))
        return cls(meshes=meshes, resting=resting, top_level=top_level, **values)

    @property
    def mesh_stages(self) -> dict[str, float]:
        """Milliseconds of each stage, of all meshes together: build, optimize, collapse, refit, restructure.

        Meshes are worked on at the same time where there are threads for it, so that the sum may be more than
        mesh_milliseconds.
        """
        names = ("build", "optimize", "collapse", "refit", "restructure")
        return {name: sum(getattr(mesh, f"{name}_milliseconds") for mesh in self.meshes) for name in names}

    def count(self, *actions: MeshAction) -> int:
        """How many meshes were treated in one of these ways."""
        return sum(mesh.action in actions for mesh in self.meshes)


@dataclass(frozen=True, slots=True)
class TreeStatistics:
    """One tree. mesh_id: -1 for the top level. builder: what made it, as in `BuildConfig`.

    Of the binary tree that the wide one was made from; of a mesh whose tree was built straight into the one that rays
    are traced through (usage "changing") or was refitted since, of that one, whose visits are fewer than a binary
    tree's:
    is_refittable: whether it may follow moved vertices; not with spatial splits.
    node_count, leaf_count, max_leaf_size, depth: nodes include leaves; depth is 0 for a single leaf.
    reference_count: primitives in leaves; more than primitive_count if some are in several.
    sah: the surface area heuristic's cost (MacDonald and Booth 1990): node visits and tests of primitives, each times
        its cost, that a random ray through the root's box is expected to need.
    sibling_overlap: area that both children of a node cover, as a share of all parents' area.
    epo: end-point overlap (Aila, Karras and Laine 2013): the expected cost of nodes whose box holds a point of a
        surface that is not in them. leaf_count_variability: the standard deviation of how many leaves' boxes a random
        line through the root's box meets. Both None unless details were asked for of a binary tree; the top level,
        curves and points have no epo.

    Of the tree that rays are traced through: wide_node_count, wide_leaf_count, wide_depth.

    Bytes: geometry_byte_count of positions and triangles, or balls (of the top level: of the instances),
    binary_byte_count (0 where that tree is no longer kept), wide_byte_count, plan_byte_count of what refits go by (0
    before the first one), motion_byte_count of what moves within the shutter (positions and trees at the steps after
    the first; of the top level its trees at the shutter's times, and where instances are at their steps; 0 of what
    stands still); byte_count is the five together.

    Attributes:
        kind: "triangles", "curves" or "points"; of the top level "instances".
        primitive_count, vertex_count: Of the mesh (of curves segments and points); of the top level, instances and 0.
        left_out_count: points, and segments of curves, that have no radius and are not among the primitives.
        user_count: Instances of the mesh.
    """

    mesh_id: int
    builder: str
    kind: str
    primitive_count: int
    vertex_count: int
    left_out_count: int
    user_count: int
    is_refittable: bool
    node_count: int
    leaf_count: int
    reference_count: int
    max_leaf_size: int
    depth: int
    sah: float
    sibling_overlap: float
    epo: float | None
    leaf_count_variability: float | None
    wide_node_count: int
    wide_leaf_count: int
    wide_depth: int
    geometry_byte_count: int
    binary_byte_count: int
    wide_byte_count: int
    plan_byte_count: int
    motion_byte_count: int
    byte_count: int

    @property
    def duplication(self) -> float:
        """References for each primitive: 1 unless space was split."""
        return self.reference_count / self.primitive_count if self.primitive_count else 1.0


@dataclass(frozen=True, slots=True)
class SceneStatistics:
    """A committed scene. segment_count: of curves; point_count: of clouds; neither is among the triangles.

    instanced_...: as rays see them, each instance counted.
    """

    meshes: tuple[TreeStatistics, ...]
    top_level: TreeStatistics
    triangle_count: int
    segment_count: int
    point_count: int
    instanced_triangle_count: int
    instanced_segment_count: int
    instanced_point_count: int
    instance_count: int
    byte_count: int
    generation: int

    @classmethod
    def from_core(cls, values: dict[str, Any]) -> SceneStatistics:
        """From the native module's dictionary."""
        meshes = tuple(TreeStatistics(**row) for row in values.pop("meshes"))
        return cls(meshes=meshes, top_level=TreeStatistics(**values.pop("top_level")), **values)
