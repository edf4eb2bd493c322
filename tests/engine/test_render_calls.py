"""Calls of `render`: the same image for any number of threads and rounds, modes, cancelling, and refused arguments."""

from __future__ import annotations

import threading
from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest
from perfect_bvh import (
    MODES,
    PASSES,
    Appearance,
    Camera,
    InstanceTable,
    MaterialTable,
    MeshAppearance,
    Scene,
    cost_to_color,
    depth_to_grey,
    render,
    render_passes,
    render_progressively,
)

SIZE = (100, 70)  # no multiple of the tile size
CAMERA = Camera.look_at((2.0, -6.0, 3.0), (0.0, 0.0, 0.0), aspect=100 / 70)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """200 random triangles over a ground."""
    rng = np.random.default_rng(5)
    made = Scene()
    corners = rng.normal(size=(200, 1, 3)) + rng.normal(size=(200, 3, 3)) * 0.3
    mesh = made.add_mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(600, dtype=np.int32).reshape(-1, 3))
    made.add_instance(mesh, np.eye(4))
    ground = np.array([(-9, -9, -2), (9, -9, -2), (9, 9, -2), (-9, 9, -2)], np.float32)
    made.add_instance(made.add_mesh(ground, np.array([(0, 1, 2), (0, 2, 3)], np.int32)), np.eye(4))
    made.commit()
    return made


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("samples", [1, 3])
def test_images_are_equal_for_any_number_of_threads(scene: Scene, mode: Any, samples: int) -> None:
    uvs = np.random.default_rng(8).random((200, 3, 2), np.float32)
    look = Appearance(meshes={0: MeshAppearance(corner_uvs=uvs)})
    images = [
        render_passes(scene, CAMERA, mode=mode, size=SIZE, samples=samples, passes=PASSES, appearance=look, threads=n)
        for n in (1, 2, 3)
    ]
    for name in PASSES:
        np.testing.assert_array_equal(images[0][name], images[1][name], err_msg=name)
        np.testing.assert_array_equal(images[0][name], images[2][name], err_msg=name)
    assert np.isfinite(images[0]["combined"]).all()
    assert np.ptp(images[0]["combined"][..., 0]) > 0.0


@pytest.mark.parametrize("mode", MODES)
def test_combined_is_the_same_with_and_without_other_passes(scene: Scene, mode: Any) -> None:
    """With a denoiser's guides, pixels are independent of one another: that is another image."""
    passes = [name for name in PASSES if not name.startswith("denoising")]
    alone = render(scene, CAMERA, mode, SIZE)
    among = render_passes(scene, CAMERA, mode=mode, size=SIZE, passes=passes)
    np.testing.assert_array_equal(alone, among["combined"])


def test_depth_modes_show_what_the_depth_passes_hold(scene: Scene) -> None:
    passes = render_passes(scene, CAMERA, size=SIZE, passes=("depth", "distance"))
    for name in ("depth", "distance"):
        image = render(scene, CAMERA, name, SIZE, samples=4)  # type: ignore[arg-type]
        np.testing.assert_array_equal(image[..., 1], passes[name])
        np.testing.assert_array_equal(image[..., 3], passes[name] < np.float32(1e10))


def test_instance_colours_belong_to_ids(scene: Scene) -> None:
    image = render(scene, CAMERA, "instance", SIZE)
    instance = render_passes(scene, CAMERA, size=SIZE, passes=("instance",))["instance"]
    colors = [np.unique(image[instance == i], axis=0) for i in (0, 1)]
    assert [len(color) for color in colors] == [1, 1]
    assert np.abs(colors[0] - colors[1]).max() > 0.1


def test_cost_is_brighter_where_more_was_visited(scene: Scene) -> None:
    image = render(scene, CAMERA, "cost", SIZE).astype(np.float64)
    passes = render_passes(scene, CAMERA, size=SIZE, passes=("nodes_visited", "primitives_tested"))
    cost = passes["nodes_visited"] + passes["primitives_tested"]
    luminance = image[..., :3] @ (0.2126, 0.7152, 0.0722)
    order = np.argsort(cost, axis=None)
    assert (np.diff(luminance.ravel()[order]) >= -1e-6).all()
    assert cost.max() > 2 * cost.min()


def test_other_seeds_give_other_noise_and_the_same_seed_the_same(scene: Scene) -> None:
    first, again, other = (render(scene, CAMERA, size=SIZE, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_continued_samples_make_the_same_image(scene: Scene) -> None:
    def render_both(filter_width: float) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        options: dict[str, Any] = {"size": SIZE, "filter_width": filter_width}
        whole = render(scene, CAMERA, samples=8, **options)
        parts = [render(scene, CAMERA, samples=4, first_sample=first, **options) for first in (0, 4)]
        return whole, (parts[0] + parts[1]) / 2

    whole, continued = render_both(0.5)
    np.testing.assert_allclose(continued, whole, atol=1e-5)
    # Samples that pixels share weigh a little more in one part than in the other.
    whole, continued = render_both(1.5)
    exact = render(scene, CAMERA, size=SIZE, samples=256)
    assert np.abs(continued - exact).mean() < 1.05 * np.abs(whole - exact).mean()


def test_a_part_of_an_image_is_the_same_as_the_whole_one_there(scene: Scene) -> None:
    """Bit for bit, though pixels share samples across tiles and across the border."""
    options: dict[str, Any] = {"size": SIZE, "samples": 8}
    whole = render(scene, CAMERA, **options)
    for border in ((0.13, 0.61, 0.2, 0.77), (0.5, 0.52, 0.0, 1.0)):
        part = render(scene, replace(CAMERA, border=border), **options)
        traced = part[..., 3] > 0.0
        assert 0.01 < traced.mean() < 0.5
        np.testing.assert_array_equal(part[traced], whole[traced])


def test_shared_samples_converge_to_the_image_under_the_filter(scene: Scene) -> None:
    """The window over finer pixels, whose samples are not shared, is the reference."""
    width, height = SIZE
    parts = 5
    size = (width * parts, height * parts)
    fine = render(scene, CAMERA, size=size, samples=16, filter_width=0.5)
    place = (np.arange(-2 * parts, 2 * parts + 1)) / (3.0 * parts) + 0.5
    angle = 2.0 * np.pi * place
    window = 0.35875 - 0.48829 * np.cos(angle) + 0.14128 * np.cos(2 * angle) - 0.01168 * np.cos(3 * angle)
    window = np.where((place >= 0.0) & (place <= 1.0), window, 0.0)
    window /= window.sum()
    blurred = fine.astype(np.float64)
    for axis in (0, 1):
        blurred = np.apply_along_axis(np.convolve, axis, blurred, window, "same")
    wanted = blurred[parts // 2 :: parts, parts // 2 :: parts]
    inside = np.s_[2:-2, 2:-2]
    shared = render(scene, CAMERA, size=SIZE, samples=256)
    assert np.abs(shared - wanted)[inside].mean() < 0.002
    assert np.abs(shared - wanted)[inside].max() < 0.05


def test_a_stop_flag_ends_a_render_from_another_thread(scene: Scene) -> None:
    flag = perfect_bvh.make_stop_flag()
    assert not flag.is_set and flag(0.5)
    expected = render(scene, CAMERA, "clay", SIZE, 2)
    np.testing.assert_array_equal(render(scene, CAMERA, "clay", SIZE, 2, None, flag), expected)
    timer = threading.Timer(0.05, flag.set)
    timer.start()
    with pytest.raises(perfect_bvh.Cancelled):
        render(scene, CAMERA, "clay", (2000, 2000), 60_000, None, flag)
    timer.join()
    assert flag.is_set and not flag(0.5)
    with pytest.raises(perfect_bvh.Cancelled):
        render(scene, CAMERA, "clay", SIZE, 2, None, flag)


def test_progressive_rounds_refine_one_image(scene: Scene) -> None:
    shares: list[float] = []

    def progress(share: float) -> bool:
        shares.append(share)
        return True

    rounds = render_progressively(scene, CAMERA, size=SIZE, samples=7, passes=("combined", "depth"), progress=progress)
    counts, images = zip(*((count, passes["combined"].copy()) for count, passes in rounds), strict=True)
    assert counts == (1, 2, 4, 7)
    exact = render(scene, CAMERA, size=SIZE, samples=64)
    errors = [float(np.abs(image - exact).mean()) for image in images]
    assert errors == sorted(errors, reverse=True)
    assert shares == sorted(shares)


def test_a_render_is_cancelled_by_its_progress(scene: Scene) -> None:
    asked: list[float] = []

    def stop(share: float) -> bool:
        asked.append(share)
        return False

    with pytest.raises(perfect_bvh.Cancelled):
        render(scene, CAMERA, size=(1920, 1080), samples=1000, progress=stop)
    assert len(asked) == 1
    assert asked[0] < 0.5


def test_an_exception_in_progress_reaches_the_caller(scene: Scene) -> None:
    def fail(share: float) -> bool:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        render(scene, CAMERA, size=(1920, 1080), samples=1000, progress=fail)


def test_a_snapshot_is_rendered_while_its_scene_has_edits() -> None:
    scene = Scene()
    mesh = scene.add_mesh([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], [(0, 1, 2)])
    instance = scene.add_instance(mesh, np.eye(4))
    scene.commit()
    snapshot = scene.snapshot()
    before = render(scene, CAMERA, "instance", SIZE)
    scene.remove_instances([instance])
    np.testing.assert_array_equal(render(snapshot, CAMERA, "instance", SIZE), before)
    with pytest.raises(perfect_bvh.StaleSceneError):
        render(scene, CAMERA, "instance", SIZE)
    scene.commit()
    assert (render(scene, CAMERA, "instance", SIZE) == 0.0).all()
    assert (render(scene, CAMERA, "clay", SIZE)[..., 3] == 1.0).all()


def test_costs_have_the_colors_that_the_mode_shows(scene: Scene) -> None:
    names = ("combined", "nodes_visited", "primitives_tested")
    passes = render_passes(scene, CAMERA, mode="cost", size=SIZE, passes=names)
    costs = passes["nodes_visited"] + passes["primitives_tested"]
    assert len(np.unique(costs)) > 10
    np.testing.assert_allclose(cost_to_color(costs), passes["combined"][..., :3], atol=1e-6)
    np.testing.assert_array_equal(cost_to_color([0, 1, 2]), cost_to_color([2, 2, 2]))
    np.testing.assert_array_equal(cost_to_color(4096), cost_to_color(512))
    assert cost_to_color(7).shape == (3,)


def test_depths_as_greys() -> None:
    depth = np.array([1.0, 2.0, 3.0, 1e10], np.float32)
    np.testing.assert_allclose(depth_to_grey(depth), (1.0, 0.5, 0.0, 0.0))
    np.testing.assert_allclose(depth_to_grey(depth, 2.0, 4.0), (1.0, 1.0, 0.5, 0.0))
    assert (depth_to_grey(np.full(3, 1e10, np.float32)) == 0.0).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mode": "fancy"}, "render: mode must be one of preview, clay, .*got 'fancy'"),
        ({"size": (0, 10)}, "render: size must be an integer from 1 to 65536, got 0"),
        ({"size": 12}, r"render: size must be \(width, height\)"),
        ({"samples": 0}, "render: samples must be an integer from 1 to .*got 0"),
        ({"samples": 1.5}, "render: samples must be an integer from 1 .*got 1.5"),
        ({"threads": -1}, "render: threads must be an integer from 0 to"),
        ({"filter_width": float("nan")}, "render: filter_width must be a number from 0 to 16, got nan"),
        ({"ao_distance": -1.0}, "render: ao_distance must be"),
        ({"clay_color": (1.0, 2.0)}, "render: clay_color must be three numbers"),
        ({"camera": None}, "render: camera must be a perfect_bvh.Camera, got NoneType"),
        ({"appearance": 3}, "render: appearance must be a perfect_bvh.Appearance, got int"),
    ],
)
def test_bad_arguments_are_named(scene: Scene, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        render(scene, **{"camera": CAMERA, "size": SIZE} | arguments)


def test_unknown_passes_options_and_scenes_are_named(scene: Scene) -> None:
    with pytest.raises(ValueError, match=r"render_passes: passes must be one of combined, .*got 'beauty'"):
        render_passes(scene, CAMERA, passes=("beauty",))
    with pytest.raises(TypeError, match="render: unknown option 'light'"):
        render(scene, CAMERA, light=3)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="render: scene must be a Scene or a Snapshot, got list"):
        render([], CAMERA)  # type: ignore[arg-type]
    flat = np.eye(4)
    flat[0, 0] = 0.0
    with pytest.raises(ValueError, match="render: the camera's matrix has no usable x axis"):
        render(scene, replace(CAMERA, matrix=flat), size=SIZE)


def table(**columns: npt.NDArray[Any]) -> InstanceTable:
    """One instance with one slot, with some columns replaced."""
    plain = {
        "ids": np.array([0], np.int32),
        "slot_offsets": np.array([0, 1], np.int32),
        "slot_materials": np.array([-1], np.int32),
        "object_indices": np.zeros(1, np.int32),
        "holdout": np.zeros(1, bool),
    }
    return InstanceTable(**plain | columns)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("appearance", "message"),
    [
        (Appearance(instances=table(holdout=np.zeros(2, bool))), "instances.holdout has 2 rows but .*ids has 1"),
        (Appearance(instances=table(ids=np.array([-1], np.int32))), "instances.ids holds a negative id"),
        (Appearance(instances=table(slot_offsets=np.array([0, 2], np.int32))), "slot_offsets must rise from 0"),
        (Appearance(instances=table(slot_materials=np.array([0], np.int32))), "refers to material 0 but .*has 0 rows"),
        (
            Appearance(materials=MaterialTable(np.ones((2, 3), np.float32))),
            r"materials.colors must have shape \(N, 4\)",
        ),
        (
            Appearance(meshes={0: MeshAppearance(corner_normals=np.zeros((7, 3, 3), np.float32))}),
            r"meshes\[0\].corner_normals has 7 rows but the mesh has 200 triangles",
        ),
        (
            Appearance(instances=table(), meshes={0: MeshAppearance(material_slots=np.zeros(7, np.int32))}),
            r"meshes\[0\].material_slots has 7 rows but the mesh has 200 triangles",
        ),
    ],
)
def test_appearances_that_do_not_fit_are_refused(scene: Scene, appearance: Appearance, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        render(scene, CAMERA, size=SIZE, appearance=appearance)


@pytest.mark.parametrize("name", [field.name for field in fields(MaterialTable) if field.default is None])
def test_material_columns_need_a_row_each(scene: Scene, name: str) -> None:
    row = {"programs": (None,)}.get(name, np.zeros((3, 3) if name.endswith(("colors", "emissions", "_tints")) else 3))
    if name in {"hairs", "finishes"}:
        row = row.astype(np.int32)
    colors, indices = np.ones((2, 4), np.float32), np.zeros(2, np.int32)
    appearance = Appearance(materials=MaterialTable(colors, indices, **{name: row}))
    with pytest.raises(ValueError, match=f"materials.{name} has . rows but materials.colors has 2"):
        render(scene, CAMERA, size=SIZE, appearance=appearance)


def test_no_camera_ray_is_lost_at_an_edge() -> None:
    """A wavy surface with a vertex on every fourth pixel's ray: most rays meet an edge."""
    count = 400
    camera = Camera.look_at((0.3, 0.2, 0.4), (1.0, 7.0, -2.0), aspect=1.0)
    left, right, bottom, top = camera.window
    across, up = (0.5 + np.arange(0, count, 2)) / count * (right - left), (0.5 + np.arange(0, count, 2)) / count
    x, y = np.meshgrid(left + across, bottom + up * (top - bottom))
    directions = np.stack([x, y, -np.ones_like(x)], axis=-1) @ camera.matrix[:3, :3].T
    away = 4.0 + 0.3 * np.sin(7.0 * x) * np.cos(5.0 * y)
    positions = camera.matrix[:3, 3] + directions * away[..., None]
    rows = np.arange(x.size, dtype=np.int32).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (rows[:-1, :-1], rows[:-1, 1:], rows[1:, 1:], rows[1:, :-1]))
    scene = Scene()
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    scene.add_instance(scene.add_mesh(positions.reshape(-1, 3).astype(np.float32), triangles))
    scene.commit()
    passes = render_passes(scene, camera, size=(count, count), passes=("instance",))
    assert np.count_nonzero(passes["instance"][4:-4, 4:-4] < 0) == 0
