"""The panels that report on a render: its statistics, a bench, and the list of unsupported features."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import pytest

bpy = pytest.importorskip("bpy")

from blender.drawn_texts import drawn, render_a_cube  # noqa: E402
from perfect_bvh_addon import panels  # noqa: E402
from perfect_bvh_addon.bench.results import (  # noqa: E402
    Results,
    Row,
    forget,
    remember,
)
from perfect_bvh_addon.panels import reports  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import ENGINE_NAME  # noqa: E402
from perfect_bvh_addon.statistics import last_result, not_shown  # noqa: E402
from perfect_bvh_addon.statistics.updates import STATES  # noqa: E402
from perfect_bvh_addon.sync.not_shown import Kind, NotShown  # noqa: E402


@pytest.fixture(autouse=True)
def rendered(registered: None) -> None:
    render_a_cube()


def test_the_table_of_a_bench_shows_with_its_advice_on_its_scene_only(tmp_path: Path) -> None:
    assert "spatial" not in drawn(panels.reports.PERFECT_BVH_PT_bench)
    rows = (
        Row("Builder", "spatial", "12.3 ms", "4.56 M rays/s", 1.0),
        Row("Updates", "refit", "1.00 ms", "1.00 M rays/s"),
    )
    sentences = {"builders": "Leave it.", "total_time": "Leave it."}
    results = Results(tmp_path / "bench.json", rows, sentences, {}, None, can_draw=False)
    remember(bpy.context.scene.session_uid, results)
    texts = drawn(panels.reports.PERFECT_BVH_PT_bench)
    start = texts.index("Builder")
    assert texts[start : start + 6] == ["Builder", "Build", "Rays", "spatial", "12.3 ms", "4.56 M rays/s"]
    assert texts[start + 6 :] == ["Updates", "Time", "Rays", "refit", "1.00 ms", "1.00 M rays/s", "Leave it."]
    forget()
    assert "spatial" not in drawn(panels.reports.PERFECT_BVH_PT_bench)


def test_a_builder_that_is_advised_can_be_compared(tmp_path: Path) -> None:
    button, compare = "perfect_bvh.compare_advised", bpy.context.scene.perfect_bvh.compare
    with pytest.raises(RuntimeError, match="benchmark this scene first"):
        bpy.ops.perfect_bvh.compare_advised()
    for better in (None, "spatial"):
        results = Results(tmp_path / "bench.json", (), {}, {}, None, can_draw=False, better=better)
        remember(bpy.context.scene.session_uid, results)
        assert (button in drawn(panels.reports.PERFECT_BVH_PT_bench)) == (better is not None)
    assert bpy.ops.perfect_bvh.compare_advised() == {"FINISHED"}
    assert (compare.left, compare.right) == ("AUTO", "SPATIAL")
    forget()


def test_an_audit_is_for_scripts_and_shows_in_no_panel() -> None:
    scene = bpy.context.scene
    bpy.ops.render.render()
    assert last_result.last_statistics(scene).audit is None
    rows = drawn(reports.PERFECT_BVH_PT_statistics)
    scene.perfect_bvh.audit, scene.perfect_bvh.samples = 0.5, 4
    bpy.ops.render.render()
    audit = last_result.last_statistics(scene).audit
    assert 0.4 * 4 * 32 * 18 < audit.checked_count < 0.6 * 4 * 32 * 18
    assert len(audit.wrong_rows) == 0
    assert not {"Audit", "Wrong"} & {*rows, *drawn(reports.PERFECT_BVH_PT_statistics)}
    scene.camera.data.type = "PANO"  # so that each panel is shown
    assert not any("audit" in name.lower() for panel in panels.CLASSES for name in drawn(panel))


# Not shown -----------------------------------------------------------------------------------------------------------


def test_all_that_could_not_be_read_stays_in_the_list_and_the_statistics_tell_of_it() -> None:
    for number in range(5):
        mesh = bpy.data.meshes.new(f"broken {number}")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (float("nan"), 1, 0)], [], [(0, 1, 2)])
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Broken {number}", mesh))
    assert "simplified" not in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))
    bpy.ops.render.render()
    not_shown.list_rows()
    panel = panels.reports.PERFECT_BVH_PT_not_shown
    texts = drawn(panel)
    assert [text for text in texts if text.startswith("Broken ") and "not finite" in text][:5] == [
        f"Broken {number}: left out 1 triangle with a vertex that is not finite or beyond 1e18" for number in range(5)
    ]
    assert "5 objects simplified: see Not Shown" in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))


def test_a_scene_of_which_nothing_is_missing_says_so_once_it_was_rendered() -> None:
    panel = panels.reports.PERFECT_BVH_PT_not_shown
    assert drawn(panel)[0] == "No light"
    bpy.context.scene.perfect_bvh.mode = "CLAY"
    bpy.ops.render.render()
    assert " ".join(drawn(panel)) == reports.ALL_SHOWN
    other = bpy.data.scenes.new("Other")
    assert not panel.poll(SimpleNamespace(engine=ENGINE_NAME, scene=other))


def broken_scene() -> Any:
    """Build a scene with one unsupported feature of each kind; return the material that has one."""
    material = bpy.data.materials.new("Wall")
    if not material.node_tree:
        material.use_nodes = True
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeAmbientOcclusion")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Cube"].data.materials.append(material)
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    bpy.ops.object.light_add()
    bpy.context.object.visible_glossy = False
    bpy.context.view_layer.use_sky = False
    bpy.ops.render.render()
    return material


def test_what_is_not_shown_is_listed_and_can_be_selected() -> None:
    material = broken_scene()
    panel = panels.reports.PERFECT_BVH_PT_not_shown
    line = "1 material simplified, 1 object not shown, 1 light simplified, 1 setting ignored"
    assert not_shown.line_of(bpy.context.scene) == line
    assert not_shown.list_rows()
    assert not not_shown.list_rows(), "nothing is new"
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    rows = {row.kind: row for row in listed.rows}
    assert set(rows) == {"material", "object", "light", "setting"}
    texts = drawn(panel)
    assert " ".join(texts).startswith(line)
    assert "Wall: Ambient Occlusion is unsupported; its flat colour is used" in texts
    assert "View Layer ViewLayer: the filter Environment is ignored, as if it was on" in texts
    for kind, name in (("material", "Cube"), ("object", "Smoke"), ("light", "Point"), ("setting", None)):
        listed.active = [row.kind for row in listed.rows].index(kind)
        assert (drawn(panel)[-1] == "perfect_bvh.select_not_shown") == (name is not None)
        if name is not None:
            uid = listed.rows[listed.active].session_uid
            assert bpy.ops.perfect_bvh.select_not_shown(kind=kind, session_uid=uid) == {"FINISHED"}
            assert [obj.name for obj in bpy.context.selected_objects] == [name]
    bpy.data.objects["Cube"].data.materials.clear()
    assert bpy.ops.perfect_bvh.select_not_shown(kind="material", session_uid=material.session_uid) == {"CANCELLED"}
    bpy.ops.render.render()
    assert not_shown.list_rows()


@pytest.mark.parametrize("kind", ["shape", "light"])
def test_objects_whose_shape_or_light_is_simplified_can_be_selected(kind: Kind) -> None:
    cube = bpy.data.objects["Cube"]
    row = NotShown(kind, cube.name, cube.session_uid, "something is unsupported; something else is used")
    not_shown.tell(bpy.context.scene, (row,))
    assert not_shown.list_rows()
    panel = panels.reports.PERFECT_BVH_PT_not_shown
    assert drawn(panel)[-1] == "perfect_bvh.select_not_shown"
    assert bpy.ops.perfect_bvh.select_not_shown(kind=kind, session_uid=cube.session_uid) == {"FINISHED"}
    assert [obj.name for obj in bpy.context.selected_objects] == ["Cube"]
    assert "Wall" not in " ".join(drawn(panel))


def test_a_scene_lists_what_is_not_shown_of_it_alone() -> None:
    broken_scene()
    not_shown.list_rows()
    other = bpy.data.scenes.new("Other")
    shown = SimpleNamespace(filter_name="", bitflag_filter_item=1)
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    flags = {}
    for scene in (bpy.context.scene, other):
        made = panels.reports.PERFECT_BVH_UL_not_shown
        flags[scene.name], _ = made.filter_items(shown, SimpleNamespace(scene=scene), listed, "rows")
    assert flags == {"Scene": [1] * 4, "Other": [0] * 4}
    shown.filter_name = "OCCLUSION"
    made = panels.reports.PERFECT_BVH_UL_not_shown
    assert sum(made.filter_items(shown, bpy.context, listed, "rows")[0]) == 1
    panel = panels.reports.PERFECT_BVH_PT_not_shown
    assert not panel.poll(SimpleNamespace(engine=ENGINE_NAME, scene=other))


def test_a_file_that_is_opened_lists_nothing_of_the_last_one(tmp_path: Path) -> None:
    broken_scene()
    not_shown.list_rows()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert not_shown.told(bpy.context.scene) == ()
    assert not_shown.list_rows()
    assert len(bpy.context.window_manager.perfect_bvh_not_shown.rows) == 0


def test_every_kind_has_an_icon_that_blender_has() -> None:
    icons = bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys()
    assert set(panels.reports.NOT_SHOWN_ICONS.values()) <= set(icons)
    assert set(get_args(Kind)) == set(panels.reports.NOT_SHOWN_ICONS)
    assert set(panels.reports.ICONS.values()) <= set(icons)
    assert set(STATES) == set(panels.reports.ICONS)
