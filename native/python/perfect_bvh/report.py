"""What a commit did, and how large and how good the trees are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

MeshAction = Literal["built", "refitted", "rebuilt"]


@dataclass(frozen=True, slots=True)
class MeshReport:
    """One mesh that a commit worked on.

    reason: a sentence. builder: what made the tree (now, or before it was refitted), as in `BuildConfig`.
    milliseconds: of one mesh, on however many threads.
    """

    mesh_id: int
    action: MeshAction
    reason: str
    builder: str
    milliseconds: float
    triangle_count: int
    byte_count: int


@dataclass(frozen=True, slots=True)
class CommitReport:
    """meshes: those that were not kept. baked_count: instances whose transform has no usable inverse.

    byte_count: of the whole committed scene. generation: of the snapshot, counted from 1.
    """

    meshes: tuple[MeshReport, ...]
    kept_count: int
    instance_count: int
    baked_count: int
    mesh_milliseconds: float
    top_level_milliseconds: float
    milliseconds: float
    byte_count: int
    generation: int

    @classmethod
    def from_core(cls, values: dict[str, Any]) -> CommitReport:
        """From the native module's dictionary."""
        meshes = tuple(MeshReport(**row) for row in values.pop("meshes"))
        return cls(meshes=meshes, **values)

    def count(self, action: MeshAction) -> int:
        """How many meshes were treated so."""
        return sum(mesh.action == action for mesh in self.meshes)


@dataclass(frozen=True, slots=True)
class TreeStatistics:
    """One tree. mesh_id: -1 for the top level. builder: what made it, as in `BuildConfig`.

    byte_count: tree and geometry. user_count: instances.
    sah: the surface area heuristic's cost, with both costs 1: node visits and triangle tests that a random
    ray through the root's box is expected to need.
    reference_count: triangles in leaves; more than primitive_count if some are in several.
    """

    mesh_id: int
    builder: str
    primitive_count: int
    vertex_count: int
    node_count: int
    leaf_count: int
    reference_count: int
    depth: int
    sah: float
    byte_count: int
    user_count: int


@dataclass(frozen=True, slots=True)
class SceneStatistics:
    """A committed scene. instanced_triangle_count: as rays see them, each instance counted."""

    meshes: tuple[TreeStatistics, ...]
    top_level: TreeStatistics
    triangle_count: int
    instanced_triangle_count: int
    instance_count: int
    byte_count: int
    generation: int

    @classmethod
    def from_core(cls, values: dict[str, Any]) -> SceneStatistics:
        """From the native module's dictionary."""
        meshes = tuple(TreeStatistics(**row) for row in values.pop("meshes"))
        return cls(meshes=meshes, top_level=TreeStatistics(**values.pop("top_level")), **values)
