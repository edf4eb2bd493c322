"""The plan of an image requests everything that its mode shows: reading more changes no pixel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest

bpy: Any = pytest.importorskip("bpy")

from perfect_bvh_addon import SceneSync  # noqa: E402
from perfect_bvh_addon.image.plan import RenderPlan, plan_render  # noqa: E402
from perfect_bvh_addon.image.still import render_frame  # noqa: E402
from perfect_bvh_addon.settings.modes import MODE_NAMES, MODES, Mode  # noqa: E402
from perfect_bvh_addon.settings.scene_settings import read_settings  # noqa: E402
from perfect_bvh_addon.sync.records import AttributeRequest  # noqa: E402

ALL = AttributeRequest(material_slots=True, corner_normals=True, corner_uvs=True, shading=True)


def image_of(mode: Mode) -> npt.NDArray[np.float32]:
    scene = bpy.context.scene
    settings = replace(read_settings(scene), mode=mode.name, samples=1)
    frame = render_frame(SceneSync(), bpy.context.evaluated_depsgraph_get(), plan_render(scene, settings))
    return frame.images["combined"]


def coloured(name: str, rgb: tuple[float, float, float]) -> Any:
    """A material whose viewport colour is not its base colour."""
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*rgb[::-1], 1.0)
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*rgb, 1.0)
    return material


@pytest.fixture
def ball(registered: None) -> Any:
    """A smooth sphere of two materials, with a UV map, under a sun."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8)
    ball = bpy.context.object
    ball.data.materials.append(coloured("red", (0.8, 0.2, 0.1)))
    ball.data.materials.append(coloured("green", (0.1, 0.7, 0.2)))
    for i, polygon in enumerate(ball.data.polygons):
        polygon.use_smooth, polygon.material_index = True, i % 2
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.0))
    bpy.ops.object.camera_add(location=(0.0, -4.0, 0.0), rotation=(np.pi / 2, 0.0, 0.0))
    scene = bpy.context.scene
    scene.camera = bpy.context.object
    scene.render.resolution_x = scene.render.resolution_y = 48
    return ball


@pytest.mark.parametrize("mode", MODES, ids=MODE_NAMES)
@pytest.mark.parametrize("in_colors", [True, False], ids=["colours", "grey"])
def test_what_a_mode_shows_is_read(ball: Any, mode: Mode, in_colors: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    bpy.context.scene.perfect_bvh.use_material_colors = in_colors
    planned = image_of(mode)
    monkeypatch.setattr(RenderPlan, "attributes", ALL)
    np.testing.assert_array_equal(planned, image_of(mode))
    assert np.ptp(planned[..., :3]) > 0.0


def test_the_add_on_offers_every_mode_of_the_engine() -> None:
    assert sorted(MODE_NAMES) == sorted(perfect_bvh.MODES)
    assert len({mode.number for mode in MODES}) == len(MODES)


@pytest.mark.parametrize("bounces", [0, 1, 12])
def test_about_as_many_rays_are_cast_as_are_planned(registered: None, repository: Path, bounces: int) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(repository / "blend_scenes" / "courtyard.blend"))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 128, 72, 100
    scene.cycles.max_bounces = bounces
    found = {}
    sync = SceneSync(watch=False)
    for mode in MODE_NAMES:
        settings = replace(read_settings(scene), mode=mode, samples=4, noise_threshold=0.0)
        plan, before = plan_render(scene, settings), sync.scene.rays_cast
        render_frame(sync, bpy.context.evaluated_depsgraph_get(), plan)
        found[mode] = (sync.scene.rays_cast - before) / plan.expected_rays
    sync.close()
    assert all(0.6 < share < 1.5 for share in found.values()), found
