"""The light of the clay mode where it is known, and where rounding errors would show."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from perfect_bvh import Appearance, Camera, InstanceTable, MaterialTable, MeshAppearance, Scene, render, render_passes

SIZE = (64, 48)
QUAD = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
QUAD_TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
CUBE = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float64)
CUBE_TRIANGLES = np.array(
    [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4)]
    + [(2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)],
    np.int32,
)
DARK_SHADOW = 0.9  # a pixel is in shadow if it has less than this part of the open light


def sphere(rings: int, segments: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """A unit sphere; its positions are its normals."""
    polar = np.linspace(0.0, math.pi, rings + 1)[:, None]
    around = np.linspace(0.0, 2.0 * math.pi, segments, endpoint=False)[None, :]
    points = np.stack(
        np.broadcast_arrays(np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)), axis=-1
    )
    row, column = np.mgrid[0:rings, 0:segments]
    a, b = row * segments + column, row * segments + (column + 1) % segments
    upper, lower = np.stack([a, a + segments, b], -1), np.stack([b, a + segments, b + segments], -1)
    triangles = np.concatenate([upper[1:].reshape(-1, 3), lower[:-1].reshape(-1, 3)])
    return points.reshape(-1, 3), triangles.astype(np.int32)


def looking_at(centre: npt.ArrayLike, size: float, *, height: float = 1.6) -> Camera:
    """A camera that sees a thing of a certain size from the side and above, with a clipping range to fit."""
    middle = np.asarray(centre, dtype=np.float64)
    eye = middle + np.array((0.7, -2.2, height)) * size
    return Camera.look_at(eye, middle, angle=math.radians(60), aspect=4 / 3, clip_start=0.1 * size, clip_end=50 * size)


def one_mesh(positions: npt.NDArray[np.floating], triangles: npt.NDArray[np.int32]) -> Scene:
    scene = Scene()
    scene.add_instance(scene.add_mesh(positions, triangles), np.eye(4))
    scene.commit()
    return scene


def light_of(
    scene: Scene,
    camera: Camera,
    appearance: Appearance | None = None,
    size: tuple[int, int] = SIZE,
    **options: object,
) -> npt.NDArray[np.float32]:
    """The green channel of white clay, NaN where there is nothing."""
    look = appearance or Appearance()
    transparent = Appearance(
        look.meshes, look.instances, look.materials, shadow_mask=look.shadow_mask, film_transparent=True
    )
    image = render(scene, camera, size=size, appearance=transparent, clay_color=(1, 1, 1), **options)  # type: ignore[arg-type]
    return np.where(image[..., 3] == 1.0, image[..., 1], np.nan)


def test_nothing_keeps_light_from_an_open_plane() -> None:
    light = light_of(one_mesh(QUAD, QUAD_TRIANGLES), looking_at((0, 0, 0), 1.0), samples=4)
    seen = light[~np.isnan(light)]
    assert seen.size > 500
    assert np.ptp(seen) <= 1e-6
    assert 0.5 < seen[0] < 1.5


@pytest.mark.parametrize("shape", ["plane", "cube", "smooth sphere"])
@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("how", ["vertices", "transform"])
def test_convex_things_throw_no_shadow_on_themselves_at_any_scale(shape: str, scale: float, how: str) -> None:
    positions, triangles = {"plane": (QUAD, QUAD_TRIANGLES), "cube": (CUBE, CUBE_TRIANGLES)}.get(shape, sphere(12, 24))
    in_vertices = how == "vertices"
    scene = Scene()
    mesh = scene.add_mesh((positions * (scale if in_vertices else 1.0)).astype(np.float32), triangles)
    scene.add_instance(mesh, np.eye(4) if in_vertices else np.diag((scale, scale, scale, 1.0)))
    scene.commit()
    look = Appearance()
    if shape == "smooth sphere":
        look = Appearance(meshes={mesh: MeshAppearance(corner_normals=positions[triangles].astype(np.float32))})
    camera = looking_at((0, 0, 0), scale)
    assert_all_open(scene, camera, look)


@pytest.mark.parametrize("shape", ["plane", "cube", "smooth sphere"])
@pytest.mark.parametrize("how", ["float64 vertices", "transform"])
def test_convex_things_throw_no_shadow_on_themselves_far_from_zero(shape: str, how: str) -> None:
    positions, triangles = {"plane": (QUAD, QUAD_TRIANGLES), "cube": (CUBE, CUBE_TRIANGLES)}.get(shape, sphere(12, 24))
    offset = np.array((1e6, -2e6, 3e6))
    transform = np.eye(4)
    scene = Scene()
    if how == "transform":
        transform[:3, 3] = offset
        mesh = scene.add_mesh(positions.astype(np.float32), triangles)
    else:
        mesh = scene.add_mesh(positions + offset, triangles)
    scene.add_instance(mesh, transform)
    scene.commit()
    look = Appearance()
    if shape == "smooth sphere":
        look = Appearance(meshes={mesh: MeshAppearance(corner_normals=positions[triangles].astype(np.float32))})
    assert_all_open(scene, looking_at(offset, 1.0), look)


def test_float32_vertices_far_from_zero_throw_no_shadow_on_themselves() -> None:
    # Steps of 1/16 in the vertices: the cube's sides are multiples of them, so that it is a cube still.
    scene = one_mesh((CUBE * 4.0 + 1e6).astype(np.float32), CUBE_TRIANGLES)
    assert_all_open(scene, looking_at((1e6, 1e6, 1e6), 4.0), Appearance())


def assert_all_open(scene: Scene, camera: Camera, look: Appearance) -> None:
    """Each pixel has as much light as the same thing whose rays meet nothing."""
    options: dict[str, object] = {"samples": 8, "filter_width": 0.0}
    light = light_of(scene, camera, look, **options)
    nothing = Appearance(look.meshes, look.instances, look.materials, shadow_mask=0)
    open_light = light_of(scene, camera, nothing, **options)
    seen = ~np.isnan(light)
    assert seen.sum() > 300
    np.testing.assert_allclose(light[seen], open_light[seen], rtol=1e-5)


def test_a_closed_box_is_dark_inside_and_has_only_bounced_light() -> None:
    scene = one_mesh(CUBE.astype(np.float32), CUBE_TRIANGLES)
    camera = Camera.look_at((0.0, -0.5, 0.0), (0, 1, 0), angle=1.0, aspect=4 / 3, clip_start=0.01)
    inside = light_of(scene, camera, samples=16, ao_distance=1e4)
    open_light = light_of(scene, camera, Appearance(shadow_mask=0), samples=1, ao_distance=1e4)
    assert not np.isnan(inside).any()
    assert (inside > 0.0).all()
    assert inside.max() < 0.5 * open_light.min()


def test_occlusion_fades_with_distance() -> None:
    def light_below(height: float) -> float:
        scene = Scene()
        mesh = scene.add_mesh(QUAD, QUAD_TRIANGLES)
        scene.add_instance(mesh, np.diag((50.0, 50.0, 1.0, 1.0)))
        roof = np.diag((50.0, 50.0, 1.0, 1.0))
        roof[2, 3] = height
        scene.add_instance(mesh, roof)
        scene.commit()
        camera = Camera.look_at((0, 0, 0.4), (0, 0, 0), angle=0.5, aspect=4 / 3, clip_start=0.01)
        return float(np.nanmean(light_of(scene, camera, samples=64, ao_distance=4.0)))

    lights = [light_below(height) for height in (0.5, 1.0, 2.0, 3.5, 20.0)]
    assert lights == sorted(lights)
    assert lights[0] < 0.5 * lights[-1]
    # Beyond the reach of occlusion (4) and of the key light's shadow (10) the roof is as good as away.
    assert lights[-1] == pytest.approx(light_below(40.0), rel=1e-6)


def test_the_mean_over_seeds_does_not_depend_on_the_number_of_samples() -> None:
    """Unbiased: few samples are noisy, not brighter or darker."""
    positions, triangles = sphere(12, 24)
    scene = Scene()
    scene.add_instance(scene.add_mesh(positions.astype(np.float32), triangles), np.eye(4))
    ground = np.diag((20.0, 20.0, 1.0, 1.0))
    ground[2, 3] = -1.0
    scene.add_instance(scene.add_mesh(QUAD, QUAD_TRIANGLES), ground)
    scene.commit()
    camera = looking_at((0, 0, 0), 2.0)
    options: dict[str, object] = {"filter_width": 0.0, "ao_distance": 3.0}
    exact = light_of(scene, camera, samples=512, **options)
    few = np.mean([light_of(scene, camera, samples=1, seed=seed, **options) for seed in range(64)], axis=0)
    shadow = exact < DARK_SHADOW * np.nanmax(exact)
    assert shadow.sum() > 100
    assert np.nanmean(few[shadow]) == pytest.approx(np.nanmean(exact[shadow]), rel=0.003)


def test_shadows_come_only_from_the_shadow_mask() -> None:
    scene = Scene()
    mesh = scene.add_mesh(QUAD, QUAD_TRIANGLES)
    roof = np.diag((50.0, 50.0, 1.0, 1.0))
    roof[2, 3] = 1.0
    scene.add_instance(mesh, np.diag((50.0, 50.0, 1.0, 1.0)), mask=0b01)
    scene.add_instance(mesh, roof, mask=0b10)
    scene.commit()
    camera = Camera.look_at((0, 0, 0.5), (0, 0, 0), angle=0.5, aspect=4 / 3, clip_start=0.01)
    with_roof = light_of(scene, camera, Appearance(shadow_mask=0b11), ao_distance=5.0)
    without = light_of(scene, camera, Appearance(shadow_mask=0b01), ao_distance=5.0)
    assert np.nanmax(with_roof) < 0.7 * np.nanmin(without)
    assert np.ptp(without[~np.isnan(without)]) <= 1e-6


def test_clay_takes_the_viewport_colours_of_materials() -> None:
    scene = one_mesh(QUAD, QUAD_TRIANGLES)
    table = InstanceTable(
        ids=np.array([0], np.int32),
        slot_offsets=np.array([0, 1], np.int32),
        slot_materials=np.array([0], np.int32),
        object_indices=np.zeros(1, np.int32),
        holdout=np.zeros(1, bool),
    )
    materials = MaterialTable(np.array([(0.5, 0.25, 0.125, 1.0)], np.float32), np.zeros(1, np.int32))
    camera = looking_at((0, 0, 0), 1.0)
    white = render(scene, camera, size=SIZE, clay_color=(1.0, 1.0, 1.0))
    colored = render(scene, camera, size=SIZE, appearance=Appearance(instances=table, materials=materials))
    hit = render_passes(scene, camera, size=SIZE, passes=("instance",))["instance"] == 0
    np.testing.assert_allclose(colored[hit][:, :3], white[hit][:, :3] * (0.5, 0.25, 0.125), rtol=1e-5)
    np.testing.assert_array_equal(colored[~hit], white[~hit])
