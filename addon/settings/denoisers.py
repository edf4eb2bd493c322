"""Which denoiser there is on this machine: Blender's own OpenImageDenoise, another one, or the engine's filter."""

from __future__ import annotations

import functools
import sys
from pathlib import Path

import bpy

# Where Blender has its own; the module bpy keeps Windows' libraries beside itself.
_PLACES = {
    "linux": ("lib/libOpenImageDenoise.so.2",),
    "win32": ("blender.shared/OpenImageDenoise.dll", "OpenImageDenoise.dll"),
    "darwin": ("lib/libOpenImageDenoise.dylib",),
}


def denoiser_libraries() -> tuple[Path, ...]:
    """The library that Blender carries, beside its own folder of scripts; empty where a distribution shares it."""
    home = Path(bpy.utils.resource_path("LOCAL")).parent
    return tuple(path for place in _PLACES.get(sys.platform, ()) if (path := home / place).exists())


def denoising_data_settings(view_layer: bpy.types.ViewLayer) -> bpy.types.bpy_struct | None:
    """What holds the switch `denoising_store_passes` of a view layer: Cycles keeps it, None if that is disabled."""
    settings = getattr(view_layer, "cycles", None)
    return settings if hasattr(settings, "denoising_store_passes") else None


@functools.cache
def denoiser_in_use() -> str:
    """Its name, for panels."""
    import perfect_bvh

    return perfect_bvh.denoiser_name(denoiser_libraries())
