"""Positions lie where the ray meets the plane of the triangle that it hits, also on triangles of kilometres.

Judged by rational arithmetic: no rounding at all.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import perfect_bvh
import pytest
from oracles import meshes

RAYS = 200
FIELDS = ("positions", "primitive_ids", "instance_ids", "primitive_uvs", "t_hit")


def exactly(vector):
    return [Fraction(float(number)) for number in vector]


def meeting_point(corners, origin, direction):
    """Where a ray meets the plane through three corners, as fractions."""
    v0, v1, v2 = corners
    a, b = ([p - q for p, q in zip(other, v0, strict=True)] for other in (v1, v2))
    normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    above = sum(n * (p - o) for n, p, o in zip(normal, v0, origin, strict=True))
    t = above / sum(n * d for n, d in zip(normal, direction, strict=True))
    return [o + t * d for o, d in zip(origin, direction, strict=True)]


def errors(hits, positions, triangles, origins, directions, place=None):
    """The largest difference of each position from the exact one. place: (3, 4), object to world."""
    found = []
    for row in range(len(origins)):
        corners = [exactly(positions[vertex]) for vertex in triangles[hits.primitive_ids[row]]]
        if place is not None:
            matrix = [exactly(line) for line in place]
            corners = [[sum(m * c for m, c in zip(line, [*p, 1], strict=True)) for line in matrix] for p in corners]
        exact = meeting_point(corners, exactly(origins[row]), exactly(directions[row]))
        found.append(max(abs(Fraction(float(p)) - e) for p, e in zip(hits.positions[row], exact, strict=True)))
    return np.array([float(error) for error in found])


def hits_of(positions, triangles, origins, directions, place=None):
    """Returns the hits in a scene of one mesh. place: as for `errors`."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(positions, triangles), place)
    scene.commit()
    return scene.cast_rays(origins, directions, fields=FIELDS)


def turned(angles):
    """A rotation about x, then about z."""
    (a, b), (c, d) = np.cos(angles), np.sin(angles)
    return np.array([(b, -d, 0), (d, b, 0), (0, 0, 1)]) @ np.array([(1, 0, 0), (0, a, -c), (0, c, a)])


def rays_onto_the_middle(seed):
    """Rays from 0.5 to 3 above the plane z = 0 onto the 10 x 10 in its middle."""
    random = np.random.default_rng(seed)
    targets = np.column_stack([random.uniform(-5.0, 5.0, (RAYS, 2)), np.zeros(RAYS)])
    origins = np.column_stack([random.uniform(-5.0, 5.0, (RAYS, 2)), random.uniform(0.5, 3.0, RAYS)])
    return origins, (targets - origins) * random.uniform(0.1, 10.0, (RAYS, 1))


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.02, 0.7), (1.0, 2.0)])
@pytest.mark.parametrize("half", [10.0, 100.0, 1500.0, 1e5])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_on_the_ground(half, tilt, dtype):
    square, triangles = meshes.grid(1, half)
    rotation = turned(tilt)
    positions = (square @ rotation.T).astype(np.float32)
    origins, directions = (rays @ rotation.T for rays in rays_onto_the_middle(3))
    origins, directions = origins.astype(dtype), directions.astype(dtype)
    hits = hits_of(positions, triangles, origins, directions)
    assert hits.is_hit.all()
    assert errors(hits, positions, triangles, origins, directions).max() <= 2.0**-45 * half


@pytest.mark.parametrize("distance", [0.0, 1e4, 1e6])
def test_through_an_instance(distance):
    """The ground of 3 km, scaled unevenly, turned, and moved away."""
    positions, triangles = meshes.grid(1, 1500.0)
    place = np.column_stack([turned((0.3, 1.1)) * (2.0, 0.5, 1.5), distance * np.array([0.6, -0.8, 0.3])])
    rays = rays_onto_the_middle(4)
    origins, directions = rays[0] @ place[:, :3].T + place[:, 3], rays[1] @ place[:, :3].T
    hits = hits_of(positions.astype(np.float32), triangles, origins, directions, place)
    assert hits.is_hit.all()
    assert errors(hits, positions, triangles, origins, directions, place).max() <= 2.0**-45 * (3000.0 + distance)


@pytest.mark.parametrize(("thinness", "aside", "far"), [(1.0, (-12, -6), (3, 6)), (1e-3, (-15, -8), (0, 2))])
def test_edge_on_and_thread_thin(thinness, aside, far):
    """Where the plane does not determine a position, it is still on its triangle.

    aside, far: powers of ten, by how much rays leave the plane and from how many triangles away they come.
    """
    positions, triangles = meshes.slivers(3000, 5)
    positions = positions.astype(np.float32)
    first, third = positions[triangles[:, 0]], positions[triangles[:, 2]]
    positions[triangles[:, 2]] = first + np.float32(thinness) * (third - first)
    corners = positions[triangles].astype(np.float64)
    sizes = np.ptp(corners, axis=1).max(axis=1)
    random = np.random.default_rng(6)
    along = corners[:, 1] - corners[:, 0] + 0.3 * (corners[:, 2] - corners[:, 0])
    turns = random.normal(size=along.shape) * (sizes * 10.0 ** random.uniform(*aside, len(along)))[:, None]
    directions = along + turns
    origins = corners.mean(axis=1) - directions * 10.0 ** random.uniform(*far, (len(along), 1))
    hits = hits_of(positions, triangles, origins, directions)
    assert hits.is_hit.sum() > 300
    struck, where = corners[hits.primitive_ids[hits.is_hit]], hits.positions[hits.is_hit]
    beyond = np.maximum(struck.min(axis=1) - where, where - struck.max(axis=1)).max(axis=1)
    assert (beyond <= 1e-6 * sizes[hits.primitive_ids[hits.is_hit]]).all()


def test_normals_of_tiny_triangles_far_from_the_origin() -> None:
    random = np.random.default_rng(0)
    for _ in range(50):
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        corners = random.normal(size=(3, 3)).astype(np.float32)
        matrix = np.column_stack([turn * 1e-6, random.normal(size=3) * 1e6])
        scene = perfect_bvh.Scene()
        scene.add_instance(scene.add_mesh(corners, [(0, 1, 2)]), matrix)
        scene.commit()
        edges = matrix[:, :3] @ (corners[1:].astype(float) - corners[0]).T
        normal = np.cross(edges[:, 0], edges[:, 1])
        normal /= np.linalg.norm(normal)
        middle = matrix[:, :3] @ corners.astype(float).mean(axis=0) + matrix[:, 3]
        hit = scene.cast_rays(middle - normal, normal, fields=("t_hit", "geometric_normals", "front_face"))
        if hit.is_hit:
            np.testing.assert_allclose(hit.geometric_normals, normal, atol=1e-6)
            assert not hit.front_face


@pytest.mark.parametrize("exponent", [0, 100, 126, 140, 149, 160, 400])
@pytest.mark.parametrize("kind", ["triangle", "point"])
def test_distances_of_directions_so_long_that_t_is_hardly_a_float(kind, exponent):
    scene = perfect_bvh.Scene()
    if kind == "triangle":
        made = scene.add_mesh(np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32), np.array([[0, 1, 2]]))
    else:
        made = scene.add_points(np.zeros((1, 3)), 0.25)
    scene.add_instance(made)
    scene.commit()
    far = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
    hits = scene.cast_rays(far, [[0.0, 0.0, -1.5 * 2.0**exponent]], t_min=-np.inf, fields=("distances", "t_hit"))
    expected = [1.0, -1.0] if kind == "triangle" else [0.75, -1.25]
    np.testing.assert_allclose(hits.distances, expected, rtol=2.0**-23)


def test_a_ray_that_begins_on_a_surface_is_at_no_distance():
    """Its point may be some roundings away."""
    scene = perfect_bvh.Scene()
    corners = np.array([(100.1, 0.3, 0.7), (101.3, 2.9, 0.4), (99.7, 0.1, 3.3)], np.float32)
    scene.add_instance(scene.add_mesh(corners, np.array([[0, 1, 2]])))
    scene.commit()
    hits = scene.cast_rays(corners, corners[::-1] + (3.0, 1.0, 2.0), t_min=-1e-3, fields=("distances", "t_hit"))
    assert (hits.distances[hits.t_hit == 0.0] == 0.0).all()
