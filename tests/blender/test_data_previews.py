"""Blender's previews of materials, lights and worlds: they show the data-block and leave nothing behind.

Without a window Blender makes them at once, on the thread that asks for them.
"""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest

bpy: Any = pytest.importorskip("bpy")

from perfect_bvh_addon.events import changes  # noqa: E402
from perfect_bvh_addon.extract import read_scene  # noqa: E402
from perfect_bvh_addon.extract import scene as extract_scene  # noqa: E402
from perfect_bvh_addon.extract.looks.images import ImageCache, ImageReader  # noqa: E402
from perfect_bvh_addon.image import data_previews  # noqa: E402
from perfect_bvh_addon.image.plan import plan_render  # noqa: E402
from perfect_bvh_addon.live import sync_cache  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import preview_settings  # noqa: E402
from perfect_bvh_addon.statistics import last_result, messages  # noqa: E402

PATIENCE = 60.0


@pytest.fixture(autouse=True)
def factory(registered: None) -> None:
    bpy.ops.wm.read_factory_settings()
    bpy.context.scene.render.engine = "PERFECT_BVH"


def preview_of(block: Any) -> Any:
    """(H, W, 4)."""
    block.asset_generate_preview()
    values = np.array(block.preview.image_pixels_float[:], np.float32)
    return values.reshape(block.preview.image_size[1], block.preview.image_size[0], 4)


def principled(material: Any) -> Any:
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED").inputs


def paint(material: Any, color: tuple[float, float, float]) -> None:
    principled(material)["Base Color"].default_value = (*color, 1.0)


def middle(image: Any) -> Any:
    height, width = image.shape[:2]
    part = image[height * 3 // 8 : height * 5 // 8, width * 3 // 8 : width * 5 // 8]
    return part.reshape(-1, 4).mean(axis=0)


def test_a_material_has_its_colour_and_a_transparent_background() -> None:
    material = bpy.data.materials["Material"]
    paint(material, (0.9, 0.02, 0.02))
    image = preview_of(material)
    red, green, blue, alpha = middle(image)
    assert red > 1.2 * max(green, blue) and alpha == 1.0
    assert image[0, 0, 3] == 0.0
    paint(material, (0.02, 0.02, 0.9))
    red, green, blue, _ = middle(preview_of(material))
    assert blue > 1.2 * max(red, green)


def test_lights_and_worlds_have_one() -> None:
    light, world = bpy.data.lights["Light"], bpy.context.scene.world
    light.color = (1.0, 0.05, 0.05)
    red, green, blue = preview_of(light)[..., :3].mean(axis=(0, 1))
    assert red > 1.2 * max(green, blue)
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.05, 0.05, 1.0, 1.0)
    red, green, blue = preview_of(world)[..., :3].mean(axis=(0, 1))
    assert blue > 1.2 * max(red, green)


def test_it_is_no_render_of_the_scene() -> None:
    """A preview changes nothing that renders, viewports and panels share, and reads nothing but the preview's stage."""
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    messages.tell(scene, messages.RENDER, "Something went wrong", is_error=True)
    handlers = {name: list(getattr(bpy.app.handlers, name)) for name, _ in changes._HANDLERS}
    before = (changes._log.now, dict(changes._edit_counts), dict(extract_scene.shared_reader.verdicts))
    preview_of(bpy.data.materials["Material"])
    assert (changes._log.now, dict(changes._edit_counts), dict(extract_scene.shared_reader.verdicts)) == before
    assert handlers == {name: list(getattr(bpy.app.handlers, name)) for name, _ in changes._HANDLERS}
    assert not sync_cache._syncs and last_result.last_statistics(scene) is None
    assert [message.text for message in messages.messages_of(scene)] == ["Something went wrong"]


@pytest.mark.parametrize("name", ["find_missing_libraries", "watched_evaluations"])
def test_nothing_but_the_stage_is_asked(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError(name)

    monkeypatch.setattr(extract_scene, name, refuse)
    graph = bpy.context.evaluated_depsgraph_get()
    cache = extract_scene.ReadCache()
    assert len(read_scene(graph, cache=cache, for_preview=True).meshes) == 1
    with pytest.raises(AssertionError, match=name):
        read_scene(graph, cache=cache)


def test_images_are_read_once_and_no_finer_than_a_preview_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    material = bpy.data.materials["Material"]
    image = bpy.data.images.new("Large", 2100, 30)
    image.generated_color = (0.02, 0.9, 0.02, 1.0)
    inputs = principled(material)
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.links.new(node.outputs["Color"], inputs["Base Color"])
    red, green, blue, _ = middle(preview_of(material))
    assert green > 1.2 * max(red, blue)
    (kept,) = data_previews._kept
    (pixels,) = (held for (_, key), (_, held) in kept.held.items() if key is None)
    assert pixels.shape == (10, 700, 4)
    monkeypatch.setattr("perfect_bvh_addon.extract.looks.images._read_pixels", lambda *_: pytest.fail("read again"))
    inputs["Roughness"].default_value = 0.9
    preview_of(material)
    assert data_previews._kept[0].held.keys() == kept.held.keys()


def test_of_tiles_the_first_stands_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    image = bpy.data.images.new("Tiled", 8, 8, tiled=True)
    image.tiles.new(1002)
    monkeypatch.setattr("perfect_bvh_addon.extract.looks.images.read_tiles", lambda *_: pytest.fail("made images"))
    assert not ImageReader(ImageCache(), for_preview=True)._shows_tiles(image)
    assert ImageReader(ImageCache())._shows_tiles(image)


def test_it_ends_when_blender_asks_for_that() -> None:
    graph = bpy.context.evaluated_depsgraph_get()
    plan = plan_render(graph.scene, preview_settings())
    asked: list[int] = []

    def is_cancelled() -> bool:
        asked.append(1)
        return len(asked) > 3

    assert data_previews.render_preview(graph, plan, is_cancelled) is None
    assert len(asked) == 4


def test_an_image_that_is_deleted_meanwhile_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    image = bpy.data.images.new("Gone", 8, 8)

    def delete(*_: Any) -> None:
        bpy.data.images.remove(image)
        image.size[0]

    monkeypatch.setattr(extract_scene, "read_world", delete)
    graph = bpy.context.evaluated_depsgraph_get()
    plan = plan_render(graph.scene, preview_settings())
    assert data_previews.render_preview(graph, plan, lambda: False) is None


def test_a_stage_without_a_camera_says_so() -> None:
    bpy.data.objects.remove(bpy.data.objects["Camera"])
    graph = bpy.context.evaluated_depsgraph_get()
    with pytest.raises(ValueError, match="no camera"):
        data_previews.render_preview(graph, plan_render(graph.scene, preview_settings()), lambda: False)


# While the add-on is disabled ----------------------------------------------------------------------------------------


def test_there_are_none_once_the_add_on_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    gate = data_previews.Gate()
    monkeypatch.setattr(data_previews, "_gate", gate)
    graph = bpy.context.evaluated_depsgraph_get()
    plan = plan_render(graph.scene, preview_settings())
    gate.close(lambda: False)
    assert data_previews.render_preview(graph, plan, lambda: False) is None
    gate.open()
    assert data_previews.render_preview(graph, plan, lambda: False) is not None


def test_those_under_way_are_told_and_waited_for() -> None:
    gate, entered, order = data_previews.Gate(), threading.Event(), []

    def preview() -> None:
        with gate.passing() as is_allowed:
            assert is_allowed
            entered.set()
            until = time.monotonic() + PATIENCE
            while gate.is_open and time.monotonic() < until:
                time.sleep(0.001)
            order.append("not told" if gate.is_open else "preview")

    thread = threading.Thread(target=preview)
    thread.start()
    assert entered.wait(PATIENCE)
    gate.close(lambda: False)
    order.append("closed")
    thread.join(PATIENCE)
    assert order == ["preview", "closed"]


def test_those_that_blender_has_begun_find_it_closed_and_are_waited_for() -> None:
    gate, order = data_previews.Gate(), []
    is_coming = iter([True])

    def preview() -> None:
        with gate.passing() as is_allowed:
            order.append(is_allowed)

    def are_coming() -> bool:
        """Say once that previews are coming; the preview itself comes after the gate was closed."""
        if next(is_coming, False):
            threading.Thread(target=preview).start()
            return True
        return not order

    gate.close(are_coming)
    assert order == [False]
