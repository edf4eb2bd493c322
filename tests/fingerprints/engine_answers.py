"""What the engine answers about the generated scenes: every query, and the trees and reports that anybody can look at.

Threads and strategies must not change an answer: that is asserted here, and each answer is recorded once.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from fingerprints.digests import Recorder, check_equal
from fingerprints.engine_scenes import SCENES, EngineScene
from oracles import meshes

COUNTERS = ("nodes_visited", "primitives_tested")
# All that `Hits` names, and for `list_intersections` all but the counters, which belong to rays.
HIT_FIELDS = (
    "t_hit", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs", "geometric_normals", "positions",
    "distances", "front_face",
)  # fmt: skip
CLOSEST_FIELDS = ("points", "distances", "instance_ids", "mesh_ids", "primitive_ids", "primitive_uvs")
# Durations, and numbers that only tell commits of one process apart.
UNSTEADY = ("scene_id", "milliseconds")


def record_engine(recorder: Recorder, names: Iterable[str] = tuple(SCENES), ray_count: int = 1500) -> None:
    """All scenes of these names, with the instruction set that is active."""
    for name in names:
        made = SCENES[name]()
        here = recorder.within(name)
        _record_commits(here.within("commits"), made)
        _record_rays(here, made, ray_count)
        _record_points(here.within("compute_closest_points"), made, ray_count)
        _record_trees(here, made.scene)


def plain(value: Any) -> Any:
    """A report as lists and dictionaries, without the durations in it."""
    if hasattr(value, "__dataclass_fields__"):
        names = [name for name in value.__dataclass_fields__ if not name.endswith(UNSTEADY)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def rays_about(centre: npt.NDArray[np.float64], count: int) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Scattered rays, a pinhole camera's, and rays along an axis through lattice points: (R, 3) float64 each."""
    origins, directions = (part.astype(np.float64) for part in meshes.random_rays(count, 31))
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 40), np.linspace(-0.3, 0.3, 24))
    pinhole = np.stack([x, np.ones_like(x), y], axis=-1).reshape(-1, 3)
    line = np.linspace(-1.0, 1.0, 13)
    lattice = np.stack([*np.meshgrid(line, line), np.full((13, 13), 3.0)], axis=-1).reshape(-1, 3)
    starts = [origins, np.broadcast_to((0.0, -3.0, 0.1), pinhole.shape), lattice]
    towards = [directions, pinhole, np.broadcast_to((0.0, 0.0, -1.0), lattice.shape)]
    return np.concatenate(starts) + centre, np.concatenate(towards)


def _variants(count: int) -> dict[str, dict[str, Any]]:
    """By name, what else a query of so many rays is given."""
    random = np.random.default_rng(32)
    limited = {
        "t_min": random.uniform(0.0, 0.5, count).astype(np.float32),
        "t_max": random.uniform(0.5, 3.0, count).astype(np.float32),
        "mask": random.integers(0, 8, count).astype(np.uint32),
    }
    return {"all": {}, "limited": limited | {"cull": "back"}, "front_culled": {"cull": "front"}}


def _record_rays(recorder: Recorder, made: EngineScene, count: int) -> None:
    rays = rays_about(made.centre, count)
    for name, options in _variants(len(rays[0])).items():
        _record_cast(recorder, made.scene, rays, name, options)
        occluded = {threads: made.scene.test_occlusions(*rays, threads=threads, **options) for threads in (1, 2)}
        for strategy in ("packets", "stream", "single"):
            occluded[strategy] = made.scene.test_occlusions(*rays, strategy=strategy, **options)
        for other in occluded:
            check_equal(f"test_occlusions by {other}", occluded, {1: occluded[other]}, (1,))
        recorder.add(f"test_occlusions/{name}", occluded[1])
        recorder.add(f"count_intersections/{name}", made.scene.count_intersections(*rays, threads=1, **options))
        for limit in (None, 2):
            found = made.scene.list_intersections(*rays, fields=HIT_FIELDS, max_hits=limit, threads=1, **options)
            listed = recorder.within(f"list_intersections/{name}/{'all' if limit is None else limit}")
            listed.add_all({field: getattr(found.hits, field) for field in HIT_FIELDS})
            listed.add("ray_splits", found.ray_splits)


def _record_cast(
    recorder: Recorder, scene: perfect_bvh.Scene, rays: tuple[Any, Any], name: str, options: dict[str, Any]
) -> None:
    fields = HIT_FIELDS + COUNTERS
    answers = {
        strategy: scene.cast_rays(*rays, fields=fields, strategy=strategy, threads=1, **options)
        for strategy in ("auto", "packets", "stream", "single")
    }
    first = answers["auto"]
    for strategy, hits in answers.items():
        check_equal(f"cast_rays by {strategy}", first.columns, hits.columns, HIT_FIELDS)
        for counter in COUNTERS:
            recorder.within("visits").add(f"cast_rays/{name}/{strategy}/{counter}", hits.columns[counter])
    check_equal("threads=2", first.columns, scene.cast_rays(*rays, fields=fields, threads=2, **options).columns, fields)
    recorder.within(f"cast_rays/{name}").add_all({field: first.columns[field] for field in HIT_FIELDS})
    recorder.add(f"cast_rays/{name}/invalid_count", first.invalid_count)


def _record_points(recorder: Recorder, made: EngineScene, count: int) -> None:
    points = np.random.default_rng(33).uniform(-2.0, 2.0, (count // 3, 3)) + made.centre
    for name, limit in (("all", np.inf), ("near", 0.2)):
        first, second = (
            made.scene.compute_closest_points(points, max_distance=limit, threads=threads) for threads in (1, 2)
        )
        columns = [{field: getattr(found, field) for field in CLOSEST_FIELDS} for found in (first, second)]
        check_equal("threads=2", *columns, CLOSEST_FIELDS)
        recorder.within(name).add_all(columns[0])


def _record_commits(recorder: Recorder, made: EngineScene) -> None:
    for number, report in enumerate(made.reports):
        here, values = recorder.within(str(number)), plain(report)
        here.add("actions", [[mesh["mesh_id"], mesh["action"], mesh["builder"]] for mesh in values["meshes"]])
        here.add("reasons", [mesh["reason"] for mesh in values["meshes"]])
        here.add("expected_costs", values.pop("meshes"))
        here.add("top_level", values.pop("top_level"))
        here.add("byte_count", values.pop("byte_count"))
        here.add("rest", values)


def _record_trees(recorder: Recorder, scene: perfect_bvh.Scene) -> None:
    statistics = plain(scene.statistics(detailed=True))
    for tree in (*statistics["meshes"], statistics["top_level"]):
        name = "top_level" if tree["mesh_id"] < 0 else f"mesh_{tree['mesh_id']}"
        bytes_taken = {key: tree.pop(key) for key in list(tree) if key.endswith("byte_count")}
        recorder.within("trees").add_all({name: tree, f"{name}_bytes": bytes_taken})
    snapshot = scene.snapshot()
    for mesh in (None, *(tree["mesh_id"] for tree in statistics["meshes"])):
        boxes = snapshot.tree_boxes(mesh)
        here = recorder.within("tree_boxes").within("top_level" if mesh is None else f"mesh_{mesh}")
        here.add_all({name: getattr(boxes, name) for name in ("boxes", "levels", "leaf_sizes", "costs", "overlaps")})
