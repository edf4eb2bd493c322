"""Errors remain where users look for them until newer work is done."""

from __future__ import annotations

import dataclasses
from typing import Any, get_args

import pytest

bpy: Any = pytest.importorskip("bpy")

from blender.builders import camera_object, mesh_object  # noqa: E402
from blender.drawn_texts import drawn  # noqa: E402
from perfect_bvh_addon import engine, panels  # noqa: E402
from perfect_bvh_addon.image import still  # noqa: E402
from perfect_bvh_addon.panels import reports  # noqa: E402
from perfect_bvh_addon.statistics import last_result, messages, not_shown  # noqa: E402
from perfect_bvh_addon.statistics.messages import messages_of  # noqa: E402
from perfect_bvh_addon.sync.not_shown import Kind, NotShown  # noqa: E402


@pytest.fixture(autouse=True)
def cube(registered: None, scene: Any) -> Any:
    scene.render.engine = "PERFECT_BVH"
    return mesh_object("Cube")


def texts() -> list[str]:
    return [message.text for message in messages_of(bpy.context.scene)]


def test_why_a_render_failed_is_shown_until_the_next_one() -> None:
    scene, camera = bpy.context.scene, camera_object()
    camera.location.z, camera.data.clip_end = 5.0, camera.data.clip_start
    with pytest.raises(RuntimeError):
        bpy.ops.render.render()
    (message,) = messages_of(scene)
    assert message.is_error and message.text.startswith("Scene 'Scene' has no camera")
    assert "clips everything" in message.text
    camera.data.clip_end = 100.0
    shown = drawn(reports.PERFECT_BVH_PT_statistics)
    assert "Messages" in shown and "has no camera" in " ".join(shown)
    bpy.ops.render.render()
    assert texts() == []
    assert "has no camera" not in " ".join(drawn(reports.PERFECT_BVH_PT_statistics))


def test_all_complaints_of_an_image_are_shown_and_what_is_listed_elsewhere_is_not_repeated() -> None:
    camera_object().location.z = 5.0
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    bpy.ops.render.render()
    statistics = messages.last_statistics(bpy.context.scene)
    assert any("Smoke" in warning for warning in statistics.report.warnings)
    assert texts() == []
    shown = " ".join(drawn(reports.PERFECT_BVH_PT_statistics))
    assert "1 object not shown" in shown and "see Not Shown" in shown
    not_shown.list_rows()
    listed = bpy.context.window_manager.perfect_bvh_not_shown
    listed.active = [row.name for row in listed.rows].index("Smoke")
    assert "Volume to Mesh" in " ".join(drawn(panels.reports.PERFECT_BVH_PT_not_shown))


def test_a_scan_that_fails_says_so_in_its_panel_and_in_the_statistics() -> None:
    camera_object().location.z = 5.0
    scan = bpy.context.scene.perfect_bvh.scan
    scan.pattern, scan.elevations = "LIDAR", "often"
    with pytest.raises(RuntimeError):
        bpy.ops.perfect_bvh.scan()
    (message,) = messages_of(bpy.context.scene)
    assert (message.source, message.is_error) == ("Scan", True) and message.text.startswith("Elevations must be")
    assert "Elevations must be degrees" in " ".join(drawn(panels.output.PERFECT_BVH_PT_scan))
    assert reports.PERFECT_BVH_PT_statistics.poll(bpy.context)
    scan.elevations, scan.columns = "-20:20:3", 12
    assert bpy.ops.perfect_bvh.scan() in ({"FINISHED"}, {"CANCELLED"})
    assert not any("Elevations" in text for text in texts())


def test_the_same_is_told_once_and_errors_first() -> None:
    scene = bpy.context.scene
    messages.tell(scene, "Scan", "A thing")
    messages.tell(scene, "Render", "Another", "A thing", is_error=True)
    assert [(message.text, message.is_error) for message in messages_of(scene)] == [
        ("Another", True),
        ("A thing", True),
    ]
    messages.begin_render(scene)
    assert texts() == ["A thing"]
    other = bpy.data.scenes.new("Other")
    messages.tell(other, "Scan", "Of the other")
    assert texts() == ["A thing"]


class View:
    """Stands in for a viewport; only its existence matters."""


def test_each_viewport_has_messages_of_its_own_and_renders_end_none_of_them() -> None:
    scene, left, right = bpy.context.scene, View(), View()
    messages.tell_of_view(scene, left, "Of the left one", is_error=True)
    messages.tell_of_view(scene, right, "Of the right one")
    assert texts() == ["Of the left one", "Of the right one"]
    messages.tell_of_view(scene, right, None)
    assert texts() == ["Of the left one"]
    messages.tell_of_view(scene, right, "Of the right one")
    messages.tell(scene, messages.RENDER, "Of a render")
    messages.begin_render(scene)
    assert texts() == ["Of the left one", "Of the right one"]
    other = bpy.data.scenes.new("Other")
    messages.tell_of_view(other, right, "Of the other scene")
    assert texts() == ["Of the left one"] and [one.text for one in messages_of(other)] == ["Of the other scene"]
    del left
    assert texts() == []


def test_what_a_render_complains_of_stays_when_a_view_is_done_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    camera_object().location.z = 5.0
    with monkeypatch.context() as patch:
        patch.setattr(engine, "render_frame", complaining)
        bpy.ops.render.render()
    assert texts() == ["No denoiser"]
    done = messages.last_statistics(bpy.context.scene)
    last_result.remember(bpy.context.scene, dataclasses.replace(done, source="Viewport", complaints=()), 0)
    assert texts() == ["No denoiser"]
    bpy.ops.render.render()
    assert texts() == []


def complaining(*arguments: Any, **options: Any) -> Any:
    """Render an image and add a complaint to its statistics."""
    made = still.render_frame(*arguments, **options)
    return dataclasses.replace(made, statistics=dataclasses.replace(made.statistics, complaints=("No denoiser",)))


def test_all_layers_of_an_image_say_what_they_lack_until_the_next_one() -> None:
    scene = bpy.context.scene
    camera_object().location.z = 5.0
    bpy.ops.object.volume_add()
    bpy.context.object.name = "Smoke"
    bpy.ops.render.render()
    dark, smoke = not_shown.told(scene)
    scene.collection.children.link(bpy.data.collections.new("Hidden"))
    scene.collection.objects.unlink(bpy.context.object)
    bpy.data.collections["Hidden"].objects.link(bpy.data.objects["Smoke"])
    scene.view_layers.new("Second").layer_collection.children["Hidden"].exclude = True
    bpy.ops.render.render()
    assert not_shown.told(scene) == (dark, smoke), "the second layer is without it, the first is not"
    scene.view_layers[0].use = False
    bpy.ops.render.render()
    assert not_shown.told(scene) == (dark,)


def test_viewports_do_not_hide_what_images_and_other_viewports_lack() -> None:
    scene, lit, normals = bpy.context.scene, View(), View()
    wall, smoke, cloud = (
        NotShown("material", "Wall", 1, "a; b"),
        NotShown("object", "Smoke", 2, "a; b"),
        NotShown("scan", "Scan", 3, "a; b"),
    )
    passes = NotShown("setting", "Passes", 0, "a; b")
    not_shown.tell(scene, (smoke, cloud, wall, passes))
    assert not_shown.line_in_viewports(scene) == "1 material simplified, 1 object not shown, 1 setting ignored"
    assert "1 scan shown in viewports only" in not_shown.line_of(scene)
    not_shown.tell_of_view(scene, normals, (smoke, cloud), with_looks=False)
    assert not_shown.told(scene) == (smoke, cloud, wall, passes), "the image lacks them still"
    not_shown.tell_of_view(scene, lit, (cloud,), with_looks=True)
    assert not_shown.told(scene) == (cloud, passes, smoke), "the wall was mended; one view still lacks the smoke"
    not_shown.tell(scene, ())
    not_shown.tell_of_view(scene, normals, (cloud, wall), with_looks=False)
    assert not_shown.told(scene) == (), "what the viewport shows by itself"
    not_shown.tell_of_view(scene, lit, (smoke, wall), with_looks=True)
    not_shown.tell_of_view(scene, normals, (smoke,), with_looks=False)
    assert not_shown.told(scene) == (smoke, wall)
    del lit
    not_shown.tell_of_view(scene, normals, (smoke,), with_looks=False)
    assert not_shown.told(scene) == (smoke,)


def test_messages_go_with_their_file() -> None:
    messages.tell(bpy.context.scene, "Scan", "A thing")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert texts() == [] and messages._told == {}


@pytest.mark.parametrize("kind", get_args(Kind))
def test_each_kind_of_what_is_not_shown_says_what_to_do(kind: Kind) -> None:
    advice = NotShown(kind, "A", 1, "it is unsupported; nothing is shown").what_to_do
    assert advice[0].isupper() and not advice.endswith(".") and len(advice) > 20
    assert NotShown(kind, "A", 1, "text", "Do that").what_to_do == "Do that"
