"""Tooltips everywhere: all registered items describe themselves in Blender's style, and grey ones give the reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from perfect_bvh_addon import operators  # noqa: E402
from perfect_bvh_addon.settings import preferences, scene_settings  # noqa: E402
from perfect_bvh_addon.statistics import not_shown, update_list  # noqa: E402
from perfect_bvh_addon.view3d import pointer  # noqa: E402

OPERATORS = [
    found
    for module in (
        *(operators.preview, operators.scan_button, operators.scan_request, operators.label_button, operators.measure),
        *(operators.add_sensor, operators.select, operators.walk, operators.bake_button, operators.help_buttons),
        pointer,
    )
    for found in vars(module).values()
    if isinstance(found, type) and issubclass(found, bpy.types.Operator)
]
OWNERS = [
    *scene_settings.CLASSES,
    *not_shown.CLASSES,
    *update_list.CLASSES,
    preferences.PERFECT_BVH_AP_preferences,
    *OPERATORS,
]


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    yield
    perfect_bvh_addon.unregister()


def rna_of(owner: Any) -> Any:
    """Return Blender's description of a class; for operators it comes from the call, because the class has none."""
    is_operator = issubclass(owner, bpy.types.Operator)
    return call_of(owner).get_rna_type() if is_operator else owner.bl_rna


def call_of(operator: Any) -> Any:
    return getattr(bpy.ops.perfect_bvh, operator.bl_idname.partition(".")[2])


def own_properties() -> Iterator[tuple[str, Any]]:
    """Yield all properties that the add-on registers, with a name for messages."""
    yield "Scene.perfect_bvh", bpy.types.Scene.bl_rna.properties["perfect_bvh"]
    for owner in OWNERS:
        for found in rna_of(owner).properties:
            if found.is_runtime:  # skips the properties that Blender gives every class
                yield f"{owner.__name__}.{found.identifier}", found


def find_fault(text: str, name: str) -> str | None:
    """Return why `text` is not a proper tooltip of an item called `name`."""
    if len(text.split()) < 3:
        return "says too little"
    if text.strip() != text or not (text[0].isupper() or not text[0].isalpha()):
        return "does not begin as a sentence"
    if text.endswith("."):
        return "ends with a full stop, which Blender's do not"
    if text.lower().startswith(name.lower() + " ") and len(text.split()) < 5:
        return "says the name again"
    return None


def test_every_class_of_operators_is_looked_at() -> None:
    """Fails if a new operator is missing in these tests."""
    known = {name for name in dir(bpy.types) if name.startswith("PERFECT_BVH_OT_")}
    assert known == {operator.__name__ for operator in OPERATORS}


def test_every_property_has_a_tooltip() -> None:
    faults = {where: find_fault(found.description, found.name) for where, found in own_properties()}
    assert {where: fault for where, fault in faults.items() if fault} == {}


def test_no_two_properties_say_the_same() -> None:
    counts = Counter(found.description for _, found in own_properties())
    assert [text for text, count in counts.items() if count > 1] == []


def test_every_choice_of_a_menu_has_a_tooltip() -> None:
    faults = {
        f"{where}={item.identifier}": find_fault(item.description, item.name)
        for where, found in own_properties()
        if found.type == "ENUM"
        for item in found.enum_items
    }
    assert len(faults) > 15
    assert {where: fault for where, fault in faults.items() if fault} == {}


@pytest.mark.parametrize("operator", OPERATORS, ids=lambda operator: operator.__name__)
def test_every_operator_has_a_tooltip(operator: Any) -> None:
    assert find_fault(rna_of(operator).description, operator.bl_label) is None


def edit_a_mesh() -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")


def nothing_is_there() -> None:
    """Leave the empty scene unchanged."""


@pytest.mark.parametrize(
    ("call", "spoil", "reason"),
    [
        ("preview", nothing_is_there, "neither a 3D viewport nor a camera"),
        ("scan", nothing_is_there, "No sensor: choose a Sensor Object"),
        ("scan", edit_a_mesh, "Switch to Object Mode first"),
        ("bake_rays", nothing_is_there, "Nothing selected: select the meshes"),
        ("bake_rays", edit_a_mesh, "Switch to Object Mode first"),
        ("select_updated", edit_a_mesh, "in Object Mode only"),
        ("select_not_shown", edit_a_mesh, "in Object Mode only"),
    ],
)
def test_a_grey_button_says_why(call: str, spoil: Callable[[], None], reason: str) -> None:
    spoil()
    operator = getattr(bpy.ops.perfect_bvh, call)
    assert not operator.poll()
    with pytest.raises(RuntimeError, match=reason):
        operator()


@pytest.mark.parametrize("name", ["preview", "scan", "bench"])
def test_without_the_engine_what_needs_it_is_grey_and_says_so(name: str, monkeypatch) -> None:
    reason = "The native engine could not be loaded: a damaged file"
    monkeypatch.setattr(operators.ticking, "native_error", lambda: reason)
    (operator,) = [found for found in OPERATORS if found.bl_idname == f"perfect_bvh.{name}"]
    with pytest.raises(RuntimeError, match=reason):
        call_of(operator)()
