"""The speed and correctness of rays through trees that followed a deformation, over the size of the deformation.

    python tests/benchmarks/stability.py --json stability.json

A mesh is twisted, burst, flattened or sheared in one step, ever more, and its tree follows by each policy. Speeds are
shares of the one through a new tree, of rays from all around, on one thread. All answers are compared bit by bit
with the new tree's, and a part of them is audited in double precision; for comparison there are the answers of a tree
that was not updated.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.machine import describe
from benchmarks.rounds import Spread, run_rounds
from benchmarks.rows import write_rows
from oracles.meshes import sphere
from perfect_bvh._tuning import POLICIES, with_policy
from tqdm import tqdm

F64 = npt.NDArray[np.float64]
RAYS = 1_500_000  # passed to the governor


def twist(positions: F64, amount: float) -> F64:
    """Twists by this number of radians from end to end."""
    turn = amount * (positions[:, 2] - positions[:, 2].min()) / np.ptp(positions[:, 2])
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = positions[:, 0], positions[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y, positions[:, 2]], axis=1)


def explode(positions: F64, amount: float) -> F64:
    """Each triangle flies away in a different direction, by at most this number of radii."""
    random = np.random.default_rng(31)
    flight = random.normal(size=(len(positions) // 3, 3))
    flight /= np.linalg.norm(flight, axis=1, keepdims=True)
    return positions + np.repeat(flight * random.random((len(flight), 1)) * amount, 3, axis=0)


def flatten(positions: F64, amount: float) -> F64:
    """Scaled by one over this factor along a diagonal."""
    axis = np.full(3, 3.0**-0.5)
    return positions - np.outer(positions @ axis, axis) * (1.0 - 1.0 / amount)


def shear(positions: F64, amount: float) -> F64:
    """X moves by this multiple of z."""
    return positions + positions[:, 2:3] * np.array([amount, 0.3 * amount, 0.0])


MOTIONS: dict[str, tuple[Callable[[F64, float], F64], tuple[float, ...], float]] = {  # amounts, and the one at rest
    "twist": (twist, (0.1, 0.3, 1.0, 2.0, 4.0, 6.28, 12.6, 25.1), 0.0),
    "explosion": (explode, (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0), 0.0),
    "scale": (flatten, (1.1, 1.5, 2.0, 4.0, 10.0, 100.0, 1000.0), 1.0),
    "shear": (shear, (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0), 0.0),
}


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--rounds", type=int, default=5, metavar="N", help="interleaved casts")
    add("--rows", type=int, default=80, metavar="N", help="of the mesh's 2 N x 1.4 N triangles")
    add("--rays", type=int, default=6_000, metavar="N", help="a cast")
    chosen = parser.parse_args()
    perfect_bvh.set_thread_count(1)
    positions, triangles = sphere(chosen.rows, round(1.4 * chosen.rows))
    rest = positions * (1.0, 0.8, 3.0)
    motions = {}
    with tqdm(total=sum(len(amounts) for _, amounts, _ in MOTIONS.values()), unit="mesh") as bar:
        for name, (move, amounts, _) in MOTIONS.items():
            # The triangles of a bursting mesh share no vertices.
            loose = (rest[triangles].reshape(-1, 3), np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3))
            start, corners = loose if name == "explosion" else (rest, triangles)
            motions[name] = []
            for amount in amounts:
                policies, left_behind = measure(start, corners, move, amount, chosen)
                motions[name].append({"amount": amount, "policies": policies, "left_behind": left_behind})
                bar.update()
    perfect_bvh.set_thread_count(0)
    figures = {"machine": describe(), "triangles": len(triangles), "rays": chosen.rays, "motions": motions}
    write_rows(chosen.json, figures)


def measure(
    start: F64, triangles: npt.NDArray[np.int32], move: Callable[[F64, float], F64], amount: float, chosen: Any
) -> tuple[dict[str, Any], int]:
    """By policy: speed as a share of the new tree's, milliseconds of the update, answers that differ or are wrong.

    Also returns how many answers of the old tree differ.
    """
    moved = move(start, amount).astype(np.float32)
    origins, directions = _rays(moved, chosen.rays)
    scenes, rows = {}, {}
    for policy in POLICIES:
        scene = with_policy(perfect_bvh.Scene(), policy)
        mesh = scene.add_mesh(start.astype(np.float32), triangles, usage="deforming")
        scene.add_instance(mesh)
        scene.commit(expected_rays=RAYS)
        before = scene.snapshot()
        scene.update_mesh(mesh, moved)
        (report,) = scene.commit(expected_rays=RAYS).meshes
        scenes[policy] = scene
        rows[policy] = {"action": report.action, "update_ms": report.milliseconds}
    casts = {
        policy: (lambda scene=scene: scene.cast_rays(origins, directions, fields=("t_hit",), threads=1))
        for policy, scene in scenes.items()
    }
    times = {policy: np.array(seconds) for policy, seconds in run_rounds(casts, chosen.rounds).items()}
    wanted = scenes["rebuild"].cast_rays(origins, directions)
    late = before.cast_rays(origins, directions)
    left_behind = int((~_same(late, wanted)).sum())
    for policy, scene in scenes.items():
        hits = scene.cast_rays(origins, directions, audit=min(1.0, 300.0 / chosen.rays))
        assert hits.audit is not None
        rows[policy] |= {
            "speed": Spread.of((times["rebuild"] / times[policy]).tolist()).as_json(),
            "different": int((~_same(hits, wanted)).sum()),
            "audited": hits.audit.checked_count,
            "wrong": len(hits.audit.wrong_rows),
        }
    return rows, left_behind


def _same(hits: perfect_bvh.Hits, wanted: perfect_bvh.Hits) -> npt.NDArray[np.bool_]:
    return np.asarray((hits.t_hit == wanted.t_hit) & (hits.primitive_ids == wanted.primitive_ids))


def _rays(positions: npt.NDArray[np.float32], count: int) -> tuple[F64, F64]:
    """From all around towards random triangles' corners: most of them meet the shape however it is deformed."""
    random = np.random.default_rng(37)
    lower, upper = positions.min(axis=0).astype(np.float64), positions.max(axis=0).astype(np.float64)
    outward = random.normal(size=(count, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    origins = (lower + upper) / 2.0 + outward * np.linalg.norm(upper - lower)
    targets = positions[random.integers(0, len(positions), count)] + random.normal(0.0, 0.02, (count, 3))
    return origins, targets - origins


if __name__ == "__main__":
    main()
