"""BVHTree and ray_cast give the answers of Blender's own functions, one by one and in arrays."""

from __future__ import annotations

import math
from typing import Any

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Vector
from mathutils.bvhtree import BVHTree as BlendersTree
from perfect_bvh_addon import BVHTree, ray_cast

RAYS = 300


@pytest.fixture(autouse=True)
def monkey() -> Any:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add(location=(1, 2, 3), rotation=(0.3, 0.2, 0.1))
    bpy.context.object.modifiers.new("Smooth", "SUBSURF")
    return bpy.context.object


def rays() -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    directions = random.normal(size=(RAYS, 3))
    unit = directions / np.linalg.norm(directions, axis=1)[:, None]
    return random.normal(scale=0.3, size=(RAYS, 3)) - 3.0 * unit, directions


def both(kind: str, monkey: Any) -> tuple[Any, Any]:
    """Build our tree and Blender's."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    if kind == "object":
        return BVHTree.FromObject(monkey, depsgraph), BlendersTree.FromObject(monkey, depsgraph)
    mesh = bmesh.new()
    mesh.from_mesh(monkey.data)
    if kind == "bmesh":
        return BVHTree.FromBMesh(mesh), BlendersTree.FromBMesh(mesh)
    vertices = [vertex.co for vertex in monkey.data.vertices]
    polygons = [list(polygon.vertices) for polygon in monkey.data.polygons]
    return BVHTree.FromPolygons(vertices, polygons), BlendersTree.FromPolygons(vertices, polygons)


def is_same(ours: Any, theirs: Any) -> bool:
    if ours[0] is None or theirs[0] is None:
        return ours == theirs == (None, None, None, None)
    is_near = (ours[0] - theirs[0]).length < 1e-5 and math.isclose(ours[3], theirs[3], abs_tol=1e-5)
    return is_near and ours[2] == theirs[2] and (ours[1] - theirs[1]).length < 1e-4


@pytest.mark.parametrize("kind", ["object", "bmesh", "polygons"])
def test_a_tree_answers_as_blenders_does(monkey: Any, kind: str) -> None:
    ours, theirs = both(kind, monkey)
    origins, directions = rays()
    single = [ours.ray_cast(o, d) for o, d in zip(origins, directions, strict=True)]
    hit = [is_same(one, theirs.ray_cast(o, d)) for one, o, d in zip(single, origins, directions, strict=True)]
    assert np.mean(hit) > 0.99  # others are at an edge
    for origin in origins:  # most are nearest to an edge or vertex, of which any polygon is right
        one, other = ours.find_nearest(origin), theirs.find_nearest(origin)
        assert abs(one[3] - other[3]) < 1e-6
        assert (one[0] - other[0]).length < 1e-3
    assert ours.ray_cast(origins[0], directions[0], 0.1) == (None, None, None, None)
    assert ours.ray_cast(origins[0], (0, 0, 0)) == (None, None, None, None)
    assert ours.find_nearest((9, 9, 9), 0.5) == theirs.find_nearest((9, 9, 9), 0.5)
    one, other = ours.find_nearest_range((0, 0, 0), 0.6), theirs.find_nearest_range((0, 0, 0), 0.6)
    assert sorted(found[2] for found in one) == sorted(found[2] for found in other) and one
    places, normals, indices, distances = ours.ray_cast(origins, directions)
    for row, (place, normal, index, away) in enumerate(single):
        if place is None:
            assert indices[row] == -1 and distances[row] == math.inf and np.isnan(places[row]).all()
            continue
        assert indices[row] == index and distances[row] == away
        assert Vector(places[row]) == place and Vector(normals[row]) == normal


def test_trees_overlap_as_blenders_do(monkey: Any) -> None:
    ours, theirs = both("polygons", monkey)
    corners = [(-1, -1, 0.1), (1, -1, 0.2), (1, 1, 0.1), (-1, 1, 0.3)]
    cut, their_cut = (kind.FromPolygons(corners, [(0, 1, 2, 3)]) for kind in (BVHTree, BlendersTree))
    assert ours.overlap(cut) == sorted(theirs.overlap(their_cut)) != []


def test_concave_polygons_and_odd_input() -> None:
    dart = BVHTree.FromPolygons([(0, 0, 0), (1, 0, 0), (0.2, 0.2, 0), (0, 1, 0)], [(0, 1, 2, 3)])
    assert dart.ray_cast((0.6, 0.6, 5), (0, 0, -1))[2] is None
    assert dart.ray_cast((0.1, 0.5, 5), (0, 0, -2)) == (Vector((0.1, 0.5, 0)), Vector((0, 0, 1)), 0, 5.0)
    empty = BVHTree.FromPolygons([], [])
    assert empty.ray_cast((0, 0, 0), (0, 0, 1)) == empty.find_nearest((0, 0, 0)) == (None, None, None, None)
    assert empty.ray_cast(np.zeros((2, 3)), np.ones((2, 3)))[2].tolist() == [-1, -1]
    with pytest.raises(ValueError, match=r"polygon 0 has vertices \[0, 1, 2\], but there are 1"):
        BVHTree.FromPolygons([(0, 0, 0)], [(0, 1, 2)])
    with pytest.raises(ValueError, match="shape"):
        dart.ray_cast((1, 2), (0, 0))
    with pytest.raises(ValueError, match="origins must have shape"):
        dart.ray_cast(None, None)
    lazy = BVHTree.FromPolygons(map(Vector, [(0, 0, 0), (1, 0, 0), (0, 1, 0)]), iter([(0, 1, 2)]))
    assert lazy.ray_cast((0.1, 0.1, 5), (0, 0, -1))[2] == 0
    with pytest.raises(ValueError, match=r"vertices must have shape \(n, 3\), got \(3, 2\)"):
        BVHTree.FromPolygons([(0, 0), (1, 0), (0, 1)], [(0, 1, 2)])
    with pytest.raises(ValueError, match=r"polygon 1 has vertices \[0, 1, -1\], but there are 3"):
        BVHTree.FromPolygons([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 1, -1)], all_triangles=True)
    with pytest.raises(TypeError, match="other_tree"):
        dart.overlap(BlendersTree.FromPolygons([], []))
    with pytest.raises(ValueError, match="cage"):
        BVHTree.FromObject(bpy.context.object, bpy.context.evaluated_depsgraph_get(), cage=True)
    empty_object = bpy.data.objects.new("Nothing", None)
    bpy.context.collection.objects.link(empty_object)
    with pytest.raises(ValueError, match="'Nothing' has no mesh"):
        BVHTree.FromObject(empty_object, bpy.context.evaluated_depsgraph_get())


def test_rays_into_the_scene_answer_as_blenders_do_and_are_never_stale(monkey: Any) -> None:
    twin = bpy.data.objects.new("Twin", monkey.data)
    bpy.context.collection.objects.link(twin)
    twin.location, twin.scale = (4, 2, 3), (2, 2, 2)
    scene = bpy.context.scene
    origins, directions = rays()
    origins += np.array([2.0, 2.0, 3.0])
    for shift in (0.0, 0.7):
        monkey.location.x += shift
        depsgraph = bpy.context.evaluated_depsgraph_get()
        answers = ray_cast(depsgraph, origins, directions)
        same = 0
        for row, (origin, direction) in enumerate(zip(origins, directions, strict=True)):
            found = scene.ray_cast(depsgraph, origin, direction)
            hit, place, normal, polygon, owner, matrix = (column[row] for column in answers)
            assert hit == found[0]
            if not hit:
                assert owner is None and polygon == -1 and (matrix == np.eye(4)).all()
                continue
            assert (Vector(place) - found[1]).length < 1e-5
            assert owner == found[4]
            np.testing.assert_allclose(matrix, np.array(found[5]), atol=1e-6)
            same += polygon == found[3] and (Vector(normal) - found[2]).length < 1e-4
        assert same > 0.99 * answers[0].sum() > 50
    miss = ray_cast(depsgraph, (0, 0, 99), (0, 0, 1))
    assert miss[0].shape == () and not miss[0] and miss[4][()] is None


@pytest.mark.parametrize("is_registered", [False, True])
def test_each_edit_is_in_the_next_answer(monkey: Any, is_registered: bool) -> None:
    import perfect_bvh_addon

    if is_registered:
        perfect_bvh_addon.register()
    try:
        monkey.modifiers.clear()
        bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, 0.0, -5.0))
        floor = bpy.context.object

        def height() -> float:
            depsgraph = bpy.context.evaluated_depsgraph_get()
            answer = ray_cast(depsgraph, (7.0, 7.0, 50.0), (0.0, 0.0, -1.0))
            assert bool(answer[0]) == bpy.context.scene.ray_cast(depsgraph, (7.0, 7.0, 50.0), (0.0, 0.0, -1.0))[0]
            return float(answer[1][2]) if answer[0] else math.nan

        assert height() == pytest.approx(-5.0)
        for vertex in floor.data.vertices:
            vertex.co.z = 1.0
        floor.data.update()
        assert height() == pytest.approx(-4.0)
        doubled = np.array([vertex.co for vertex in floor.data.vertices]) * (1.0, 1.0, 2.0)
        floor.data.vertices.foreach_set("co", doubled.ravel())
        floor.data.update()
        assert height() == pytest.approx(-3.0)
        floor.location.z = 2.0
        assert height() == pytest.approx(4.0)
        floor.modifiers.new("Wave", "DISPLACE").strength = 0.0
        floor.modifiers["Wave"].mid_level = 0.0
        floor.modifiers["Wave"].strength = 1.0
        assert height() == pytest.approx(5.0)
        floor.hide_viewport = True
        assert math.isnan(height())
        floor.hide_viewport = False
        assert height() == pytest.approx(5.0)
    finally:
        if is_registered:
            perfect_bvh_addon.unregister()
