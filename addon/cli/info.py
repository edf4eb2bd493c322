"""`perfect-bvh info`: the plan: each mesh of a scene with its class, its tree, and what they are expected to cost."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, TextIO

from ..settings.modes import find_mode
from ..statistics.words import memory, primitives, sum_of
from .arguments import CommandError, check_blend_file
from .blender import apply_settings, open_scene, render_job, stop_on_interrupt
from .console import format_table, quiet_blender

if TYPE_CHECKING:
    import bpy
    from perfect_bvh import MeshReport, SceneStatistics

    from ..live.scene_sync import SceneSync
    from ..statistics.frame_statistics import FrameStatistics
    from ..sync.report import SyncReport

HEADER = (
    "mesh",
    "class",
    "builder",
    "made of",
    "users",
    "nodes",
    "depth",
    "SAH cost",
    "bytes",
    "build ms",
    "rays",
    "trace ms",
    "why this class",
)
LEFT_COLUMNS = frozenset({0, 1, 2, len(HEADER) - 1})


def run_info(arguments: argparse.Namespace) -> int:
    """Print the tables; the exit status."""
    path = check_blend_file(arguments.file)
    with quiet_blender() as out, stop_on_interrupt():
        scene = open_scene(path, arguments)
        apply_settings(scene, arguments)
        if arguments.frame is not None:
            from ..live.scene_view import go_to_frame

            go_to_frame(scene, arguments.frame, arguments.viewport)
        if scene.camera is None:
            _add_camera(scene)
        _write(out, scene, *_sync_scene(scene, arguments.viewport))
    return 0


def _add_camera(scene: bpy.types.Scene) -> None:
    """Blender renders nothing without one, although no mesh depends on it. The file is never saved."""
    import bpy

    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)


def _sync_scene(scene: bpy.types.Scene, for_viewport: bool) -> tuple[SceneSync, FrameStatistics]:
    """The scene as a render sees it, or as viewports do."""
    from ..engine import RenderJob
    from ..live.sync_cache import syncs_of

    job = RenderJob(trace=False, for_viewport=for_viewport)
    render_job(scene, job)
    if job.frame is None:
        raise CommandError(f"scene {scene.name!r} could not be read")
    return syncs_of(scene)[-1], job.frame.statistics


def _write(out: TextIO, scene: bpy.types.Scene, sync: SceneSync, planned: FrameStatistics) -> None:
    statistics = sync.scene.statistics()
    rows = _mesh_rows(sync, planned.report, statistics)
    out.write(f"{scene.name}, frame {scene.frame_current}\n")
    out.write(format_table(HEADER, rows, LEFT_COLUMNS) + "\n")
    top, made = statistics.top_level, statistics
    distinct = sum_of(made.triangle_count, made.segment_count, made.point_count)
    instanced = sum_of(made.instanced_triangle_count, made.instanced_segment_count, made.instanced_point_count)
    out.write(
        f"{len(statistics.meshes):,} meshes, {distinct}; {statistics.instance_count:,} instances show {instanced}; "
        f"top level {top.node_count:,} nodes, depth {top.depth}, {memory(top.byte_count)}; "
        f"all {memory(statistics.byte_count)}\n"
    )
    settings, (width, height) = planned.settings, planned.size
    mode = find_mode(settings.mode)
    samples = 1 if mode.has_range else settings.samples
    out.write(
        f"rays and trace ms: of one image of {width} x {height} pixels, mode {mode.word}, samples {samples}, "
        "on one thread, as expected\n"
    )
    for warning in sync.warnings:
        out.write(f"warning: {warning}\n")


def _mesh_rows(sync: SceneSync, report: SyncReport, statistics: SceneStatistics) -> list[tuple[str, ...]]:
    """A line for each mesh, the most bytes first; at the end those of which nothing is built."""
    changes = {change.mesh_id: change for change in report.meshes}
    decisions = {row.mesh_id: row for row in report.commit.meshes}
    return [
        (
            changes[tree.mesh_id].name,
            changes[tree.mesh_id].usage,
            tree.builder,
            primitives(tree.primitive_count, tree.kind),
            f"{tree.user_count:,}",
            f"{tree.node_count:,}",
            str(tree.depth),
            f"{tree.sah:.1f}",
            memory(tree.byte_count),
            *_expected_costs(decisions.get(tree.mesh_id)),
            changes[tree.mesh_id].usage_reason,
        )
        for tree in sorted(statistics.meshes, key=lambda tree: -tree.byte_count)
    ] + [(mesh.name, "unseen", *[""] * (len(HEADER) - 3), mesh.reason) for mesh in report.unseen]


def _expected_costs(decision: MeshReport | None) -> tuple[str, str, str]:
    """Of building, the number of rays that meet the mesh's box, and what they take in the commits that it serves."""
    if decision is None or decision.expected_rays is None:
        return "", "", ""
    chosen = [row for row in decision.alternatives if row.builder == decision.builder]
    if not chosen or chosen[0].trace_milliseconds is None:
        return "", f"{decision.expected_rays:,.0f}", ""
    return (
        f"{chosen[0].update_milliseconds:.1f}",
        f"{decision.expected_rays:,.0f}",
        f"{chosen[0].trace_milliseconds:.1f}",
    )
