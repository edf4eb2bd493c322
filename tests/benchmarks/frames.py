"""What each frame of an animation costs by each policy, updates and rays together, and what the governor decided.

    python tests/benchmarks/frames.py --json frames.json

Each frame is read once and given to all policies in turn, the order rotating. Times are the processor's, of one thread.
Rays go on from what the camera sees in random directions; a sample of them is timed and reckoned up to the number that
the governor was told. `sync.py --policies` sums the same up for more frames and rays.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import perfect_bvh
from benchmarks.machine import describe
from benchmarks.policies import TimedScene, exploding_records
from benchmarks.rounds import Spread
from benchmarks.sync import animated_records
from perfect_bvh_addon.bench.subject import bounced_rays, make_scene
from perfect_bvh_addon.sync.records import SceneRecord
from perfect_bvh_addon.sync.state import SceneState
from tqdm import tqdm

ANIMATIONS = ("tree_in_wind", "cloth", "ocean", "exploding")
POLICIES = ("refit", "rebuild", "governed")
SAMPLE = 30_000  # rays that are timed
Row = dict[str, Any]


def main() -> None:
    """Measure, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--frames", type=int, default=24, metavar="N", help="of each animation")
    add("--rays", type=int, default=1_500_000, metavar="N", help="that follow each update")
    add("--rounds", type=int, default=3, metavar="N", help="times that each animation is played")
    add("--only", default="", metavar="NAME", help="animations whose name contains this")
    chosen = parser.parse_args()
    perfect_bvh.set_thread_count(1)
    results = []
    for name in tqdm([each for each in ANIMATIONS if chosen.only in each], unit="animation"):
        records = exploding_records() if name == "exploding" else animated_records(name)
        results.append(play(name, list(itertools.islice(records, chosen.frames)), chosen.rays, chosen.rounds))
    perfect_bvh.set_thread_count(0)
    chosen.json.parent.mkdir(parents=True, exist_ok=True)
    figures = {"machine": describe(), "rays": chosen.rays, "animations": results}
    chosen.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def play(name: str, records: list[SceneRecord], rays: int, rounds: int) -> Row:
    """One animation, so many times."""
    runs = [_play_once(records, rays, number) for number in range(rounds)]
    frames = []
    for place, record in enumerate(records):
        row: Row = {"frame": record.frame, "policies": {}}
        for policy in POLICIES:
            rows = [run[place][policy] for run in runs]
            kept = {key: rows[-1][key] for key in ("actions", "reasons")}
            times = {key: Spread.of([each[key] for each in rows]).as_json() for key in ("update_ms", "all_ms")}
            row["policies"][policy] = {**times, **kept}
        frames.append(row)
    return {"name": name, "triangles": sum(len(mesh.triangles) for mesh in records[0].meshes), "frames": frames}


def _play_once(records: list[SceneRecord], rays: int, number: int) -> list[dict[str, Row]]:
    states = {policy: SceneState(lambda policy=policy: TimedScene(policy)) for policy in POLICIES}
    rows = []
    for place, record in enumerate(records):
        look = make_scene(record)
        look.commit()
        origins, directions = bounced_rays(record, look)
        batch = origins[:: max(1, len(origins) // SAMPLE)], directions[:: max(1, len(origins) // SAMPLE)]
        row: dict[str, Row] = {}
        turn = (place + number) % len(POLICIES)
        order = POLICIES[turn:] + POLICIES[:turn]
        for policy in order:
            report = states[policy].update(record, expected_rays=rays)
            row[policy] = {
                "update_ms": states[policy].scene.milliseconds,  # type: ignore[attr-defined]
                "actions": sorted({mesh.action for mesh in report.commit.meshes}),
                "reasons": sorted({mesh.reason for mesh in report.commit.meshes})[:3],
            }
        least = dict.fromkeys(order, float("inf"))
        for policy in (*order, *reversed(order)):
            started = time.thread_time()
            states[policy].scene.cast_rays(*batch, fields=("t_hit",), threads=1)  # type: ignore[attr-defined]
            least[policy] = min(least[policy], (time.thread_time() - started) * 1e3)
        for policy, milliseconds in least.items():
            row[policy]["all_ms"] = row[policy]["update_ms"] + milliseconds * rays / len(batch[0])
        rows.append(row)
    return rows


if __name__ == "__main__":
    main()
