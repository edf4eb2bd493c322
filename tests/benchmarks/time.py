"""Rays with individual times through objects that move within the shutter, compared with Embree's motion blur.

    python tests/benchmarks/time.py --json time.json

A walking crowd, a tree in the wind, an explosion, turning stones and a car in a street that does not move, made from
seeds (`generated_motion.py`; `--detail` makes them smaller), of 2 and of 8 steps. For each: primary, diffuse and
occlusion rays at random times through ours and Embree's; the same kinds of rays through the scene frozen half-way, ours
and Embree's; and those with times where nothing moves. All on one thread, from C++. A sample of answers is judged by
the double-precision oracle, through Python.

The JSON holds `rows`, the output of native/benchmarks/time_bench.cpp for each scene with its name and the number of
`wrong` among the `judged` answers; and `goals`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
from benchmarks import generated_motion, options
from benchmarks.generated_motion import BenchMotion
from benchmarks.native import NativePrograms
from benchmarks.tables import Cell, format_goals, format_table
from tqdm import tqdm

PROGRAM = "time_bench"
KINDS = ("primary", "diffuse", "occlusion")
PEERS = ("embree", "ours", "embree still", "ours still", "ours still with times")
Row = dict[str, Any]
Ratios = dict[tuple[str, str], float]  # by scene and kind of ray


def main() -> None:
    """Measure, print the tables, write the JSON."""
    parser = options.parser(__doc__ or "")
    parser.add_argument("--detail", type=float, default=1.0, metavar="X", help="triangles and instances, times this")
    parser.add_argument("--scenes", nargs="+", choices=list(generated_motion.MAKERS), help="all, if not given")
    parser.add_argument("--steps", nargs="+", type=int, default=[2, 8], help="of each motion")
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS), help="of rays")
    parser.add_argument("--visits", action="store_true", help="tell what our rays visit, counted in another run")
    parser.add_argument("--judged", type=int, default=50_000_000, metavar="N", help="pairs of a ray and a triangle")
    chosen = options.parse(parser)
    native = NativePrograms(chosen.native)
    if not native.has(PROGRAM):
        raise SystemExit(native.why_not(PROGRAM))
    words = ["--rounds", str(chosen.rounds), "--size", chosen.size, "--kinds", ",".join(chosen.kinds)]
    words += ["--visits"] if chosen.visits else []
    scenes = [(name, steps) for steps in chosen.steps for name in chosen.scenes or generated_motion.MAKERS]
    rows: list[Row] = []
    for name, steps in tqdm(scenes, unit="scene", desc="time"):
        scene = generated_motion.MAKERS[name](chosen.detail, steps)
        inside = ["--inside"] if scene.is_inside else []
        rows.append(
            {"name": scene.name, **native.run(PROGRAM, scene, [*words, *inside]), **judge(scene, chosen.judged)}
        )
    goals = list_goals(rows)
    print(describe(rows) + "\n\n" + format_goals(goals))
    options.save(chosen, {"rows": rows, "goals": goals})


def judge(scene: BenchMotion, pairs: int) -> Row:
    """Rays from around the scene towards points in it, at random times: how many answers the oracle calls wrong."""
    count = int(np.clip(pairs // scene.triangle_count, 20, 5_000))
    random = np.random.default_rng(71)
    made = scene.scene()
    low, high = scene.bounds()
    target = random.uniform(low, high, (count, 3))
    origin = (low + high) / 2 + np.linalg.norm(high - low) * random.normal(size=(count, 3))
    times = random.uniform(0.0, 1.0, count)
    hits = made.cast_rays(origin, target - origin, times=times, audit=1.0)
    return {"judged": count, "judged_hits": int(hits.is_hit.sum()), "wrong": len(hits.audit.wrong_rows)}


def speeds(row: Row) -> dict[str, dict[str, float]]:
    """M rays/s by kind of ray and competitor."""
    by: dict[str, dict[str, float]] = {}
    for ray in row["rays"]:
        by.setdefault(ray["rays"], {})[ray["competitor"]] = ray["mrays_per_second"]
    return by


def ratios(rows: list[Row], competitor: str, to: str) -> Ratios:
    """How many times as fast."""
    return {(row["name"], kind): speed[competitor] / speed[to] for row in rows for kind, speed in speeds(row).items()}


def list_goals(rows: list[Row]) -> list[Row]:
    """Each goal, the figure reached, and where the worst figure is."""
    peer = ratios(rows, "ours", "embree")
    cost, idle = ratios(rows, "ours still", "ours"), ratios(rows, "ours still", "ours still with times")
    mean = float(np.exp(np.mean(np.log(list(peer.values())))))
    return [
        _goal("rays / Embree's motion blur, geometric mean", mean, 1.15, f"of {len(peer)}"),
        _goal("rays / Embree's motion blur, least", *_at(min, peer, 0.95)),
        _goal("moving, of the frozen scene's cost, most", *_at(max, cost, 1.4), is_most=True),
        _goal("nothing moves, of the cost without times, most", *_at(max, idle, 1.02), is_most=True),
    ]


def _at(choose: Callable[..., tuple[str, str]], values: Ratios, wanted: float) -> tuple[float, float, str]:
    where = choose(values, key=lambda key: values[key])
    return values[where], wanted, ", ".join(where)


def _goal(name: str, measured: float, wanted: float, where: str, *, is_most: bool = False) -> Row:
    reached = measured <= wanted if is_most else measured >= wanted
    return {"goal": name, "measured": measured, "wanted": wanted, "reached": reached, "where": where, "most": is_most}


def describe(rows: list[Row]) -> str:
    """A table of speeds and ratios."""
    lines: list[list[Cell]] = []
    for row in rows:
        for kind, speed in speeds(row).items():
            ours = next(ray for ray in row["rays"] if (ray["rays"], ray["competitor"]) == (kind, "ours"))
            costs = [speed["ours still"] / speed["ours"], speed["embree still"] / speed["embree"]]
            differ = 1e6 * ours["different_from_first"] / ours["ray_count"]
            cells: list[Cell] = [speed["ours"] / speed["embree"], *costs, differ, row["wrong"], row["judged"]]
            lines.append([f"{row['name']}, {kind}", *(speed[peer] for peer in PEERS), *cells])
    heads = ("M rays/s", *PEERS, "ours / embree", "moving / still", "embree's", "differ, ppm", "wrong", "of")
    return format_table(heads, lines)


if __name__ == "__main__":
    main()
