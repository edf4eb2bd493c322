"""Casts rays exactly through vertices and middles of edges of any meshes, and counts lost rays: there must be none.

    python tests/benchmarks/mesh_edges.py --json edges.json [--mesh FILE.npz ...] [--default-meshes]

Three kinds, a third of the rays each: directions of few bits; float32 origins all around, with doubles as directions;
and float32 for both. Those are left out whose line does not meet its target exactly. A triangle with a corner or a side
there is met, unless the line lies in its plane. A ray is lost if it misses, or hits farther away, although there is
such a triangle; it is counted as unlisted if its list of intersections lacks one. Where a mesh is closed, rays from
outside past edges, as closely as doubles can represent, cross it an even number of times, except those that meet an
edge exactly.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np
import numpy.typing as npt
import perfect_bvh
from benchmarks import options
from benchmarks.meshes import BenchMesh
from benchmarks.peers import scene_of
from perfect_bvh._tuning import Traced
from tqdm import tqdm

KINDS = ("few bits", "any direction", "float32")
ROUNDED = 2.0**-22  # of t, which is a float
AT_ONCE = 10_000  # rays, whose intersections are listed together
TERMS = ((1, 0, 1, 2), (-1, 0, 2, 1), (1, 1, 2, 0), (-1, 1, 0, 2), (1, 2, 0, 1), (-1, 2, 1, 0))  # of a triple product
BY_FRACTIONS = 100  # rays of each kind at each mesh that are looked at again
F64, Ints, Bools = npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Aimed:
    """Rays whose lines meet targets exactly. t: of those. sides: (R, 2) vertices that the target lies between."""

    origins: F64
    directions: F64
    t: F64
    sides: Ints

    def pick(self, rows: Any) -> Aimed:
        return Aimed(self.origins[rows], self.directions[rows], self.t[rows], self.sides[rows])


def main() -> None:
    """Measure, write the JSON; fail if a ray is lost."""
    parser = options.parser(__doc__ or "", is_timed=False)
    options.add_meshes(parser)
    parser.add_argument("--rays", type=int, default=60_000, metavar="N", help="at each mesh, before any are left out")
    chosen = options.parse(parser)
    rows = [measure(mesh, chosen.rays) for mesh in tqdm(options.meshes_of(chosen), unit="mesh")]
    for row in rows:
        print(", ".join(f"{name} {value:,}" if name != "name" else str(value) for name, value in row.items()))
    options.save(chosen, {"meshes": rows})
    if any(row["lost"] or row["unlisted"] or row.get("odd", 0) for row in rows):
        raise SystemExit("rays were lost, or crossed a closed mesh an odd number of times")


def measure(mesh: BenchMesh, count: int) -> dict[str, Any]:
    """How many rays were cast at a mesh, and how many of them were lost."""
    scene, random = scene_of(mesh), np.random.default_rng(41)
    row: dict[str, Any] = {"name": mesh.name, "triangles": len(mesh.triangles)}
    row |= dict.fromkeys((*KINDS, "rays", "lost", "unlisted"), 0)
    around = Neighbours(mesh.triangles)
    for kind in KINDS:
        rays = aim(mesh, kind, count // len(KINDS), random)
        check_by_fractions(mesh, rays.pick(slice(BY_FRACTIONS)))
        for start in range(0, len(rays.t), AT_ONCE):
            part = rays.pick(slice(start, start + AT_ONCE))
            lost, unlisted = lost_rays(mesh, scene, part, around)
            row[kind] += len(part.t)
            row["rays"] += len(part.t)
            row["lost"] += int(lost.sum())
            row["unlisted"] += int(unlisted.sum())
    if is_closed(mesh.triangles):
        row |= odd_crossings(mesh, scene, count // len(KINDS), random)
    return row


# Rays ----------------------------------------------------------------------------------------------------------------


def aim(mesh: BenchMesh, kind: str, count: int, random: np.random.Generator) -> Aimed:
    """A half at vertices, a half at middles of edges; those whose line meets it exactly are kept."""
    positions = mesh.positions.astype(np.float64)
    sides = mesh.triangles[random.integers(0, len(mesh.triangles), count)][:, :2].astype(np.int64)
    sides[: count // 2, 1] = sides[: count // 2, 0]
    targets = positions[sides].sum(axis=1) / 2
    reach = float(np.ptp(positions, axis=0).max())
    if kind == "few bits":
        unit = 2.0 ** np.floor(np.log2(reach) - 8)
        directions = random.integers(-255, 256, (count, 3)) * unit
        steps = random.choice([0.25, 1.0, 3.0, 64.0], count)
        origins = targets - steps[:, None] * directions
    elif kind == "any direction":
        way = random.normal(size=(count, 3))
        origins = positions.mean(axis=0) + way * (reach / np.linalg.norm(way, axis=1))[:, None]
        origins, steps = origins.astype(np.float32).astype(np.float64), np.ones(count)
        directions = targets - origins
    else:  # floats no more than a factor of two apart have a float as their difference (Sterbenz 1974)
        origins = (targets * random.uniform(0.5, 2.0, (count, 3))).astype(np.float32).astype(np.float64)
        directions, steps = (targets - origins).astype(np.float32).astype(np.float64), np.ones(count)
    rays = Aimed(origins, directions, steps, sides)
    return rays.pick(directions.any(axis=1) & _meet_targets(positions, rays))


def _meet_targets(positions: F64, rays: Aimed) -> Bools:
    """Whether origin + t * direction is the target. t * direction is a double; sums that are rounded count as no."""
    ends = positions[rays.sides]
    way = rays.t[:, None] * rays.directions
    reached, target = rays.origins + way, ends[:, 0] + ends[:, 1]
    is_exact = _is_exact(rays.origins, way, reached) & _is_exact(ends[:, 0], ends[:, 1], target)
    return np.asarray((is_exact & (2.0 * reached == target)).all(axis=1))


def _is_exact(a: F64, b: F64, total: F64) -> Bools:
    """Whether a + b was not rounded (Knuth's TwoSum)."""
    other = total - a
    return np.asarray(((a - (total - other)) + (b - other)) == 0.0)


def check_by_fractions(mesh: BenchMesh, rays: Aimed) -> None:
    """Raises ArithmeticError if a line does not meet its target."""
    for origin, direction, t, sides in zip(rays.origins, rays.directions, rays.t, rays.sides, strict=True):
        for o, d, (a, b) in zip(origin, direction, mesh.positions[sides].T, strict=True):
            if 2 * (Fraction(float(o)) + Fraction(float(t)) * Fraction(float(d))) != Fraction(float(a)) + Fraction(
                float(b)
            ):
                raise ArithmeticError(f"mesh_edges: a ray from {origin} along {direction} does not meet its target")


# Judging -------------------------------------------------------------------------------------------------------------


class Neighbours:
    """The triangles at each vertex."""

    def __init__(self, triangles: npt.NDArray[np.int32]) -> None:
        corners = triangles.ravel()
        self._triangles = triangles
        self._order = np.argsort(corners, kind="stable") // 3
        self._first = np.searchsorted(np.sort(corners), np.arange(corners.max() + 2))

    def at(self, sides: Ints) -> tuple[Ints, Ints]:
        """Rows of sides (R, 2), and triangles that have both vertices."""
        first, last = self._first[sides[:, 0]], self._first[sides[:, 0] + 1]
        rows = np.repeat(np.arange(len(sides)), last - first)
        within = np.arange(len(rows)) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
        found = self._order[first[rows] + within]
        has_both = (self._triangles[found] == sides[rows, 1][:, None]).any(axis=1)
        return rows[has_both], found[has_both]


def lost_rays(mesh: BenchMesh, scene: perfect_bvh.Scene, rays: Aimed, around: Neighbours) -> tuple[Bools, Bools]:
    """(R,) each: that miss their target by closest or any hits; whose lists lack a triangle at the target."""
    columns = rays.origins, rays.directions
    owners, triangles = around.at(rays.sides)
    is_met = ~_are_in_planes(mesh.positions[mesh.triangles[triangles]], rays.directions[owners])
    owners, triangles = owners[is_met], triangles[is_met]
    expected, unlisted = np.zeros(len(rays.t), np.bool_), np.zeros(len(rays.t), np.bool_)
    expected[owners] = True
    lost = ~scene.test_occlusions(*columns)
    for strategy in ("stream", "packets"):
        hits = Traced(scene, strategy).cast_rays(*columns, fields=("t_hit",))
        lost |= hits.t_hit > rays.t * (1.0 + ROUNDED)  # infinite on a miss
    listed, rows = scene.list_intersections(*columns)
    lost |= scene.count_intersections(*columns) != np.diff(rows)
    count = len(mesh.triangles)
    keys = np.repeat(np.arange(len(rays.t)), np.diff(rows)) * count + listed.primitive_ids
    unlisted[owners[~np.isin(owners * count + triangles, keys)]] = True
    return lost & expected, unlisted


def _are_in_planes(corners: npt.NDArray[np.float32], directions: F64) -> Bools:
    """Whether direction . (corner 1 - corner 0) x (corner 2 - corner 0) is zero: by doubles, else by fractions."""
    ends = corners.astype(np.float64)
    p, q = ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0]
    terms = np.stack([sign * directions[:, k] * p[:, i] * q[:, j] for sign, k, i, j in TERMS])
    size = np.abs(terms).sum(axis=0)
    result = size == 0.0
    for row in np.flatnonzero((np.abs(terms.sum(axis=0)) <= 2.0**-48 * size) & ~result):
        result[row] = _is_in_plane(ends[row].tolist(), directions[row].tolist())
    return np.asarray(result)


def _is_in_plane(corners: list[list[float]], direction: list[float]) -> bool:
    a, b, c = ([Fraction(x) for x in corner] for corner in corners)
    p, q = ([x - y for x, y in zip(end, a, strict=True)] for end in (b, c))
    return sum(sign * Fraction(direction[k]) * p[i] * q[j] for sign, k, i, j in TERMS) == 0


# Closed meshes -------------------------------------------------------------------------------------------------------


def is_closed(triangles: npt.NDArray[np.int32]) -> bool:
    """Whether an even number of triangles is at every edge."""
    edges = np.sort(triangles[:, [(0, 1), (1, 2), (2, 0)]].reshape(-1, 2), axis=1)
    return not (np.unique(edges, axis=0, return_counts=True)[1] % 2).any()


def odd_crossings(mesh: BenchMesh, scene: perfect_bvh.Scene, count: int, random: np.random.Generator) -> dict[str, int]:
    """For rays from outside of a closed mesh, aimed closely past edges; those that meet one are left out."""
    positions = mesh.positions.astype(np.float64)
    corners = positions[mesh.triangles[random.integers(0, len(mesh.triangles), count)]]
    share = 10.0 ** random.uniform(-16.0, -3.0, (count, 1))
    targets = (corners[:, 0] + corners[:, 1]) / 2 * (1 - share) + share * corners[:, 2]
    low, high = positions.min(axis=0), positions.max(axis=0)
    way = random.normal(size=targets.shape)
    origins = (low + high) / 2 + way * (float(np.linalg.norm(high - low)) / np.linalg.norm(way, axis=1))[:, None]
    directions = targets - origins
    crossings = scene.count_intersections(origins, directions)
    odd = np.flatnonzero(crossings % 2)
    listed, rows = scene.list_intersections(origins[odd], directions[odd])
    at_edges = sum(
        any(
            _meets_edge(corners_of, origin, direction)
            for corners_of in positions[mesh.triangles[listed.primitive_ids[first:last]]]
        )
        for origin, direction, first, last in zip(origins[odd], directions[odd], rows[:-1], rows[1:], strict=True)
    )
    return {"past edges": count, "crossings": int(crossings.sum()), "at edges": at_edges, "odd": len(odd) - at_edges}


def _meets_edge(corners: F64, origin: F64, direction: F64) -> bool:
    """Whether the line of a ray that meets a triangle meets one of its edges, by fractions."""
    o, d = ([Fraction(x) for x in vector.tolist()] for vector in (origin, direction))
    seen = [[Fraction(x) - y for x, y in zip(corner, o, strict=True)] for corner in corners.tolist()]
    for p, q in ((seen[0], seen[1]), (seen[1], seen[2]), (seen[2], seen[0])):
        if sum(d[i] * (p[i - 2] * q[i - 1] - p[i - 1] * q[i - 2]) for i in range(3)) == 0:
            return True
    return False


if __name__ == "__main__":
    main()
