"""Meshes in the record equal Blender's evaluated ones: all types, odd cases, with and without reading by address."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import (
    evaluated,
    mesh_data,
    mesh_object,
    reference_soup,
    soup_of,
)
from blender.object_kinds import ALL_ATTRIBUTES, KINDS, add_mesh, only_mesh
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.pointer_views import ArrayReader


@pytest.mark.parametrize("kind", KINDS)
def test_every_object_type_reads_as_blender_converts_it(scene: Any, kind: str) -> None:
    obj = KINDS[kind]()
    obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.3, 0.2, 0.1), (1, 2, 0.5)
    if kind != "metaball":  # Blender 4.2 polygonises no mirrored metaball
        obj.scale.y = -2
    depsgraph = evaluated()
    record = read_scene(depsgraph)
    assert soup_of(record) == reference_soup(depsgraph)

    converted = obj.evaluated_get(depsgraph).to_mesh()
    converted.calc_loop_triangles()
    (mesh,) = record.meshes
    assert len(record.instances) == 1
    assert len(mesh.triangles) == len(converted.loop_triangles) > 10
    np.testing.assert_array_equal(mesh.positions, [vertex.co for vertex in converted.vertices])
    np.testing.assert_array_equal(mesh.triangles, [triangle.vertices for triangle in converted.loop_triangles])
    assert mesh.positions.dtype == np.float32
    assert mesh.triangles.dtype == mesh.polygon_ids.dtype == np.int32
    obj.evaluated_get(depsgraph).to_mesh_clear()


def test_metaballs_of_a_family_are_one_mesh(scene: Any) -> None:
    bpy.ops.object.metaball_add(type="BALL")
    bpy.ops.object.metaball_add(type="BALL", location=(1, 0, 0))
    record = read_scene(evaluated())
    assert len(record.instances) == len(record.meshes) == 1


def test_an_empty_scene_is_an_empty_record(scene: Any) -> None:
    record = read_scene(evaluated())
    assert (record.meshes, record.objects, record.materials, record.warnings) == ((), (), (), ())
    assert len(record.instances) == 0
    assert record.instances.transforms.shape == (0, 3, 4)
    assert record.instances.persistent_ids.shape == (0, 8)
    assert record.camera is None
    assert record.size == (32, 18)


@pytest.mark.parametrize(
    ("vertices", "edges"),
    [([], []), ([(0, 0, 0)], []), ([(0, 0, 0), (1, 0, 0)], [(0, 1)])],
    ids=["nothing", "a vertex", "an edge"],
)
def test_an_object_without_faces_is_not_there(scene: Any, vertices: list[Any], edges: list[Any]) -> None:
    data = bpy.data.meshes.new("bare")
    data.from_pydata(vertices, edges, [])
    mesh_object("bare", data)
    mesh_object("solid")
    record = read_scene(evaluated(), ALL_ATTRIBUTES)
    assert [record.objects[row].name for row in record.instances.object_indices] == ["solid"]
    assert len(record.meshes) == 1


def test_loose_edges_and_vertices_do_not_disturb_the_triangles(scene: Any) -> None:
    data = bpy.data.meshes.new("loose")
    vertices = [(9, 9, 9), (0, 0, 0), (1, 0, 0), (0, 1, 0), (7, 7, 7)]
    data.from_pydata(vertices, [(0, 4)], [(1, 2, 3)])
    mesh_object("loose", data)
    mesh = only_mesh()
    np.testing.assert_array_equal(mesh.positions, np.array(vertices, np.float32))
    np.testing.assert_array_equal(mesh.triangles, [[1, 2, 3]])


def test_polygons_are_cut_as_blender_cuts_them_and_keep_their_ids(scene: Any) -> None:
    outline = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (2, 1, 0), (0, 4, 0)]  # concave
    mesh_object("n-gon", mesh_data("n-gon", [*outline, (0, 0, 5), (1, 0, 5), (0, 1, 5)], [(0, 1, 2, 3, 4), (5, 6, 7)]))
    depsgraph = evaluated()
    mesh = only_mesh()
    assert mesh.polygon_ids.tolist() == [0, 0, 0, 1]
    assert soup_of(read_scene(depsgraph)) == reference_soup(depsgraph)
    corners = mesh.positions[mesh.triangles[:3]]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(10.0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_triangles_that_are_not_finite_are_dropped_and_the_others_keep_their_ids(scene: Any, value: float) -> None:
    vertices = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, value, 1), (5, 5, 5), (6, 5, 5), (5, 6, 5)]
    data = mesh_data("broken", vertices, [(0, 1, 2), (0, 1, 3), (4, 5, 6)])
    data.materials.append(None)
    data.materials.append(None)
    data.polygons[2].material_index = 1
    data.uv_layers.new()
    mesh_object("broken", data)
    record = read_scene(evaluated(), ALL_ATTRIBUTES)
    (mesh,) = record.meshes
    assert mesh.dropped_triangles == 1
    assert mesh.triangle_ids is not None
    assert mesh.triangle_ids.tolist() == mesh.polygon_ids.tolist() == [0, 2]
    np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2], [4, 5, 6]])
    assert mesh.material_slots is not None
    assert mesh.material_slots.tolist() == [0, 1]
    assert mesh.corner_uvs is not None
    assert mesh.corner_uvs.shape == (2, 3, 2)
    assert np.isfinite(mesh.positions).all()
    assert len(mesh.positions) == len(vertices)
    assert record.warnings == ("broken: left out 1 triangle with a vertex that is not finite or beyond 1e18",)


def test_a_loose_vertex_that_is_not_finite_costs_no_triangle(scene: Any) -> None:
    mesh_object("stray", mesh_data("stray", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (np.nan, 0, 0)], [(0, 1, 2)]))
    record = read_scene(evaluated())
    (mesh,) = record.meshes
    assert (mesh.dropped_triangles, mesh.triangle_ids, record.warnings) == (0, None, ())
    assert np.isfinite(mesh.positions).all()


def test_a_mesh_with_no_finite_triangle_left_is_still_a_record(scene: Any) -> None:
    mesh_object("lost", mesh_data("lost", [(np.nan, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    mesh = only_mesh()
    assert (mesh.dropped_triangles, mesh.triangles.shape, mesh.positions.shape) == (1, (0, 3), (3, 3))
    assert np.isfinite(mesh.positions).all()


@pytest.mark.parametrize("modifier", [None, "SUBSURF"])
def test_unsaved_edits_of_edit_mode_are_read(scene: Any, modifier: str | None) -> None:
    import bmesh

    obj = add_mesh()
    if modifier:
        obj.modifiers.new("modifier", modifier)
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    edited.verts.ensure_lookup_table()
    edited.verts[0].co.x = 99.0
    bmesh.ops.delete(edited, geom=[edited.verts[7]])
    bmesh.update_edit_mesh(obj.data)
    depsgraph = evaluated()
    mesh = only_mesh()
    reference = obj.evaluated_get(depsgraph).to_mesh()
    np.testing.assert_array_equal(mesh.positions, [vertex.co for vertex in reference.vertices])
    assert mesh.positions.max() > 20.0
    obj.evaluated_get(depsgraph).to_mesh_clear()
    bpy.ops.object.mode_set(mode="OBJECT")


# Reading by address --------------------------------------------------------------------------------------------------


def test_views_and_foreach_get_read_the_same(scene: Any) -> None:
    for add in KINDS.values():
        add()
        if bpy.context.object.type == "MESH":
            bpy.ops.object.shade_smooth()
    reader = ArrayReader()
    fast = read_scene(evaluated(), ALL_ATTRIBUTES, reader=reader)
    slow = read_scene(evaluated(), ALL_ATTRIBUTES, reader=ArrayReader(use_views=False))
    assert len(fast.meshes) == len(slow.meshes) == len(KINDS)
    for one, other in zip(fast.meshes, slow.meshes, strict=True):
        for name in ("positions", "triangles", "polygon_ids", "material_slots", "corner_normals", "corner_uvs"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    needed = {"positions", "corner_verts", "corner_triangles", "triangle_polygons"}
    assert all(reader.verdicts[name] for name in needed)  # this Blender has the layout that makes reading fast


def test_records_own_their_arrays(scene: Any) -> None:
    obj = add_mesh()
    mesh = only_mesh()
    before = mesh.positions.copy()
    obj.data.vertices.foreach_set("co", np.zeros(len(obj.data.vertices) * 3, np.float32))
    obj.data.update()
    evaluated()
    np.testing.assert_array_equal(mesh.positions, before)
    assert mesh.positions.flags.owndata
    assert mesh.positions.flags.writeable


@pytest.mark.parametrize("failure", ["stride", "values"])
def test_an_unexpected_layout_falls_back_to_foreach_get(scene: Any, failure: str) -> None:
    """The elements of such a collection lie elsewhere, or have another content, than those of a plain array."""
    from perfect_bvh_addon.extract.pointer_views import ArrayKind

    real = np.arange(12, dtype=np.float32).reshape(4, 3)
    padded = np.zeros((4, 4), np.float32) if failure == "stride" else real + 1.0

    class Element:
        def __init__(self, index: int) -> None:
            self.vector = real[index]
            self.index = index

        def as_pointer(self) -> int:
            return padded.ctypes.data + self.index * padded.strides[0]

    class Collection:
        def __len__(self) -> int:
            return len(real)

        def __getitem__(self, index: int) -> Element:
            return Element(index)

        def foreach_get(self, attribute: str, out: np.ndarray) -> None:
            assert attribute == "vector"
            out[:] = real.ravel()

    kind = ArrayKind("odd", 3, np.dtype(np.float32), "vector", lambda item: item.vector)
    reader = ArrayReader()
    np.testing.assert_array_equal(reader.read(Collection(), kind), real)
    assert reader.verdicts == {"odd": False}
