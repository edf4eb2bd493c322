"""Scenes that are read again without asking every object everything, and all changes that prevent this."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import SQUARE, camera_object, collection, collection_instance, evaluated, mesh_data, mesh_object
from blender.node_setups import add, new_red, shader
from blender.syncing import height
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.events.asking import EvaluationLog
from perfect_bvh_addon.extract import scene as reading


def thing(name: str) -> Any:
    return bpy.data.objects[name]


@pytest.fixture
def readings(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Record for each reading with a cache whether everything was read again."""
    made: list[bool] = []
    again = reading.read_again

    def spy(*arguments: Any) -> Any:
        parts = again(*arguments)
        if arguments[4] is not None:  # the log; a verifying update has none
            made.append(parts is None)
        return parts

    monkeypatch.setattr(reading, "read_again", spy)
    return made


@pytest.fixture
def sync(scene: Any, readings: list[bool]) -> Iterator[SceneSync]:
    """Plain objects of one mesh, one with a separate mesh and a material, and objects without a surface."""
    shared = mesh_data("shared", *SQUARE)
    for number in range(4):
        mesh_object(f"square {number}", shared, location=(3 * number, 0, 0))
    own = mesh_object("own", mesh_data("own", *SQUARE), location=(0, 5, 0))
    own.data.materials.append(bpy.data.materials.new("paint"))
    scene.collection.objects.link(bpy.data.objects.new("empty", None))
    scene.collection.objects.link(bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT")))
    camera_object()
    made = SceneSync(AttributeRequest(shading=True))
    made.update(evaluated())
    readings.clear()
    yield made
    made.close()


def move_by_parent() -> None:
    thing("square 1").parent = thing("empty")
    evaluated()
    thing("empty").location.z = 2.0


def animate() -> None:
    for frame, z in ((1, 0.0), (10, 9.0)):
        thing("square 0").location.z = z
        thing("square 0").keyframe_insert("location", frame=frame)
    evaluated()
    bpy.context.scene.frame_set(5)


QUIET: dict[str, Callable[[], None]] = {
    "nothing": lambda: None,
    "moved": lambda: setattr(thing("square 0").location, "z", 4.0),
    "all moved": lambda: [setattr(obj.location, "z", 3.0) for obj in bpy.data.objects] and None,
    "camera moved": lambda: setattr(thing("camera").location, "z", 7.0),
    "lamp moved": lambda: setattr(thing("lamp").location, "z", 7.0),
    "coloured": lambda: setattr(thing("square 0"), "color", (1, 0, 0, 1)),
}


@pytest.mark.parametrize("name", QUIET)
def test_a_change_of_places_alone_is_read_again(sync: SceneSync, readings: list[bool], name: str) -> None:
    QUIET[name]()
    report = sync.update(evaluated(), verify=True)
    assert (report.mismatches, readings) == ((), [False])
    assert_as_fresh(sync)


@pytest.mark.parametrize("change", [move_by_parent, animate], ids=lambda change: change.__name__)
def test_what_is_moved_by_something_else_is_read_again(
    sync: SceneSync, readings: list[bool], change: Callable[[], None]
) -> None:
    change()
    sync.update(evaluated())
    readings.clear()
    if change is animate:
        bpy.context.scene.frame_set(10)
    else:
        thing("empty").location.z = 5.0
    report = sync.update(evaluated(), verify=True)
    assert (report.mismatches, readings, report.moved_count) == ((), [False], 1)
    assert_as_fresh(sync)


def remove() -> None:
    bpy.data.objects.remove(thing("square 2"))


def swap_one() -> None:
    """Replace an object, so that the number of objects is unchanged."""
    remove()
    mesh_object("new", mesh_data("new"))


def instance_a_collection() -> None:
    inner = collection("inner", linked=False)
    mesh_object("leaf", mesh_data("leaf"), collection=inner)
    collection_instance("tree", inner, location=(0, 0, 3))


def hide_by_driver_like_animation() -> None:
    obj = thing("square 3")
    for frame, hidden in ((1, False), (2, True)):
        obj.hide_viewport = hidden
        obj.keyframe_insert("hide_viewport", frame=frame)
    bpy.context.scene.frame_set(1)
    evaluated()
    bpy.context.scene.frame_set(2)


def add_a_material() -> None:
    thing("own").material_slots[0].material = bpy.data.materials.new("other")


def another_material_of_the_object() -> None:
    thing("own").material_slots[0].link = "OBJECT"
    thing("own").material_slots[0].material = bpy.data.materials.new("other")


def ask_for_adaptive_subdivision() -> None:
    modifier = thing("own").modifiers.new("fine", "SUBSURF")
    evaluated()
    if bpy.app.version >= (5, 0, 0):
        modifier.use_adaptive_subdivision = True
    else:
        bpy.context.scene.cycles.feature_set = "EXPERIMENTAL"
        thing("own").cycles.use_adaptive_subdivision = True


LOUD: dict[str, Callable[[], None]] = {
    "lens": lambda: setattr(thing("camera").data, "lens", 20.0),
    "hidden": lambda: thing("square 0").hide_set(True),
    "hidden in viewports": lambda: setattr(thing("square 0"), "hide_viewport", True),
    "removed": remove,
    "swapped": swap_one,
    "collection instanced": instance_a_collection,
    "hidden by animation": hide_by_driver_like_animation,
    "hidden from the camera": lambda: setattr(thing("square 0"), "visible_camera", False),
    "moved and hidden from shadows": lambda: (
        setattr(thing("square 0").location, "z", 2.0) or setattr(thing("square 0"), "visible_shadow", False)
    ),
    "pass index": lambda: setattr(thing("square 0"), "pass_index", 7),
    "renamed": lambda: setattr(thing("square 0"), "name", "renamed"),
    "holdout": lambda: setattr(thing("square 0"), "is_holdout", True),
    "shadow catcher": lambda: setattr(thing("square 0"), "is_shadow_catcher", True),
    "focus distance": lambda: setattr(thing("camera").data.dof, "use_dof", True),
    "layer holdout": lambda: setattr(bpy.context.view_layer.layer_collection, "holdout", True),
    "painted": lambda: setattr(bpy.data.materials["paint"], "diffuse_color", (0, 1, 0, 1)),
    "other material": add_a_material,
    "material of the object": another_material_of_the_object,
    "override": lambda: setattr(bpy.context.view_layer, "material_override", bpy.data.materials["paint"]),
    "vertices": lambda: (
        thing("own").data.vertices.foreach_set("co", np.ones(12, np.float32)) or thing("own").data.update()
    ),
    "other mesh": lambda: setattr(thing("own"), "data", mesh_data("other")),
    "modifier": lambda: thing("own").modifiers.new("solid", "SOLIDIFY") and None,
    "instancer": lambda: setattr(thing("square 0"), "instance_type", "VERTS"),
    "not finite": lambda: setattr(thing("square 0").location, "z", float("inf")),
    "adaptive subdivision": ask_for_adaptive_subdivision,
    "world": lambda: setattr(bpy.context.scene, "world", bpy.data.worlds.new("sky")),
}


@pytest.mark.parametrize("name", LOUD)
def test_whatever_else_changes_all_is_read_again(sync: SceneSync, readings: list[bool], name: str) -> None:
    LOUD[name]()
    report = sync.update(evaluated(), verify=True)
    assert report.mismatches == ()
    assert True in readings
    assert_as_fresh(sync)
    # The next change of transforms is applied on top of that.
    thing("square 1").location.z = 6.0
    assert sync.update(evaluated(), verify=True).mismatches == ()
    assert_as_fresh(sync)


def test_what_is_asked_for_is_read(sync: SceneSync, readings: list[bool]) -> None:
    sync.request(AttributeRequest(corner_uvs=True))
    sync.update(evaluated())
    assert readings == [True]


def test_a_changed_image_is_read(sync: SceneSync, readings: list[bool]) -> None:
    image = bpy.data.images.new("dots", 2, 2)
    material = bpy.data.materials["paint"]
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    sync.update(evaluated())
    image.pixels.foreach_set(np.full(16, 0.5, np.float32))
    thing("square 0").location.z = 1.0
    readings.clear()
    sync.update(evaluated())
    assert readings == [True]
    assert_as_fresh(sync)


def test_an_object_that_coordinates_follow_is_never_old(sync: SceneSync, readings: list[bool]) -> None:
    """An object that is scaled to nothing does not end the reading either."""
    paint = bpy.data.materials["paint"]
    if not paint.node_tree:
        paint.use_nodes = True
    place = add(paint.node_tree, "TexCoord")
    place.object = thing("empty")
    paint.node_tree.links.new(place.outputs["Object"], shader(paint).inputs["Base Color"])
    sync.update(evaluated())
    first = sync.record.materials
    for change in ({"location": (1.0, 2.0, 3.0)}, {"scale": (0.0, 1.0, 1.0)}):
        for name, value in change.items():
            setattr(thing("empty"), name, value)
        sync.update(evaluated())
        assert sync.record.materials != first
        first = sync.record.materials
    assert all(readings)


def test_edit_mode_is_read_again(sync: SceneSync, readings: list[bool]) -> None:
    bpy.context.view_layer.objects.active = thing("own")
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        for step in range(3):
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.transform.translate(value=(0, 0, 1))
            thing("square 0").location.z = step
            assert sync.update(evaluated(), verify=True).mismatches == ()
            assert height(sync, 0.2, 5.2) == pytest.approx(step + 1)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    assert sync.update(evaluated(), verify=True).mismatches == ()


def test_light_linking_of_what_shines_is_read_again(sync: SceneSync, readings: list[bool]) -> None:
    own, few = thing("own"), bpy.data.collections.new("few")
    own.data.materials[0] = new_red("shine")
    shader(own.data.materials[0]).inputs["Emission Strength"].default_value = 1.0
    assert sync.update(evaluated()).not_shown == ()
    for receivers, told in ((few, ["own: its light linking is unsupported; it lights everything"]), (None, [])):
        readings.clear()
        own.light_linking.receiver_collection = receivers
        report = sync.update(evaluated(), verify=True)
        assert (list(map(str, report.not_shown)), report.mismatches) == (told, ())
        assert True in readings


def test_the_log_tells_what_it_does_not_know() -> None:
    log = EvaluationLog()
    assert log.find_touched(1, log.now) == frozenset()
    since = log.now
    log.forget()
    assert log.find_touched(1, since) is None
    assert log.find_touched(1, log.now) == frozenset()


def assert_as_fresh(sync: SceneSync) -> None:
    """Compare the whole record, and rays from above, with a fresh sync."""
    fresh = SceneSync(sync._attributes, watch=False)
    fresh.update(bpy.context.evaluated_depsgraph_get())
    one, other = sync.record, fresh.record
    assert (one.objects, one.materials, one.world, one.warnings) == (
        other.objects,
        other.materials,
        other.world,
        other.warnings,
    )
    np.testing.assert_array_equal(one.instances.transforms, other.instances.transforms)
    np.testing.assert_array_equal(one.instances.masks, other.instances.masks)
    np.testing.assert_array_equal(one.lights.positions, other.lights.positions)
    x, y = np.meshgrid(np.linspace(-3, 12, 40), np.linspace(-3, 8, 30))
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, 30.0)], axis=1)
    hits = [each.scene.cast_rays(origins, [(0.0, 0.0, -1.0)]) for each in (sync, fresh)]
    np.testing.assert_array_equal(hits[0].t_hit, hits[1].t_hit)
    names = [each.describe(hit.instance_ids).names for each, hit in zip((sync, fresh), hits, strict=True)]
    np.testing.assert_array_equal(*names)
    fresh.close()
