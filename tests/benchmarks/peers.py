"""The engines that can cast rays from Python: this one, Embree through embreex, Blender's BVHTree and scene.ray_cast.

Each is built from a mesh and then answers the same rays, all on one thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.meshes import BenchMesh
from benchmarks.rays import Rays
from perfect_bvh._tuning import Traced

Ids = npt.NDArray[np.int64]
Hit = tuple[int, float, int] | None  # triangle, distance, instance


@dataclass(frozen=True)
class Answers:
    """t: (R,) in multiples of the directions, inf on a miss. primitive_ids, instance_ids: (R,), -1 on a miss.

    For queries of any hit, the only information in an id is whether it is -1.
    """

    t: npt.NDArray[np.float64]
    primitive_ids: Ids
    instance_ids: Ids

    @classmethod
    def of_one(cls, t: npt.NDArray[np.float64], primitive_ids: Ids) -> Answers:
        """Answers of a single mesh, as instance 0."""
        return cls(t, primitive_ids, np.where(primitive_ids >= 0, 0, -1))

    @classmethod
    def of_any(cls, occluded: npt.NDArray[np.bool_]) -> Answers:
        """Whether there is a hit."""
        return cls.of_one(np.zeros(len(occluded)), np.where(occluded, 0, -1))


@dataclass(frozen=True)
class Peer:
    """closest, any: the timed functions. answers, occluded: the same queries untimed, for `ask`.

    ray_limit: the most rays for peers that take one ray a call.
    """

    name: str
    closest: Callable[[Rays], object]
    any: Callable[[Rays], object]
    answers: Callable[[Rays], Answers]
    occluded: Callable[[Rays], npt.NDArray[np.bool_]]
    ray_limit: int | None = None

    def cast(self, rays: Rays) -> object:
        return self.any(rays) if rays.is_any_hit else self.closest(rays)

    def ask(self, rays: Rays) -> Answers:
        """Returns the answers for the judge."""
        return Answers.of_any(self.occluded(rays)) if rays.is_any_hit else self.answers(rays)


def scene_of(mesh: BenchMesh, build: Any = "auto", usage: str = "static") -> perfect_bvh.Scene:
    """A committed scene of one mesh in its own place."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(mesh.positions, mesh.triangles, build=build, usage=usage))
    scene.commit()
    return scene


def ours(scene: perfect_bvh.Scene, name: str, isa: str | None = None, strategy: str = "auto", **keywords: Any) -> Peer:
    """This engine. isa: as in `available_isas`. keywords: for `cast_rays` and `test_occlusions`."""
    snapshot = Traced(scene.snapshot(), strategy)

    def cast(rays: Rays) -> perfect_bvh.Hits:
        perfect_bvh.set_active_isa(isa)
        fields = ("t_hit", "primitive_ids", "instance_ids")
        columns = rays.origins, rays.directions
        return snapshot.cast_rays(*columns, t_max=rays.t_max, fields=fields, threads=1, **keywords)

    def test(rays: Rays) -> npt.NDArray[np.bool_]:
        perfect_bvh.set_active_isa(isa)
        return snapshot.test_occlusions(
            rays.origins, rays.directions, t_min=0.0, t_max=rays.t_max, threads=1, **keywords
        )

    def answers(rays: Rays) -> Answers:
        hits = cast(rays)
        ids = (hits.primitive_ids.astype(np.int64), hits.instance_ids.astype(np.int64))
        return Answers(hits.t_hit.astype(np.float64), *ids)

    return Peer(name, cast, test, answers, test)


def ours_in_every_way(scene: perfect_bvh.Scene) -> list[Peer]:
    """This engine with each instruction set; with the best of them each strategy."""
    result = [ours(scene, f"perfect_bvh, {isa}", isa) for isa in perfect_bvh.available_isas()]
    for strategy in ("packets", "stream", "single"):
        result.append(ours(scene, f"perfect_bvh, {strategy}", strategy=strategy))
    return result


def embreex(mesh: BenchMesh, *, is_robust: bool = False, all_fields: bool = False) -> Peer:
    """Embree through embreex: rtcIntersect1 and rtcOccluded1 in a compiled loop. May raise ImportError.

    all_fields: closest hits are asked for with all that embreex gives, not for the triangle alone.
    """
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=is_robust)
    TriangleMesh(scene, mesh.positions, mesh.triangles)

    @lru_cache(maxsize=1)  # rays are in the peer's own format before the clock
    def limits_of(count: int, t_max: float) -> npt.NDArray[np.float32]:
        return np.full(count, t_max, np.float32)

    def run(rays: Rays, **keywords: Any) -> Any:
        limits = None if math.isinf(rays.t_max) else limits_of(len(rays), rays.t_max)
        return scene.run(rays.origins, rays.directions, limits, **keywords)

    def answers(rays: Rays) -> Answers:
        found = run(rays, output=1)
        ids = np.where(found["geomID"] == 0, found["primID"], -1).astype(np.int64)
        return Answers.of_one(np.where(ids >= 0, found["tfar"], np.inf).astype(np.float64), ids)

    def occluded(rays: Rays) -> npt.NDArray[np.bool_]:
        return np.asarray(run(rays, query="OCCLUDED")) != -1

    run(Rays("first", np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)))  # commits the scene
    name = "embreex, robust" if is_robust else "embreex"
    closest = (lambda rays: run(rays, output=1)) if all_fields else run
    return Peer(name, closest, lambda rays: run(rays, query="OCCLUDED"), answers, occluded)


def bvh_tree(mesh: BenchMesh, ray_limit: int) -> Peer:
    """mathutils.bvhtree.BVHTree. May raise ImportError."""
    tree = make_bvh_tree(*as_lists(mesh))

    def cast(origin: Any, direction: Any, distance: float) -> Hit:
        _, _, index, reached = tree.ray_cast(origin, direction, distance)
        return None if index is None else (index, reached, 0)

    return _one_by_one("BVHTree", cast, ray_limit)


def as_lists(mesh: BenchMesh) -> tuple[list[list[float]], list[list[int]]]:
    """The arguments of BVHTree.FromPolygons."""
    return mesh.positions.tolist(), mesh.triangles.tolist()


def make_bvh_tree(positions: list[list[float]], triangles: list[list[int]]) -> Any:
    """A BVHTree. May raise ImportError."""
    import bpy  # noqa: F401
    from mathutils.bvhtree import BVHTree

    return BVHTree.FromPolygons(positions, triangles, all_triangles=True)


def blender_scene(mesh: BenchMesh, transforms: npt.NDArray[np.float64], ray_limit: int) -> Peer:
    """Blender's scene.ray_cast, with an object for each of the transforms (I, 4, 4). May raise ImportError."""
    import bpy
    from mathutils import Matrix

    bpy.ops.wm.read_factory_settings(use_empty=True)
    data = bpy.data.meshes.new(mesh.name)
    positions, triangles = as_lists(mesh)
    data.from_pydata(positions, [], triangles)
    for index, transform in enumerate(transforms):
        placed = bpy.data.objects.new(str(index), data)
        placed.matrix_world = Matrix(transform.tolist())
        bpy.context.collection.objects.link(placed)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    scene = bpy.context.scene

    def cast(origin: Any, direction: Any, distance: float) -> Hit:
        is_hit, location, _, index, placed, _ = scene.ray_cast(depsgraph, origin, direction, distance=distance)
        return (index, math.dist(location, origin), int(placed.name)) if is_hit else None

    return _one_by_one("scene.ray_cast", cast, ray_limit)


def _one_by_one(name: str, cast: Callable[[Any, Any, float], Hit], ray_limit: int) -> Peer:
    """cast(origin, direction, distance): one ray."""

    def run(rays: Rays) -> list[Hit]:
        distance = min(rays.t_max, 1e30)
        columns = zip(rays.origins.tolist(), rays.directions.tolist(), strict=True)
        return [cast(origin, direction, distance) for origin, direction in columns]

    def answers(rays: Rays) -> Answers:
        rows = [(-1, math.inf, -1) if hit is None else hit for hit in run(rays)]
        ids, distances, instances = (np.array(column) for column in zip(*rows, strict=True))
        lengths = np.linalg.norm(rays.directions.astype(np.float64), axis=1)
        return Answers(distances / lengths, ids, instances)

    def occluded(rays: Rays) -> npt.NDArray[np.bool_]:
        return answers(rays).primitive_ids >= 0

    return Peer(name, run, run, answers, occluded, ray_limit)
