"""Fixtures for tests that run inside Blender's Python module; without it they are skipped."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

bpy: Any = pytest.importorskip("bpy")


@pytest.fixture(autouse=True, scope="module")
def factory_settings() -> None:
    """Reset Blender, because test files share a process in any order and must not find another file's leftovers."""
    import perfect_bvh_addon

    perfect_bvh_addon.unregister()
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture
def registered() -> Iterator[None]:
    """Register the add-on during the test."""
    import perfect_bvh_addon

    perfect_bvh_addon.register()
    yield
    perfect_bvh_addon.unregister()


@pytest.fixture
def keeps_syncs(scene: Any) -> Iterator[None]:
    """Register only the add-on's cache of syncs during the test; the cache is empty at first."""
    from perfect_bvh_addon.live import sync_cache

    sync_cache.clear_syncs()
    sync_cache.register()
    yield
    sync_cache.unregister()


@pytest.fixture
def without_windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Rendered viewports can be drawn without a window: see `registered_without_windows`."""
    from blender.shown_viewport import registered_without_windows

    with registered_without_windows(monkeypatch):
        yield


@pytest.fixture
def scene() -> Any:
    """An empty scene in a new file, with a small render size."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 32, 18
    return scene


@pytest.fixture
def box(scene: Any) -> Any:
    """A cube from -1 to 1, alone in its scene."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    return bpy.context.object


@pytest.fixture
def sync() -> Iterator[Any]:
    """A sync to be updated in halves; at the end no work is running any more."""
    from blender.long_builds import building_threads
    from perfect_bvh_addon import SceneSync

    made = SceneSync(watch=False)
    yield made
    made.close()
    assert not building_threads()


@pytest.fixture
def cube(scene: Any) -> Any:
    """A cube at the origin, seen from above by the scene's camera, with few samples."""
    bpy.ops.mesh.primitive_cube_add()
    made = bpy.context.object
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0.0, 0.0, 8.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")  # surfaces without light are black
    scene.perfect_bvh.samples = 4
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def room(scene: Any) -> Any:
    """A scene to be scanned: see `furnish`."""
    from blender.scanned_room import furnish

    return furnish(scene)


@pytest.fixture
def material() -> Any:
    """The material of a cube that is alone in a new file: see `material_of_a_cube`."""
    from blender.named_rows import material_of_a_cube

    return material_of_a_cube()


@pytest.fixture
def drawn_batches(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Collect the lines of trees that would be drawn: see `keep_lines`."""
    from blender.followed_trees import keep_lines

    return keep_lines(monkeypatch)


@pytest.fixture
def overlay() -> Iterator[Any]:
    """A `SceneOverlay` that is notified of changes, as drawn ones are."""
    from perfect_bvh_addon.events.changes import listen, stop_listening
    from perfect_bvh_addon.view3d.tree_overlay.scene_overlay import SceneOverlay

    made = SceneOverlay()
    listen(made)
    yield made
    stop_listening(made)


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A closed `Gate`; it is opened at the end, so that nothing waits for it any longer."""
    from blender.long_builds import Gate

    made = Gate(monkeypatch)
    yield made
    made.open()


@pytest.fixture(scope="module")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A .blend file for the command line: see `save_small_file`."""
    from blender.command_lines import save_small_file

    path = tmp_path_factory.mktemp("small") / "small.blend"
    save_small_file(path)
    return path
