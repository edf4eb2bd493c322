"""The passes of a render: which ones a view layer asks for, and how images get into them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..settings.denoisers import denoising_data_settings
from .plan import NOISY, VECTOR, Window

if TYPE_CHECKING:
    from .still import Images

MODERN_PASS_NAMES = bpy.app.version >= (5, 0, 0)


@dataclass(frozen=True, slots=True)
class PassSpec:
    """A pass in Blender's words (name, channels, kind, the view layer's switch) and in a frame's images (source)."""

    name: str
    channels: str
    kind: str
    switch: str
    source: str


PASSES = (
    PassSpec("Depth", "Z", "VALUE", "use_pass_z", "depth"),
    PassSpec("Normal", "XYZ", "VECTOR", "use_pass_normal", "normal"),
    PassSpec("Vector", "XYZW", "VECTOR", "use_pass_vector", VECTOR),
    PassSpec("Object Index" if MODERN_PASS_NAMES else "IndexOB", "X", "VALUE", "use_pass_object_index", "object_index"),
    PassSpec(
        "Material Index" if MODERN_PASS_NAMES else "IndexMA", "X", "VALUE", "use_pass_material_index", "material_index"
    ),
)


# What compositors denoise by themselves, under the names that Cycles gives it.
DENOISING_PASSES = (
    PassSpec("Noisy Image", "RGBA", "COLOR", "denoising_store_passes", NOISY),
    PassSpec("Denoising Normal", "XYZ", "VECTOR", "denoising_store_passes", "denoising_normal"),
    PassSpec("Denoising Albedo", "RGB", "COLOR", "denoising_store_passes", "denoising_albedo"),
)


def enabled_passes(view_layer: bpy.types.ViewLayer, with_vector: bool) -> tuple[PassSpec, ...]:
    """The passes beside Combined that the view layer asks for.

    with_vector: False where there is motion blur: what is blurred shall not be blurred again, so that Blender's own
    engines have one of both, too.
    """
    switches = denoising_data_settings(view_layer)
    denoising = () if switches is None else (spec for spec in DENOISING_PASSES if getattr(switches, spec.switch))
    wanted = (spec for spec in PASSES if getattr(view_layer, spec.switch) and (with_vector or spec.source != VECTOR))
    return (*wanted, *denoising)


def write_passes(
    layer: bpy.types.RenderLayer,
    specs: tuple[PassSpec, ...],
    images: Images,
    window: Window,
) -> None:
    """Copies what is traced of each image into its pass of a render result, whose rows begin at the bottom.

    specs: of what the layer has beside Combined. images: (H, W) or (H, W, channels), row 0 on top, by the renderer's
    names.
    window: (left, right, bottom, top) in pixels, from the lower left.
    """
    left, right, bottom, top = window
    sources = {"Combined": "combined"} | {spec.name: spec.source for spec in specs}
    for render_pass in layer.passes:
        source = sources.get(render_pass.name)
        if source is not None:
            image = images[source]
            part = image[::-1][bottom:top, left:right]
            render_pass.rect.foreach_set(np.ascontiguousarray(part, np.float32).ravel())
