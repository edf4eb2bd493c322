"""The table of hits: the hits of rays in twelve scenes, as hashes that are the same on every system and processor.

    python tests/hit_table/table.py            # compare this machine with recorded.json; exits with 1 where it differs
    python tests/hit_table/table.py --record   # write recorded.json: only where answers are meant to change

Needs numpy and the engine alone, and a few seconds. Each scene is traced by each instruction set and strategy; a row is
one of these, and all rows of a scene must have the scene's hashes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(TESTS))

import numpy as np
import perfect_bvh
from benchmarks.rows import write_rows
from hit_table.hashing import Doubles, between, mixed
from hit_table.scenes import SCENES, Made
from perfect_bvh._tuning import STRATEGIES, Traced

RECORD = TESTS / "hit_table" / "recorded.json"
FIELDS = ("t_hit", "instance_ids", "primitive_ids", "primitive_uvs")
Hashes = dict[str, str | int]
Record = dict[str, Hashes]


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(description="Compare what rays hit here with what they hit everywhere else.")
    parser.add_argument("--record", action="store_true", help="write the record instead of comparing with it")
    chosen = parser.parse_args(arguments)
    print(f"{platform.system()} {platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}")
    if chosen.record:
        write_rows(RECORD, record())
        return 0
    recorded, differing = load_record(), 0
    for name in SCENES:
        for row, hashes in rows_of(name):
            same = hashes == recorded[name]
            differing += not same
            print(f"{name:13}{row:28}{digest_of(hashes)}  {'same' if same else 'DIFFERS'}")
    print(f"{differing} rows differ from the record" if differing else "Every row is as recorded.")
    return 1 if differing else 0


def load_record() -> Record:
    """By scene, the hashes that every system must give."""
    recorded: Record = json.loads(RECORD.read_text(encoding="utf-8"))
    return recorded


def record() -> Record:
    """By scene, the hashes of this machine. Raises AssertionError where its own rows disagree."""
    found: Record = {}
    for name in SCENES:
        for row, hashes in rows_of(name):
            if found.setdefault(name, hashes) != hashes:
                raise AssertionError(f"{name}: {row} differs from the rows before it")
    return found


def rows_of(name: str) -> Iterator[tuple[str, Hashes]]:
    """Instruction set and strategy as words, with the hashes of their answers."""
    before = perfect_bvh.active_isa()
    try:
        made = SCENES[name]()
        for isa, strategy in product(perfect_bvh.available_isas(), STRATEGIES):
            perfect_bvh.set_active_isa(isa)
            yield f"{isa} {strategy}", hashes_of(made, strategy)
    finally:
        perfect_bvh.set_active_isa(before)


def digest_of(hashes: Hashes) -> str:
    """One short hash of a row."""
    return hashlib.sha256(json.dumps(hashes, sort_keys=True).encode()).hexdigest()[:16]


def hashes_of(made: Made, strategy: str) -> Hashes:
    """Returns the hash of each column of the hits, and the number of rays that hit."""
    rays = rays_about(made.centre)
    found: Hashes = {"hits": 0}
    for name, limits in (("all", {}), ("limited", limits_of(len(rays[0])))):
        hits = Traced(made.scene, strategy).cast_rays(*rays, fields=FIELDS, **limits)
        columns = {field: getattr(hits, field) for field in FIELDS}
        columns["occluded"] = Traced(made.scene, strategy).test_occlusions(*rays, **limits)
        found["hits"] = int(found["hits"]) + int(hits.is_hit.sum())
        for field, column in columns.items():
            little_endian = np.ascontiguousarray(column).astype(column.dtype.newbyteorder("<"))
            found[f"{name} {field}"] = hashlib.sha256(little_endian.tobytes()).hexdigest()
    return found


def rays_about(centre: Doubles) -> tuple[Doubles, Doubles]:
    """Scattered rays, a pinhole camera's, and rays along each axis through lattice points: (R, 3) float64 each."""
    pinhole = np.stack(np.broadcast_arrays(*np.ogrid[-20:20, -24:24], 40), axis=-1).reshape(-1, 3)[:, [1, 2, 0]] / 40.0
    line = np.arange(-8, 9) / 8.0
    lattice = np.stack([*np.meshgrid(line, line), np.full((17, 17), 3.0)], axis=-1).reshape(-1, 3)
    down = np.broadcast_to((0.0, 0.0, -1.0), lattice.shape)
    starts = [between(-2, 2, (1500, 3), 91), np.broadcast_to((0.0, -3.0, 0.125), pinhole.shape)]
    ways = [between(-1, 1, (1500, 3), 92), pinhole]
    for axis in range(3):
        starts.append(np.roll(lattice, axis, axis=1))
        ways.append(np.roll(down, axis, axis=1))
    return np.concatenate(starts) + centre, np.concatenate(ways)


def limits_of(count: int) -> dict[str, object]:
    """Where rays begin and end, the masks that they see, and which sides."""
    t_min = between(0, 1, (count,), 93) / 2.0
    t_max = 0.5 + between(0, 4, (count,), 94)
    mask = mixed(count, 95) >> np.uint32(29)
    return {"t_min": t_min.astype(np.float32), "t_max": t_max.astype(np.float32), "mask": mask, "cull": "back"}


if __name__ == "__main__":
    sys.exit(main())
