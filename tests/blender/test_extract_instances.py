"""Every way in which Blender shows an object more than once, compared with the simplest reading and with counts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import (
    SQUARE,
    NodeGroup,
    camera_object,
    collection,
    collection_instance,
    evaluated,
    in_render,
    instances_on_grid,
    made_cube,
    mesh_data,
    mesh_object,
    object_info,
    reference_soup,
    soup_of,
)
from perfect_bvh_addon.extract import read_scene
from perfect_bvh_addon.sync.records import SceneRecord

# Each builder returns the expectation: the number of instances for each "instancer/object", and the number of meshes.
Expectation = tuple[dict[str, int], int]


def counts_of(record: SceneRecord) -> dict[str, int]:
    instances = record.instances
    names: Counter[str] = Counter()
    for obj, parent in zip(instances.object_indices, instances.parent_indices, strict=True):
        prefix = f"{record.objects[parent].name}/" if parent >= 0 else ""
        names[prefix + record.objects[obj].name] += 1
    return dict(names)


def collections_() -> Expectation:
    shown = collection("shown", linked=False)
    mesh_object("a", collection=shown)
    mesh_object("b", collection=shown, location=(2, 0, 0))
    collection_instance("first", shown)
    collection_instance("second", shown, location=(0, 5, 0))
    return {"first/a": 1, "first/b": 1, "second/a": 1, "second/b": 1}, 2


def nested_collections() -> Expectation:
    inner = collection("inner", linked=False)
    inner.instance_offset = (0.5, 0, 0)
    mesh_object("leaf", collection=inner)
    outer = collection("outer", linked=False)
    for x in range(3):
        collection_instance(f"branch {x}", inner, outer, location=(x, 0, 0)).rotation_euler.z = x
    mesh_object("trunk", collection=outer)
    collection_instance("tree", outer)
    collection_instance("other tree", outer, location=(0, 9, 0)).scale = (2, 2, -2)
    return {"tree/leaf": 3, "other tree/leaf": 3, "tree/trunk": 1, "other tree/trunk": 1}, 2


def nodes_made_mesh() -> Expectation:
    instances_on_grid("grid", made_cube, 3, keep_own=True)
    return {"grid": 1, "grid/grid": 9}, 2


def nodes_object() -> Expectation:
    source = mesh_object("source", location=(0, 0, 7))
    instances_on_grid("grid", object_info(source), 3)
    return {"source": 1, "grid/source": 9}, 1


def nodes_several_objects() -> Expectation:
    shown = collection("shown", linked=False)
    for index in range(3):
        mesh_object(f"shape {index}", mesh_data(f"shape {index}", *SQUARE), collection=shown)

    def from_collection(group: NodeGroup) -> Any:
        return group.node(
            "GeometryNodeCollectionInfo", Collection=shown, Separate_Children=True, Reset_Children=True
        ).outputs["Instances"]

    instances_on_grid("grid", from_collection, 2)
    return {f"grid/shape {index}": 4 for index in range(3)}, 3


def nodes_of_nodes() -> Expectation:
    source = instances_on_grid("source", made_cube, 2)
    instances_on_grid("grid", object_info(source), 3)
    return {"source/source": 4, "grid/source": 36}, 1


def nodes_within_a_collection() -> Expectation:
    shown = collection("shown", linked=False)
    source = instances_on_grid("source", made_cube, 2, keep_own=True)
    bpy.context.scene.collection.objects.unlink(source)
    shown.objects.link(source)
    collection_instance("empty", shown)
    return {"empty/source": 5}, 2


def nodes_made_curves() -> Expectation:
    """A text object whose nodes show its letters as instances; their mesh belongs to no object."""
    bpy.ops.object.text_add()
    obj = bpy.context.object
    obj.data.body = "aba"
    return {"Text/Text": 1}, 1


def vertices() -> Expectation:
    parent = mesh_object("parent", mesh_data("square", *SQUARE))
    parent.instance_type = "VERTS"
    mesh_object("child", location=(0, 0, 1)).parent = parent
    return {"parent": 1, "parent/child": 4, "child": 1}, 2


def faces() -> Expectation:
    parent = mesh_object("parent")
    parent.instance_type, parent.use_instance_faces_scale = "FACES", True
    mesh_object("child", mesh_data("square", *SQUARE)).parent = parent
    return {"parent": 1, "parent/child": 4, "child": 1}, 2


def particle_emitter(render_type: str, kind: str) -> Any:
    emitter = mesh_object("emitter", mesh_data("square", *SQUARE))
    emitter.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.type, settings.render_type = 7, kind, render_type
    if kind == "EMITTER":
        settings.frame_start = settings.frame_end = 1
        settings.physics_type = "NO"
    return settings


def particles_object() -> Expectation:
    particle_emitter("OBJECT", "EMITTER").instance_object = mesh_object("grain", location=(0, 0, 3))
    return {"emitter": 1, "emitter/grain": 7, "grain": 1}, 2


def hair_object() -> Expectation:
    particle_emitter("OBJECT", "HAIR").instance_object = mesh_object("blade", location=(0, 0, 3))
    return {"emitter": 1, "emitter/blade": 7, "blade": 1}, 2


def particles_collection() -> Expectation:
    shown = collection("shown", linked=False)
    mesh_object("a", collection=shown)
    settings = particle_emitter("COLLECTION", "HAIR")
    settings.instance_collection, settings.use_whole_collection = shown, True
    mesh_object("b", collection=shown, location=(1, 0, 0))
    return {"emitter": 1, "emitter/a": 7, "emitter/b": 7}, 3


KINDS: dict[str, Callable[[], Expectation]] = {
    "collections": collections_,
    "nested collections": nested_collections,
    "nodes, made mesh": nodes_made_mesh,
    "nodes, object": nodes_object,
    "nodes, several objects": nodes_several_objects,
    "nodes of nodes": nodes_of_nodes,
    "nodes within a collection": nodes_within_a_collection,
    "text": nodes_made_curves,
    "vertices": vertices,
    "faces": faces,
    "particles, object": particles_object,
    "hair, object": hair_object,
    "particles, collection": particles_collection,
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_instance(scene: Any, kind: str) -> None:
    names, mesh_count = KINDS[kind]()
    depsgraph = evaluated()
    record = read_scene(depsgraph)
    assert counts_of(record) == names
    assert len(record.meshes) == mesh_count
    assert soup_of(record) == reference_soup(depsgraph)
    assert_identified(record)


def assert_identified(record: SceneRecord) -> None:
    """Check that object, instancer and persistent id together identify an instance; plain objects have no such id."""
    instances = record.instances
    names = {
        (
            record.objects[instances.object_indices[row]].session_uid,
            int(instances.parent_indices[row]),
            int(instances.mesh_indices[row]),
            *instances.persistent_ids[row].tolist(),
        )
        for row in range(len(instances))
    }
    assert len(names) == len(instances)
    assert not instances.persistent_ids[instances.parent_indices < 0].any()
    uids = {obj.name: obj.session_uid for obj in bpy.data.objects}
    assert all(uids[obj.name] == obj.session_uid for obj in record.objects)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_instance_in_a_render(scene: Any, kind: str) -> None:
    KINDS[kind]()
    camera_object()
    record, soup = in_render(lambda depsgraph: (read_scene(depsgraph), reference_soup(depsgraph)))
    assert soup_of(record) == soup
    assert len(soup) > 0


@pytest.mark.parametrize("kind", KINDS)
def test_keys_and_ids_are_the_same_at_every_evaluation(scene: Any, kind: str) -> None:
    KINDS[kind]()
    first = read_scene(evaluated())
    for obj in bpy.data.objects:
        obj.update_tag(refresh={"OBJECT", "DATA"} if obj.data else {"OBJECT"})
    second = read_scene(evaluated())
    assert [mesh.key for mesh in first.meshes] == [mesh.key for mesh in second.meshes]
    np.testing.assert_array_equal(first.instances.persistent_ids, second.instances.persistent_ids)
    np.testing.assert_array_equal(first.instances.transforms, second.instances.transforms)


@pytest.mark.parametrize("setting", [None, "is_holdout", "visible_camera"])
@pytest.mark.parametrize("kind", KINDS)
def test_references_that_others_hold_change_nothing(scene: Any, kind: str, setting: str | None) -> None:
    """If Python holds an evaluated object, Blender returns it in place of the object's duplicates."""
    KINDS[kind]()
    for obj in bpy.data.objects:
        if setting:
            setattr(obj, setting, not getattr(obj, setting))
    depsgraph = evaluated()
    free = read_scene(depsgraph)
    held: list[Any] = [obj.evaluated_get(depsgraph) for obj in bpy.data.objects]
    held += [obj.data for obj in held]
    for instance in depsgraph.object_instances:
        held += [instance.instance_object, instance.parent, instance.object.data]
    bound = read_scene(depsgraph)
    assert soup_of(bound) == soup_of(free)
    assert (bound.objects, [mesh.key for mesh in bound.meshes]) == (free.objects, [mesh.key for mesh in free.meshes])
    for column in ("mesh_indices", "object_indices", "parent_indices", "masks", "transforms"):
        np.testing.assert_array_equal(getattr(bound.instances, column), getattr(free.instances, column))
    assert held


def test_linked_objects_share_what_a_collection_shows(scene: Any) -> None:
    shown = collection("shown", linked=False)
    data = mesh_data("shared")
    mesh_object("inside", data, collection=shown)
    mesh_object("outside", data)
    collection_instance("empty", shown)
    record = read_scene(evaluated())
    assert len(record.meshes) == 1
    assert counts_of(record) == {"outside": 1, "empty/inside": 1}


def test_made_meshes_bring_their_own_materials(scene: Any) -> None:
    red = bpy.data.materials.new("red")

    def painted_cube(group: NodeGroup) -> Any:
        paint = group.node("GeometryNodeSetMaterial", Material=red)
        group.link(made_cube(group), paint.inputs["Geometry"])
        return paint.outputs["Geometry"]

    obj = instances_on_grid("grid", painted_cube, keep_own=True)
    obj.data.materials.append(bpy.data.materials.new("green"))
    record = read_scene(evaluated())
    seen = {
        parent >= 0: [record.materials[row].name for row in record.objects[index].material_slots if row >= 0]
        for index, parent in zip(record.instances.object_indices, record.instances.parent_indices, strict=True)
    }
    assert seen == {False: ["green"], True: ["red"]}


@pytest.mark.parametrize("place", [float("nan"), float("inf"), 1e20])
def test_matrices_that_cannot_be_traced_are_left_out_with_a_warning(scene: Any, place: float) -> None:
    mesh_object("fine")
    mesh_object("broken").location.x = place
    record = read_scene(evaluated())
    assert counts_of(record) == {"fine": 1}
    assert record.warnings == ("broken: left out 1 instance with a matrix that is not finite or beyond 1e18",)


def test_what_has_no_surface_is_named(scene: Any) -> None:
    bpy.ops.object.volume_add()
    mesh_object("thing")
    bpy.ops.object.light_add()
    bpy.ops.object.empty_add()
    bpy.ops.object.speaker_add()
    record = read_scene(evaluated())
    assert counts_of(record) == {"thing": 1}
    assert [warning.split(": ")[1] for warning in record.warnings] == ["volumes are not supported; left out"]


def test_a_background_scene_is_part_of_the_picture(scene: Any) -> None:
    mesh_object("front")
    other = bpy.data.scenes.new("other")
    other.collection.objects.link(mesh_object("back", collection=False))
    scene.background_set = other
    assert counts_of(read_scene(evaluated())) == {"front": 1, "back": 1}
