"""Two trees over one object's triangles: built by each side's settings, measured with the same rays. Needs no Blender.

Both are built in separate scenes, on any thread: nothing that others hold is changed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from perfect_bvh import BuildConfig
from perfect_bvh._tuning import with_policy

from ...settings.view_settings import REFITTED, TreeChoice
from ...statistics.words import count_of, duration
from ...sync.records import MeshRecord
from ..pointer import OneObject, RayCost, Rays, cost_of, diffuse_rays, primary_rays

# The text under two compared trees: rows of a name, a value and a ratio.


SAME = 0.005  # ratios as near to 1 as that are shown as 1


@dataclass(frozen=True, slots=True)
class Row:
    """ratio: to the other side's value, None where there is none to compare with; below 1 is better."""

    name: str
    value: str
    ratio: float | None = None

    @property
    def ratio_text(self) -> str:
        """The ratio as text, such as "0.76 x"."""
        if self.ratio is None:
            return ""
        return f"{self.ratio:.2f} x" if self.ratio < 9.995 else f"{self.ratio:,.0f} x"

    @property
    def is_better(self) -> bool:
        """Noticeably."""
        return self.ratio is not None and self.ratio < 1.0 - SAME

    @property
    def is_worse(self) -> bool:
        """Noticeably."""
        return self.ratio is not None and self.ratio > 1.0 + SAME


def rows_of(side: Side, other: Side | None = None) -> list[Row]:
    """Returns the rows of one side; other: the side that it is compared with."""
    ratio = _ratio if other is not None else _no_ratio
    built = f" (built: {side.built_sah:,.1f})" if side.is_refitted else ""
    rows = [Row("SAH", f"{side.sah:,.1f}{built}", ratio(side.sah, other and other.sah))]
    if side.epo is not None:
        rows.append(Row("Overlap (EPO)", f"{side.epo:,.2f}", ratio(side.epo, other and other.epo)))
    rows.append(Row("Nodes", f"{side.nodes:,}"))
    rows.append(Row("Leaves", f"{side.leaves:,}"))
    name = "Refit" if side.is_refitted else "Build"
    rows.append(Row(name, duration(side.milliseconds), ratio(side.milliseconds, other and other.milliseconds)))
    rows.append(_of_rays("Primary Ray", side.primary, other and other.primary))
    if side.diffuse is not None:
        rows.append(_of_rays("Diffuse Ray", side.diffuse, other and other.diffuse))
    return rows


def heading_of(comparison: Comparison) -> str:
    """Returns the title of a comparison."""
    triangles = count_of(len(comparison.shown.mesh.triangles), "triangle")
    return f"{comparison.shown.name}, frame {comparison.frame}: {triangles}"


def level_line(level: int, depth: int, count: int) -> str:
    """Which boxes of a side are drawn."""
    return f"Level {min(level, depth)} of {depth}: {count_of(count, 'box', 'boxes')}"


def _of_rays(name: str, cost: RayCost, other: RayCost | None) -> Row:
    value = f"{cost.nodes:.1f} nodes, {cost.triangles:.1f} triangles"
    if other is None:
        return Row(name, value)
    return Row(name, value, _ratio(cost.nodes + cost.triangles, other.nodes + other.triangles))


def _ratio(value: float, other: float | None) -> float | None:
    return value / other if other else None


def _no_ratio(value: float, other: float | None) -> float | None:
    return None


# Shaded mesh ---------------------------------------------------------------------------------------------------------
# A mesh with a color at each vertex, as if lit from above: an object with its boxes.


Float32Array = npt.NDArray[np.float32]

# More take long to hand to a graphics card; boxes are shown without the object then.
MOST_TRIANGLES = 1_000_000
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
# Of what light does not reach, and of what faces it.
DARKEST, BRIGHTEST = 0.22, 0.7


@dataclass(frozen=True, slots=True)
class ShadedMesh:
    """positions: (V, 3) float32. colors: (V, 4) float32 RGBA. triangles: (T, 3) int32."""

    positions: Float32Array
    colors: Float32Array
    triangles: npt.NDArray[np.int32]


def shade(mesh: MeshRecord) -> ShadedMesh | None:
    """Shades a mesh; None if it has more triangles than can be drawn."""
    if len(mesh.triangles) > MOST_TRIANGLES:
        return None
    positions = mesh.positions.astype(np.float64)
    corners = positions[mesh.triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.empty_like(positions)
    for axis in range(3):
        of_corners = np.repeat(areas[:, axis], 3)
        normals[:, axis] = np.bincount(mesh.triangles.ravel(), of_corners, minlength=len(positions))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facing = (normals / np.where(lengths > 0.0, lengths, 1.0)) @ LIGHT
    grey = DARKEST + (BRIGHTEST - DARKEST) * (0.5 + 0.5 * facing)
    colors = np.ones((len(positions), 4), np.float32)
    colors[:, :3] = grey[:, None]
    return ShadedMesh(mesh.positions.astype(np.float32), colors, np.ascontiguousarray(mesh.triangles, np.int32))


# Compare trees -------------------------------------------------------------------------------------------------------


Progress = Callable[[float], object]

# Shorter builds are repeated, and the shortest time is shown: other load on the machine only adds to it.
SHORT_MILLISECONDS, MOST_BUILDS = 20.0, 3
# End-point overlap takes microseconds a triangle.
MOST_FOR_OVERLAP = 150_000


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two trees.

    snapshot, mesh: the tree's. sah: of the tree that rays are traced through, built_sah: of that before it was
    refitted. epo: end-point overlap, None if unknown. nodes, leaves, depth: of that tree; nodes are those with
    children. references: triangles in leaves, with repetitions. milliseconds: of the build, or of the refit.
    primary, diffuse: average costs of rays; no diffuse ones if no primary one hit anything.
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

    first: the object in the frame from which a tree is refitted, None for no refit. Raises ValueError if it
    has other triangles there, `perfect_bvh.Cancelled` when `progress` returns False, and the engine's errors.
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
        raise perfect_bvh.Cancelled("the comparison was stopped")
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
        raise ValueError(
            f"{shown.name} has different triangles in the first frame, whose BVH cannot be refitted to these"
        )
    scene = with_policy(perfect_bvh.Scene(), "refit")
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
