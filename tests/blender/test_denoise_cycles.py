"""Blender's OpenImageDenoise: found, used as Cycles uses it, stopped, and independent of the number of threads."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import perfect_bvh
import pytest

bpy = pytest.importorskip("bpy")

from oracles.cycles import preserved, write_multilayer  # noqa: E402
from oracles.exr import read_exr  # noqa: E402
from perfect_bvh.denoise import Denoiser, denoise, denoiser_name  # noqa: E402

Image = npt.NDArray[np.float32]
SIZE = (120, 80)
FEW_SAMPLES, MANY_SAMPLES = 4, 128


@dataclass(frozen=True, slots=True)
class Rendered:
    """Cycles' images of a scene, (H, W, 3): with and without its denoiser, and the denoiser's guides."""

    denoised: Image
    noisy: Image
    albedo: Image
    normal: Image


def render(scene: bpy.types.Scene, samples: int, prefilter: str = "ACCURATE") -> Rendered:
    layer = scene.view_layers[0]
    cycles = scene.cycles
    with (
        tempfile.TemporaryDirectory() as folder,
        preserved(
            (cycles, "samples", samples),
            (cycles, "use_adaptive_sampling", False),
            (cycles, "use_denoising", True),
            (cycles, "denoising_prefilter", prefilter),
            (cycles, "denoising_quality", "HIGH"),
            (layer.cycles, "denoising_store_passes", True),
        ),
    ):
        path = Path(folder) / "passes.exr"
        write_multilayer(path, scene, "CYCLES")
        planes = read_exr(path)

    def stack(name: str, channels: str) -> Image:
        return np.stack([planes[f"{layer.name}.{name}.{channel}"] for channel in channels], axis=-1)

    return Rendered(
        stack("Combined", "RGB"),
        stack("Noisy Image", "RGB"),
        stack("Denoising Albedo", "RGB"),
        stack("Denoising Normal", "XYZ"),
    )


@pytest.fixture(scope="module")
def room(factory_settings: None) -> bpy.types.Scene:
    """A sphere and a cube on the ground under a lamp and a dim sky."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    bpy.ops.mesh.primitive_plane_add(size=20.0)
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 0.0, 1.0))
    bpy.ops.mesh.primitive_uv_sphere_add(location=(-1.5, 0.0, 1.0))
    for row, item in enumerate(bpy.data.objects):
        material = bpy.data.materials.new(item.name)
        material.use_nodes = True
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = [(0.6, 0.6, 0.5, 1), (0.7, 0.1, 0.1, 1), (0.1, 0.3, 0.7, 1)][row]
        item.data.materials.append(material)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.data.energy, lamp.data.shadow_soft_size, lamp.location = 400.0, 0.5, (-3.0, -3.0, 5.0)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -9.0, 4.0), (1.2, 0.0, 0.0)
    for item in (lamp, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    return scene


@pytest.fixture(scope="module")
def few(room: bpy.types.Scene) -> Rendered:
    return render(room, FEW_SAMPLES)


@pytest.fixture(scope="module")
def truth(room: bpy.types.Scene) -> Image:
    return render(room, MANY_SAMPLES).noisy


def error(image: Image, truth: Image) -> float:
    return float(np.sqrt(np.mean((image - truth) ** 2)))


def test_blender_s_own_library_is_found() -> None:
    assert denoiser_name().startswith("OpenImageDenoise 2.")
    made = Denoiser((5, 4), backend="oidn")
    assert made.name == denoiser_name() and not made.complaints


@pytest.mark.parametrize("prefilter", ["ACCURATE", "FAST", "NONE"])
def test_it_denoises_as_cycles_does(room: bpy.types.Scene, prefilter: str) -> None:
    """Rows go from the lowest upwards, as in Cycles' images: the network does not treat all directions alike."""
    theirs = render(room, FEW_SAMPLES, prefilter)
    given = (np.flipud(image) for image in (theirs.noisy, theirs.albedo, theirs.normal))
    ours = np.flipud(denoise(*given, prefilter=prefilter.lower(), quality="high", backend="oidn"))
    assert error(theirs.noisy, theirs.denoised) > 4e-3
    np.testing.assert_allclose(ours, theirs.denoised, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("backend", "share"), [("oidn", 0.5), ("joint", 0.75)])
def test_the_error_falls(few: Rendered, truth: Image, backend: str, share: float) -> None:
    smooth = denoise(few.noisy, few.albedo, few.normal, backend=backend)
    assert error(smooth, truth) < share * error(few.noisy, truth)


def test_threads_change_no_bit(few: Rendered) -> None:
    first, second = (denoise(few.noisy, few.albedo, few.normal, threads=threads, backend="oidn") for threads in (1, 3))
    np.testing.assert_array_equal(first, second)


def test_images_one_after_the_other_are_as_if_alone(few: Rendered) -> None:
    kept = Denoiser(SIZE, backend="oidn")
    guided, alone = denoise(few.noisy, few.albedo, few.normal), denoise(few.noisy)
    for _ in range(2):
        np.testing.assert_array_equal(kept.denoise(few.noisy, few.albedo, few.normal), guided)
        np.testing.assert_array_equal(kept.denoise(few.noisy), alone)
    assert error(kept.denoise(few.noisy, normal=few.normal), alone) > 0.0


def test_alpha_is_handed_on(few: Rendered, rng: np.random.Generator) -> None:
    alpha = rng.random((*few.noisy.shape[:2], 1), np.float32)
    result = denoise(np.concatenate([few.noisy, alpha], axis=-1), few.albedo, few.normal, backend="oidn")
    np.testing.assert_array_equal(result[..., 3:], alpha)
    np.testing.assert_array_equal(result[..., :3], denoise(few.noisy, few.albedo, few.normal, backend="oidn"))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_what_is_no_number_stays_where_it_is(few: Rendered, wrong: float) -> None:
    spoilt = few.noisy.copy()
    spoilt[40, 60] = wrong
    whole, result = (denoise(image, few.albedo, few.normal, backend="oidn") for image in (few.noisy, spoilt))
    assert np.isfinite(result).all()
    assert np.abs(result - whole).max() < 0.2 * whole.max()


@pytest.mark.parametrize("size", [(1, 1), (1, 3), (15, 70)])
def test_the_network_gets_no_images_without_surroundings(size: tuple[int, int]) -> None:
    """The network would make a grey pixel black."""
    color = np.full((size[1], size[0], 3), 0.25, np.float32)
    made = Denoiser(size, backend="auto")
    np.testing.assert_allclose(made.denoise(color, color, np.zeros_like(color)), color, rtol=1e-5)
    assert made.name == "Joint Filter" and not made.complaints


def test_it_stops_when_asked_to(rng: np.random.Generator) -> None:
    color = rng.random((1080, 1920, 3), np.float32)
    made = Denoiser((1920, 1080), backend="oidn", quality="high")
    with pytest.raises(perfect_bvh.Cancelled):
        made.denoise(color, progress=lambda done: False)
    shares: list[float] = []
    small = Denoiser((640, 360), backend="oidn")
    small.denoise(color[:360, :640], color[:360, :640], color[:360, :640], lambda done: shares.append(done))
    assert shares == sorted(shares) and shares[0] >= 0.0 and shares[-1] <= 1.0
