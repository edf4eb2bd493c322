"""Which objects share one mesh, and the keys that identify meshes from evaluation to evaluation."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import (
    evaluated,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
)
from blender.object_kinds import ALL_ATTRIBUTES, KINDS, add_modified_mesh
from perfect_bvh_addon.extract import read_scene


def test_linked_data_is_one_mesh(scene: Any) -> None:
    data = mesh_data("shared")
    for index in range(5):
        mesh_object(f"user {index}", data, location=(index, 0, 0))
    record = read_scene(evaluated())
    assert len(record.meshes) == 1
    assert record.instances.mesh_indices.tolist() == [0] * 5
    np.testing.assert_array_equal(record.instances.transforms[:, 0, 3], np.arange(5))


@pytest.mark.parametrize("kind", ["modified mesh", "text", "curve"])
def test_linked_data_that_blender_evaluates_once_an_object_is_one_mesh_again(scene: Any, kind: str) -> None:
    first = KINDS[kind]()
    for _ in range(3):
        copy = first.copy()
        copy.location.x += 3.0
        scene.collection.objects.link(copy)
    record = read_scene(evaluated(), ALL_ATTRIBUTES)
    assert len(record.meshes) == 1
    assert len(record.instances) == 4


def test_linked_data_that_differs_after_modifiers_is_not_shared(scene: Any) -> None:
    first = add_modified_mesh()
    second = first.copy()
    second.modifiers["bend"].angle = 1.0
    scene.collection.objects.link(second)
    record = read_scene(evaluated())
    assert len(record.meshes) == 2
    assert len({mesh.key for mesh in record.meshes}) == 2


def test_keys_survive_evaluation_renaming_and_other_objects(scene: Any) -> None:
    add_modified_mesh()
    KINDS["text"]()
    mesh_object("plain")
    instances_on_grid("nodes", made_cube, keep_own=True)

    def keys() -> dict[Any, int]:
        return {mesh.key: len(mesh.positions) for mesh in read_scene(evaluated()).meshes}

    before = keys()
    assert len(before) == 5
    for obj in list(bpy.data.objects):
        obj.name = f"renamed {obj.name}"
        obj.update_tag(refresh={"DATA"})
    assert keys() == before
    mesh_object("a first object, by name")
    after = keys()
    assert before.items() < after.items()


def test_a_mesh_made_by_nodes_keeps_its_key_while_it_deforms(scene: Any) -> None:
    obj = instances_on_grid("nodes", made_cube)
    size = next(node for node in obj.modifiers[0].node_group.nodes if node.bl_idname == "GeometryNodeMeshCube").inputs
    (before,) = read_scene(evaluated()).meshes
    size["Size"].default_value = (1, 2, 3)
    (deformed,) = read_scene(evaluated()).meshes
    assert deformed.key == before.key
    assert not np.array_equal(deformed.positions, before.positions)
    size["Vertices X"].default_value = 3
    (changed,) = read_scene(evaluated()).meshes
    assert changed.key != before.key


def test_objects_tell_how_their_meshes_will_behave(scene: Any) -> None:
    mesh_object("still")
    mesh_object("bent").modifiers.new("bones", "ARMATURE")
    mesh_object("cut").modifiers.new("build", "BUILD")
    shaped = mesh_object("shaped")
    shaped.shape_key_add(name="Basis")
    shaped.shape_key_add(name="other")
    scene.frame_set(50)  # half of it is built
    record = read_scene(evaluated())
    usages = {
        record.objects[obj].name: record.meshes[mesh].usage
        for obj, mesh in zip(record.instances.object_indices, record.instances.mesh_indices, strict=True)
    }
    assert usages == {"still": "static", "bent": "deforming", "cut": "changing", "shaped": "deforming"}
