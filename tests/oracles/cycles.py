"""Cycles as the oracle for images: its depth, normal and index passes of the scene that Blender holds.

One sample through a filter of the least width that Cycles accepts (0.01 of a pixel): every value belongs
to one ray within 0.005 pixels of the pixel's centre. The passes come back through a multilayer OpenEXR file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt

from . import recorded
from .exr import Planes, read_exr
from .scene_digest import scene_digest

FILTER_WIDTH = 0.01
Image = npt.NDArray[np.float32]
MODERN_NAMES = bpy.app.version >= (5, 0, 0)
OBJECT_INDEX = "Object Index" if MODERN_NAMES else "IndexOB"
MATERIAL_INDEX = "Material Index" if MODERN_NAMES else "IndexMA"
FLAT = ("Depth.Z", f"{OBJECT_INDEX}.X", f"{MATERIAL_INDEX}.X")  # in the order of the fields of `Surfaces`


@dataclass(frozen=True, slots=True)
class Surfaces:
    """The passes of each pixel: float32, row 0 on top.

    depth: (H, W), Z along the view axis, 1e10 on the background. normal: (H, W, 3), world space, turned to the
    viewer, zero on the background. object_index, material_index: (H, W).
    """

    depth: npt.NDArray[np.float32]
    object_index: npt.NDArray[np.float32]
    material_index: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Passes(Surfaces):
    """The passes of each pixel, and combined: (H, W, 4)."""

    combined: npt.NDArray[np.float32]


@contextmanager
def preserved(*settings: tuple[object, str, object]) -> Iterator[None]:
    """Set each (owner, property, value) for a while; the old values come back in reverse order."""
    before = []
    try:
        for owner, name, value in settings:
            before.append((owner, name, getattr(owner, name)))
            setattr(owner, name, value)
        yield
    finally:
        for owner, name, value in reversed(before):
            setattr(owner, name, value)


@contextmanager
def _as_multilayer(path: Path, scene: bpy.types.Scene, engine: str, is_denoised: bool) -> Iterator[None]:
    """Set the scene to render with `engine`, with every pass, into an uncompressed 32-bit multilayer EXR file."""
    view_layer = scene.view_layers[0]
    image = scene.render.image_settings
    settings = [
        (scene.render, "engine", engine),
        (scene.render, "filepath", str(path)),
        (scene.render, "use_file_extension", False),
        (scene.render, "use_compositing", False),
        (scene.render, "use_sequencer", False),
        *((view_layer, f"use_pass_{name}", True) for name in ("z", "normal", "object_index", "material_index")),
    ]
    if engine == "PERFECT_BVH":
        settings.append((scene.perfect_bvh, "use_denoising", is_denoised))
    if hasattr(image, "media_type"):
        settings.append((image, "media_type", "MULTI_LAYER_IMAGE"))
    settings += [(image, "file_format", "OPEN_EXR_MULTILAYER"), (image, "color_depth", "32")]
    settings += [(image, "exr_codec", "NONE")]
    if hasattr(image, "use_exr_interleave"):
        settings.append((image, "use_exr_interleave", True))  # several parts fail where pixels are not square
    with preserved(*settings):
        yield


def write_multilayer(path: Path, scene: bpy.types.Scene, engine: str, is_denoised: bool = False) -> None:
    """Render with `engine`, every pass on, into an uncompressed 32-bit multilayer OpenEXR file.

    is_denoised: of our own engine's images; Cycles does as the scene says.
    """
    with _as_multilayer(path, scene, engine, is_denoised):
        bpy.ops.render.render(write_still=True, scene=scene.name)


def render_planes(scene: bpy.types.Scene, engine: str, names: Sequence[str], is_half: bool = False) -> Planes:
    """The first view layer's planes `names` ("Depth.Z"), (H, W) each; those of Cycles may come from a recording.

    is_half: the recording may be in half precision, as the samples' noise is larger than its steps.
    """
    prefix = f"{scene.view_layers[0].name}."
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "planes.exr"

        def render() -> Planes:
            bpy.ops.render.render(write_still=True, scene=scene.name)
            return {key.removeprefix(prefix): plane for key, plane in read_exr(path).items()}

        with _as_multilayer(path, scene, engine, is_denoised=False):
            if engine == "CYCLES" and recorded.active is not None:
                return recorded.active.planes(scene_digest(scene), names, is_half, render)
            return render()


def render_image(scene: bpy.types.Scene, engine: str, name: str, channels: str, is_half: bool = False) -> Image:
    """(H, W, C): the planes of one pass as an image."""
    names = [f"{name}.{channel}" for channel in channels]
    planes = render_planes(scene, engine, names, is_half)
    return np.stack([planes[name] for name in names], axis=-1)


def render_noisy(scene: bpy.types.Scene, engine: str) -> Image:
    """(H, W, 4): the image of samples by chance, that of Cycles in half precision at least."""
    return render_image(scene, engine, "Combined", "RGBA", is_half=True)


def render_beside(scene: bpy.types.Scene, samples: int) -> tuple[Image, Image]:
    """(H, W, 4), ours and that of Cycles, which casts every sample and has no denoiser; light bounces alike in both."""
    cycles = scene.cycles
    with preserved(
        (cycles, "samples", samples),
        (cycles, "use_denoising", False),
        (cycles, "use_adaptive_sampling", False),
        (scene.perfect_bvh, "samples", samples),
        (scene.perfect_bvh, "use_noise_threshold", False),
    ):
        theirs = render_noisy(scene, "CYCLES")
        return render_noisy(scene, "PERFECT_BVH"), theirs


def render_cycles_uvs(scene: bpy.types.Scene) -> npt.NDArray[np.float32]:
    """(H, W, 3): Cycles' pass UV through the pixels' centres; (u, v, 1), zero where there is no map or no surface."""
    view_layer, cycles = scene.view_layers[0], scene.cycles
    with preserved(
        (view_layer, "use_pass_uv", True),
        (cycles, "samples", 1),
        (cycles, "use_adaptive_sampling", False),
        (cycles, "use_denoising", False),
        (cycles, "filter_width", FILTER_WIDTH),
        (cycles, "max_bounces", 0),
    ):
        return render_image(scene, "CYCLES", "UV", "UVA")


def render_passes(scene: bpy.types.Scene, engine: str = "CYCLES") -> Passes:
    """The passes of `scene` as Blender's pipeline delivers them from `engine`."""
    image, normal = [f"Combined.{channel}" for channel in "RGBA"], [f"Normal.{channel}" for channel in "XYZ"]
    planes = render_planes(scene, engine, [*image, *FLAT, *normal])
    combined, normals = (np.stack([planes[name] for name in names], axis=-1) for names in (image, normal))
    return Passes(*(planes[name] for name in FLAT), normals, combined)


def render_cycles(scene: bpy.types.Scene, samples: int = 1) -> Surfaces:
    """Cycles' own passes: `samples` rays a pixel through its centre, no bounces, no denoising, no lens blur.

    The normals come from a second render in which everything is diffuse: glossy closures bend the normal that
    Cycles writes, so that no mirror image lies below the surface, by up to 30 degrees on a smooth edge.
    """
    cycles = scene.cycles
    camera = scene.camera.data
    view_layer = scene.view_layers[0]
    diffuse = _make_diffuse_material()
    try:
        with preserved(
            (cycles, "device", "CPU"),
            (cycles, "samples", samples),
            (cycles, "use_adaptive_sampling", False),
            (cycles, "use_denoising", False),
            (cycles, "pixel_filter_type", "BLACKMAN_HARRIS"),
            (cycles, "filter_width", FILTER_WIDTH),
            (cycles, "max_bounces", 0),
            (camera.dof, "use_dof", False),
            (scene.render, "use_motion_blur", False),
        ):
            planes = render_planes(scene, "CYCLES", FLAT)
            with preserved((view_layer, "material_override", diffuse)):
                normal = render_image(scene, "CYCLES", "Normal", "XYZ")
    finally:
        bpy.data.materials.remove(diffuse)
    return Surfaces(*(planes[name] for name in FLAT), normal)


def _make_diffuse_material() -> bpy.types.Material:
    material = bpy.data.materials.new("Matt")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    return material


def index_edges(*indices: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """(H, W) True within one pixel of where any of the (H, W) index images changes: 3 x 3 neighbourhoods."""
    edges = np.zeros(indices[0].shape, bool)
    for image in indices:
        low = high = np.pad(image, 1, mode="edge")
        low = np.minimum(np.minimum(low[:-2], low[1:-1]), low[2:])
        low = np.minimum(np.minimum(low[:, :-2], low[:, 1:-1]), low[:, 2:])
        high = np.maximum(np.maximum(high[:-2], high[1:-1]), high[2:])
        high = np.maximum(np.maximum(high[:, :-2], high[:, 1:-1]), high[:, 2:])
        edges |= low != high
    return edges
