"""A ray hits a triangle if and only if its line meets the closed triangle in exact arithmetic.

Edges and vertices count. The rays here pass exactly through vertices and points of edges. A million of them:
`python tests/engine/test_exact_hits.py`, with tests/ on the path.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes
from oracles.exact_rays import F64, lines_meet, plane_distances
from perfect_bvh._tuning import Traced

SHAPES = ("box", "sphere", "grid", "slivers")
SCALES = (1e-6, 1.0, 3.7, 1e6)
OFFSETS = (0.0, 1.0, 1e3, 1e6)
KINDS = ("vertices", "edges", "silhouettes")
# Turned by a quarter, mirrored and four times as large: instances map rays without rounding.
TURNED = np.array([(0.0, -4.0, 0.0, 0.0), (0.0, 0.0, 4.0, 0.0), (4.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)])


@dataclass(frozen=True)
class Case:
    positions: np.ndarray
    triangles: np.ndarray
    origins: F64
    directions: F64


def unit_mesh(shape: str) -> meshes.Mesh:
    if shape == "box":
        corners = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return corners, np.array([side for a, b, c, d in sides for side in ((a, b, c), (a, c, d))], np.int32)
    if shape == "sphere":
        return meshes.sphere(9, 8)
    return meshes.grid(8) if shape == "grid" else meshes.slivers(80, 3)


def exact_targets(positions: np.ndarray, triangles: np.ndarray, kind: str, count: int, random) -> F64:
    """Vertices, or points of edges that doubles hold exactly: a + k / 8 (b - a)."""
    corners = positions.astype(np.float64)[triangles[random.integers(0, len(triangles), count)]]
    if kind == "vertices":
        return corners[:, 0]
    share = random.integers(1, 8, (count, 1)) / 8.0
    return corners[:, 0] + share * (corners[:, 1] - corners[:, 0])


def make_case(shape: str, scale: float, offset: float, kind: str, count: int, seed: int) -> Case:
    """Rays from inside, outside and far away whose lines pass through the targets exactly, if doubles allow it."""
    random = np.random.default_rng(seed)
    unit, triangles = unit_mesh(shape)
    positions = (unit * scale + offset).astype(np.float32)
    targets = exact_targets(positions, triangles, kind, count, random)
    size = float(np.ptp(positions, axis=0).max()) or scale
    # Directions of few bits, and a whole number of steps back along them: the origin is then exact for most targets.
    unit_step = 2.0 ** np.floor(np.log2(size) - 6)
    directions = random.integers(-60, 61, (count, 3)).astype(np.float64)
    directions[~directions.any(axis=1)] = (0.0, 0.0, 1.0)
    if kind == "silhouettes":  # along the sides of boxes and grids, and through the points of others
        directions[np.arange(count), random.integers(0, 3, count)] = 0.0
        directions[~directions.any(axis=1)] = (0.0, 0.0, 1.0)
    directions *= unit_step
    steps = random.choice([0.125, 1.0, 2.0, 5.0, 64.0, 2.0**20], (count, 1))
    origins = targets - steps * directions
    as_floats = random.random(count) < 0.5  # float32 input: exact for some, next to the edge for the others
    origins[as_floats] = origins[as_floats].astype(np.float32)
    directions[as_floats] = (targets[as_floats] - origins[as_floats]).astype(np.float32)
    directions[~directions.any(axis=1)] = (0.0, 0.0, unit_step)
    return Case(positions, triangles, origins, directions)


def make_scene(case: Case, transform: np.ndarray) -> perfect_bvh.Scene:
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(case.positions, case.triangles), transform)
    scene.commit()
    return scene


def unlike(case: Case) -> int:
    """How many rays any query answers differently from exact arithmetic, through instances and without."""
    met = lines_meet(case.positions, case.triangles, case.origins, case.directions)
    t = plane_distances(case.positions, case.triangles, case.origins, case.directions)
    wrong = wrong_answers(make_scene(case, np.eye(4)), met, t, case.origins, case.directions)
    turned = case.origins @ TURNED[:3, :3].T, case.directions @ TURNED[:3, :3].T
    return int((wrong | wrong_answers(make_scene(case, TURNED), met, t, *turned)).sum())


def wrong_answers(scene: perfect_bvh.Scene, met: np.ndarray, t: F64, *rays: F64, times: float = 0.0) -> np.ndarray:
    """True for each ray that a query answers differently. met, t: (rays, triangles), of their lines."""
    # Which side of its origin a ray meets a triangle on is a question of t, which is rounded.
    clear = ~(met & (np.abs(t) < 1e-12)).any(axis=1)
    met = met & (t > 0.0)
    expected = met.sum(axis=1)
    wrong = scene.count_intersections(*rays, times=times) != expected
    wrong |= scene.test_occlusions(*rays, times=times) != (expected > 0)
    for strategy in ("stream", "packets"):
        hits = Traced(scene, strategy).cast_rays(*rays, times=times)
        nearest = np.where(met, t, np.inf).min(axis=1)
        wrong |= hits.is_hit != (expected > 0)
        wrong |= hits.is_hit & ~np.isclose(hits.t_hit, nearest.astype(np.float64), rtol=2.0**-22, atol=0.0)
    listed, rows = scene.list_intersections(*rays, times=times)
    found = np.zeros_like(met)
    for row in range(len(met)):
        found[row, listed.primitive_ids[rows[row] : rows[row + 1]]] = True
    wrong |= (found != met).any(axis=1)
    return wrong & clear


@pytest.mark.parametrize("isa", perfect_bvh.available_isas())
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_hits_are_exact(shape: str, kind: str, isa: str) -> None:
    perfect_bvh.set_active_isa(isa)
    try:
        for number, (scale, offset) in enumerate([(1.0, 0.0), (1e-6, 0.0), (3.7, 1e3), (1e6, 1e6)]):
            assert unlike(make_case(shape, scale, offset, kind, 300, number)) == 0, (scale, offset)
    finally:
        perfect_bvh.set_active_isa(None)


@pytest.mark.parametrize("isa", perfect_bvh.available_isas())
@pytest.mark.parametrize(
    "exponents", [(-22, -36, 0), (-24, -38, 0), (-30, -46, 0), (-53, -73, 0), (-130, -145, 0), (-80, -100, 40)]
)
def test_hits_of_triangles_that_are_tiny_beside_their_mesh_are_exact(exponents: tuple[int, ...], isa: str) -> None:
    """Seen from as far away as the mesh reaches, their corners round to nearly the same floats."""
    random = np.random.default_rng(11)
    place, size, reach = (2.0**exponent for exponent in exponents)
    middles = random.integers(-8, 9, (60, 1, 3)) * place / 8
    tiny = middles + random.integers(-4, 5, (60, 3, 3)) * size / 4
    far = np.array([[(1, 1, 1), (1, 1.5, 1), (1, 1, 1.5)]])
    positions = (reach * np.concatenate([tiny, far]).reshape(-1, 3)).astype(np.float32)
    triangles = np.arange(len(positions), dtype=np.int32).reshape(-1, 3)
    corners = positions.astype(np.float64).reshape(-1, 3, 3)[random.integers(0, 60, 120)]
    share = random.integers(0, 5, (120, 1)) / 4
    targets = np.where(
        random.random((120, 1)) < 0.3, corners.mean(axis=1), corners[:, 0] * share + corners[:, 1] * (1 - share)
    )
    directions = random.integers(-8, 9, (120, 3)) * reach / 4.0
    directions[~directions.any(axis=1)] = reach
    origins = targets - random.choice([0.5, 1.0, 2.0], (120, 1)) * directions
    case = Case(positions, triangles, origins, directions)
    perfect_bvh.set_active_isa(isa)
    try:
        assert unlike(case) == 0
    finally:
        perfect_bvh.set_active_isa(None)


@pytest.mark.parametrize("shape", ["box", "grid"])
def test_hits_of_moving_shapes_are_exact(shape: str) -> None:
    """At a time between its steps a mesh has its positions there, rounded to floats: here they are whole numbers."""
    case = make_case(shape, 8.0, 0.0, "vertices", 300, 5)
    scene = perfect_bvh.Scene()
    mesh = scene.add_mesh(case.positions, case.triangles)
    scene.add_instance(mesh)
    way = np.array([2.0, 4.0, -6.0], np.float32)
    scene.set_mesh_motion(mesh, np.stack([case.positions - way, case.positions + way]))
    scene.commit()
    met = lines_meet(case.positions, case.triangles, case.origins, case.directions)
    t = plane_distances(case.positions, case.triangles, case.origins, case.directions)
    assert not wrong_answers(scene, met, t, case.origins, case.directions, times=0.5).any()


def rays_near_planes(positions: np.ndarray, triangles: np.ndarray, random) -> tuple[F64, F64]:
    """For each triangle 200 rays through it, from 3 and from 3e6 away, at angles of 2^-48 to 2^-31 to its plane."""
    corners = np.repeat(positions.astype(np.float64)[triangles], 200, axis=0)
    side = corners[:, 1] - corners[:, 0]
    normals = np.cross(side, corners[:, 2] - corners[:, 0])
    units = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    along = side / np.linalg.norm(side, axis=1, keepdims=True)
    turn = random.uniform(0, 2 * np.pi, (len(corners), 1))
    ways = np.cos(turn) * along + np.sin(turn) * np.cross(units, along)
    ways += 2.0 ** random.integers(-48, -30, (len(corners), 1)) * units * random.choice([-1, 1], (len(corners), 1))
    targets = np.einsum("rc,rcx->rx", random.dirichlet([2, 2, 2], len(corners)), corners)
    origins = targets + random.choice([3.0, 3e6], (len(corners), 1)) * ways
    return origins, targets - origins


@pytest.mark.parametrize("kind", ["at rest", "mirrored", "squeezed", "turning", "bending"])
def test_front_faces_are_those_that_culling_leaves(kind: str) -> None:
    """Rays almost in the planes of slivers, where a rounded product of normal and direction does not give the side."""
    random = np.random.default_rng(21)
    unlike_count = found = 0
    for _ in range(30):
        corners = random.normal(size=(3, 3))
        corners[2] = corners[0] + 0.4 * (corners[1] - corners[0]) + 2.0 ** -random.integers(14, 23) * corners[2]
        positions = corners.astype(np.float32)
        origins, directions = rays_near_planes(positions, np.array([[0, 1, 2]]), random)
        place = np.diag([-1.0 if kind == "mirrored" else 1.0, 1.0, 1.0 if kind == "at rest" else 1e-4, 1.0])
        scene = perfect_bvh.Scene()
        mesh = scene.add_mesh(positions, np.array([[0, 1, 2]]))
        instance = scene.add_instance(mesh, place)
        if kind == "turning":
            turned = np.array([(0.0, -1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0, 0, 0, 1.0)])
            scene.set_instance_motion([instance], np.stack([place[None], (turned @ place)[None]]))
        if kind == "bending":
            scene.set_mesh_motion(
                mesh, np.stack([positions, positions + random.normal(size=(3, 3)).astype(np.float32)])
            )
        scene.commit()
        times = np.where(random.random(len(origins)) < 0.5, 0.0, 2.0**-40).astype(np.float32)
        rays = {"t_min": -np.inf, "times": times if kind in ("turning", "bending") else 0.0}
        rays |= {"origins": origins @ place[:3, :3], "directions": directions @ place[:3, :3]}
        hits = scene.cast_rays(**rays, fields=("front_face", "t_hit"))
        fronts = scene.cast_rays(**rays, fields=("t_hit",), cull="back").is_hit
        unlike_count += int((hits.is_hit & (hits.front_face != fronts)).sum())
        found += int(hits.is_hit.sum())
    assert unlike_count == 0 and found > 200


@pytest.mark.parametrize("isa", perfect_bvh.available_isas())
@pytest.mark.parametrize("size", [1e-91, 1e-200, 1e-308, 5e-324])
def test_components_that_are_too_small_for_exact_products_count_as_zero(size: float, isa: str) -> None:
    """A ray that they would lead past an edge, or a vertex, hits it."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32), np.array([[0, 1, 2]])))
    scene.commit()
    origins = np.repeat([(0.0, 0.0, 1.0), (0.0, 0.5, 1.0), (0.5, 0.0, 1.0), (0.5, 0.5, 1.0)], 4, axis=0)
    directions = np.tile([(-size, 0.0, -1.0), (0.0, -size, -1.0), (size, size, -1.0), (-size, size, -1.0)], (4, 1))
    perfect_bvh.set_active_isa(isa)
    try:
        for strategy in ("stream", "packets"):
            traced = Traced(scene, strategy)
            assert traced.cast_rays(origins, directions).is_hit.all()
            assert traced.cast_rays(origins * 2.0**-40, directions * 2.0**-40).is_hit.all()
    finally:
        perfect_bvh.set_active_isa(None)
    assert not scene.cast_rays(origins[:1], [(-1e-80, 0.0, -1.0)]).is_hit.any()


def test_a_closed_mesh_is_crossed_an_even_number_of_times() -> None:
    """By rays that begin outside and touch no vertex or edge: points of edges are moved into a triangle."""
    positions, triangles = meshes.sphere(9, 8)
    positions = positions.astype(np.float32)
    random = np.random.default_rng(7)
    corners = positions.astype(np.float64)[triangles[random.integers(0, len(triangles), 20_000)]]
    share = 10.0 ** random.uniform(-16.0, -6.0, (len(corners), 1))
    targets = (corners[:, 0] + corners[:, 1]) / 2 * (1 - share) + share * corners[:, 2]
    origins = 5.0 * random.normal(size=targets.shape)
    origins *= np.maximum(1.0, 2.0 / np.linalg.norm(origins, axis=1, keepdims=True))
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles))
    scene.commit()
    met = lines_meet(positions, triangles, origins, targets - origins)
    assert (scene.count_intersections(origins, targets - origins) == met.sum(axis=1)).all()
    assert (met.sum(axis=1) % 2 == 0).mean() > 0.95  # the others touch an edge: doubles hold some targets no nearer


def try_many(rays: int) -> int:
    """Print the number of rays answered differently for each case; return their sum."""
    total = 0
    cases = [(s, k, c, o) for s in SHAPES for k in KINDS for c in SCALES for o in OFFSETS]
    for number, (shape, kind, scale, offset) in enumerate(cases):
        wrong = unlike(make_case(shape, scale, offset, kind, rays // len(cases), 1000 + number))
        total += wrong
        if wrong:
            print(f"{shape}, {kind}, scale {scale:g}, offset {offset:g}: {wrong} unlike", flush=True)  # noqa: T201
    print(f"{rays // len(cases) * len(cases)} rays: {total} unlike")  # noqa: T201
    return total


if __name__ == "__main__":
    sys.exit(try_many(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000) != 0)
