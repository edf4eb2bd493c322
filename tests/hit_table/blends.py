"""Fingerprints of all results from the example scenes, to prove that an internal change has changed no answer.

    python tests/hit_table/blends.py before.json    # with the package of before the change
    python tests/hit_table/blends.py after.json     # with that of after it
    diff before.json after.json

Of each file in blend_scenes: sync reports, lookups, images, scans, and renders through Blender and the command line, a
line of JSON each, in a few minutes of one core. Only what users' scripts can reach is called, so that one program fits
both packages. Items with `/visits/` in their names count nodes and triangles that rays visited: a change of a tree may
change them, and nothing else. Rays at generated scenes are `table.py`'s.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(TESTS))
    engine = importlib.util.find_spec("perfect_bvh")
    assert engine is not None and engine.origin is not None, "perfect_bvh is not installed"
    # Decisions follow the package's own calibration, independent of this machine's measurements.
    os.environ["PERFECT_BVH_CALIBRATION"] = str(Path(engine.origin).with_name("calibration.json"))

import bpy
import numpy as np
import perfect_bvh
import perfect_bvh_addon
from benchmarks.rows import write_rows
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
CLOSEST_FIELDS = ("points", "distances", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs")
# Durations, and numbers that only distinguish commits of one process.
UNSTEADY = ("scene_id", "milliseconds")
Values = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(description="Record fingerprints of what becomes of the example scenes.")
    parser.add_argument("out", type=Path, metavar="OUT.json", help="where they go")
    parser.add_argument("files", type=Path, nargs="*", metavar="FILE.blend", help="without any: all of blend_scenes")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    items = {}
    for path in chosen.files or sorted((TESTS.parent / "blend_scenes").glob("*.blend")):
        with tempfile.TemporaryDirectory() as folder:
            answers = answers_of(path, Path(folder)) | {"command_line": command_line_of(path, Path(folder) / "images")}
        items |= {f"{path.stem}/{name}": value for name, value in digests_of(answers)}
    write_rows(chosen.out, items)
    print(f"{len(items)} items in {chosen.out}")


def digests_of(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yields names, joined by slashes for nested mappings, and sha256 of all values that are no mappings."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}/{inner}", digest) for inner, digest in digests_of(value))
        else:
            yield name, digest_of(value)


def digest_of(value: Any) -> str:
    """Returns the digest of an array (type, shape, bits; one of objects as a list) or of a value that JSON takes."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        content = f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
    else:
        content = json.dumps(value.tolist() if isinstance(value, np.ndarray) else value, sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()


def answers_of(path: Path, folder: Path) -> Values:
    """One file, as a script uses the add-on; folder: for the files that Blender writes."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    attributes = perfect_bvh_addon.AttributeRequest(
        material_slots=True, corner_normals=True, corner_uvs=True, shading=True
    )
    sync = perfect_bvh_addon.SceneSync(attributes, for_viewport=False)
    found: Values = {}
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        report = sync.update(bpy.context.evaluated_depsgraph_get(), 100_000, size=SIZE)
        found |= {f"sync/{frame}": report_of(report), f"lookups/{frame}": lookups_of(sync)}
        if frame in IMAGE_FRAMES:
            found[f"images/{frame}"] = images_of(sync)
    sync.close()
    return found | {"scans": scans_of(), "render": renders_of(folder / "passes.exr")}


def report_of(report: Any) -> Values:
    counts = ("added", "removed", "moved", "masked", "kept")
    flags = ("camera_changed", "materials_changed", "attributes_changed", "finishes_earlier_update", "has_changes")
    ledger = [{key: row[key] for key in row if key != "milliseconds"} for row in report.ledger]
    return {
        "mesh_actions": [[mesh.name, mesh.action, mesh.reason, mesh.triangle_count] for mesh in report.meshes],
        "mesh_usages": [[mesh.name, mesh.usage, mesh.usage_reason] for mesh in report.meshes],
        "objects": [
            [row.name, row.action, row.reason, row.instance_count, row.changed_count] for row in report.objects
        ],
        "counts": [getattr(report, f"{name}_count") for name in counts],
        "flags": [bool(getattr(report, name)) for name in flags],
        "unseen": plain(report.unseen),
        "warnings": list(report.warnings),
        "engine_actions": [[row["mesh"], row["action"], row["builder"], row["triangles"]] for row in ledger],
        "engine_reasons": [row["reason"] for row in ledger],
        "ledger": ledger,
        "byte_count": report.byte_count,
    }


def plain(value: Any) -> Any:
    """A report as lists and dictionaries, without the durations in it."""
    if dataclasses.is_dataclass(value):
        names = [each.name for each in dataclasses.fields(value) if not each.name.endswith(UNSTEADY)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def lookups_of(sync: Any) -> Values:
    """All queries about the camera, the name of each hit in Blender, and the trees."""
    directions = np.random.default_rng(41).normal(size=(2000, 3))
    origin, scene = sync.camera.matrix[:3, 3], sync.scene
    hits = scene.cast_rays(origin, directions)
    listed = scene.list_intersections(origin, directions)
    closest = scene.compute_closest_points(origin + directions)
    return {
        "cast_rays": hits.columns,
        "test_occlusions": scene.test_occlusions(origin, directions),
        "count_intersections": scene.count_intersections(origin, directions),
        "list_intersections": listed.hits.columns | {"ray_splits": listed.ray_splits},
        "closest_points": {name: getattr(closest, name) for name in CLOSEST_FIELDS},
        "trees": plain(scene.statistics(detailed=True)),
        "names": sync.describe(hits.instance_ids).names,
        "polygon_ids": sync.polygon_ids(hits),
        "triangle_ids": sync.triangle_ids(hits),
        "material_ids": sync.material_ids(hits),
        "material_names": sync.material_names,
    }


def images_of(sync: Any) -> Values:
    """Raises AssertionError where the number of threads changes an image."""
    found: dict[str, Values] = {"images": {}, "visits": {}}
    for mode in perfect_bvh.MODES:
        passes = perfect_bvh.PASSES if mode in FULL_MODES else ("combined",)
        options: Values = {"mode": mode, "size": SIZE, "samples": SAMPLES, "appearance": sync.appearance}
        first, second = (
            perfect_bvh.render_passes(sync.scene, sync.camera, passes=passes, threads=threads, **options)
            for threads in (1, 2)
        )
        for name in passes:
            if digest_of(first[name]) != digest_of(second[name]):
                raise AssertionError(f"{mode}: {name} differs by two threads")
            section = "visits" if mode == "cost" or name in COUNTERS else "images"
            found[section][f"{mode}/{name}"] = first[name]
    return found


def scans_of() -> Values:
    lidar = perfect_bvh_addon.SpinningLidar(elevations=tuple(range(-15, 16, 5)), columns=120, rate=24.0)
    found: Values = {}
    for name, pattern in {"camera": perfect_bvh_addon.CameraGrid(64, 36), "lidar": lidar}.items():
        cloud = perfect_bvh_addon.scan(pattern, frames=(1, 2), steps_per_frame=2)
        names = [cloud.object_names, cloud.material_names, cloud.ray_count, cloud.warnings]
        found[name] = {column: getattr(cloud, column) for column in CLOUD_COLUMNS} | {"names": names}
    return found


def renders_of(path: Path) -> Values:
    """Returns all passes as Blender receives them from the engine, through the file that Blender writes."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    scene.perfect_bvh.samples = SAMPLES
    found: Values = {}
    for mode in ("PREVIEW", "CLAY", "NORMAL"):
        scene.perfect_bvh.mode = mode
        scene.frame_set(2)
        write_multilayer(path, scene, "PERFECT_BVH")
        found[mode.lower()] = read_exr(path)
    return found


def command_line_of(path: Path, folder: Path) -> Values:
    """The images that `perfect-bvh render` writes, by file name, as bytes."""
    program = "import sys; from perfect_bvh_addon.cli import main; sys.exit(main())"
    options = ["--frames", "1-3", "--size", "96x54", "--samples", "2", "--quiet"]
    command = [sys.executable, "-c", program, "render", str(path), "-o", f"{folder}/", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return {image.name: np.frombuffer(image.read_bytes(), np.uint8) for image in sorted(folder.iterdir())}


if __name__ == "__main__":
    main()
