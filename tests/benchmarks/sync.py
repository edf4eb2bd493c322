"""The cost of staying in step with Blender: per frame, read, compare, update calls, trees, top level and rays.

    python tests/benchmarks/sync.py --json OUT.json
    python tests/benchmarks/sync.py --json OUT.json --only "instances moved"

    python tests/benchmarks/sync.py --json OUT.json --policies

Cases: the animated scenes of blend_scenes, a million deforming triangles, instances made by geometry nodes that move,
one object moved among ten thousand, an edit in a scene with a mesh of three million triangles that it does not touch.
`read_list_ms` is the time to read the same instances through Blender's list. Blender's own evaluation is part of
`evaluate_ms` only. `cpu_ms` is the CPU time of an update, of all threads: on a busy machine it is more reliable than
wall-clock time, which all other figures are. With --policies the animated scenes and a bursting ball are played with
each policy of the governor instead, see policies.py.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import bpy
import numpy as np
import perfect_bvh
from benchmarks import policies
from benchmarks.machine import REPOSITORY, describe
from benchmarks.rounds import Spread
from benchmarks.rows import write_rows
from benchmarks.tables import format_table
from blender.builders import instances_on_grid, made_cube, mesh_data, mesh_object
from perfect_bvh_addon import SceneSync
from perfect_bvh_addon.extract import ReadCache, read_scene
from perfect_bvh_addon.extract.pointer_views import ArrayReader

SCENES = ("tree_in_wind", "cloth", "gears", "ocean", "crowd", "courtyard")
RAYS = 100_000
Step = Callable[[int], object]  # makes the change of a round, before Blender evaluates it


class Case:
    """One scene, changed in rounds."""

    def __init__(self, name: str, step: Step, *, compare_list: bool = False) -> None:
        self.name = name
        self.step = step
        self.compare_list = compare_list

    def measure(self, rounds: int) -> dict[str, Any]:
        """Milliseconds of each part: the first update, and the middle of the later ones."""
        sync = SceneSync()
        figures = []
        for number in range(rounds + 1):
            self.step(number)
            started = time.perf_counter()
            depsgraph = bpy.context.evaluated_depsgraph_get()
            depsgraph.update()
            evaluated = (time.perf_counter() - started) * 1e3
            worked = time.process_time()
            report = sync.update(depsgraph)
            worked = (time.process_time() - worked) * 1e3
            figures.append({"evaluate_ms": evaluated, **_parts(report), "cpu_ms": worked, "trace_ms": _trace(sync)})
        result: dict[str, Any] = {
            "name": self.name,
            "triangles": sum(len(mesh.triangles) for mesh in sync.record.meshes),
            "instances": len(sync.record.instances),
            "rays": RAYS,
            "first": figures[0],
            "later": {key: Spread.of([figure[key] for figure in figures[1:]]).as_json() for key in figures[0]},
            "last_report": str(report),
            "last_top_level": report.commit.top_level.reason,
        }
        if self.compare_list:
            result["read_list_ms"] = _time_reading(depsgraph, ArrayReader(use_views=False))
        sync.close()
        return result


def _parts(report: Any) -> dict[str, float]:
    commit = report.commit
    return {
        "read_ms": report.read_milliseconds,
        "compare_ms": report.compare_milliseconds,
        "update_ms": report.apply_milliseconds,
        "trees_ms": commit.mesh_milliseconds,
        "top_level_ms": commit.top_level_milliseconds,
        **{f"top_level_{name}_ms": value for name, value in commit.top_level.stages.items()},
        "commit_ms": report.commit_milliseconds,
        "all_ms": report.milliseconds,
        "all_but_commit_ms": report.milliseconds - report.commit_milliseconds,
    }


def _trace(sync: SceneSync) -> float:
    """Milliseconds of rays from all around towards the scene."""
    transforms = sync.record.instances.transforms
    middle = transforms[:, :, 3].mean(axis=0) if len(transforms) else np.zeros(3)
    size = max(5.0, float(np.ptp(transforms[:, :, 3], axis=0).max())) if len(transforms) else 5.0
    random = np.random.default_rng(1)
    directions = random.normal(size=(RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    targets = middle + random.uniform(-0.5, 0.5, (RAYS, 3)) * size
    started = time.perf_counter()
    sync.scene.cast_rays(targets - directions * size * 2, directions, fields=("t_hit",))
    return (time.perf_counter() - started) * 1e3


def _time_reading(depsgraph: Any, reader: ArrayReader) -> float:
    started = time.perf_counter()
    read_scene(depsgraph, reader=reader, cache=ReadCache())
    return (time.perf_counter() - started) * 1e3


# Cases ---------------------------------------------------------------------------------------------------------------


def cases(largest: int, only: str) -> Iterator[Case]:
    """Each is set up when it is its turn."""
    makers: dict[str, Callable[[], Case]] = {name: partial(animated_scene, name) for name in SCENES}
    makers["deforming 1M triangles"] = deforming
    for count in (1_000, 10_000, 100_000, 1_000_000):
        if count <= largest:
            makers[f"{count:,} instances moved"] = partial(moved_instances, count)
    makers["one object moved among 10,000"] = one_object
    makers["one object moved among 10,000 meshes"] = one_mesh
    makers["edit beside 3M triangles"] = unrelated_edit
    for name, make in makers.items():
        if only in name:
            yield make()


def _clear() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)


def animated_scene(name: str) -> Case:
    bpy.ops.wm.open_mainfile(filepath=str(REPOSITORY / "blend_scenes" / f"{name}.blend"))
    scene = bpy.context.scene
    return Case(name, lambda number: scene.frame_set(scene.frame_start + number))


def _grid(name: str, side: int) -> Any:
    """A square of side x side squares, two triangles each."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side, y_subdivisions=side, size=10.0)
    bpy.context.object.name = name
    return bpy.context.object


def deforming() -> Case:
    _clear()
    data = _grid("sheet", 707).data
    points = np.empty(len(data.vertices) * 3, np.float32)
    data.vertices.foreach_get("co", points)

    def step(number: int) -> None:
        moved = points.copy()
        moved[2::3] = np.sin(points[::3] + 0.3 * number)
        data.attributes["position"].data.foreach_set("vector", moved)
        data.update()

    return Case("deforming 1M triangles", step)


def moved_instances(count: int) -> Case:
    _clear()
    field = instances_on_grid("field", made_cube, round(count**0.5))
    nodes = field.modifiers[0].node_group.nodes
    size = next(node for node in nodes if node.bl_idname == "GeometryNodeMeshGrid").inputs["Size X"]

    def step(number: int) -> None:
        size.default_value = count**0.5 * (3.0 + 0.1 * number)

    return Case(f"{count:,} instances moved", step, compare_list=True)


def one_object() -> Case:
    _clear()
    data = mesh_data("shared")
    return _one_moves("one object moved among 10,000", lambda index: data)


def one_mesh() -> Case:
    """Each object has a separate mesh."""
    _clear()
    return _one_moves("one object moved among 10,000 meshes", lambda index: mesh_data(f"mesh {index}"))


def _one_moves(name: str, data_of: Callable[[int], Any]) -> Case:
    for index in range(10_000):
        mesh_object(f"object {index}", data_of(index), location=(index % 100 * 3, index // 100 * 3, 0))
    obj = bpy.data.objects["object 5050"]
    return Case(name, lambda number: setattr(obj.location, "z", number))


def unrelated_edit() -> Case:
    _clear()
    _grid("character", 1225)
    other = mesh_object("other", location=(20, 0, 0))
    return Case("edit beside 3M triangles", lambda number: setattr(other.location, "z", number))


# The printed figures of each case: the median over its later updates.
_COLUMNS = ("evaluate", "read", "compare", "update", "trees", "top_level", "all", "cpu", "trace")
# Milliseconds that an update may take in all, on an idle machine.
_GOALS = {
    "deforming 1M triangles": 25,
    "100,000 instances moved": 30,
    "1,000,000 instances moved": 300,
    "one object moved among 10,000": 100,
    "one object moved among 10,000 meshes": 100,
    "edit beside 3M triangles": 1,
}


def describe_cases(results: list[dict[str, Any]]) -> str:
    """A table of milliseconds, a row a case."""
    rows = [
        (result["name"], *(result["later"][f"{name}_ms"]["median"] for name in _COLUMNS), _GOALS.get(result["name"]))
        for result in results
    ]
    return format_table(("ms", *(name.replace("_", " ") for name in _COLUMNS), "goal"), rows)


# Policies ------------------------------------------------------------------------------------------------------------

ANIMATED = ("tree_in_wind", "cloth", "gears", "ocean")


def compare_policies(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """The figures of each animation, with one line of each policy written as they come."""
    perfect_bvh.set_thread_count(1)
    for name in (*ANIMATED, "exploding"):
        if options.only in name:
            records = policies.exploding_records() if name == "exploding" else animated_records(name)
            frames = list(itertools.islice(records, options.frames))
            result = policies.compare(name, frames, options.rays, options.rounds)
            sys.stdout.write(policies.describe(result) + "\n")
            sys.stdout.flush()
            yield result


def animated_records(name: str) -> Iterator[Any]:
    bpy.ops.wm.open_mainfile(filepath=str(REPOSITORY / "blend_scenes" / f"{name}.blend"))
    scene, cache = bpy.context.scene, ReadCache()
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        yield read_scene(bpy.context.evaluated_depsgraph_get(), cache=cache)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    parser.add_argument("--rounds", type=int, default=7, metavar="N", help="updates after the first")
    parser.add_argument("--largest", type=int, default=1_000_000, metavar="N", help="instances of the largest field")
    parser.add_argument("--only", default="", metavar="NAME", help="cases whose name contains this")
    parser.add_argument("--policies", action="store_true", help="compare always refit, always rebuild and governed")
    parser.add_argument("--rays", type=int, default=1_500_000, metavar="N", help="of a frame, for --policies")
    parser.add_argument("--frames", type=int, default=48, metavar="N", help="for --policies")
    options = parser.parse_args()
    if options.policies:
        results = list(compare_policies(options))
        write_rows(options.json, {"machine": describe(), "policies": results})
        return
    results = []
    for case in cases(options.largest, options.only):
        results.append(case.measure(options.rounds))
        sys.stdout.write(f"{case.name}: {results[-1]['last_report']}\n")
        sys.stdout.flush()
    write_rows(options.json, {"machine": describe(), "cases": results})
    sys.stdout.write(describe_cases(results) + "\n")


if __name__ == "__main__":
    main()
