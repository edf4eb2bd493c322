"""The losses of usual methods and of this engine on curves and points: counted, never timed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import perfect_bvh
from benchmarks.generated_curves import BenchBalls, one_place
from oracles.round_judge import judge
from oracles.round_world import RoundPart, RoundWorld
from perfect_bvh import BuildConfig

from .loss import PER_MILLION, WORK, Loss
from .losses_of_answers import per_million
from .losses_of_work import work_of
from .naive import tree
from .naive.tubes import tessellated
from .playing import SHIPPED
from .round_zoo import ROUND_CASES, Rays, RoundCase, cast_in_float, lost, rays_at

RAYS = 1000
MILLION = 1_000_000
# Few: each asks every one of a million points.
RAYS_AT_A_MILLION = 20
BUILDS: dict[str, BuildConfig | str] = {
    "auto": "auto",
    "sweep": BuildConfig(builder="sweep"),
    "spatial": BuildConfig(builder="spatial", duplication_budget=5.0),
    "optimized": BuildConfig(optimize=3),
    "median": BuildConfig(builder="median"),
}


def scene_of(balls: BenchBalls, build: BuildConfig | str = "auto", usage: str = "static") -> perfect_bvh.Scene:
    """One instance of curves or points, committed."""
    scene = perfect_bvh.Scene(calibration=SHIPPED)
    how: dict[str, Any] = {"build": build, "usage": usage}
    if balls.offsets is None:
        scene.add_instance(scene.add_points(balls.points, balls.radii, **how))
    else:
        scene.add_instance(scene.add_curves(balls.points, balls.radii, balls.offsets, **how))
    scene.commit()
    return scene


def triangles_of(balls: BenchBalls) -> tuple[perfect_bvh.Scene, np.ndarray]:
    """Returns a committed scene of triangles instead; and the curve or point of each triangle."""
    positions, triangles, owners = tessellated(balls)
    scene = perfect_bvh.Scene(calibration=SHIPPED)
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    return scene, owners


def played(case: RoundCase) -> Iterator[tuple[perfect_bvh.Scene, BenchBalls]]:
    """One scene; later states move its meshes."""
    scene: perfect_bvh.Scene | None = None
    for balls in case.states():
        if scene is None:
            scene = scene_of(balls, usage="deforming" if len(case.states()) > 1 else "static")
        else:
            (mesh,) = scene.statistics().meshes
            (scene.update_points if balls.offsets is None else scene.update_curves)(mesh.mesh_id, balls.points)
            scene.commit()
        yield scene, balls


def world_of(balls: BenchBalls) -> RoundWorld:
    """Returns the shapes for the reference in double precision: the scene's only instance."""
    return RoundWorld.of([RoundPart(0, balls.points, balls.radii, balls.offsets, np.eye(4), 0xFFFFFFFF)])


def _wrong(balls: BenchBalls, rays: Rays, hits: perfect_bvh.Hits) -> np.ndarray:
    return judge(world_of(balls), *rays, hits.t_hit, hits.instance_ids, hits.primitive_ids).wrong


def _last(case: RoundCase) -> tuple[perfect_bvh.Scene, BenchBalls, Rays]:
    scene, balls = list(played(case))[-1]
    return scene, balls, rays_at(balls, RAYS, 1)


# Losses of usual methods ---------------------------------------------------------------------------------------------


def formulas_in_float(case: RoundCase) -> Loss:
    """Rays whose hit a test of all segments in float loses, invents or puts more than a thousandth off."""
    scene, balls, rays = _last(case)
    hits = scene.cast_rays(*rays)
    naive = lost(cast_in_float(balls, rays)[0], hits.t_hit)
    return Loss("lost or off by 1e-3 per million", per_million(naive), per_million(_wrong(balls, rays, hits)))


def frame_before(case: RoundCase) -> Loss:
    """The answers of the frame before, taken for this one's; ours: after each motion."""
    naive, ours = [], []
    before: perfect_bvh.Snapshot | None = None
    for index, (scene, balls) in enumerate(played(case)):
        rays = rays_at(balls, RAYS, index)
        if before is not None:
            naive.append(_wrong(balls, rays, before.cast_rays(*rays)))
            ours.append(_wrong(balls, rays, scene.cast_rays(*rays)))
        before = scene.snapshot()
    return Loss(PER_MILLION, per_million(np.concatenate(naive)), per_million(np.concatenate(ours)))


def as_triangles(case: RoundCase) -> Loss:
    """Work through our own best tree over tubes or octahedra, relative to the best over the true curves and points."""
    _, balls, rays = _last(case)
    return _beside_the_best(case, work_of(triangles_of(balls)[0], rays))


def median_splits(case: RoundCase) -> Loss:
    """Work, relative to the best of all builders; ours: the default builder."""
    return _beside_the_best(case, _works(case)["median"])


def _beside_the_best(case: RoundCase, naive: int) -> Loss:
    works = _works(case)
    name = min(works, key=works.__getitem__)
    other = None if name == "auto" else (name, 1.0)
    return Loss(WORK, naive / works[name], works["auto"] / works[name], nothing=1.0, other=other)


@cache
def _works(case: RoundCase) -> dict[str, int]:
    _, balls, rays = _last(case)
    return {name: work_of(scene_of(balls, build), rays) for name, build in BUILDS.items()}


def endless_node(case: RoundCase) -> Loss:
    """A million points that no split parts; ours: points past the largest leaf, if answers are those of the case."""
    (few,) = case.states()
    many = one_place(MILLION)
    boxes = np.stack([many.points - many.radii[:, None], many.points + many.radii[:, None]], axis=1).astype(np.float64)
    rows = np.arange(MILLION)
    left, right = tree.at_the_middle(boxes, rows)
    stuck = MILLION if len(left) == 0 or len(right) == 0 else 0
    scene, rays = scene_of(many), rays_at(few, RAYS_AT_A_MILLION, 1)
    hits, expected = scene.cast_rays(*rays), scene_of(few).cast_rays(*rays)
    if not (np.array_equal(hits.t_hit, expected.t_hit) and np.array_equal(hits.primitive_ids, expected.primitive_ids)):
        raise AssertionError("endless_node: a million points in one place are not hit as a thousand are")
    leaf = scene.statistics().meshes[0].max_leaf_size
    return Loss("points in one endless node", stuck, max(0, leaf - BuildConfig().max_leaf_size))


# The rows ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RoundMeasure:
    """A row of the table: its words, and the function that measures the two losses."""

    title: str
    method: str
    held: str
    take: Callable[[RoundCase], Loss]


_FLOAT = "formulas of cone and balls in float32"
_IN_DOUBLE = "Float finds which segments a ray may meet, double precision decides, with margins that are derived."
ROUND_MEASURES: dict[str, RoundMeasure] = {
    "joints_of_a_zigzag": RoundMeasure(
        "Joints of a zigzag",
        _FLOAT,
        "A curve is the union of its segments: what one hides of its neighbour is no surface.",
        formulas_in_float,
    ),
    "hair_in_the_wind": RoundMeasure(
        "Strands in the wind",
        "trees of the frame before",
        "Boxes of segments are refitted in the commit; queries answer from a snapshot of one frame or refuse.",
        frame_before,
    ),
    "ball_of_sticks": RoundMeasure(
        "A ball of slanted sticks",
        "tubes of six sides",
        "A segment is one primitive, whose leaf is asked for its cone and not for its box.",
        as_triangles,
    ),
    "spheres_in_spheres": RoundMeasure(
        "Spheres in spheres",
        "median splits",
        "Splits by surface area, as of triangles. Restructured trees (`optimize`) do better.",
        median_splits,
    ),
    "points_in_one_place": RoundMeasure(
        "A million points in one place",
        "splits at the middle",
        "Halved in order, to a depth of 17. Each ray asks all of them, since each may be the first: that is dear.",
        endless_node,
    ),
    "tips_and_doubled_points": RoundMeasure("Tips and doubled points", _FLOAT, _IN_DOUBLE, formulas_in_float),
    "far_from_zero": RoundMeasure("Fur far from zero", _FLOAT, _IN_DOUBLE, formulas_in_float),
}


def unlike_as_triangles(case: RoundCase) -> float:
    """Rays per million that hit one and miss the other, or another curve or point, where triangles replace them."""
    scene, balls, rays = _last(case)
    hits = scene.cast_rays(*rays)
    if _wrong(balls, rays, hits).any():
        raise AssertionError(f"unlike_as_triangles: {case.name}: the reference finds our own answers wrong")
    mesh, owners = triangles_of(balls)
    met = mesh.cast_rays(*rays)
    return per_million(np.where(met.is_hit, owners[met.primitive_ids], -1) != hits.primitive_ids)


@cache
def measure_round(case: RoundCase) -> Loss:
    """The losses on a case; the same numbers in every run."""
    return ROUND_MEASURES[case.name].take(case)


def round_row(case: RoundCase) -> dict[str, object]:
    """One case: its words, the losses on it, and its triangles' losses, measured now."""
    told = ROUND_MEASURES[case.name]
    words = {"name": case.name, "title": told.title, "breaks": case.breaks, "held": told.held, "method": told.method}
    return {**words, **measure_round(case).as_json(), "as_triangles": round(unlike_as_triangles(case))}


def round_rows() -> list[dict[str, object]]:
    """Returns all rows, in the order of the zoo."""
    return [round_row(case) for case in ROUND_CASES]
