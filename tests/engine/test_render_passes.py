"""The hits of each pixel's ray, in scenes whose answers are known by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from oracles import meshes
from perfect_bvh import (
    MODES,
    Appearance,
    Camera,
    InstanceTable,
    LightPaths,
    MaterialTable,
    MeshAppearance,
    Scene,
    apply_pixel_filter,
    render,
    render_passes,
    render_progressively,
)

WIDTH, HEIGHT = 64, 36
SIZE = (WIDTH, HEIGHT)
WINDOW = (-1.0, 1.0, -0.5625, 0.5625)
QUAD = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
QUAD_TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)], np.int32)


def quad_scene(*transforms: npt.NDArray[np.float64]) -> Scene:
    """Squares of side 2 in their own z = 0, facing up: instances 0, 1, ... of mesh 0."""
    scene = Scene()
    mesh = scene.add_mesh(QUAD, QUAD_TRIANGLES)
    for transform in transforms:
        scene.add_instance(mesh, transform)
    scene.commit()
    return scene


def placed(x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: float = 1.0) -> npt.NDArray[np.float64]:
    matrix = np.diag((scale, scale, scale, 1.0))
    matrix[:3, 3] = x, y, z
    return matrix


def pixel_centres() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Where pixel centres lie on the window: x of the columns, y of the rows from the top."""
    left, right, bottom, top = WINDOW
    x = left + (np.arange(WIDTH) + 0.5) * (right - left) / WIDTH
    y = top - (np.arange(HEIGHT) + 0.5) * (top - bottom) / HEIGHT
    return x, y


def test_depth_is_along_the_view_axis_and_distance_along_the_ray() -> None:
    passes = render_passes(
        quad_scene(placed(z=-3.0, scale=10.0)), Camera(window=WINDOW), size=SIZE, passes=("depth", "distance", "normal")
    )
    x, y = pixel_centres()
    np.testing.assert_allclose(passes["depth"], 3.0, rtol=1e-6)
    np.testing.assert_allclose(passes["distance"], 3.0 * np.sqrt(1.0 + x**2 + y[:, None] ** 2), rtol=1e-6)
    np.testing.assert_allclose(passes["normal"], np.broadcast_to((0.0, 0.0, 1.0), (HEIGHT, WIDTH, 3)), atol=1e-7)


def test_rows_start_at_the_top_and_columns_at_the_left() -> None:
    # The square covers x in [1, 3], y in [0.2, 2.2] of the plane 4 in front: a corner of the upper right quarter.
    passes = render_passes(
        quad_scene(placed(2.0, 1.2, -4.0)), Camera(window=WINDOW), size=SIZE, passes=("instance", "depth", "primitive")
    )
    x, y = pixel_centres()
    inside = ((4 * x >= 1) & (4 * x <= 3)) & ((4 * y >= 0.2) & (4 * y <= 2.2))[:, None]
    assert 0 < inside.sum() < inside.size
    np.testing.assert_array_equal(passes["instance"], np.where(inside, 0, -1))
    np.testing.assert_array_equal(passes["depth"] == np.float32(1e10), ~inside)
    np.testing.assert_array_equal(passes["primitive"] >= 0, inside)


def test_orthographic_windows_are_in_world_units() -> None:
    scene = quad_scene(placed(z=-5.0, scale=0.25))
    camera = Camera(window=WINDOW, projection="orthographic")
    passes = render_passes(scene, camera, size=SIZE, passes=("depth", "distance", "instance"))
    x, y = pixel_centres()
    inside = (abs(x) <= 0.25) & (abs(y) <= 0.25)[:, None]
    np.testing.assert_array_equal(passes["instance"] == 0, inside)
    np.testing.assert_allclose(passes["depth"][inside], 5.0, rtol=1e-6)
    np.testing.assert_array_equal(passes["depth"], passes["distance"])


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_clipping_is_along_the_view_axis(projection: str) -> None:
    scene = quad_scene(placed(z=-2.0, scale=9.0), placed(z=-3.0, scale=9.0), placed(z=-4.0, scale=9.0))

    def seen(start: float, end: float) -> npt.NDArray[np.int32]:
        camera = Camera(window=WINDOW, projection=projection, clip_start=start, clip_end=end)  # type: ignore[arg-type]
        return np.unique(render_passes(scene, camera, size=SIZE, passes=("instance",))["instance"])

    # If the range were along the ray, the corners of a perspective image would see another square than the middle.
    assert seen(0.1, 100.0).tolist() == [0]
    assert seen(2.001, 100.0).tolist() == [1]
    assert seen(3.001, 100.0).tolist() == [2]
    assert seen(2.001, 2.999).tolist() == [-1]
    assert seen(0.1, 1.999).tolist() == [-1]


def test_panoramas_see_by_longitude_and_latitude() -> None:
    """Compared with rays cast one by one, from a camera that is turned; depth is the distance."""
    scene = quad_scene(
        *(placed(x, y, z, 1.5) for x, y, z in [(0, 0, -4), (5, 1, 0), (-5, 0, 3), (0, 4, 2), (1, -4, 1)])
    )
    turn = np.eye(4)
    turn[:3, :3] = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]]
    turn[:3, 3] = 0.1, -0.2, 0.3
    west, east, south, north = window = (-2.5, 3.0, -1.4, 1.5)
    camera = Camera(turn, window, "equirectangular", clip_start=0.5, clip_end=7.0)
    passes = render_passes(scene, camera, size=SIZE, passes=("depth", "distance", "instance", "normal"))
    longitude = west + (np.arange(WIDTH) + 0.5) * (east - west) / WIDTH
    latitude = (north - (np.arange(HEIGHT) + 0.5) * (north - south) / HEIGHT)[:, None]
    flat = np.cos(latitude)
    local = np.stack(
        [flat * np.sin(longitude), np.broadcast_to(np.sin(latitude), SIZE[::-1]), -flat * np.cos(longitude)], axis=-1
    )
    hits = scene.cast_rays(turn[:3, 3], local @ turn[:3, :3].T, t_min=0.5, t_max=7.0)
    assert set(np.unique(hits.instance_ids)) == {-1, 0, 1, 2, 3, 4}
    np.testing.assert_array_equal(passes["instance"], hits.instance_ids)
    np.testing.assert_allclose(passes["depth"], np.where(hits.is_hit, hits.t_hit, 1e10), rtol=1e-6)
    np.testing.assert_array_equal(passes["depth"], passes["distance"])


def test_a_panoramas_wires_are_as_wide_as_asked() -> None:
    """A wall whose middle edge runs upwards, at the equator: the dark line across it is as many pixels wide."""
    wall = np.array([(-2, -2, -3), (0, -2, -3), (0, 2, -3), (2, -2, -3), (2, 2, -3)], np.float32)
    scene = Scene()
    scene.add_instance(scene.add_mesh(wall, np.array([(0, 1, 2), (1, 3, 4), (1, 4, 2)], np.int32)))
    scene.commit()
    camera = Camera(window=(-0.4, 0.4, -0.05, 0.05), projection="equirectangular")
    for width in (2.0, 5.0):
        image = render(scene, camera, "wireframe", (160, 20), wire_width=width, wire_color=(0, 0, 0))
        row = image[10, 60:100, 0]
        assert (1.0 - row / row.max()).sum() == pytest.approx(width, rel=0.1)


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_shows_a_panorama(mode: Any) -> None:
    scene = quad_scene(placed(0, 0, -4), placed(0, 0, 4))
    camera = Camera(window=(-math.pi, math.pi, -1.5, 1.5), projection="equirectangular")
    image = render(scene, camera, mode, SIZE, 2)
    assert np.isfinite(image).all()
    assert np.ptp(image) > 0.0


def test_uvs_are_those_of_the_map_and_black_without_one() -> None:
    scene = quad_scene(placed(-1.5, 0, -3.0), placed(1.5, 0, -3.0))
    other = scene.add_mesh(QUAD, QUAD_TRIANGLES)
    scene.add_instance(other, placed(0.0, 1.2, -3.5, 0.3))
    scene.commit()
    corners = QUAD[QUAD_TRIANGLES][..., :2].astype(np.float32) * 3.0 - 1.0  # leaves 0..1
    look = Appearance(meshes={0: MeshAppearance(corner_uvs=corners)})
    passes = render_passes(
        scene, Camera(window=WINDOW), mode="uv", size=SIZE, appearance=look, passes=("combined", "instance", "depth")
    )
    seen, (x, y) = passes["instance"], pixel_centres()
    for instance, middle in ((0, -1.5), (1, 1.5)):
        inside = seen == instance
        assert inside.any()
        u, v = (3.0 * x - middle) * 3.0 - 1.0, ((3.0 * y) * 3.0 - 1.0)[:, None]
        np.testing.assert_allclose(passes["combined"][inside, 0], np.broadcast_to(u, inside.shape)[inside], atol=1e-4)
        np.testing.assert_allclose(passes["combined"][inside, 1], np.broadcast_to(v, inside.shape)[inside], atol=1e-4)
        assert (passes["combined"][inside, 2:] == 1.0).all()
    assert (seen == 2).any()
    assert (passes["combined"][seen == 2] == (0.0, 0.0, 0.0, 1.0)).all()
    assert (passes["combined"][seen == -1] == 0.0).all()


def test_a_matcap_shows_the_same_ball_from_everywhere() -> None:
    """Its shade follows from the normal relative to the camera: turning camera and ball together changes nothing."""
    scene = Scene()
    ball = scene.add_mesh(*meshes.sphere(64, 128, 1.0))
    scene.add_instance(ball)
    scene.commit()
    images = []
    for place in ((0.0, -4.0, 0.0), (3.0, 2.0, 1.7), (-1.0, 0.5, -3.8)):
        camera = Camera.look_at(np.array(place) / np.linalg.norm(place) * 4.0, (0, 0, 0), aspect=1.0, angle=0.45)
        images.append(render(scene, camera, "matcap", (60, 60), 4, clay_color=(0.5, 0.5, 0.5))[..., 1])
    for image in images[1:]:
        assert np.abs(image - images[0]).mean() < 0.01
    left, right = images[0][20:40, 8:14].mean(), images[0][20:40, 46:52].mean()
    assert left > 1.2 * right > 0.0


def test_a_shifted_window_is_a_cut_of_a_larger_one() -> None:
    scene = quad_scene(placed(0.3, -0.2, -3.0, 0.6), placed(-1.0, 0.7, -2.5, 0.3))
    whole = render_passes(scene, Camera(window=WINDOW), size=SIZE, passes=("instance", "depth"))
    quarter = Camera(window=(0.0, 1.0, 0.0, 0.5625))
    part = render_passes(scene, quarter, size=(WIDTH // 2, HEIGHT // 2), passes=("instance", "depth"))
    np.testing.assert_array_equal(part["instance"], whole["instance"][: HEIGHT // 2, WIDTH // 2 :])
    np.testing.assert_allclose(part["depth"], whole["depth"][: HEIGHT // 2, WIDTH // 2 :], rtol=1e-6)


def test_pixels_outside_the_border_are_not_traced() -> None:
    scene = quad_scene(placed(z=-3.0, scale=10.0))
    names = ("combined", "depth", "normal", "instance", "object_index")
    whole = render_passes(scene, Camera(window=WINDOW), size=SIZE, passes=names)
    camera = Camera(window=WINDOW, border=(0.25, 0.5, 0.5, 1.0))  # left, right, bottom, top
    part = render_passes(scene, camera, size=SIZE, passes=names)
    inside = np.zeros((HEIGHT, WIDTH), bool)
    inside[: HEIGHT // 2, WIDTH // 4 : WIDTH // 2] = True
    for name in names:
        np.testing.assert_array_equal(part[name][inside], whole[name][inside], err_msg=name)
    assert (part["combined"][~inside] == 0.0).all()
    assert (part["depth"][~inside] == np.float32(1e10)).all()
    assert (part["instance"][~inside] == -1).all()
    assert (part["combined"][inside][:, 3] == 1.0).all()


def test_a_scaled_camera_matrix_changes_nothing() -> None:
    scene = quad_scene(placed(0.3, -0.2, -3.0, 0.6))
    matrix = np.eye(4)
    scaled = matrix @ np.diag((2.0, 0.5, 7.0, 1.0))
    plain = render(scene, Camera(matrix, WINDOW), "normal", SIZE)
    np.testing.assert_array_equal(plain, render(scene, Camera(scaled, WINDOW), "normal", SIZE))


def test_normals_turn_towards_the_viewer_and_follow_mirrors_and_shear() -> None:
    shear = np.eye(4)
    shear[2, 0] = 0.5  # z grows with x: the plane z = x / 2
    shear[2, 3] = -3.0
    up = np.array((-0.5, 0.0, 1.0)) / math.sqrt(1.25)
    mirrored = shear @ np.diag((1.0, -1.0, 1.0, 1.0))
    turned = shear @ np.diag((1.0, -1.0, -1.0, 1.0))  # its back to the camera
    for transform in (shear, mirrored, turned):
        passes = render_passes(quad_scene(transform), Camera(window=WINDOW), size=SIZE, passes=("normal", "instance"))
        hit = passes["instance"] == 0
        assert hit.sum() > 100
        np.testing.assert_allclose(passes["normal"][hit], np.broadcast_to(up, (hit.sum(), 3)), atol=1e-6)


def test_smooth_normals_are_interpolated_and_transformed() -> None:
    corners = np.array([(-0.6, 0.0, 0.8), (0.6, 0.0, 0.8), (0.6, 0.0, 0.8), (-0.6, 0.0, 0.8)], np.float32)
    transform = placed(z=-3.0) @ np.diag((2.0, 1.0, 1.0, 1.0))
    scene = quad_scene(transform)
    appearance = Appearance(meshes={0: MeshAppearance(corner_normals=corners[QUAD_TRIANGLES])})
    passes = render_passes(
        scene, Camera(window=WINDOW), size=SIZE, appearance=appearance, passes=("normal", "instance")
    )
    x, _y = pixel_centres()
    hit = passes["instance"] == 0
    object_x = 3.0 * np.broadcast_to(x, hit.shape) / 2.0
    expected = np.stack([0.6 * object_x / 2.0, np.zeros_like(object_x), np.full_like(object_x, 0.8)], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    np.testing.assert_allclose(passes["normal"][hit], expected[hit], atol=1e-5)


def two_squares() -> tuple[Scene, Callable[..., Appearance]]:
    """Instance 0 left with two materials, instance 1 right; how to make their appearance."""
    scene = quad_scene(placed(-1.2, 0.0, -3.0), placed(1.2, 0.0, -3.0))

    def appearance(**changes: object) -> Appearance:
        table = InstanceTable(
            ids=np.array([1, 0], np.int32),
            slot_offsets=np.array([0, 1, 3], np.int32),
            slot_materials=np.array([1, 0, 2], np.int32),
            object_indices=np.array([7, 5], np.int32),
            holdout=changes.pop("holdout", np.zeros(2, bool)),  # type: ignore[arg-type]
        )
        materials = MaterialTable(
            np.array([(1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)], np.float32), np.array([11, 12, 13], np.int32)
        )
        meshes = {0: MeshAppearance(material_slots=np.array([0, 1], np.int32))}
        return Appearance(meshes, table, materials, **changes)  # type: ignore[arg-type]

    return scene, appearance


def test_indices_come_from_the_tables_by_instance_id() -> None:
    scene, appearance = two_squares()
    passes = render_passes(
        scene,
        Camera(window=WINDOW),
        size=SIZE,
        appearance=appearance(),
        passes=("object_index", "material_index", "instance", "primitive"),
    )
    instance, primitive = passes["instance"], passes["primitive"]
    np.testing.assert_array_equal(passes["object_index"], np.choose(instance + 1, [0, 5, 7]))
    # The right square has one slot only: its second triangle falls back to it.
    left = np.where(primitive == 0, 11, 13)
    np.testing.assert_array_equal(passes["material_index"], np.choose(instance + 1, [0, left, 12]))
    assert np.unique(passes["material_index"]).tolist() == [0, 11, 12, 13]


def test_holdouts_are_transparent_and_hide_what_is_behind() -> None:
    scene, appearance = two_squares()
    look = appearance(holdout=np.array([True, False]))  # instance 1
    names = ("combined", "depth", "normal", "instance", "object_index")
    plain = render_passes(scene, Camera(window=WINDOW), size=SIZE, appearance=appearance(), passes=names)
    cut = render_passes(scene, Camera(window=WINDOW), size=SIZE, appearance=look, passes=names)
    hole = plain["instance"] == 1
    assert hole.any()
    assert (cut["combined"][hole] == 0.0).all()
    assert (cut["depth"][hole] == np.float32(1e10)).all()
    assert (cut["instance"][hole] == -1).all()
    for name in names:
        np.testing.assert_array_equal(cut[name][~hole], plain[name][~hole], err_msg=name)


def test_a_transparent_film_has_no_backdrop() -> None:
    scene, appearance = two_squares()
    camera = Camera(window=WINDOW)
    clear = render(scene, camera, size=SIZE, appearance=appearance(film_transparent=True))
    solid = render(scene, camera, size=SIZE, appearance=appearance())
    hit = render_passes(scene, camera, size=SIZE, passes=("instance",))["instance"] >= 0
    assert (clear[~hit] == 0.0).all()
    assert (solid[~hit][:, :3] > 0.0).all()
    assert (solid[..., 3] == 1.0).all()
    np.testing.assert_array_equal(clear[hit], solid[hit])


def test_camera_rays_pass_by_instances_outside_their_mask() -> None:
    scene = Scene()
    mesh = scene.add_mesh(QUAD, QUAD_TRIANGLES)
    scene.add_instance(mesh, placed(z=-2.0, scale=9.0), mask=0b10)
    scene.add_instance(mesh, placed(z=-3.0, scale=9.0), mask=0b01)
    scene.commit()
    look = Appearance(camera_mask=0b01)
    passes = render_passes(scene, Camera(window=WINDOW), size=SIZE, appearance=look, passes=("instance",))
    assert (passes["instance"] == 1).all()


def test_data_passes_do_not_change_with_samples() -> None:
    scene = quad_scene(placed(0.3, -0.2, -3.0, 0.6), placed(-1.0, 0.7, -2.5, 0.3))
    names = ("combined", "depth", "normal", "instance", "primitive")
    one = render_passes(scene, Camera(window=WINDOW), size=SIZE, samples=1, passes=names)
    many = render_passes(scene, Camera(window=WINDOW), size=SIZE, samples=5, passes=names)
    for name in names[1:]:
        np.testing.assert_array_equal(one[name], many[name], err_msg=name)
    assert not np.array_equal(one["combined"], many["combined"])


def test_costs_are_counted() -> None:
    passes = render_passes(
        quad_scene(placed(z=-3.0, scale=0.5)),
        Camera(window=WINDOW),
        size=SIZE,
        passes=("nodes_visited", "primitives_tested", "instance"),
    )
    hit = passes["instance"] == 0
    assert (passes["nodes_visited"] > 0).all()
    assert (passes["primitives_tested"][hit] > 0).all()


@pytest.mark.parametrize("mode", ["preview", "clay"])
def test_passes_can_be_had_without_the_picture(mode: str) -> None:
    scene, camera = Scene(), Camera.look_at((0.2, 0.2, 5.0), (0.2, 0.2, 0.0), up=(0.0, 1.0, 0.0))
    scene.add_instance(scene.add_mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
    scene.commit()
    asked = {"mode": mode, "size": (32, 18), "samples": 8}
    alone = render_passes(scene, camera, passes=("depth",), **asked)
    beside = render_passes(scene, camera, passes=("combined", "depth"), **asked)
    assert list(alone) == ["depth"]
    np.testing.assert_array_equal(alone["depth"], beside["depth"])


GUIDES = ("denoising_color", "denoising_albedo", "denoising_normal")


@pytest.mark.parametrize("name", GUIDES)
def test_a_guide_alone_is_what_it_is_beside_the_others(name: str):
    scene, camera = quad_scene(np.eye(4)), Camera.look_at((0.0, -3.0, 3.0), (0.0, 0.0, 0.0))
    for mode in ("preview", "clay"):
        asked: dict[str, Any] = {"mode": mode, "size": SIZE, "samples": 2}
        alone = render_passes(scene, camera, passes=(name,), **asked)
        assert list(alone) == [name] and alone[name].any()
        beside = render_passes(scene, camera, passes=("combined", *GUIDES), **asked)
        np.testing.assert_array_equal(alone[name], beside[name])


def noise_of(name: str, **asked: Any) -> npt.NDArray[np.float64]:
    """Of a floor that fills the image, under a roof that hides a part of the sky: by how much two images differ."""
    scene = quad_scene(np.eye(4), placed(x=0.9, z=0.5))
    camera = Camera.look_at((0.0, 0.0, 0.3), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    one, other = (
        render_passes(
            scene, camera, mode="clay", size=(64, 64), samples=2, passes=("combined", *GUIDES), seed=seed, **asked
        )[name][..., 1].astype(np.float64)
        for seed in (1, 2)
    )
    return one - other


def test_pixels_share_samples_and_what_a_denoiser_takes_does_not() -> None:
    correlations = {}
    for name in ("combined", "denoising_color"):
        noise = noise_of(name)
        assert noise.std() > 1e-4
        correlations[name] = float((noise[:, 1:] * noise[:, :-1]).mean() / noise.var())
    assert correlations["combined"] > 0.2
    assert abs(correlations["denoising_color"]) < 0.08


def test_at_pixel_centres_both_are_the_same() -> None:
    for asked in ({"filter_width": 0.0}, {"filter_width": 0.5}):
        np.testing.assert_array_equal(noise_of("combined", **asked), noise_of("denoising_color", **asked))


@pytest.mark.parametrize("width", [1.5, 2.5])
def test_own_samples_become_like_the_film_by_its_filter(width: float) -> None:
    scene, camera = quad_scene(np.eye(4)), Camera.look_at((0.7, -3.0, 4.0), (0.0, 0.0, 0.0))
    asked: dict[str, Any] = {"mode": "normal", "size": SIZE, "samples": 256, "filter_width": width}
    made = render_passes(scene, camera, passes=("combined", *GUIDES), **asked)

    def off(image: npt.NDArray[np.float32]) -> float:
        return float(np.sqrt(np.mean((image - made["combined"]) ** 2)))

    own = made["denoising_color"]
    assert off(own) > 0.005
    assert off(apply_pixel_filter(own, width)) < 0.55 * off(own)


def test_a_filter_keeps_even_colours_and_one_within_a_pixel_keeps_all() -> None:
    even, uneven = np.full((5, 1, 4), 0.3, np.float32), np.random.default_rng(0).random((6, 7, 3), np.float32)
    np.testing.assert_array_equal(apply_pixel_filter(even, 16.0), even)
    np.testing.assert_array_equal(apply_pixel_filter(uneven, 1.0), uneven)
    with pytest.raises(ValueError, match=r"apply_pixel_filter: image must have shape \(H, W, C\), got \(6, 7\)"):
        apply_pixel_filter(uneven[..., 0])


def test_a_sample_that_others_follow_spreads_like_them() -> None:
    scene, camera = quad_scene(np.eye(4)), Camera.look_at((0.0, -3.0, 3.0), (0.0, 0.0, 0.0))
    asked: dict[str, Any] = {"mode": "normal", "size": SIZE}
    alone, first = (render(scene, camera, **asked, is_continued=is_continued) for is_continued in (False, True))
    assert not np.array_equal(alone, first)
    rounds = [passes["combined"].copy() for _, passes in render_progressively(scene, camera, **asked, samples=2)]
    np.testing.assert_array_equal(rounds[0], first)
    (one,) = (passes["combined"].copy() for _, passes in render_progressively(scene, camera, **asked, samples=1))
    np.testing.assert_array_equal(one, alone)


def panes(alphas: tuple[float, ...], threshold: float, **more: Any) -> Appearance:
    """Squares one behind the other, each with its own material: rows 0, 1 ..., pass indices 1, 2 ..."""
    count = len(alphas)
    table = np.arange(count, dtype=np.int32)
    return Appearance(
        instances=InstanceTable(
            table, np.arange(count + 1, dtype=np.int32), table, table + np.int32(1), np.zeros(count, np.bool_)
        ),
        materials=MaterialTable(
            np.ones((count, 4), np.float32), table + np.int32(1), alphas=np.float32(alphas), **more
        ),
        pass_alpha_threshold=threshold,
    )


@pytest.mark.parametrize(
    ("alphas", "threshold", "bounces", "seen"),
    [
        ((0.0, 0.49, 0.5, 1.0), 0.5, 8, 2),
        ((0.0, 0.49, 0.49, 0.0), 0.5, 8, None),
        ((0.0, 0.2, 0.3, 1.0), 0.0, 8, 0),
        ((0.2, 0.2, 0.9, 1.0), 1.0, 8, 3),
        ((0.2, 0.2, 0.9, 1.0), 1.0, 3, 3),
        ((0.2, 0.2, 0.9, 1.0), 1.0, 2, None),
    ],
)
def test_passes_look_through_what_has_less_alpha_than_the_threshold(
    alphas: tuple[float, ...], threshold: float, bounces: int, seen: int | None
) -> None:
    scene = quad_scene(*(placed(z=-2.0 - layer, scale=10.0) for layer in range(len(alphas))))
    asked: dict[str, Any] = {"size": SIZE, "light_paths": LightPaths(transparent_bounces=bounces)}
    names = ("depth", "instance", "object_index", "material_index", "normal", "primitive")
    passes = render_passes(scene, Camera(window=WINDOW), appearance=panes(alphas, threshold), passes=names, **asked)
    hits = seen is not None
    depth, row = (2.0 + seen, seen) if seen is not None else (1e10, -1)
    np.testing.assert_allclose(passes["depth"], depth, rtol=1e-6)
    np.testing.assert_array_equal(passes["instance"], row)
    np.testing.assert_array_equal(passes["object_index"], row + 1)
    np.testing.assert_array_equal(passes["material_index"], row + 1)
    np.testing.assert_array_equal(passes["primitive"] >= 0, hits)
    np.testing.assert_array_equal(passes["normal"][..., 2], float(hits))


def test_the_threshold_of_passes_is_not_that_of_the_image() -> None:
    scene, camera = quad_scene(placed(z=-2.0), placed(z=-3.0, scale=10.0)), Camera(window=WINDOW)

    def shown(threshold: float) -> dict[str, npt.NDArray[Any]]:
        asked: dict[str, Any] = {"mode": "preview", "size": SIZE, "passes": ("combined", "depth")}
        return render_passes(scene, camera, appearance=panes((0.3, 1.0), threshold), **asked)

    without, with_threshold = shown(0.0), shown(0.5)
    np.testing.assert_array_equal(without["combined"], with_threshold["combined"])
    assert set(np.unique(without["depth"].round(4))) == {2.0, 3.0}
    np.testing.assert_allclose(with_threshold["depth"], 3.0, rtol=1e-6)


def test_passes_end_at_holdouts_behind_transparent_surfaces() -> None:
    scene = quad_scene(*(placed(z=-2.0 - layer, scale=10.0) for layer in range(3)))
    appearance = panes((0.2, 1.0, 1.0), 0.5, holdouts=np.float32((0.0, 1.0, 0.0)))
    passes = render_passes(scene, Camera(window=WINDOW), size=SIZE, appearance=appearance, passes=("depth", "instance"))
    np.testing.assert_array_equal(passes["depth"], np.float32(1e10))
    np.testing.assert_array_equal(passes["instance"], -1)
