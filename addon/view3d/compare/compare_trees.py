"""Two trees over one object's triangles: built as each side asks for it, measured with the same rays. Knows no Blender.

Both are built in scenes of their own, on any thread: nothing that others hold is touched.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh import BuildConfig

from ...settings.tree_settings import REFITTED, TreeChoice
from ..one_object import OneObject
from ..sample_rays import RayCost, Rays, cost_of, diffuse_rays, primary_rays
from .shaded_mesh import ShadedMesh, shade

Progress = Callable[[float], object]

# What takes less is done several times, and the shortest time told: whatever else the machine does only adds to it.
SHORT_MILLISECONDS, MOST_BUILDS = 20.0, 3
# End-point overlap takes microseconds a triangle.
MOST_FOR_OVERLAP = 150_000


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two trees.

    snapshot, mesh: what holds it. sah: of the tree that rays meet, built_sah: of that before it was refitted. epo:
    end-point overlap, None where it is not known. nodes, leaves, depth: of that tree; nodes are those with children.
    references: triangles in leaves, counted as often as they are there. milliseconds: of the build, or of the refit.
    primary, diffuse: what rays met in the mean; no diffuse ones where no primary one met anything.
    """

    label: str
    snapshot: perfect_bvh.Snapshot
    mesh: int
    sah: float
    built_sah: float
    epo: float | None
    nodes: int
    leaves: int
    depth: int
    references: int
    milliseconds: float
    is_refitted: bool
    primary: RayCost
    diffuse: RayCost | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """frame: of the scene; shaded: the object itself."""

    shown: OneObject
    frame: int
    left: Side
    right: Side
    shaded: ShadedMesh | None

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) of the object's box in its own space."""
        return self.left.snapshot.tree_boxes(self.left.mesh, last_level=0).boxes[0]


def compare(
    shown: OneObject, frame: int, choices: tuple[TreeChoice, TreeChoice], first: OneObject | None, progress: Progress
) -> Comparison:
    """Build, measure, and shade.

    first: the object in the frame from which a tree is refitted, None if none is. Raises ValueError where that has
    other triangles, `perfect_bvh.Cancelled` when `progress` returns False, and what the engine raises.
    """
    if not len(shown.mesh.triangles):
        raise ValueError(f"{shown.name} has no triangles")
    built = []
    for number, choice in enumerate(choices):
        part = _part(progress, 0.45 * number, 0.35)
        scene, mesh, report = _build(shown, choice, first, part)
        milliseconds = report.milliseconds
        for _ in range(MOST_BUILDS - 1):
            if milliseconds < SHORT_MILLISECONDS:
                milliseconds = min(milliseconds, _build(shown, choice, first, part)[2].milliseconds)
        built.append((choice, scene, mesh, milliseconds, _part(progress, 0.45 * number + 0.35, 0.1)))
    lower, upper = shown.mesh.positions.min(axis=0), shown.mesh.positions.max(axis=0)
    primary = primary_rays(lower, upper)
    diffuse = diffuse_rays(built[0][1].snapshot(), primary)
    left, right = (_measure(*one, primary=primary, diffuse=diffuse) for one in built)
    if progress(0.95) is False:
        raise perfect_bvh.Cancelled("comparing was stopped")
    return Comparison(shown, frame, left, right, shade(shown.mesh))


def _build(
    shown: OneObject, choice: TreeChoice, first: OneObject | None, progress: Progress
) -> tuple[perfect_bvh.Scene, int, Any]:
    """The scene, the mesh in it, and the report of it."""
    config = BuildConfig(builder=choice.builder, optimize=choice.optimize)  # type: ignore[arg-type]
    if choice.identifier != REFITTED:
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(shown.mesh.positions, shown.mesh.triangles, build=config)
        scene.add_instance(mesh)
        return scene, mesh, scene.commit(progress=progress).meshes[0]
    if first is None or not are_refittable(first, shown):
        raise ValueError(f"{shown.name} has other triangles in the first frame: no tree of them can be refitted")
    scene = perfect_bvh.Scene(policy="refit")
    mesh = scene.add_mesh(first.mesh.positions, first.mesh.triangles, build=config, usage="deforming")
    scene.add_instance(mesh)
    scene.commit(progress=_part(progress, 0.0, 0.9))
    scene.update_mesh(mesh, shown.mesh.positions)
    return scene, mesh, scene.commit(progress=_part(progress, 0.9, 0.1)).meshes[0]


def are_refittable(first: OneObject, now: OneObject) -> bool:
    """Whether the same triangles have only moved."""
    return len(first.mesh.positions) == len(now.mesh.positions) and np.array_equal(
        first.mesh.triangles, now.mesh.triangles
    )


def _measure(
    choice: TreeChoice,
    scene: perfect_bvh.Scene,
    mesh: int,
    milliseconds: float,
    progress: Progress,
    *,
    primary: Rays,
    diffuse: Rays | None,
) -> Side:
    snapshot = scene.snapshot()
    is_refitted = choice.identifier == REFITTED
    root = snapshot.tree_boxes(mesh, last_level=0)
    detailed = not is_refitted and len(root.primitives) <= MOST_FOR_OVERLAP
    (found,) = scene.statistics(detailed, progress=progress).meshes
    return Side(
        label=choice.label,
        snapshot=snapshot,
        mesh=mesh,
        sah=root.sah,
        built_sah=root.built_sah,
        epo=found.epo,
        nodes=found.wide_node_count,
        leaves=found.wide_leaf_count,
        depth=root.depth,
        references=len(root.primitives),
        milliseconds=milliseconds,
        is_refitted=is_refitted,
        primary=cost_of(snapshot, primary),
        diffuse=None if diffuse is None else cost_of(snapshot, diffuse),
    )


def _part(progress: Progress, start: float, size: float) -> Progress:
    return lambda share: progress(start + size * share)
