"""Attributes of a mesh other than its triangles: they are read only on request."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import bpy
import numpy as np
from blender.builders import (
    SQUARE,
    evaluated,
    mesh_data,
    mesh_object,
)
from blender.object_kinds import add_mesh, only_mesh
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.extract.geometry.meshes import read_corner_normals
from perfect_bvh_addon.extract.pointer_views import ArrayReader
from perfect_bvh_addon.sync.records import AttributeRequest


def test_only_what_was_asked_for_is_read(scene: Any) -> None:
    add_mesh()
    bpy.ops.object.shade_smooth()
    (bare,) = read_scene(evaluated(), AttributeRequest(material_slots=False)).meshes
    assert (bare.material_slots, bare.corner_normals, bare.corner_uvs) == (None, None, None)
    full = only_mesh()
    assert full.material_slots is not None
    assert full.corner_normals is not None
    assert full.corner_uvs is not None
    count = len(full.triangles)
    assert full.material_slots.shape == (count,)
    assert full.corner_normals.shape == (count, 3, 3)
    assert full.corner_uvs.shape == (count, 3, 2)


def test_flat_meshes_have_no_corner_normals_and_smooth_ones_have_blenders(scene: Any) -> None:
    obj = add_mesh()
    assert only_mesh().corner_normals is None
    bpy.ops.object.shade_smooth()
    obj.data.polygons[3].use_smooth = False
    read = only_mesh().corner_normals
    data = obj.evaluated_get(evaluated()).data
    expected = [[data.corner_normals[loop].vector for loop in triangle.loops] for triangle in data.loop_triangles]
    assert read is not None
    np.testing.assert_allclose(read, expected, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(read, axis=2), 1.0, atol=1e-5)


def test_custom_normals_are_read(scene: Any) -> None:
    obj = add_mesh()
    bpy.ops.object.shade_smooth()
    tilted = [(0.6, 0.0, 0.8)] * len(obj.data.loops)
    obj.data.normals_split_custom_set(tilted)
    read = only_mesh().corner_normals
    assert read is not None
    np.testing.assert_allclose(read.reshape(-1, 3), np.broadcast_to([0.6, 0.0, 0.8], (read.size // 3, 3)), atol=0.02)


def test_the_uv_map_that_renders_use_is_read(scene: Any) -> None:
    data = mesh_data("square", *SQUARE)
    data.uv_layers.new(name="shown").uv.foreach_set("vector", np.zeros(8, np.float32))
    rendered = data.uv_layers.new(name="rendered")
    coordinates = np.arange(8, dtype=np.float32).reshape(4, 2)
    rendered.uv.foreach_set("vector", coordinates.ravel())
    data.uv_layers.active = data.uv_layers["shown"]
    rendered.active_render = True
    mesh_object("square", data)
    mesh = only_mesh()
    assert mesh.corner_uvs is not None
    np.testing.assert_array_equal(mesh.corner_uvs, coordinates[mesh.triangles])


def test_material_slots_of_triangles_and_objects(scene: Any) -> None:
    red, blue = bpy.data.materials.new("red"), bpy.data.materials.new("blue")
    red.diffuse_color, blue.pass_index = (1, 0, 0, 1), 7
    data = mesh_data("painted", [*SQUARE[0], (0, 0, 3), (1, 0, 3), (0, 1, 3)], [(0, 1, 2, 3), (4, 5, 6)])
    for material in (red, None):
        data.materials.append(material)
    data.polygons[1].material_index = 1
    first, second = mesh_object("first", data), mesh_object("second", data)
    second.material_slots[0].link = "OBJECT"
    second.material_slots[0].material = blue
    assert first.material_slots[0].material == red

    record = read_scene(evaluated())
    names = [material.name for material in record.materials]
    slots = {obj.name: [names[row] if row >= 0 else None for row in obj.material_slots] for obj in record.objects}
    assert slots == {"first": ["red", None], "second": ["blue", None]}
    (mesh,) = record.meshes
    assert mesh.material_slots is not None
    assert mesh.material_slots.tolist() == [0, 0, 1]
    by_name = {material.name: material for material in record.materials}
    assert by_name["red"].color == (1.0, 0.0, 0.0, 1.0)
    assert by_name["blue"].pass_index == 7
    assert by_name["blue"].session_uid == blue.session_uid


def test_the_view_layers_override_stands_for_every_material(scene: Any) -> None:
    data = mesh_data("painted")
    data.materials.append(bpy.data.materials.new("own"))
    mesh_object("painted", data)
    mesh_object("bare", location=(5, 0, 0))
    scene.view_layers[0].material_override = bpy.data.materials.new("override")
    record = read_scene(evaluated())
    assert [material.name for material in record.materials] == ["override"]
    assert {obj.material_slots for obj in record.objects} == {(0,)}


def test_corner_normals_that_are_no_numbers_stand_for_the_triangle_s_own() -> None:
    normals = np.arange(18, dtype=np.float32).reshape(6, 3)
    normals[1, 2], normals[4] = np.nan, np.inf
    normals.flags.writeable = False  # Blender's own memory
    corners = np.array([[0, 1, 2], [2, 3, 0], [3, 4, 5]], np.int32)
    mesh = SimpleNamespace(normals_domain="CORNER", corner_normals=None)
    reader = cast(ArrayReader, SimpleNamespace(view=lambda *_: normals))
    expected = np.where(np.isfinite(normals).all(axis=1)[:, None], normals, 0.0)[corners]
    read = read_corner_normals(mesh, corners, reader)
    assert read is not None and read.flags.owndata
    np.testing.assert_array_equal(read, expected)
