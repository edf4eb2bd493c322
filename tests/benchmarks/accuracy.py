"""How many answers are wrong where coordinates are hard, and how fast each engine gives them.

    python tests/benchmarks/accuracy.py --json accuracy.json

A closed sphere is moved away from the origin, scaled, or stretched until its triangles are slivers; rays start within
it, so that each must hit: a miss is wrong however the ray is rounded. They are aimed at random points of the surface
and, where it is hardest, at its vertices. For a sample of the first kind the double-precision oracle also judges
triangle and distance, unless the sphere is so far away that rounding decides every answer. The program also measures
the errors of distances on grounds of two triangles, flat and aslant, the larger the harder; the rays lost or invented
exactly at a box's outlines (exact_edges.py); and the speed of each engine on one thread.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks import exact_edges, options, peers
from benchmarks.build_python import measure_rays
from benchmarks.judging import Judge
from benchmarks.large_triangles import SIDES, errors_of_t, ground, rays_at_its_middle
from benchmarks.meshes import BenchMesh
from benchmarks.native import NativePrograms
from benchmarks.native_answers import ask
from benchmarks.peers import Answers
from benchmarks.rays import Rays, make_rays
from benchmarks.rounds import Spread
from oracles.meshes import sphere
from perfect_bvh.audit import Audit
from tqdm import tqdm

EMBREE = ("embree", "embree_robust")
RINGS, SEGMENTS = 48, 64
OURS, PLACED = "perfect_bvh", "perfect_bvh, placed by its matrix"
F64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A sphere, its deformation, and rays by the kind of their target. matrix: the deformation as a transform."""

    sweep: str
    value: float
    mesh: BenchMesh
    rays: dict[str, Rays]
    matrix: F64 | None = None

    @property
    def can_be_judged(self) -> bool:
        """The oracle calls every answer ambiguous that lies within some roundings of the largest coordinate."""
        return self.sweep != "offset" or self.value < 1e5


def main() -> None:
    """Measure, write the JSON."""
    parser = options.parser(__doc__ or "")
    options.add_ray_limit(parser)
    parser.add_argument("--rays", type=int, default=30_000, metavar="N", help="at each sphere")
    parser.add_argument("--sample", type=int, default=50, metavar="N", help="rays of them that the oracle judges")
    chosen = options.parse(parser)
    native, left_out = NativePrograms(chosen.native), list[str]()
    if not native.has("answers_bench"):
        left_out.append(native.why_not("answers_bench"))
    sweeps: dict[str, list[dict[str, Any]]] = {}
    for case in tqdm(list(_cases(chosen.rays)), unit="sphere"):
        judge = Judge(case.mesh) if case.can_be_judged else None
        row: dict[str, Any] = {"value": case.value}
        for aim, rays in case.rays.items():
            answers = _ask_all(case, rays, native, chosen, left_out)
            row[aim] = _count(rays, answers, judge if aim == "surface" else None, chosen.sample)
        sweeps.setdefault(case.sweep, []).append(row)
    grounds = {name: _grounds(name == "aslant", native, chosen, left_out) for name in ("flat", "aslant")}
    exact = exact_edges.measure(chosen.rays // 3, chosen.ray_limit)
    speeds = _measure_speeds(native, chosen)
    left_out = list(dict.fromkeys(left_out))
    spheres = {"triangle_count": 2 * SEGMENTS * (RINGS - 1), "sweeps": sweeps}
    options.save(chosen, {"left_out": left_out, **spheres, "grounds": grounds, "exact": exact, "speeds": speeds})


def _cases(count: int) -> Iterator[Case]:
    random = np.random.default_rng(23)
    positions, triangles = sphere(RINGS, SEGMENTS)
    outward = random.normal(size=(count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)

    picked = random.integers(0, len(positions), count)

    def case(sweep: str, value: float, scale: npt.ArrayLike = 1.0, offset: float = 0.0) -> Case:
        matrix = np.eye(4)
        matrix[:3, 3] = offset / 3.0**0.5
        centre = matrix[:3, 3].astype(np.float32)
        placed = (positions * scale + matrix[:3, 3]).astype(np.float32)
        # At the vertices where they have come to lie by being rounded, from where the centre has.
        aims = {"surface": outward * scale, "vertices": (placed[picked].astype(np.float64) - centre)}
        origins = np.tile(centre, (count, 1))
        rays = {aim: Rays(sweep, origins, each.astype(np.float32)) for aim, each in aims.items()}
        mesh = BenchMesh(sweep, placed, triangles, is_inside=True)
        return Case(sweep, value, mesh, rays, matrix if sweep == "offset" else None)

    for offset in (0.0, *(10.0**power for power in range(1, 7))):
        yield case("offset", offset, offset=offset)
    for power in range(-6, 9, 2):
        yield case("scale", 10.0**power, scale=10.0**power)
    for power in range(6):
        yield case("aspect", 10.0**power, scale=np.array([10.0**power, 1.0, 1.0]))


def _grounds(
    is_aslant: bool, native: NativePrograms, chosen: argparse.Namespace, left_out: list[str]
) -> list[dict[str, Any]]:
    """For each side the errors of t by engine."""
    rows = []
    for side in SIDES:
        mesh, rays = ground(side, is_aslant), rays_at_its_middle(chosen.rays, is_aslant)
        answers = _ask_all(Case("ground", side, mesh, {}), rays, native, chosen, left_out)
        rows.append({"value": side, "t": {name: errors_of_t(mesh, rays, each) for name, each in answers.items()}})
    return rows


def _ask_all(
    case: Case, rays: Rays, native: NativePrograms, chosen: argparse.Namespace, left_out: list[str]
) -> dict[str, Answers]:
    """Everyone's answers; peers that take one ray a call get the first rays only."""
    answers: dict[str, Answers] = {}
    if native.has("answers_bench"):
        found = ask(native, case.mesh, rays, EMBREE, {})
        answers |= {name: each for name, each in found.items() if name in EMBREE}
    few = rays.pick(slice(chosen.ray_limit))
    answers[OURS] = peers.ours(peers.scene_of(case.mesh), OURS).answers(rays)
    if case.matrix is not None:
        answers[PLACED] = _placed(case.matrix, rays)
    others = {
        "BVHTree": lambda: peers.bvh_tree(case.mesh, chosen.ray_limit),
        "scene.ray_cast": lambda: peers.blender_scene(case.mesh, np.eye(4)[None], chosen.ray_limit),
    }
    for name, make in others.items():
        try:
            answers[name] = make().answers(few)
        except ImportError as error:
            left_out.append(f"{name}: {error}")
    return answers


def _placed(matrix: F64, rays: Rays) -> Answers:
    """The same sphere kept about its own origin and put in its place by a matrix, the rays in doubles."""
    positions, triangles = sphere(RINGS, SEGMENTS)
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles), matrix)
    scene.commit()
    hits = scene.cast_rays(np.tile(matrix[:3, 3], (len(rays), 1)), rays.directions.astype(np.float64))
    return Answers.of_one(hits.t_hit.astype(np.float64), hits.primitive_ids.astype(np.int64))


def _count(rays: Rays, answers: dict[str, Answers], judge: Judge | None, sample: int) -> dict[str, dict[str, float]]:
    """By engine: misses per million with their 95 % confidence interval, and the oracle's findings."""
    common = min(len(each.t) for each in answers.values())
    rows = np.unique(np.linspace(0, common - 1, min(sample, common)).astype(np.intp))
    parts = {
        name: Answers(each.t[rows], each.primitive_ids[rows], each.instance_ids[rows])
        for name, each in answers.items()
        if name != PLACED
    }
    wrong = judge.count_wrong(rays.pick(rows), parts) if judge else {}
    return {name: _row(each, wrong.get(name)) for name, each in answers.items()}


def _row(answers: Answers, wrong: Any) -> dict[str, float]:
    missed = np.flatnonzero(answers.primitive_ids < 0)
    audit = Audit(len(answers.t), missed, 0)
    low, high = audit.interval
    row = {"rays": len(answers.t), "missed_per_million": audit.wrong_per_million, "low": low, "high": high}
    return row | ({"judged": wrong.judged, "judged_wrong": wrong.wrong} if wrong else {})


def _measure_speeds(native: NativePrograms, chosen: argparse.Namespace) -> dict[str, dict[str, float]]:
    """M rays/s within the sphere on one thread: of native code where it is built, from Python otherwise."""
    positions, triangles = sphere(RINGS, SEGMENTS)
    mesh = BenchMesh("sphere", positions.astype(np.float32), triangles, is_inside=True)
    speeds: dict[str, list[float]] = {}
    if native.has("trace_bench"):
        words = ["--rounds", "1", "--kinds", "diffuse", "--isas", perfect_bvh.active_isa(), "--size", chosen.size]
        words += ["--peers", ",".join(EMBREE), "--inside"]
        for _ in range(chosen.rounds):
            for run in native.run("trace_bench", mesh, words):
                name = run["competitor"] if run["competitor"] in EMBREE else OURS
                speeds.setdefault(name, []).append(run["mrays_per_second"])
    result = {name: {**Spread.of(values).as_json(), "from": "native"} for name, values in speeds.items()}
    rays = next(rays for rays in make_rays(mesh, *options.size_of(chosen)) if rays.name == "diffuse")
    try:
        tracers = [peers.bvh_tree(mesh, chosen.ray_limit), peers.blender_scene(mesh, np.eye(4)[None], chosen.ray_limit)]
    except ImportError:
        return result
    for name, row in measure_rays(tracers, rays, chosen.rounds, lambda: None).items():
        result[name] = {**row["rounds"], "from": "Python"}
    return result


if __name__ == "__main__":
    main()
