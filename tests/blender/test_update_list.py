"""Scene Updates as a list: its rows, the row that remains chosen, and the objects that choosing a row selects."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.builders import (  # noqa: E402
    camera_object,
    collection,
    collection_instance,
    mesh_data,
    mesh_object,
)
from perfect_bvh_addon.panels.reports import PERFECT_BVH_UL_updates, fitting_name  # noqa: E402
from perfect_bvh_addon.statistics import update_list  # noqa: E402


@pytest.fixture
def listed(registered: None, scene: Any) -> Any:
    """Return a function that renders and returns the scene's list."""
    camera_object().location.z = 9.0
    scene.render.engine = "PERFECT_BVH"

    def make() -> Any:
        bpy.ops.render.render()
        update_list.rows_of(scene)
        assert update_list.fill()
        return update_list.rows_of(scene)

    return make


def shown(rows: Any, word: str = "") -> list[str]:
    stand = SimpleNamespace(filter_name=word, bitflag_filter_item=1)
    flags, _ = PERFECT_BVH_UL_updates.filter_items(stand, bpy.context, rows, "rows")
    return [row.name for row, flag in zip(rows.rows, flags, strict=True) if flag]


def selected() -> set[str]:
    return {obj.name for obj in bpy.context.view_layer.objects if obj.select_get()}


def choose(rows: Any, name: str) -> None:
    rows.active = [row.name for row in rows.rows].index(name)


def test_what_is_unchanged_is_one_row_that_unfolds(listed: Any) -> None:
    for name in ("A", "B", "C"):
        mesh_object(name)
    assert set(shown(listed())) == {"A", "B", "C"}
    bpy.data.objects["B"].location.x = 1.0
    rows = listed()
    assert shown(rows) == ["B", "2 unchanged"]
    rows.is_unfolded = True
    assert shown(rows)[:2] == ["B", "2 unchanged"] and set(shown(rows)[2:]) == {"A", "C"}
    choose(rows, "2 unchanged")
    assert not rows.is_unfolded and rows.done == "", "the whole row folds"
    assert shown(rows, "c") == ["C"], "what is searched for is found without unfolding"
    assert not update_list.fill(), "nothing is new"


def test_what_is_unchanged_is_listed_at_once_where_nothing_else_is(listed: Any) -> None:
    for name in ("A", "B", "C"):
        mesh_object(name)
    listed()
    assert set(shown(listed())) == {"A", "B", "C"}


def test_the_chosen_row_stays_chosen_wherever_it_gets_to(listed: Any) -> None:
    for name in ("A", "B"):
        mesh_object(name)
    rows = listed()
    choose(rows, "A")
    assert selected() == {"A"}
    bpy.data.objects["B"].location.x = 1.0
    rows = listed()
    assert rows.rows[rows.active].name == "A" and rows.done.startswith("Unchanged")
    assert selected() == {"A"}, "only who chooses a row selects"


def test_a_row_selects_all_its_objects_and_no_others(listed: Any) -> None:
    shared = mesh_data("shared")
    for name in ("A", "B"):
        mesh_object(name, shared)
    mesh_object("C").select_set(True)
    rows = listed()
    choose(rows, "A and 1 more")
    assert selected() == {"A", "B"} and bpy.context.view_layer.objects.active.name in {"A", "B"}
    bpy.data.objects["A"].hide_set(True)
    choose(rows, "A and 1 more")
    assert selected() == {"B"} and rows.note == ""


def test_the_list_is_sorted_by_the_rays_or_by_the_time(listed: Any) -> None:
    for name, size in (("Small", 0.1), ("Large", 3.0), ("Middle", 1.0)):
        mesh_object(name).scale = (size,) * 3
    rows = listed()
    shares = {row.name: row.share for row in rows.rows}
    assert rows.sort_by == "SHARE" and shown(rows)[0] == "Large" and shares["Large"] > shares["Small"]
    rows.sort_by = "TIME"
    assert update_list.fill()
    found = update_list.updates_of(rows.scene_uid).changed
    assert [row.milliseconds for row in found] == sorted((row.milliseconds for row in found), reverse=True)
    assert shown(rows) == [row.name for row in found]


def test_the_number_of_objects_is_seen_however_narrow_the_sidebar(listed: Any) -> None:
    mesh = mesh_data("shared")
    for number in range(9):
        mesh_object(f"Figure {number}", mesh)
    mesh_object("Alone")
    items = {item.short_name: item for item in listed().rows if item.short_name}
    (shared,) = (item for name, item in items.items() if name.endswith(" +8"))
    assert shared.name.endswith(" and 8 more") and items["Alone"].name == "Alone"
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.5))
    for width, expected in ((300, shared.short_name), (1200, shared.name)):
        context = SimpleNamespace(region=SimpleNamespace(width=1.5 * width), preferences=preferences)
        item = SimpleNamespace(name=shared.name, short_name=shared.short_name, time="0.24 ms")
        assert fitting_name(context, item) == expected
    item.name = "A name that was cut in the middle of it"
    for width, is_whole in ((300, False), (480, True)):
        context = SimpleNamespace(region=SimpleNamespace(width=1.5 * width), preferences=preferences)
        assert (fitting_name(context, item) == item.name) == is_whole


@pytest.mark.parametrize(("width", "cells"), [(170, 1), (300, 3)])
def test_a_narrow_list_has_names_alone(width: int, cells: int) -> None:
    told: list[str] = []
    layout = SimpleNamespace(label=lambda text="", icon="": told.append(text))
    layout.split = lambda factor: layout
    layout.row = lambda: layout
    preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))
    context = SimpleNamespace(region=SimpleNamespace(width=width), preferences=preferences)
    item = SimpleNamespace(name="Tree", short_name="Tree", time="19 ms", share="16%", state="built")
    PERFECT_BVH_UL_updates.draw_item(None, context, layout, None, item, 0, None, "")
    assert told == ["Tree", "19 ms", "16%"][:cells]


def test_what_cannot_be_selected_is_said_and_raises_nothing(listed: Any) -> None:
    mesh_object("A")
    mesh_object("B")
    away = collection("away")
    mesh_object("Away", collection=away)
    rows = listed()
    choose(rows, "B")
    bpy.data.objects["A"].hide_set(True)
    choose(rows, "A")
    assert rows.note == "A: hidden here" and selected() == {"B"}
    bpy.context.view_layer.layer_collection.children["away"].exclude = True
    choose(rows, "Away")
    assert rows.note == "Away: not in this view layer" and selected() == {"B"}
    bpy.data.objects.remove(bpy.data.objects["Away"])
    choose(rows, "Away")
    assert "not in this view layer" in rows.note
    bpy.context.view_layer.objects.active = bpy.data.objects["B"]
    bpy.ops.object.mode_set(mode="EDIT")
    choose(rows, "A")
    assert rows.note == "Objects can be selected in Object Mode only"
    assert rows.done and rows.advice, "what was done is said all the same"
    bpy.ops.object.mode_set(mode="OBJECT")
    rows.active = 999
    assert rows.done == "" and bpy.ops.perfect_bvh.select_updated() == {"CANCELLED"}


def test_what_instances_show_selects_their_instancer(listed: Any) -> None:
    inner = collection("inner", linked=False)
    mesh_object("Leaf", collection=inner)
    collection_instance("Tree", inner)
    rows = listed()
    choose(rows, "Leaf")
    assert selected() == {"Tree"} and rows.note == ""


def test_selecting_is_a_step_that_can_be_undone(listed: Any) -> None:
    mesh_object("A").select_set(True)
    mesh_object("B")
    rows = listed()
    bpy.ops.ed.undo_push(message="before")
    choose(rows, "B")
    assert selected() == {"B"}
    bpy.ops.ed.undo()
    assert selected() == {"A"}
    assert update_list.rows_of(bpy.context.scene) is not None


def test_lists_go_with_their_file(listed: Any, tmp_path: Path) -> None:
    mesh_object("A")
    listed()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert update_list.rows_of(bpy.context.scene) is None and not update_list.fill()
    assert len(bpy.context.window_manager.perfect_bvh_updates) == 0
