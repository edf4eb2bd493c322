"""Uv maps and colours of meshes: read for the materials that name them, and never stale when either is edited."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from blender.builders import SQUARE, evaluated, mesh_data, mesh_object
from blender.node_setups import add, image_node, new_red, paint, shader
from perfect_bvh_addon import AttributeRequest, SceneSync
from perfect_bvh_addon.sync.records import MeshRecord

LINKED_TO_OBJECT = "OBJECT"


@pytest.fixture
def sync(scene: Any) -> Iterator[SceneSync]:
    """Two equal painted squares with two uv maps, side by side; no material shows the maps or the paint."""
    for name in ("one", "other"):
        obj = mesh_object(name, mesh_data(name, *SQUARE))
        paint(obj.data)
        for number, layer in enumerate(("Plain", "Second")):
            uvs = obj.data.uv_layers.new(name=layer).uv
            uvs.foreach_set("vector", np.float32([number + 0.1 * corner for corner in range(8)]))
        obj.data.materials.append(new_red(name))
    made = SceneSync(AttributeRequest(shading=True))
    made.update(evaluated())
    yield made
    made.close()


def mesh_of(sync: SceneSync, name: str = "one") -> MeshRecord:
    return next(mesh for mesh in sync.record.meshes if mesh.name == name)


def layers_of(mesh: MeshRecord) -> set[str]:
    """Return the names of all layers that were read; active ones are "uv" and "color"."""
    unnamed = {"uv": mesh.corner_uvs, "color": mesh.corner_colors}
    return {name for name, array in unnamed.items() if array is not None} | {*mesh.named_uvs, *mesh.named_colors}


def update(sync: SceneSync) -> Any:
    report = sync.update(evaluated(), verify=True)
    assert report.mismatches == ()
    return report


def show_color(material: Any, name: str = "Paint") -> Any:
    tree = material.node_tree
    node = add(tree, "Attribute")
    node.attribute_name = name
    tree.links.new(node.outputs["Color"], shader(material).inputs["Base Color"])
    return node


def show_image(material: Any, uv_map: str | None = None, socket: str = "Base Color") -> Any:
    """Show an image with this uv map, or with the active one."""
    tree = material.node_tree
    image = image_node(tree)
    tree.links.new(image.outputs[0], shader(material).inputs[socket])
    if uv_map is None:
        return image
    node = add(tree, "UVMap")
    node.uv_map = uv_map
    tree.links.new(node.outputs[0], image.inputs[0])
    return node


def material(name: str = "one") -> Any:
    return bpy.data.materials[name]


def data(name: str = "one") -> Any:
    return bpy.data.objects[name].data


def test_nothing_is_read_that_no_material_shows(sync: SceneSync) -> None:
    assert [layers_of(mesh) for mesh in sync.record.meshes] == [set(), set()]


def test_a_material_that_begins_to_show_colors_has_them_read_and_dropped_again(sync: SceneSync) -> None:
    show_color(material())
    report = update(sync)
    assert (report.attributes_changed, report.materials_changed) == (True, True)
    mesh = mesh_of(sync)
    assert layers_of(mesh) == {"Paint"}
    painted = np.array([item.color[:3] for item in data().color_attributes["Paint"].data], np.float32)
    np.testing.assert_array_equal(mesh.named_colors["Paint"][0], painted[data().loop_triangles[0].loops])
    assert layers_of(mesh_of(sync, "other")) == set()
    held = mesh.positions
    sync.update(evaluated())
    assert mesh_of(sync).named_colors["Paint"] is mesh.named_colors["Paint"]  # not read again

    tree = material().node_tree
    tree.links.remove(shader(material()).inputs["Base Color"].links[0])
    assert update(sync).attributes_changed
    assert layers_of(mesh_of(sync)) == set()
    assert mesh_of(sync).positions is held


def test_another_material_in_the_slot_has_its_layers_read(sync: SceneSync) -> None:
    show_color(material("other"))
    update(sync)
    data().materials[0] = material("other")
    update(sync)
    assert layers_of(mesh_of(sync)) == {"Paint"}
    data().materials[0] = material("one")
    update(sync)
    assert layers_of(mesh_of(sync)) == set()


def repaint() -> None:
    for item in data().color_attributes["Paint"].data:
        item.color = (0.2, 0.4, 0.6, 1.0)
    data().update()


def move_uvs() -> None:
    data().uv_layers["Second"].uv.foreach_set("vector", np.full(8, 0.3, np.float32))
    data().update()


EDITS: dict[str, tuple[Callable[[], None], set[str]]] = {
    "painted": (repaint, {"Paint", "Second"}),
    "uvs moved": (move_uvs, {"Paint", "Second"}),
    "colors renamed": (lambda: setattr(data().color_attributes["Paint"], "name", "New"), {"Second"}),
    "map renamed": (lambda: setattr(data().uv_layers["Second"], "name", "New"), {"Paint"}),
    "colors removed": (lambda: data().color_attributes.remove(data().color_attributes["Paint"]), {"Second"}),
    "map removed": (lambda: data().uv_layers.remove(data().uv_layers["Second"]), {"Paint"}),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_of_what_is_shown_is_read(sync: SceneSync, name: str) -> None:
    show_color(material())
    show_image(material(), "Second", "Emission Color")
    shader(material()).inputs["Emission Strength"].default_value = 1.0
    update(sync)
    assert layers_of(mesh_of(sync)) == {"Paint", "Second"}
    edit, expected = EDITS[name]
    edit()
    data().update_tag()  # as the interface does; Blender itself goes on with the old ones after a script's edit
    assert update(sync).attributes_changed
    assert layers_of(mesh_of(sync)) == expected


def test_another_active_map_is_read(sync: SceneSync) -> None:
    show_image(material())
    update(sync)
    first = mesh_of(sync).corner_uvs
    data().uv_layers["Second"].active_render = True
    assert update(sync).attributes_changed
    assert not np.array_equal(mesh_of(sync).corner_uvs, first)


def test_materials_of_one_mesh_and_images_of_one_material_name_different_maps(sync: SceneSync) -> None:
    show_image(material(), "Second")
    show_image(material(), None, "Emission Color")
    shader(material()).inputs["Emission Strength"].default_value = 1.0
    show_image(material("other"), "Plain")
    data().materials.append(material("other"))
    update(sync)
    mesh = mesh_of(sync)
    assert layers_of(mesh) == {"uv", "Plain", "Second"}
    assert mesh.named_uvs["Plain"] is mesh.corner_uvs
    assert layers_of(mesh_of(sync, "other")) == {"Plain"}
    names = [record.program.layer_names("uvs") for record in sync.record.materials if record.program is not None]
    assert set().union(*names) == {"", "Plain", "Second"}


def test_a_node_that_names_another_map_is_followed(sync: SceneSync) -> None:
    node = show_image(material(), "Second")
    update(sync)
    node.uv_map = "Plain"
    update(sync)
    assert layers_of(mesh_of(sync)) == {"Plain"}
    node.uv_map = "nothing"
    update(sync)
    assert layers_of(mesh_of(sync)) == set()


@pytest.mark.parametrize("is_named_first", [False, True])
def test_a_shared_mesh_has_what_all_that_show_it_want(sync: SceneSync, is_named_first: bool) -> None:
    """The engine has one mesh, although one object has a separate material."""
    show_color(material("other"))
    twin = mesh_object("a twin" if is_named_first else "twin", data())
    twin.material_slots[0].link = LINKED_TO_OBJECT
    twin.material_slots[0].material = material("other")
    for _ in range(2):
        update(sync)
        assert len(sync.record.meshes) == 2
        assert layers_of(mesh_of(sync)) == {"Paint"}
    before = mesh_of(sync).named_colors["Paint"]
    bpy.data.objects["other"].location.x += 1.0
    data("other").update_tag()
    update(sync)
    assert mesh_of(sync).named_colors["Paint"] is before
    twin.material_slots[0].material = material("one")
    update(sync)
    assert layers_of(mesh_of(sync)) == set()


def test_twins_that_are_painted_differently_stay_apart(sync: SceneSync) -> None:
    """Each object has a separate evaluated mesh; the meshes differ only in colours that some materials show."""
    show_color(material("other"))
    for name in ("first", "second"):
        obj = mesh_object(name, data())
        obj.modifiers.new("flat", "TRIANGULATE")
        obj.material_slots[0].link = LINKED_TO_OBJECT
        obj.material_slots[0].material = material("one")
    update(sync)
    assert len(sync.record.meshes) == 3  # they are one
    bpy.data.objects["second"].material_slots[0].material = material("other")
    update(sync)
    assert sorted(map(sorted, map(layers_of, sync.record.meshes))) == [[], [], ["Paint"], ["Paint"]]


def test_what_is_drawn_in_edit_mode_is_read(sync: SceneSync) -> None:
    show_image(material(), "Second")
    update(sync)
    before = mesh_of(sync).named_uvs["Second"]
    bpy.context.view_layer.objects.active = bpy.data.objects["one"]
    bpy.ops.object.mode_set(mode="EDIT")
    update(sync)
    np.testing.assert_array_equal(mesh_of(sync).named_uvs["Second"], before)
    bpy.ops.object.mode_set(mode="OBJECT")


def test_the_mode_uv_reads_the_active_map_of_all(sync: SceneSync) -> None:
    sync.request(AttributeRequest(corner_uvs=True), only=True)
    update(sync)
    assert [layers_of(mesh) for mesh in sync.record.meshes] == [{"uv"}, {"uv"}]


@pytest.mark.parametrize(
    ("kind", "domain", "value", "expected"),
    [
        ("FLOAT", "POINT", {"value": 0.35}, (0.35, 0.35, 0.35)),
        ("FLOAT2", "FACE", {"vector": (0.1, 0.2)}, (0.1, 0.2, 0.0)),
        ("FLOAT_VECTOR", "CORNER", {"vector": (0.1, 0.2, 0.3)}, (0.1, 0.2, 0.3)),
        ("FLOAT_COLOR", "POINT", {"color": (0.1, 0.2, 0.3, 1.0)}, (0.1, 0.2, 0.3)),
        ("FLOAT_VECTOR", "EDGE", {"vector": (0.1, 0.2, 0.3)}, None),
    ],
)
def test_any_attribute_may_be_the_color(sync: SceneSync, kind: str, domain: str, value: Any, expected: Any) -> None:
    attribute = data().attributes.new("made", kind, domain)
    for item in attribute.data:
        for name, number in value.items():
            setattr(item, name, number)
    show_color(material(), "made")
    update(sync)
    colors = mesh_of(sync).named_colors
    if expected is None:
        assert colors == {}
    else:
        assert colors["made"].reshape(-1, 3) == pytest.approx(np.float32([expected] * 6))
