"""Small static meshes that are used once: a tree for each, one for each part of them, or one over all triangles.

    python tests/benchmarks/shared_tree.py --json shared_tree.json

Octahedra of 8 triangles, boxes of 12 and balls of 200 are spread at random. Apart, each is a mesh and an instance;
opened, each half of a box and each quarter of a ball is: so the top level reaches into the meshes, as if it opened its
instances (Benthin, Woop, Wald and Afra 2017), except that each part takes a separate row. An octahedron is one leaf and
is not split. Together, all is one mesh in world space. All give the same hits, which is checked. Times are the
processor's, of one thread, in turns: of adding and committing everything, of rays from all around towards places in the
scene, and of moving one of them: apart a new transform (opened: one for each part), together new positions of the whole
mesh and a refit. Visits are of nodes and instances, of a ray.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks.machine import describe
from benchmarks.rounds import Spread
from benchmarks.rows import write_rows
from benchmarks.tables import format_table

RAYS = 100_000
PARTS = {"octahedron": 1, "box": 2, "ball": 4}
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Mesh = tuple[Floats, Ints]


@dataclass(frozen=True, slots=True)
class Shapes:
    """positions: (V, 3) and triangles: (T, 3) of one; places: (N, 3) of all."""

    positions: Floats
    triangles: Ints
    places: Floats

    @property
    def whole(self) -> list[Mesh]:
        """One of them."""
        return [(self.positions, self.triangles)]

    def parts(self, count: int) -> list[Mesh]:
        """One of them in this number of parts, halved again and again across the longest side."""
        centres = self.positions[self.triangles].mean(axis=1)
        groups = [np.arange(len(self.triangles))]
        while len(groups) < count:
            rows = groups.pop(int(np.argmax([len(group) for group in groups])))
            axis = int(np.argmax(np.ptp(centres[rows], axis=0)))
            groups += np.array_split(rows[np.argsort(centres[rows, axis], kind="stable")], 2)
        meshes = []
        for rows in groups:
            vertices, corners = np.unique(self.triangles[rows].ravel(), return_inverse=True)
            meshes.append((self.positions[vertices], corners.reshape(-1, 3).astype(np.int32)))
        return meshes

    @property
    def merged(self) -> Mesh:
        """All of them in one mesh."""
        positions = (self.positions[None] + self.places[:, None]).reshape(-1, 3)
        firsts = np.arange(len(self.places), dtype=np.int32) * len(self.positions)
        return positions, (self.triangles[None] + firsts[:, None, None]).reshape(-1, 3)


def _octahedron() -> Mesh:
    positions = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)
    upper = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]], np.int32)
    return positions, np.concatenate([upper, np.where(upper == 2, 5, upper)[:, ::-1]])


def _ball(columns: int, rows: int) -> Mesh:
    """2 * columns * rows triangles, those at the poles without area."""
    u, v = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns + 1), indexing="ij")
    points = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    triangles = np.concatenate(
        [np.stack([corner, below, corner + 1], axis=1), np.stack([corner + 1, below, below + 1], axis=1)]
    )
    return points.astype(np.float32), triangles.astype(np.int32)


def _shapes(kind: str, count: int) -> Shapes:
    makers = {"octahedron": _octahedron, "box": lambda: _ball(3, 2), "ball": lambda: _ball(10, 10)}
    positions, triangles = makers[kind]()
    side = count ** (1 / 3) * 4.0  # a few of their sizes apart
    places = np.random.default_rng(1).uniform(0, side, (count, 3)).astype(np.float32)
    return Shapes(positions, triangles, places)


def _matrices(places: Floats) -> Floats:
    matrices = np.tile(np.eye(3, 4, dtype=np.float32), (len(places), 1, 1))
    matrices[:, :, 3] = places
    return matrices


class _Apart:
    def __init__(self, shapes: Shapes, parts: list[Mesh] | None = None) -> None:
        parts = parts or shapes.whole
        self._places = shapes.places.copy()
        self.scene = perfect_bvh.Scene()
        meshes = [self.scene.add_mesh(*part) for _ in shapes.places for part in parts]
        ids = self.scene.add_instances(meshes, _matrices(np.repeat(shapes.places, len(parts), axis=0)))
        self._ids = np.asarray(ids).reshape(-1, len(parts))
        self.scene.commit()

    def move_one(self, number: int) -> None:
        row = number % len(self._places)
        self._places[row] += 0.5
        ids = self._ids[row]
        self.scene.set_transforms(ids, _matrices(np.repeat(self._places[row : row + 1], len(ids), axis=0)))
        self.scene.commit()


class _Together:
    def __init__(self, shapes: Shapes) -> None:
        self._size = len(shapes.positions)
        self._positions, triangles = shapes.merged
        self.scene = perfect_bvh.Scene()
        self._mesh = self.scene.add_mesh(self._positions, triangles)
        self.scene.add_instance(self._mesh)
        self.scene.commit()

    def move_one(self, number: int) -> None:
        first = number * self._size % len(self._positions)
        self._positions[first : first + self._size] += 0.5
        self.scene.update_mesh(self._mesh, self._positions)
        self.scene.commit()


def _rays(shapes: Shapes) -> tuple[Floats, Floats]:
    random = np.random.default_rng(2)
    lower, upper = shapes.places.min(axis=0), shapes.places.max(axis=0)
    outward = random.normal(size=(RAYS, 3))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    origins = (lower + upper) / 2 + outward * np.linalg.norm(upper - lower)
    directions = random.uniform(lower, upper, (RAYS, 3)) - origins
    return origins.astype(np.float32), directions.astype(np.float32)


def measure(kind: str, count: int, rounds: int) -> dict[str, Any]:
    """The figures of one kind and number of shapes."""
    shapes = _shapes(kind, count)
    rays = _rays(shapes)
    parts = shapes.parts(PARTS[kind])
    makers: dict[str, Any] = {"apart": _Apart, "opened": lambda shapes: _Apart(shapes, parts), "together": _Together}
    if len(parts) == 1:
        del makers["opened"]
    times: dict[str, dict[str, list[float]]] = {
        name: {"build_ms": [], "trace_ms": [], "edit_ms": []} for name in makers
    }
    sizes, visits = {}, {}
    for number in range(rounds):
        hits = {}
        for name in list(makers)[:: 1 if number % 2 == 0 else -1]:
            row = times[name]
            started = time.thread_time()
            way = makers[name](shapes)
            row["build_ms"].append((time.thread_time() - started) * 1e3)
            started = time.thread_time()
            hits[name] = way.scene.cast_rays(*rays, threads=1)
            row["trace_ms"].append((time.thread_time() - started) * 1e3)
            visits[name] = float(way.scene.cast_rays(*rays, fields=["nodes_visited"]).nodes_visited.mean())
            started = time.thread_time()
            way.move_one(number)
            row["edit_ms"].append((time.thread_time() - started) * 1e3)
            sizes[name] = way.scene.statistics().byte_count
        _check(hits)
    figures = {
        name: {key: Spread.of(values).as_json() for key, values in row.items()}
        | {"byte_count": sizes[name], "visits": visits[name]}
        for name, row in times.items()
    }
    return {"kind": kind, "count": count, "triangles": count * len(shapes.triangles), "rays": RAYS, **figures}


def _check(hits: dict[str, Any]) -> None:
    """The same answers, except for rays so close to an edge that rounding a box's placement decides."""
    one = hits["together"]
    for name, other in hits.items():
        differ = one.is_hit != other.is_hit
        both = one.is_hit & other.is_hit
        differ[both] = np.abs(one.t_hit[both] - other.t_hit[both]) > 1e-4
        if differ.mean() > 1e-4:
            raise SystemExit(f"{int(differ.sum())} of {len(differ)} rays differ ({name})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument("--counts", type=int, nargs="+", default=[1_000, 10_000], metavar="N")
    options = parser.parse_args()
    perfect_bvh.set_thread_count(1)
    rows = [measure(kind, count, options.rounds) for kind in PARTS for count in options.counts]
    write_rows(options.json, {"machine": describe(), "rows": rows})
    keys = ("build_ms", "trace_ms", "edit_ms")
    table = [
        (
            row["kind"],
            row["count"],
            name,
            *(row[name][key]["median"] for key in keys),
            row[name]["visits"],
            row[name]["byte_count"] / 2**20,
        )
        for row in rows
        for name in ("apart", "opened", "together")
        if name in row
    ]
    sys.stdout.write(format_table(("shapes", "count", "trees", *keys, "visits", "MiB"), table) + "\n")


if __name__ == "__main__":
    main()
