"""Reports of commits, and of the size and quality of trees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

# refitted: new boxes, the same tree. rotated, partly_rebuilt: refitted, then restructured where motion had degraded
# it.
# kept: nothing was done, though a new tree was considered.
MeshAction = Literal["built", "refitted", "rotated", "partly_rebuilt", "rebuilt", "kept"]


@dataclass(frozen=True, slots=True)
class Alternative:
    """A possible action for a mesh, and its expected cost on one thread.

    Attributes:
        builder: The builder of the new tree; "" if none would be built.
        trace_milliseconds: For the expected rays; None if their number is unknown.
    """

    action: MeshAction
    builder: str
    update_milliseconds: float
    trace_milliseconds: float | None


@dataclass(frozen=True, slots=True)
class MeshReport:
    """One mesh that a commit worked on, and the reason for the action: a row of the governor's ledger.

    Attributes:
        usage: The usage given to `Scene.add_mesh` or `Scene.set_usage`.
        reason: A sentence.
        alternatives: The engine's choices; empty if there was only one.
        expected_rays: The expected number of rays that meet the mesh's box, None if unknown.
        node_visits, leaf_visits: The expected visits of a random ray that meets the box, in the tree that is traced
            now.
        builder: The builder of the tree (now, or before it was refitted; or of a later build), as in `BuildConfig`.
        milliseconds: Of one mesh, on any number of threads; then of its stages, 0 for those that did not run: building
            the binary tree, improving it by reinsertion, collapsing it into the wide tree that rays are traced through;
            or refitting that (also if it was then found too slow to trace) and restructuring it by rotations or by
            rebuilding parts of it
        restructured_share: The share of its leaves in these parts.
        fresh_cost, refitted_cost, cost: Expected visits to nodes of a ray through the mesh's box: in the
            tree when it was built, in that tree refitted (both 0 if no refit was tried), and in the current tree.
        kind: "triangles", "curves" or "points"
        triangle_count: For curves the number of segments, for points the number of points.
        byte_count: Of the geometry, its tree and the refit plan. In addition, while a mesh deforms in every commit,
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
        """Converts the native module's dictionary."""
        alternatives = tuple(Alternative(**row) for row in values.pop("alternatives"))
        return cls(alternatives=alternatives, **values)


@dataclass(frozen=True, slots=True)
class TopLevelReport:
    """The tree over the instances, and the times of its stages; 0 for a stage that did not run.

    Attributes:
        is_refitted: Whether the last tree got new boxes, and no other was built.
        reason: Why it was refitted, built or kept.
        builder: "agglomerative" if pairwise clustering of its upper parts made it cheaper. Otherwise the builder:
            "binned", or "fast" if there are few rays for the number of instances; "" without instances.
        placing_milliseconds: For inverse transforms and world boxes.
        refit_milliseconds: Also if its result was then rejected.
        build_milliseconds: For the binary tree.
        clustering_milliseconds: For its upper part.
        collapse_milliseconds: For making the tree that rays are traced through.
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
    """The result of a commit.

    meshes: those that were not kept. resting: those kept in trees degraded by motion ("governed" only), and why.

    Attributes:
        kept_count: The number of all kept meshes, resting or not.
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
        """Converts the native module's dictionary."""
        meshes, resting = (
            tuple(MeshReport.from_core(row) for row in values.pop(name)) for name in ("meshes", "resting")
        )
        top_level = TopLevelReport(**values.pop("top_level"))
        return cls(meshes=meshes, resting=resting, top_level=top_level, **values)

    @property
    def mesh_stages(self) -> dict[str, float]:
        """Milliseconds of each stage, of all meshes together: build, optimize, collapse, refit, restructure.

        Meshes are processed in parallel if there are threads for it, so the sum may exceed mesh_milliseconds.
        """
        names = ("build", "optimize", "collapse", "refit", "restructure")
        return {name: sum(getattr(mesh, f"{name}_milliseconds") for mesh in self.meshes) for name in names}

    def count(self, *actions: MeshAction) -> int:
        """Counts the meshes that were treated in one of these ways."""
        return sum(mesh.action in actions for mesh in self.meshes)


@dataclass(frozen=True, slots=True)
class TreeStatistics:
    """Statistics of one tree. mesh_id: -1 for the top level. builder: as in `BuildConfig`.

    The following describe the binary tree that the wide one was made from. If a mesh's tree was built directly as a
    wide tree (usage "changing") or was refitted since, and for the top level, they describe the wide tree, which needs
    fewer visits than a binary one.
    is_refittable: whether it can be refitted; not with spatial splits.
    node_count, leaf_count, max_leaf_size, depth: nodes include leaves; depth is 0 for a single leaf.
    reference_count: primitives in leaves; more than primitive_count if some are in several.
    sah: the surface area heuristic's cost (MacDonald and Booth 1990): the expected node visits and primitive tests,
        each times its cost, of a random ray through the root's box.
    sibling_overlap: area that both children of a node cover, as a share of all parents' area.
    epo: end-point overlap (Aila, Karras and Laine 2013): the expected cost of nodes whose box holds a point of a
        surface that is not in them. leaf_count_variability: the standard deviation of the number of leaf boxes that a
        random line through the root's box hits. Both are None unless details of a binary tree were requested; the top
        level, curves and points have no epo.

    Of the tree that rays are traced through: wide_node_count, wide_leaf_count, wide_depth.

    Bytes: geometry_byte_count of positions and triangles, or spheres (for the top level: of the instances),
    wide_byte_count, plan_byte_count of the refit plan (0 before the first refit), motion_byte_count of motion within
    the shutter (positions and trees at the steps after the first; for the top level its trees at the shutter's times,
    and the instances' transforms at their steps; 0 without motion); byte_count is the sum of the four.

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
    wide_byte_count: int
    plan_byte_count: int
    motion_byte_count: int
    byte_count: int

    @property
    def duplication(self) -> float:
        """References for each primitive: 1 without spatial splits."""
        return self.reference_count / self.primitive_count if self.primitive_count else 1.0


@dataclass(frozen=True, slots=True)
class SceneStatistics:
    """Statistics of a committed scene. segment_count: of curves; point_count: of clouds; triangles include neither.

    instanced_...: as rays see them, counted for each instance.
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
        """Converts the native module's dictionary."""
        meshes = tuple(TreeStatistics(**row) for row in values.pop("meshes"))
        return cls(meshes=meshes, top_level=TreeStatistics(**values.pop("top_level")), **values)
