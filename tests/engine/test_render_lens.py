"""A lens's effect on an image: how far it blurs, which parts stay sharp, and which passes it must not change."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from perfect_bvh import (
    PASSES,
    Appearance,
    Camera,
    InstanceTable,
    Lens,
    MaterialTable,
    Scene,
    World,
    render,
    render_passes,
    render_progressively,
)

SIZE = 64
WINDOW = (-0.5, 0.5, -0.5, 0.5)
PROJECTIONS = ["perspective", "orthographic", "equirectangular"]


def squares(*places: tuple[float, float, float], half: float) -> Scene:
    """Squares that face a camera at the origin."""
    corners = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], np.float64)
    scene = Scene()
    for place in places:
        mesh = scene.add_mesh(corners + np.array(place), np.array([(0, 1, 2), (0, 2, 3)], np.int32))
        scene.add_instance(mesh)
    scene.commit()
    return scene


def emissive(count: int) -> Appearance:
    """Everything shines by itself, before a black world."""
    return Appearance(
        instances=InstanceTable(
            ids=np.arange(count, dtype=np.int32),
            slot_offsets=np.arange(count + 1, dtype=np.int32),
            slot_materials=np.zeros(count, np.int32),
            object_indices=np.zeros(count, np.int32),
            holdout=np.zeros(count, np.bool_),
        ),
        materials=MaterialTable(
            np.ones((1, 4), np.float32), np.zeros(1, np.int32), emissions=np.ones((1, 3), np.float32)
        ),
        world=World(),
    )


def picture(scene: Scene, camera: Camera, samples: int = 256, count: int = 1) -> npt.NDArray[np.float32]:
    """(H, W), the light of emissive surfaces."""
    return render(scene, camera, "preview", (SIZE, SIZE), samples, emissive(count))[..., 1]


def blur_radius(lens: Lens, distance: float, projection: str) -> float:
    """Returns the blur of a point at this distance in the frame's units."""
    spread = lens.radius * abs(distance / lens.focus_distance - 1.0)
    return spread if projection == "orthographic" else spread / distance


def moments(image: npt.NDArray[np.float32]) -> tuple[float, float, float]:
    """The mean squares across and up, and the mean cube up, of where the light is, in the frame's units."""
    y, x = 0.5 - (np.mgrid[:SIZE, :SIZE] + 0.5) / SIZE
    share = image.astype(np.float64) / image.sum()
    return float((share * x**2).sum()), float((share * y**2).sum()), float((share * y**3).sum())


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize(("focus", "distance"), [(2.0, 6.0), (8.0, 2.0), (1e6, 4.0)])
def test_a_point_is_blurred_over_the_disk_of_the_formula(projection, focus: float, distance: float) -> None:
    wanted, spot = 0.3, 0.04  # of the frame's units
    lens = Lens(1.0, focus)
    lens = replace(lens, radius=wanted / blur_radius(lens, distance, projection))
    camera = Camera(window=WINDOW, projection=projection, lens=lens)
    half = spot * (1.0 if projection == "orthographic" else distance)
    image = picture(squares((0, 0, -distance), half=half), camera)
    across, up, _ = moments(image)
    # A disk's mean square is a quarter of that of its radius, a square's a third of that of half its side.
    expected = wanted**2 / 4 + spot**2 / 3
    assert (across, up) == pytest.approx((expected, expected), rel=0.08 if projection == "equirectangular" else 0.02)
    radius = np.hypot(*((np.mgrid[:SIZE, :SIZE] + 0.5) / SIZE - 0.5))
    inside = image[radius < wanted - 2.0 * spot]
    assert inside.std() < 0.3 * inside.mean()
    assert image[radius > wanted + 2.0 * spot].max() < 0.05 * inside.mean()


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_what_is_in_focus_stays_sharp(projection) -> None:
    """Squares at the distance in focus, all over the frame; along the ray in a panorama, where only one is."""
    places = [(0.0, 0.0, -4.0)]
    if projection != "equirectangular":
        places += [(1.2, 0.7, -4.0), (-1.1, 1.3, -4.0)]
    window = (-2.0, 2.0, -2.0, 2.0) if projection == "orthographic" else WINDOW
    camera = Camera(window=window, projection=projection)
    scene = squares(*places, half=0.25)
    sharp = picture(scene, camera, 64, len(places))
    through_lens = picture(scene, replace(camera, lens=Lens(0.2, 4.0)), 64, len(places))
    assert np.abs(through_lens - sharp).max() < 0.03
    out_of_focus = picture(scene, replace(camera, lens=Lens(0.2, 2.0)), 64, len(places))
    assert np.abs(out_of_focus - sharp).max() > 0.3


@pytest.mark.parametrize(("blades", "ratio"), [(0, 2.0), (3, 1.0), (4, 0.9), (6, 1.5)])
def test_the_blur_has_the_shape_of_the_aperture(blades: int, ratio: float) -> None:
    """Of things behind the focus it is upright, as seen from the camera."""
    spot = 0.08
    lens = Lens(0.4, 1.0, blades=blades, rotation=math.pi / 2, ratio=ratio)
    camera = Camera(window=WINDOW, lens=lens)
    image = picture(squares((0, 0, -4.0), half=4.0 * spot), camera)
    radius = blur_radius(lens, 4.0, "perspective")
    square = radius**2 * (2.0 + math.cos(2.0 * math.pi / blades) if blades else 3.0) / 12.0
    across, up, cube = moments(image)
    assert across == pytest.approx(square / ratio**2 + spot**2 / 3, rel=0.04)
    assert up == pytest.approx(square + spot**2 / 3, rel=0.04)
    # Turned by a quarter a triangle has an edge on top.
    assert cube == pytest.approx(-(radius**3) / 40 if blades == 3 else 0.0, abs=1e-4)


def test_only_preview_and_only_its_picture_see_the_lens() -> None:
    scene = squares((0, 0, -4.0), (0.8, 0.2, -8.0), half=0.3)
    camera = Camera(window=WINDOW)
    blended = {"combined", "denoising_color", "denoising_albedo", "denoising_normal"}
    blurred = replace(camera, lens=Lens(0.3, 1.0))
    for mode in ("preview", "clay", "matcap", "wireframe", "normal", "depth", "cost"):
        for samples in (1, 4):
            asked = {"mode": mode, "size": (SIZE, SIZE), "samples": samples, "appearance": emissive(2)}
            sharp = render_passes(scene, camera, passes=PASSES, **asked)
            seen = render_passes(scene, blurred, passes=PASSES, **asked)
            for name in PASSES:
                is_same = np.array_equal(sharp[name], seen[name])
                assert is_same != (mode == "preview" and name in blended), (mode, samples, name)
            alone = render_passes(scene, blurred, passes=("combined", "denoising_albedo"), **asked)
            np.testing.assert_array_equal(alone["combined"], seen["combined"])


def test_rounds_of_samples_add_up_to_the_blur() -> None:
    scene = squares((0, 0, -6.0), half=0.15)
    camera = Camera(window=WINDOW, lens=Lens(0.6, 2.0))
    reference = picture(scene, camera, 512)
    options = {"mode": "preview", "size": (SIZE, SIZE), "appearance": emissive(1), "passes": ("combined", "depth")}
    rounds = [
        (done, passes["combined"][..., 1].copy())
        for done, passes in render_progressively(scene, camera, samples=64, **options)
    ]
    assert [done for done, _ in rounds] == [1, 2, 4, 8, 16, 32, 64]
    errors = [float(np.sqrt(np.mean((image - reference) ** 2))) for _, image in rounds]
    assert errors[-1] < errors[0] / 8.0  # samples that are independent end at an eighth


@pytest.mark.parametrize("blades", [0, 5])
def test_samples_spread_over_the_lens(blades: int) -> None:
    """The error of 64 samples a pixel is less than half of that of 64 independent ones."""
    scene = squares((0, 0, -6.0), (0.7, -0.4, -3.0), half=0.5)
    camera = Camera(window=WINDOW, lens=Lens(0.4, 2.0, blades=blades))
    reference, image = (
        render(scene, camera, "preview", (32, 32), samples, emissive(2), filter_width=0.0, seed=seed)[..., 1]
        for samples, seed in ((4096, 1), (64, 2))
    )
    independent = math.sqrt(np.mean(reference * (1.0 - reference) / 64))
    assert independent > 0.01
    assert math.sqrt(np.mean((image - reference) ** 2)) < 0.5 * independent


@pytest.mark.parametrize("threads", [1, 2])
def test_blur_does_not_depend_on_threads(threads: int) -> None:
    scene = squares((0, 0, -6.0), half=0.5)
    camera = Camera(window=WINDOW, lens=Lens(0.4, 2.0))
    images = [
        render(scene, camera, "preview", (SIZE, SIZE), 4, emissive(1), threads=count, seed=3) for count in (threads, 0)
    ]
    np.testing.assert_array_equal(*images)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": 0.0}, "Lens: radius must be a finite number above 0, got 0.0"),
        ({"focus_distance": math.nan}, "Lens: focus_distance must be a finite number above 0"),
        ({"ratio": -1.0}, "Lens: ratio must be a finite number above 0"),
        ({"rotation": math.inf}, "Lens: rotation must be a finite number"),
        ({"blades": 2}, "Lens: blades must be 0 for a circle, or 3 to 1000; got 2"),
        ({"blades": -3}, "Lens: blades"),
    ],
)
def test_bad_lenses_are_refused(change, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(Lens(0.1, 1.0), **change)
