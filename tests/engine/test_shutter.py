"""Images of what moves while the shutter is open.

A shutter that rolls without any duration gives each row of pixels a single time, so that rows are compared with those
of scenes frozen at that time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from engine.preview_looks import emissive, lights, materials, one_material
from oracles.moving import positions_at, transform_at
from oracles.moving_scene import MovingScene, still_copy
from perfect_bvh import Appearance, Camera, HairTable, MeshAppearance, Scene, Shutter

SIZE = (48, 24)
ROLLING = Shutter(rolling=0.0)
CAMERA = Camera.look_at((0.0, -4.0, 0.4), (0.0, 0.0, 0.0), aspect=2.0)
STEPS = 3


def row_times() -> npt.NDArray[np.float32]:
    return (np.arange(SIZE[1], dtype=np.float32) + np.float32(1)) / np.float32(SIZE[1])


def appearance(scene: Scene, normals: dict[int, npt.NDArray[Any]] | None = None) -> Appearance:
    """Everything grey and matt, under the studio's sky."""
    count = scene.statistics().instance_count
    return Appearance(
        instances=one_material(count),
        materials=materials(base_colors=np.full((1, 3), 0.8, np.float32)),
        meshes={mesh: MeshAppearance(corner_normals=values) for mesh, values in (normals or {}).items()},
    )


def preview(scene: Scene, look: Appearance, shutter: Shutter | None, camera: Camera = CAMERA, samples: int = 4) -> Any:
    return perfect_bvh.render(scene, camera, "preview", SIZE, samples, look, filter_width=0.0, shutter=shutter)


@pytest.mark.parametrize("time_range", [(0.0, 1.0), (0.25, 0.75)])
def test_each_row_shows_the_scene_as_it_is_at_its_time(time_range: tuple[float, float]) -> None:
    moving = MovingScene(STEPS, time_range)
    look = appearance(moving.scene)
    image = preview(moving.scene, look, ROLLING)
    still = still_copy(moving, STEPS, 0)
    differing = 0
    for row, time in enumerate(row_times()):
        moving.frozen(still, float(time))
        expected = preview(still, look, None)[row]
        differing += int((np.abs(image[row] - expected).max(axis=1) > 1e-4).sum())
    # Transforms of the frozen scene are rounded differently, so a path close to an edge may pass it on the other side.
    assert differing <= SIZE[0] * SIZE[1] // 100
    assert np.ptp(image[..., :3]) > 0.1


def test_all_samples_together_are_the_mean_over_the_time() -> None:
    moving = MovingScene(STEPS)
    look = appearance(moving.scene)
    blurred = preview(moving.scene, look, Shutter(), samples=256)
    still = still_copy(moving, STEPS, 0)
    total = np.zeros_like(blurred)
    times = (np.arange(32) + 0.5) / 32
    for time in times:
        moving.frozen(still, float(time))
        total += preview(still, look, None, samples=16)
    difference = np.abs(blurred - total / len(times))
    assert difference.mean() < 0.02 and np.quantile(difference, 0.99) < 0.15


def test_other_modes_and_passes_show_the_middle() -> None:
    moving = MovingScene(STEPS)
    look = appearance(moving.scene)
    names = ("depth", "distance", "normal", "instance", "primitive")
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 0.5)
    asked: dict[str, Any] = {"size": SIZE, "samples": 2, "passes": names, "appearance": look}
    found = perfect_bvh.render_passes(moving.scene, CAMERA, mode="preview", shutter=Shutter(), **asked)
    expected = perfect_bvh.render_passes(still, CAMERA, mode="clay", **asked)
    same = found["instance"] == expected["instance"]
    assert same.mean() > 0.995
    for name in ("depth", "distance", "normal"):
        assert np.allclose(found[name][same], expected[name][same], atol=1e-5)
    for mode in ("clay", "normal", "wireframe", "matcap"):
        image = perfect_bvh.render(moving.scene, CAMERA, mode, SIZE, 1, look, shutter=Shutter(), ao_distance=1.0)
        frozen = perfect_bvh.render(still, CAMERA, mode, SIZE, 1, look, ao_distance=1.0)
        assert (np.abs(image - frozen).max(axis=2) > 1e-3).mean() < 0.02


def test_what_is_not_to_be_blurred_is_seen_in_the_middle() -> None:
    moving = MovingScene(STEPS)
    look = appearance(moving.scene)
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 0.5)
    difference = np.abs(preview(moving.scene, look, Shutter(blurs=False)) - preview(still, look, None)).max(axis=2)
    assert (difference > 1e-4).mean() < 0.01


def test_a_still_scene_needs_no_time() -> None:
    moving = MovingScene(STEPS)
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 0.3)
    look = appearance(still)
    assert np.array_equal(preview(still, look, Shutter()), preview(still, look, None))


def test_pixels_depend_on_neither_threads_nor_instruction_set() -> None:
    moving = MovingScene(STEPS)
    look = appearance(moving.scene)
    asked: dict[str, Any] = {"shutter": Shutter((0.0, 1.0, 0.0), 0.5)}
    first = perfect_bvh.render(moving.scene, CAMERA, "preview", SIZE, 2, look, threads=1, **asked)
    for isa in perfect_bvh.available_isas():
        perfect_bvh.set_active_isa(isa)
        try:
            other = perfect_bvh.render(moving.scene, CAMERA, "preview", SIZE, 2, look, threads=2, **asked)
        finally:
            perfect_bvh.set_active_isa(None)
        assert np.array_equal(first, other)


def test_camera_rays_of_all_times_are_audited() -> None:
    moving = MovingScene(STEPS)
    look, audit = appearance(moving.scene), perfect_bvh.RenderAudit(1.0)
    perfect_bvh.render(moving.scene, CAMERA, "preview", SIZE, 4, look, shutter=Shutter(), audit=audit)
    assert audit.result.checked_count >= SIZE[0] * SIZE[1] * 4
    assert len(audit.result.wrong_rows) == 0


# The camera ----------------------------------------------------------------------------------------------------------


def moving_cameras() -> tuple[Camera, ...]:
    """Cameras that move, turn and zoom."""
    places = [((-1.0, -4.0, 0.4), 1.0), ((0.0, -4.5, 0.0), 1.1), ((1.0, -4.0, -0.4), 0.8)]
    return tuple(Camera.look_at(place, (0.2, 0.0, 0.0), aspect=2.0, angle=angle) for place, angle in places)


def camera_at(cameras: tuple[Camera, ...], time: float) -> Camera:
    step = min(int(time * (len(cameras) - 1)), len(cameras) - 2)
    share = time * (len(cameras) - 1) - step
    window = tuple(
        (1 - share) * a + share * b for a, b in zip(cameras[step].window, cameras[step + 1].window, strict=True)
    )
    matrix = transform_at(np.stack([camera.matrix for camera in cameras]), time)
    return replace(CAMERA, matrix=matrix, window=window)


def test_each_row_is_seen_from_where_the_camera_is_at_its_time() -> None:
    moving = MovingScene(STEPS)
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 0.5)
    look, cameras = appearance(still), moving_cameras()
    image = preview(still, look, replace(ROLLING, cameras=cameras))
    differing = 0
    for row, time in enumerate(row_times()):
        expected = preview(still, look, None, camera_at(cameras, float(time)))[row]
        differing += int((np.abs(image[row] - expected).max(axis=1) > 1e-4).sum())
    assert differing <= SIZE[0] * SIZE[1] // 100


def test_passes_are_seen_from_the_camera_in_the_middle() -> None:
    moving = MovingScene(STEPS)
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 0.5)
    cameras = moving_cameras()
    asked: dict[str, Any] = {"size": SIZE, "passes": ("depth", "instance")}
    found = perfect_bvh.render_passes(still, CAMERA, shutter=Shutter(cameras=cameras), **asked)
    expected = perfect_bvh.render_passes(still, camera_at(cameras, 0.5), **asked)
    assert (found["instance"] == expected["instance"]).mean() > 0.995


# Surfaces that change their shape ------------------------------------------------------------------------------------


def test_corner_normals_turn_with_their_triangles() -> None:
    """A bent sheet that is turned by its vertices look like one that its instance turns."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5)), axis=-1).reshape(-1, 2)
    positions = np.column_stack([grid[:, 0], 0.3 * grid[:, 0] ** 2, grid[:, 1]]).astype(np.float32)
    rows = np.arange(20).reshape(4, 5)[:, :4].ravel()
    triangles = np.concatenate([np.stack([rows, rows + 1, rows + 6], 1), np.stack([rows, rows + 6, rows + 5], 1)])
    slopes = 0.6 * positions[:, 0]
    vertex_normals = np.column_stack([slopes, -np.ones(25), np.zeros(25)]) / np.sqrt(1 + slopes**2)[:, None]
    corner_normals = vertex_normals[triangles].astype(np.float32)
    turn = transform_of(0.6, (0.0, 0.0, 0.0))
    turned = (positions @ turn[:3, :3].T).astype(np.float32)

    scene = Scene()
    mesh = scene.add_mesh(positions, triangles)
    scene.add_instance(mesh)
    scene.set_mesh_motion(mesh, np.stack([positions, turned]))
    scene.commit()
    look = appearance(scene, {mesh: corner_normals})
    # At time 1, which the last row has, of normals that are those of time 0.
    image = preview(scene, look, replace(ROLLING, frame_time=0.0))

    placed = Scene()
    other = placed.add_mesh(positions, triangles)
    placed.add_instance(other, turn)
    placed.commit()
    expected = preview(placed, appearance(placed, {other: corner_normals}), None)
    assert (expected[-1, :, 3] > 0).any()
    assert np.allclose(image[-1], expected[-1], atol=2e-3)


@pytest.mark.parametrize("start", [1.0, 1e-3, 0.0])
def test_a_light_that_grows_is_as_bright_as_it_is_large_then(start: float) -> None:
    floor = np.array([(-4, -4, -1), (4, -4, -1), (4, 4, -1), (-4, 4, -1)], np.float32)
    lamp = np.array([(-1, -1, 1), (-1, 1, 1), (1, 1, 1), (1, -1, 1)], np.float32) * np.float32(0.2)
    lamp[:, 2] = 1.0
    quad = [(0, 1, 2), (0, 2, 3)]
    grown = lamp * np.array([4.0, 4.0, 1.0], np.float32)

    def make(corners: npt.NDArray[np.float32]) -> tuple[Scene, int]:
        scene = Scene()
        scene.add_instance(scene.add_mesh(floor, quad))
        mesh = scene.add_mesh(corners, quad)
        scene.add_instance(mesh)
        scene.commit()
        return scene, mesh

    look = replace(emissive(40.0), camera_mask=0xFFFFFFFF)
    scene, mesh = make(lamp)
    scene.set_mesh_motion(mesh, np.stack([lamp * np.float32([start, start, 1.0]), grown]))
    scene.commit()
    image = preview(scene, look, ROLLING, samples=1024)
    still, _ = make(grown)
    expected = preview(still, look, None, samples=1024)
    assert expected[-1, :, :3].min() > 0.1
    assert np.allclose(image[-1], expected[-1], rtol=0.1)
    assert image[-1].mean() == pytest.approx(expected[-1].mean(), rel=0.01)


# The curve -----------------------------------------------------------------------------------------------------------


def test_times_follow_the_curve() -> None:
    assert len(Shutter().times()) == 0
    even = Shutter((1.0, 1.0, 1.0)).times()
    assert np.allclose(even, np.linspace(0, 1, len(even)), atol=1e-6)
    triangle = Shutter((0.0, 1.0, 0.0)).times()
    chances = np.linspace(0.0, 1.0, len(triangle))
    expected = np.where(chances < 0.5, np.sqrt(chances / 2), 1 - np.sqrt((1 - chances) / 2))
    assert np.allclose(triangle, expected, atol=5e-4)
    for peak in (1, 777, 9000):
        narrow = Shutter(tuple(float(place == peak) for place in range(9001))).times()
        assert np.abs(narrow - peak / 9000).max() <= 1.01 / 9000
    late = Shutter((0.0, 0.0, 0.0, 0.0, 1.0)).times()
    assert (late >= 0.75 - 1e-3).all() and late[-1] == 1.0


def test_a_shutter_that_opens_late_shows_what_is_late() -> None:
    moving = MovingScene(STEPS)
    look = appearance(moving.scene)
    curve = (0.0,) * 1024 + (1.0,)
    image = preview(moving.scene, look, Shutter(curve))
    still = still_copy(moving, STEPS, 0)
    moving.frozen(still, 1.0)
    difference = np.abs(image - preview(still, look, None)).max(axis=2)
    assert (difference > 0.02).mean() < 0.05


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"curve": (1.0,)}, "two or more finite numbers"),
        ({"curve": (0.0, 0.0)}, "not all 0"),
        ({"curve": (1.0, float("nan"))}, "two or more finite numbers"),
        ({"curve": (1.0, -1.0)}, "0 or more"),
        ({"rolling": 1.5}, "rolling must be a number from 0 to 1"),
        ({"rolling": float("nan")}, "rolling must be a number from 0 to 1"),
        ({"frame_time": -0.1}, "frame_time must be a number from 0 to 1"),
        ({"cameras": (CAMERA,)}, "two or more of one projection"),
        ({"cameras": (CAMERA, replace(CAMERA, projection="orthographic"))}, "two or more of one projection"),
        ({"cameras": (CAMERA, 3)}, r"cameras\[1\] must be a perfect_bvh.Camera, got int"),
    ],
)
def test_bad_shutters_are_refused(bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Shutter(**bad)


def test_a_shutter_must_fit_the_camera() -> None:
    scene = MovingScene(2).scene
    panorama = replace(CAMERA, projection="equirectangular")
    with pytest.raises(ValueError, match=r"render: shutter.cameras must be perspective"):
        perfect_bvh.render(scene, CAMERA, shutter=Shutter(cameras=(panorama, panorama)))
    with pytest.raises(ValueError, match=r"render: shutter must be a perfect_bvh.Shutter, got int"):
        perfect_bvh.render(scene, CAMERA, shutter=1)
    flat = replace(CAMERA, matrix=np.array([[1.0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    with pytest.raises(ValueError, match="flattens nothing"):
        perfect_bvh.render(scene, CAMERA, shutter=Shutter(cameras=(flat, flat)))


def test_lights_are_where_they_are_whatever_the_time() -> None:
    """A lamp's light on a floor does not depend on the time of the rays that ask for it."""
    scene = Scene()
    floor = np.array([(-4, -4, -1), (4, -4, -1), (4, 4, -1), (-4, 4, -1)], np.float32)
    scene.add_instance(scene.add_mesh(floor, [(0, 1, 2), (0, 2, 3)]))
    scene.commit()
    look = replace(appearance(scene), lights=lights(0, (0.0, 0.0, 1.0), 5.0))
    assert np.array_equal(preview(scene, look, Shutter()), preview(scene, look, None))


def fiber() -> HairTable:
    """One kind of brown hair, which light passes."""
    one = np.ones(1, np.float32)
    return HairTable(
        surfaces=0.0 * one,
        fibers=one,
        absorptions=np.full((1, 3), 0.3, np.float32),
        colored=np.zeros(1, np.bool_),
        roughnesses=np.full((1, 2), 0.3, np.float32),
        coats=0.0 * one,
        tilts=0.03 * one,
        iors=1.55 * one,
    )


@pytest.mark.parametrize("shape", ["round", "ribbon"])
@pytest.mark.parametrize("is_hair", [False, True])
def test_curves_and_points_are_seen_at_the_time_of_their_row(shape: Any, is_hair: bool) -> None:
    random = np.random.default_rng(3)
    strands, each = 40, 5
    roots = np.column_stack(
        [random.uniform(-1.5, 1.5, strands), random.uniform(-1, 1, strands), np.full(strands, -0.8)]
    )
    along = np.linspace(0, 1.6, each)[:, None] * [0.0, 0.0, 1.0]
    first = (roots[:, None] + along).reshape(-1, 3).astype(np.float32)
    bent = (first + 0.4 * (first[:, 2:] + 0.8) ** 2 * [1.0, 0.3, -0.2]).astype(np.float32)
    radii, offsets = np.full(len(first), 0.03, np.float32), np.arange(0, len(first) + 1, each)
    balls = random.uniform(-1, 1, (12, 3)).astype(np.float32)
    path = np.stack([np.eye(4), transform_of(0.5, (0.2, 0.0, 0.1))])

    def make(curves: npt.NDArray[np.float32], points: npt.NDArray[np.float32], place: npt.NDArray[np.float64]) -> Any:
        scene = Scene()
        ids = (
            scene.add_curves(curves, radii, offsets, shape=shape),
            scene.add_points(points, np.full(12, 0.1, np.float32)),
        )
        placed = [scene.add_instance(mesh, place) for mesh in ids]
        return scene, ids, placed

    scene, (curves, points), placed = make(first, balls, np.eye(4))
    scene.set_curves_motion(curves, np.stack([first, bent]))
    scene.set_points_motion(points, np.stack([balls, balls + np.float32(0.1)]))
    scene.set_instance_motion(placed, np.stack([path, path], axis=1))
    scene.commit()
    look = appearance(scene)
    if is_hair:
        look = replace(look, hair=fiber(), materials=replace(look.materials, hairs=np.zeros(1, np.int32)))
    image = preview(scene, look, ROLLING)
    differing, total = 0, 0.0
    for row, time in enumerate(row_times()):
        at = float(time)
        still, *_ = make(
            positions_at(np.stack([first, bent]), at),
            positions_at(np.stack([balls, balls + np.float32(0.1)]), at),
            transform_at(path, at),
        )
        still.commit()
        expected = preview(still, look, None)[row]
        differing += int((np.abs(image[row] - expected).max(axis=1) > 1e-3).sum())
        total += float(expected[:, :3].mean()) / SIZE[1]
    assert image[..., :3].mean() == pytest.approx(total, rel=0.01)
    # Which way light goes on that passes ribbons of hair, the last digit of their transform may decide.
    assert differing <= SIZE[0] * SIZE[1] // (10 if is_hair and shape == "ribbon" else 100)


def transform_of(angle: float, place: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """A turn about the vertical axis, and where it goes."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = place
    return matrix
