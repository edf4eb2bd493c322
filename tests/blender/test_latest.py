"""The panels' report of the last work on a scene, and whether it is still up to date."""

from __future__ import annotations

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from blender.drawn_texts import drawn  # noqa: E402
from perfect_bvh_addon.engine import RenderJob, attend  # noqa: E402
from perfect_bvh_addon.panels import reports  # noqa: E402
from perfect_bvh_addon.settings import preferences  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402
from perfect_bvh_addon.statistics import last_result  # noqa: E402
from perfect_bvh_addon.statistics import last_result as summary  # noqa: E402
from perfect_bvh_addon.statistics.updates import find_updates  # noqa: E402

OUTDATED = "The scene has changed since"


@pytest.fixture(autouse=True)
def rendered(registered: None) -> None:
    """A cube in a rendered scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.camera_add(location=(0.0, 0.0, 8.0))
    scene.camera = bpy.context.object
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    scene.perfect_bvh.samples = 2
    bpy.ops.render.render()


def first_rows() -> list[tuple[str, str]]:
    return summary.statistics_rows(last_result.last_statistics(bpy.context.scene))[:2]


def test_a_render_and_a_preview_say_what_they_were_of() -> None:
    assert first_rows() == [("Render", "Frame 1"), ("Resolution", "32 x 18 px")]
    bpy.context.scene.perfect_bvh.preview_percentage = 50
    assert bpy.ops.perfect_bvh.preview() == {"FINISHED"}
    assert first_rows() == [("View to Image", "Frame 1"), ("Resolution", "16 x 9 px")]
    statistics = last_result.last_statistics(bpy.context.scene)
    assert statistics.camera_rays == 2 * 16 * 9
    assert statistics.trace_milliseconds > 0.0
    updates = find_updates(statistics.report, statistics.owners)
    (row,) = updates.changed or updates.unchanged
    assert 0.5 < row.share <= 1.0  # the other rays hit nothing


def edit_object() -> None:
    bpy.data.objects["Cube"].location.x += 1.0
    bpy.context.view_layer.update()


def edit_mesh() -> None:
    bpy.data.meshes["Cube"].vertices[0].co.x += 1.0
    bpy.data.meshes["Cube"].update()
    bpy.context.view_layer.update()


def delete_object() -> None:
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.context.view_layer.update()


def change_frame() -> None:
    bpy.context.scene.frame_set(2)


def change_settings() -> None:
    bpy.context.scene.perfect_bvh.mode = "COST"


@pytest.mark.parametrize("edit", [edit_object, edit_mesh, delete_object, change_frame, change_settings])
def test_an_edit_outdates_what_was_done_and_a_render_renews_it(edit) -> None:
    scene = bpy.context.scene
    assert not last_result.is_outdated(scene)
    edit()
    assert last_result.is_outdated(scene)
    assert OUTDATED in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))
    bpy.ops.render.render()
    assert OUTDATED not in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))
    assert not last_result.is_outdated(scene)


def of_viewport(mode: str) -> Any:
    """The statistics that a Rendered viewport in this mode leaves."""
    scene = bpy.context.scene
    settings = replace(read_settings(scene, is_viewport=True), mode=mode)
    return replace(last_result.last_statistics(scene), source="Viewport", settings=settings)


def test_a_viewport_with_a_mode_of_its_own_is_not_outdated_by_that() -> None:
    scene = bpy.context.scene
    last_result.remember(scene, of_viewport("normal"), last_result.edits_of(scene))
    assert not last_result.is_outdated(scene)
    scene.perfect_bvh.viewport_samples = 7
    assert last_result.is_outdated(scene)


def test_what_the_last_render_shows_is_known_whatever_viewports_do() -> None:
    scene = bpy.context.scene
    assert last_result.last_render_mode(scene) == "preview"
    last_result.remember(scene, of_viewport("cost"), last_result.edits_of(scene))
    assert last_result.last_render_mode(scene) == "preview"
    scene.perfect_bvh.mode = "COST"
    bpy.ops.render.render()
    assert last_result.last_render_mode(scene) == "cost"
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert last_result.last_render_mode(bpy.context.scene) is None


def test_what_only_selects_outdates_nothing() -> None:
    bpy.data.objects["Cube"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    bpy.context.view_layer.update()
    assert not last_result.is_outdated(bpy.context.scene)


def test_an_edit_of_another_scene_outdates_nothing() -> None:
    first = bpy.context.scene
    other = bpy.data.scenes.new("Other")
    made = bpy.data.objects.new("Only there", bpy.data.meshes.new("Only there"))
    other.collection.objects.link(made)
    other.view_layers[0].update()
    made.location.x = 3.0
    other.view_layers[0].update()
    assert not last_result.is_outdated(first)


def test_what_was_done_goes_with_its_scene_and_its_file() -> None:
    scene = bpy.context.scene
    uid = scene.session_uid
    other = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(scene)
    other.view_layers[0].update()
    bpy.context.view_layer.update()
    assert uid not in last_result._latest
    last_result._latest[other.session_uid] = None
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert not last_result._latest


def test_panels_are_drawn_again_by_the_main_thread_alone(monkeypatch) -> None:
    """A render's thread leaves a note; only the thread that looks for notes touches areas."""
    drawn: list[tuple[str, threading.Thread]] = []
    regions: list[tuple[str, threading.Thread]] = []

    def place(kind: str, tagged: list[tuple[str, threading.Thread]], **more: Any) -> SimpleNamespace:
        return SimpleNamespace(type=kind, tag_redraw=lambda: tagged.append((kind, threading.current_thread())), **more)

    def area(kind: str) -> SimpleNamespace:
        return place(kind, drawn, regions=[place(region, regions) for region in ("WINDOW", "UI")])

    window = SimpleNamespace(screen=SimpleNamespace(areas=[area("PROPERTIES"), area("VIEW_3D")]))
    context = SimpleNamespace(window_manager=SimpleNamespace(windows=[window, window]))
    last_result._show_news()
    scene, statistics = bpy.context.scene, last_result.last_statistics(bpy.context.scene)
    monkeypatch.setattr(preferences, "bpy", SimpleNamespace(context=context))
    assert last_result._show_news() == last_result.TIMER_SECONDS
    assert not drawn
    thread = threading.Thread(target=last_result.remember, args=(scene, statistics, last_result.edits_of(scene)))
    thread.start()
    thread.join()
    assert not drawn
    last_result._show_news()
    last_result._show_news()
    assert drawn == [("PROPERTIES", threading.main_thread())] * 2
    assert regions == [("UI", threading.main_thread())] * 2, "of viewports the sidebars alone"
    for _ in range(2):
        edit_object()
        last_result._show_news()
    assert len(drawn) == 4, "they have heard of the first edit, and say of the second what they say already"


def test_a_viewport_that_finds_nothing_changed_confirms_what_a_viewport_did() -> None:
    scene = bpy.context.scene
    statistics = last_result.last_statistics(scene)
    edit_object()
    last_result.confirm_view(scene, statistics.report)
    assert last_result.is_outdated(scene)  # a render is not confirmed by viewports
    shown = replace(statistics, source="Viewport", settings=read_settings(scene, is_viewport=True))
    last_result.remember(scene, shown, last_result.edits_of(scene))
    edit_object()
    last_result.confirm_view(scene, replace(statistics.report))
    assert last_result.is_outdated(scene)  # a viewport with other trees, as in local view, says nothing of it either
    last_result.confirm_view(scene, statistics.report)
    assert not last_result.is_outdated(scene)


def test_an_edit_during_a_render_outdates_it() -> None:
    """The render shows the scene that was read at the start."""
    scene = bpy.context.scene
    edits = iter([edit_object])

    def go_on(done: float) -> bool:
        for edit in edits:
            edit()
        return True

    with attend(RenderJob(progress=go_on)) as job:
        bpy.ops.render.render()
    assert job.frame is not None and next(edits, None) is None
    assert last_result.is_outdated(scene)
    bpy.ops.render.render()
    assert not last_result.is_outdated(scene)


def test_undoing_outdates_what_was_done() -> None:
    for message in ("before", "after"):
        edit_object()
        bpy.ops.ed.undo_push(message=message)
    bpy.ops.render.render()
    assert not last_result.is_outdated(bpy.context.scene)
    bpy.ops.ed.undo()
    assert last_result.is_outdated(bpy.context.scene)
