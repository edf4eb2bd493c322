"""What becomes of an example scene: its syncs over three frames, images of each mode, lookups, a scan, a render by F12.

`perfect_bvh_addon` is used as a script uses it, through what its package exports.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import perfect_bvh
import perfect_bvh_addon
from fingerprints.digests import Recorder, check_equal
from fingerprints.engine_answers import plain
from oracles.cycles import write_multilayer
from oracles.exr import read_exr

FRAMES = (1, 2, 3)
IMAGE_FRAMES = (1, 3)
SIZE = (96, 54)
SAMPLES = 2
# Modes whose images take no light: all passes are recorded with one of each kind.
FULL_MODES = ("preview", "clay")
COUNTERS = ("nodes_visited", "primitives_tested")
CLOUD_COLUMNS = (
    "positions", "distances", "normals", "object_ids", "instance_ids", "material_ids", "times", "ray_ids",
)  # fmt: skip


def record_blend(recorder: Recorder, path: Path, folder: Path) -> None:
    """One file; folder: for what Blender writes meanwhile."""
    perfect_bvh_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(path))
    attributes = perfect_bvh_addon.AttributeRequest(
        material_slots=True, corner_normals=True, corner_uvs=True, shading=True
    )
    sync = perfect_bvh_addon.SceneSync(attributes, for_viewport=False)
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        report = sync.update(bpy.context.evaluated_depsgraph_get(), 100_000, size=SIZE)
        _record_report(recorder.within(f"sync/{frame}"), report)
        _record_lookups(recorder.within(f"lookups/{frame}"), sync)
        if frame in IMAGE_FRAMES:
            _record_images(recorder.within(f"images/{frame}"), sync)
    sync.close()
    _record_scans(recorder.within("scans"))
    _record_render(recorder.within("render"), folder / "passes.exr")


def _record_report(recorder: Recorder, report: Any) -> None:
    recorder.add("mesh_actions", [[mesh.name, mesh.action, mesh.reason, mesh.triangle_count] for mesh in report.meshes])
    recorder.add("mesh_usages", [[mesh.name, mesh.usage, mesh.usage_reason] for mesh in report.meshes])
    objects = [[row.name, row.action, row.reason, row.instance_count, row.changed_count] for row in report.objects]
    recorder.add("objects", objects)
    counts = ("added", "removed", "moved", "masked", "kept")
    flags = ("camera_changed", "materials_changed", "attributes_changed", "finishes_earlier_update", "has_changes")
    recorder.add("counts", [getattr(report, f"{name}_count") for name in counts])
    recorder.add("flags", [bool(getattr(report, name)) for name in flags])
    recorder.add("unseen", plain(report.unseen))
    recorder.add("warnings", list(report.warnings))
    ledger = [{key: row[key] for key in row if key != "milliseconds"} for row in report.ledger]
    recorder.add("engine_actions", [[row["mesh"], row["action"], row["builder"], row["triangles"]] for row in ledger])
    recorder.add("engine_reasons", [row["reason"] for row in ledger])
    recorder.add("ledger", ledger)
    recorder.add("byte_count", report.byte_count)


def _record_lookups(recorder: Recorder, sync: Any) -> None:
    """Rays about the camera, and what each hit is called in Blender."""
    directions = np.random.default_rng(41).normal(size=(2000, 3))
    hits = sync.scene.cast_rays(sync.camera.matrix[:3, 3], directions)
    described = sync.describe(hits.instance_ids)
    recorder.add("t_hit", hits.t_hit)
    recorder.add("names", described.names)
    recorder.add("polygon_ids", sync.polygon_ids(hits))
    recorder.add("triangle_ids", sync.triangle_ids(hits))
    recorder.add("material_ids", sync.material_ids(hits))
    recorder.add("material_names", sync.material_names)


def _record_images(recorder: Recorder, sync: Any) -> None:
    for mode in perfect_bvh.MODES:
        passes = perfect_bvh.PASSES if mode in FULL_MODES else ("combined",)
        options: dict[str, Any] = {"mode": mode, "size": SIZE, "samples": SAMPLES, "appearance": sync.appearance}
        first, second = (
            perfect_bvh.render_passes(sync.scene, sync.camera, passes=passes, threads=threads, **options)
            for threads in (1, 2)
        )
        check_equal(f"{mode} with threads=2", first, second, passes)
        for name in passes:
            section = "visits" if mode == "cost" or name in COUNTERS else "images"
            recorder.within(section).add(f"{mode}/{name}", first[name])


def _record_scans(recorder: Recorder) -> None:
    lidar = perfect_bvh_addon.SpinningLidar(elevations=tuple(range(-15, 16, 5)), columns=120, rate=24.0)
    patterns = {"camera": perfect_bvh_addon.CameraGrid(64, 36), "lidar": lidar}
    for name, pattern in patterns.items():
        cloud = perfect_bvh_addon.scan(pattern, frames=(1, 2), steps_per_frame=2)
        here = recorder.within(name)
        here.add_all({column: getattr(cloud, column) for column in CLOUD_COLUMNS})
        here.add("names", [cloud.object_names, cloud.material_names, cloud.ray_count, cloud.warnings])


def _record_render(recorder: Recorder, path: Path) -> None:
    """All passes as Blender gets them from the engine, through the file that it writes."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    scene.perfect_bvh.samples = SAMPLES
    for mode in ("PREVIEW", "CLAY", "NORMAL"):
        scene.perfect_bvh.mode = mode
        scene.frame_set(2)
        write_multilayer(path, scene, "PERFECT_BVH")
        recorder.within(mode.lower()).add_all(read_exr(path))
