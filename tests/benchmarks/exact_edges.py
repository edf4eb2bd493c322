"""Counts rays that each engine loses or invents exactly at the vertices and edges of a box, or closely past them.

    python tests/benchmarks/exact_edges.py --json exact_edges.json

Rays begin nearer or farther from a box with sides of one unit. All coordinates are eighths, except in rays that pass an
edge closely, whose directions are one float off: float32 holds all of them exactly, also at a million units. So integer
arithmetic decides which rays hit the box, and an engine that disagrees has rounded. accuracy.py measures the same.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import numpy.typing as npt
from benchmarks import options, peers
from benchmarks.machine import describe
from benchmarks.meshes import BenchMesh
from benchmarks.peers import Answers
from benchmarks.rays import Rays
from oracles.exact_rays import lines_meet, plane_distances
from perfect_bvh.audit import Audit

DISTANCES = (4, 2**6, 2**10, 2**14, 2**17, 2**20)  # the last is the farthest where floats have eighths
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    parser.add_argument("--rays", type=int, default=10_000, metavar="N", help="from each distance")
    options.add_ray_limit(parser)
    chosen = parser.parse_args()
    figures = measure(chosen.rays, chosen.ray_limit)
    chosen.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def measure(count: int, ray_limit: int) -> dict[str, Any]:
    """By distance the rays that each engine loses and invents; also the machine, and peers without packages."""
    mesh, rows, left_out = box(), list[dict[str, Any]](), list[str]()
    for distance in DISTANCES:
        rays = rays_at_outlines(mesh, distance, count)
        right = is_hit(mesh, rays)
        answers = {name: _row(each, right) for name, each in _answers(mesh, rays, ray_limit, left_out)}
        rows.append({"value": distance, "hits": int(right.sum()), "answers": answers})
    machine = describe()
    del machine["time"]
    left_out = list(dict.fromkeys(left_out))
    return {"machine": machine, "left_out": left_out, "rays": count, "distances": rows}


def box() -> BenchMesh:
    """Makes a box from -0.5 to 0.5."""
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)], np.float32)
    triangles = np.array([row for a, b, c, d in SIDES for row in ((a, b, c), (a, c, d))], np.int32)
    return BenchMesh("box", corners, triangles)


def rays_at_outlines(mesh: BenchMesh, distance: int, count: int) -> Rays:
    """Rays from outside of a box, at vertices and at eighths of edges; a third of them are one float off."""
    random = np.random.default_rng(31)
    corners = mesh.positions.astype(np.float64)[mesh.triangles[random.integers(0, len(mesh.triangles), count)]]
    share = np.where(random.random((count, 1)) < 0.5, 0, random.integers(1, 8, (count, 1))) / 8
    targets = corners[:, 0] * (1.0 - share) + corners[:, 1] * share
    origins = random.integers(-8 * distance, 8 * distance + 1, (count, 3)) / 8
    rows, axis = np.arange(count), random.integers(0, 3, count)
    origins[rows, axis] = random.choice((-1, 1), count) * random.integers(5, 8 * distance + 1, count) / 8
    directions = (targets - origins).astype(np.float32)
    nudged = np.nextafter(directions, random.choice((-np.inf, np.inf), directions.shape).astype(np.float32))
    is_beside = (random.random((count, 1)) < 1 / 3) & (directions != 0)
    return Rays("outlines", origins.astype(np.float32), np.where(is_beside, nudged, directions))


def is_hit(mesh: BenchMesh, rays: Rays) -> npt.NDArray[np.bool_]:
    """(R,) by whole numbers."""
    columns = mesh.positions, mesh.triangles, rays.origins.astype(np.float64), rays.directions.astype(np.float64)
    return np.asarray((lines_meet(*columns) & (plane_distances(*columns) > 0.0)).any(axis=1))


def _answers(mesh: BenchMesh, rays: Rays, ray_limit: int, left_out: list[str]) -> Iterator[tuple[str, Answers]]:
    """Peers that take one ray a call get the first rays only."""
    makers: dict[str, Callable[[], peers.Peer]] = {
        "perfect_bvh": lambda: peers.ours(peers.scene_of(mesh), "perfect_bvh"),
        "embree": lambda: peers.embreex(mesh),
        "embree_robust": lambda: peers.embreex(mesh, is_robust=True),
        "BVHTree": lambda: peers.bvh_tree(mesh, ray_limit),
        "scene.ray_cast": lambda: peers.blender_scene(mesh, np.eye(4)[None], ray_limit),
    }
    for name, make in makers.items():
        try:
            peer = make()
        except ImportError as error:
            left_out.append(f"{name}: {error}")
            continue
        yield name, peer.answers(rays.pick(slice(peer.ray_limit)))


def _row(answers: Answers, right: npt.NDArray[np.bool_]) -> dict[str, float]:
    """Wrong rays with their 95 % confidence, and of those how many are made up."""
    expected, found = right[: len(answers.t)], answers.primitive_ids >= 0
    audit = Audit(len(found), np.flatnonzero(found != expected), 0)
    low, high = audit.interval
    made_up = 1e6 * float(np.mean(found & ~expected))
    return {
        "rays": len(found),
        "wrong_per_million": audit.wrong_per_million,
        "low": low,
        "high": high,
        "made_up_per_million": made_up,
    }


if __name__ == "__main__":
    main()
