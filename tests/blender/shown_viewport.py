"""A viewport in Rendered shading without a window: its drawn images are kept and compared with new renders."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import perfect_bvh_addon
import pytest
from blender.long_builds import PATIENCE, building_threads, patiently
from perfect_bvh_addon.image.plan import plan_view
from perfect_bvh_addon.image.progressive import Pace
from perfect_bvh_addon.image.refinement import Refinement, View
from perfect_bvh_addon.live import pending_commit
from perfect_bvh_addon.settings.scene_settings import read_settings
from perfect_bvh_addon.sync.appearance import as_camera
from perfect_bvh_addon.sync.records import CameraRecord
from perfect_bvh_addon.view3d.rendered import screen as screen_image
from perfect_bvh_addon.view3d.rendered import viewport
from perfect_bvh_addon.view3d.rendered.redraws import TYPE_FILTERS

SIZE = (32, 18)


@contextmanager
def registered_without_windows(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Register the add-on inside the context. Textures are the images themselves, and each view looks from above.

    At the end no work is running any more.
    """
    matrix = np.eye(4)
    matrix[2, 3] = 8.0
    camera = CameraRecord(matrix, (-1.0, 1.0, -0.5625, 0.5625), "perspective", 0.1, 100.0)
    monkeypatch.setattr(screen_image, "texture_of", lambda image, mode: image)
    monkeypatch.setattr(viewport, "draw_patches", lambda screen, scene, image, size: screen.append(whole_of(image)))
    monkeypatch.setattr(viewport, "AWAITING_SECONDS", PATIENCE)  # does not depend on the machine's speed
    monkeypatch.setattr(viewport, "BURST_SECONDS", 0.0)
    monkeypatch.setattr(viewport, "camera_of", lambda *_: (camera, None))
    monkeypatch.setattr(pending_commit, "BUILDING_SECONDS", 0.05)
    perfect_bvh_addon.register()
    yield
    perfect_bvh_addon.unregister()
    assert not building_threads()


def cube_to_show(scene: bpy.types.Scene) -> bpy.types.Object:
    """A cube under a plain world, with few samples."""
    bpy.ops.mesh.primitive_cube_add()
    scene.world = bpy.data.worlds.new("World")  # surfaces without light are black
    scene.perfect_bvh.samples = 2
    return bpy.context.object


def whole_of(image: screen_image.ScreenImage) -> np.ndarray:
    """Compose the image of all patches, with coarse pixels enlarged to their size on screen."""
    width, height = image.size
    shown = np.full((height, width, 4), np.nan, np.float32)
    for place, patch in image.patches.items():
        pixels = patch.texture.repeat(place.divisor, axis=0).repeat(place.divisor, axis=1)
        first, end = place.rows
        shown[first:end] = pixels[: end - first, :width]
    return shown


class Shown:
    """A region in Rendered shading. screen: the drawn images, in order."""

    def __init__(self) -> None:
        self.viewport = viewport.Viewport()
        self.screen: list[Any] = []
        filters = dict.fromkeys(TYPE_FILTERS, True)
        self.context = SimpleNamespace(
            space_data=SimpleNamespace(
                local_view=None,
                use_local_collections=False,
                shading=SimpleNamespace(
                    use_scene_lights_render=True,
                    use_scene_world_render=True,
                    perfect_bvh=SimpleNamespace(mode="RENDER"),
                ),
                **filters,
            ),
            region=SimpleNamespace(width=SIZE[0], height=SIZE[1], as_pointer=lambda: 7),
            region_data=None,
            screen=SimpleNamespace(is_animation_playing=False),
        )

    def update(self) -> None:
        """Update as Blender does after an edit."""
        self.viewport.update(self.context, bpy.context.evaluated_depsgraph_get())

    def redraw(self) -> bool:
        """Redraw as Blender does; return whether another redraw is needed."""
        return self.viewport.draw(self.screen, self.context, bpy.context.evaluated_depsgraph_get())

    def finish(self) -> np.ndarray:
        """Redraw until the image is finished; return it: (H, W, 4)."""
        for _ in patiently("the image is not finished"):
            if not self.redraw():
                break
        return self.screen[-1]


def fresh() -> np.ndarray:
    """Render the finished image of the current scene with new trees."""
    sync = perfect_bvh_addon.SceneSync(watch=False)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plan = plan_view(read_settings(depsgraph.scene), SIZE)
    sync.request(plan.attributes)
    sync.update(depsgraph)
    camera = as_camera(viewport.camera_of()[0])
    refinement = Refinement(View.of(sync, camera, plan), Pace())
    while not refinement.is_finished:
        refinement.step(10.0)
    return refinement.image


def move(cube: bpy.types.Object, x: float) -> None:
    """Make an edit that viewports are notified of."""
    cube.location.x = x
    bpy.context.view_layer.update()
