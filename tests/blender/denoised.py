"""Shared helpers for tests of denoising, noise thresholds and samples: a scene, and renders of it."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np
import perfect_bvh
from oracles.cycles import preserved
from perfect_bvh.denoise import DenoiseQuality, Prefilter, denoise
from perfect_bvh_addon.engine import RenderJob, attend
from perfect_bvh_addon.image.plan import GUIDES, NOISY, plan_render
from perfect_bvh_addon.image.still import Frame
from perfect_bvh_addon.live.scene_sync import SceneSync
from perfect_bvh_addon.settings.scene_settings import read_settings

SIZE = WIDTH, HEIGHT = 96, 54


def lit_cube() -> bpy.types.Scene:
    """A cube on a floor under a lamp, seen obliquely, with few samples."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 0.0, 1.0))
    bpy.ops.object.light_add(type="POINT", location=(3.0, -4.0, 5.0))
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 500.0, 1.0
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (7.0, -7.0, 5.0), (1.109, 0.0, 0.785)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "PERFECT_BVH"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.perfect_bvh.samples = 2
    return scene


def render(job: RenderJob | None = None) -> Frame:
    """Render the scene; return the image with its statistics. Fails if there is no image."""
    with attend(job or RenderJob()) as attended:
        bpy.ops.render.render()
    assert attended.frame is not None
    return attended.frame


def combined(scene: bpy.types.Scene, **settings: object) -> np.ndarray:
    """Render with other settings; return the combined pass, (H, W, 4)."""
    with preserved(*((scene.perfect_bvh, name, value) for name, value in settings.items())):
        return render().images["combined"]


def ask_for_data(scene: bpy.types.Scene) -> None:
    """Enable the passes that a denoiser in the compositor needs."""
    scene.view_layers[0].cycles.denoising_store_passes = True


def expect(
    images: Mapping[str, np.ndarray], noise: Mapping[str, np.ndarray] | None, quality: DenoiseQuality = "fast"
) -> np.ndarray:
    """Compute the expected result for a traced image."""
    color, *guides = (images[name] for name in GUIDES)
    prefilter: Prefilter = "fast" if quality == "fast" else "none"
    clean = denoise(color, *guides, quality=quality, prefilter=prefilter)
    if noise is None:
        return clean
    with_noise, without = (
        denoise(image, *guides, quality="fast", prefilter=prefilter) for image in (color, color - noise[NOISY])
    )
    clean, through = (perfect_bvh.apply_pixel_filter(image) for image in (clean, with_noise - without))
    return perfect_bvh.restore_detail(images["combined"], noise["combined"], clean, through, *guides)


def trace(scene: bpy.types.Scene) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the images of a render before denoising, and their noise."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    plan = plan_render(scene, read_settings(scene))
    sync = SceneSync(attributes=plan.attributes)
    sync.update(depsgraph)
    noise: dict[str, np.ndarray] = {}
    *_, (_, images) = perfect_bvh.render_progressively(
        sync.scene,
        sync.camera,
        mode=plan.settings.mode,
        size=plan.size,
        samples=plan.samples,
        appearance=sync.appearance,
        passes=("combined", *GUIDES),
        sampling=plan.make_sampling(),
        noise=noise,
        **plan.options,
    )
    return images, noise
