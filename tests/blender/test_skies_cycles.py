"""All models of the Sky Texture, direction by direction and closely at the horizon, compared with Cycles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import perfect_bvh_addon  # noqa: E402
from oracles.cycles import FILTER_WIDTH, preserved, render_noisy  # noqa: E402
from perfect_bvh_addon.live.sync_cache import clear_syncs  # noqa: E402

WIDTH, HEIGHT = 32, 16
FINER = 27  # our pixels in each of Cycles' pixels; Cycles samples only the middle
# Elevation, azimuth, turbidity, albedo.
SUNS = [
    (90.0, 0.0, 2.2, 0.3),
    (75.0, 10.0, 3.0, 0.0),
    (60.0, 100.0, 1.5, 0.5),
    (52.0, -130.0, 10.0, 1.0),
    (45.0, 45.0, 4.5, 0.8),
    (33.0, -60.0, 6.3, 0.25),
    (25.0, 170.0, 2.5, 1.0),
    (16.0, 20.0, 8.7, 0.1),
    (9.0, -20.0, 3.4, 0.6),
    (4.0, 80.0, 5.5, 0.0),
    (1.0, -100.0, 2.0, 0.9),
    (-6.0, 30.0, 2.2, 0.5),
]


@pytest.fixture
def sky() -> Iterator[Any]:
    """A Sky Texture that fills the whole panorama."""
    perfect_bvh_addon.register()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.object.camera_add(rotation=(math.pi / 2, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    world = scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    sky = world.node_tree.nodes.new("ShaderNodeTexSky")
    world.node_tree.links.new(sky.outputs[0], world.node_tree.nodes["Background"].inputs["Color"])
    yield sky
    clear_syncs()
    perfect_bvh_addon.unregister()


def set_up(sky: Any, model: str, degrees: float, azimuth: float, turbidity: float, albedo: float) -> None:
    elevation, around = math.radians(degrees), math.radians(azimuth)
    sky.sky_type, sky.turbidity, sky.ground_albedo = model, turbidity, albedo
    flat = math.cos(elevation)
    sky.sun_direction = (flat * math.sin(around), flat * math.cos(around), math.sin(elevation))


def render_middles(scene: Any, engine: str, finer: int) -> np.ndarray:
    """Render (HEIGHT, WIDTH, 3): the light from the directions of a coarse panorama's pixels."""
    with preserved(
        (scene.render, "resolution_x", WIDTH * finer),
        (scene.render, "resolution_y", HEIGHT * finer),
        (scene.cycles, "samples", 1),
        (scene.cycles, "use_adaptive_sampling", False),
        (scene.cycles, "use_denoising", False),
        (scene.cycles, "filter_width", FILTER_WIDTH),
        (scene.perfect_bvh, "samples", 4),
        (scene.perfect_bvh, "use_noise_threshold", False),
    ):
        return render_noisy(scene, engine)[finer // 2 :: finer, finer // 2 :: finer, :3]


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("model", ["PREETHAM", "HOSEK_WILKIE"])
def test_an_older_sky_is_that_of_cycles_in_each_direction(sky: Any, model: str, sun: tuple[float, ...]) -> None:
    """Within 2 % in each channel, except for values below a five-hundredth of the brightest."""
    set_up(sky, model, *sun)
    theirs = render_middles(bpy.context.scene, "CYCLES", 1)
    ours = render_middles(bpy.context.scene, "PERFECT_BVH", FINER)
    assert theirs.max() > 0.0
    assert ours == pytest.approx(theirs, rel=0.02, abs=0.002 * theirs.max())


MODERN = ["SINGLE_SCATTERING", "MULTIPLE_SCATTERING"] if bpy.app.version >= (5, 0, 0) else ["NISHITA"]
# Settings other than the default ones, under a sun of medium height.
AIRS = [{"altitude": 3000.0, "air_density": 2.0}, {"aerosol_density": 5.0}, {"ozone_density": 6.0}]
PLACES = [(sun[0], sun[1], {}) for sun in SUNS] + [(40.0, 0.0, air) for air in AIRS]


@pytest.mark.parametrize(("degrees", "azimuth", "air"), PLACES)
@pytest.mark.parametrize("model", MODERN)
def test_a_sky_of_the_air_is_that_of_cycles_in_each_direction(
    sky: Any, model: str, degrees: float, azimuth: float, air: dict[str, float]
) -> None:
    """Within 2 %, above and below the horizon, except for values below a five-hundredth of the brightest."""
    sky.sky_type, sky.sun_disc = model, False
    sky.sun_elevation, sky.sun_rotation = math.radians(degrees), math.radians(azimuth)
    for name, value in ({"altitude": 100.0} | air).items():
        setattr(sky, name if hasattr(sky, name) else name.replace("aerosol", "dust"), value)
    theirs = render_middles(bpy.context.scene, "CYCLES", 1)
    ours = render_middles(bpy.context.scene, "PERFECT_BVH", FINER)
    assert theirs[HEIGHT // 2 :].max() > 0.0
    assert ours == pytest.approx(theirs, rel=0.02, abs=0.002 * theirs.max())


@pytest.mark.parametrize(("degrees", "altitude"), [(40.0, 100.0), (2.0, 100.0), (15.0, 3000.0)])
@pytest.mark.parametrize("model", [*MODERN, "PREETHAM", "HOSEK_WILKIE"])
def test_the_horizon_is_that_of_cycles(sky: Any, model: str, degrees: float, altitude: float) -> None:
    """Within 2 % in each channel, two degrees up and down: even rows a third of a degree high were a tenth off."""
    set_up(sky, model, degrees, 0.0, 3.0, 0.3)
    sky.sun_disc, sky.sun_elevation, sky.altitude = False, math.radians(degrees), altitude
    scene = bpy.context.scene
    scene.camera.data.type, scene.camera.data.angle = "PERSP", math.radians(8.0)
    theirs = render_middles(scene, "CYCLES", 1)
    ours = render_middles(scene, "PERFECT_BVH", FINER)
    assert np.ptp(theirs.mean(axis=(1, 2))) > 0.02 * theirs.max(), "nothing changes at the horizon"
    assert ours == pytest.approx(theirs, rel=0.02, abs=0.002 * theirs.max())
