"""Any bytes as a small mesh and rays at it: coincident, degenerate, flat and thin triangles, of any size.

Rays lie in their planes, on their edges and in their corners; every answer is the double-precision oracle's.
"""

from __future__ import annotations

import numpy as np
import perfect_bvh
from oracles.brute_force import WorldTriangles, certain_hits, judge
from oracles.closest_point import distances_to_triangles
from perfect_bvh.build_config import BUILDERS

from .bytes import Bytes, Features

COORDINATES = np.float32([0.0, 1.0, -1.0, 0.5, 0.25, 1.0 + 2.0**-23, 1e-7, -1e-3, 3.0, 0.1])
SCALES = (1.0, 1e-20, 1e-6, 1e5, 1e12)
VERTICES, TRIANGLES, RAYS = 12, 10, 40


def trace_hard_mesh(data: bytes) -> Features:
    """One mesh, asked in every way."""
    source = Bytes(data)
    scale = np.float32(source.pick(SCALES))
    build = perfect_bvh.BuildConfig(builder=source.pick(BUILDERS))
    triangles = np.array([[source.take(VERTICES) for _ in range(3)] for _ in range(TRIANGLES)], np.int32)
    positions = scale * np.array([[source.pick(COORDINATES) for _ in range(3)] for _ in range(VERTICES)], np.float32)
    # Origins and targets from the rest of the bytes, then pairs derived from them.
    random = np.random.default_rng(list(source.data))
    origins, targets = scale * random.choice(COORDINATES, (2, RAYS, 3))
    made = perfect_bvh.Scene()
    ident = made.add_instance(made.add_mesh(positions, triangles, build=build))
    made.commit()
    world = WorldTriangles.of([(ident, positions, triangles, np.eye(4), 0xFFFFFFFF)])
    with np.errstate(all="ignore"):
        features = _check_rays(made, world, origins, targets - origins)
    found = made.compute_closest_points(origins)
    expected = distances_to_triangles(origins, positions[triangles]).min(axis=1)
    assert np.abs(found.distances - expected).max() <= 1e-12 * 10.0 * scale
    return features | {("built", build.builder, str(scale))}


def _check_rays(
    made: perfect_bvh.Scene, world: WorldTriangles, origins: np.ndarray, directions: np.ndarray
) -> Features:
    hits = made.cast_rays(origins, directions)
    valid = np.any(directions != 0.0, axis=1)
    assert hits.invalid_count == (~valid).sum()
    assert not hits.is_hit[~valid].any()
    sent = origins[valid], directions[valid]
    verdict = judge(world, *sent, hits.t_hit[valid], hits.instance_ids[valid], hits.primitive_ids[valid])
    assert not verdict.wrong.any(), str(verdict)
    every, splits = made.list_intersections(*sent)
    sure, possible, _, _ = certain_hits(world, *sent)
    listed = np.zeros(sure.shape, int)
    np.add.at(listed, (np.repeat(np.arange(len(sure)), np.diff(splits)), every.primitive_ids), 1)
    assert listed.max(initial=0) <= 1
    assert not (sure & (listed == 0)).any()
    assert not ((listed == 1) & ~possible).any()
    most = int(np.diff(splits).max(initial=0))
    return {("met", str(most)), ("hit", str(hits.is_hit.any())), ("invalid", str((~valid).any()))}
