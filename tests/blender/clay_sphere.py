"""A view of a sphere in the mode "clay", for tests that refine and trace views without Blender's scenes."""

from __future__ import annotations

import perfect_bvh
from oracles import meshes
from perfect_bvh_addon.image.plan import plan_view
from perfect_bvh_addon.image.refinement import View
from perfect_bvh_addon.settings.scene_settings import RenderSettings


def view_of_a_sphere(size: tuple[int, int], samples: int) -> View:
    """size: width and height in pixels."""
    scene = perfect_bvh.Scene()
    scene.add_instance(scene.add_mesh(*meshes.sphere(16, 24)))
    scene.commit()
    camera = perfect_bvh.Camera.look_at((3.0, 2.0, 1.5), (0.0, 0.0, 0.0), aspect=size[0] / size[1])
    settings = RenderSettings("clay", samples, ao_distance=0.0, use_material_colors=True, threads=0)
    return View(scene.snapshot(), perfect_bvh.Appearance(), camera, plan_view(settings, size))
