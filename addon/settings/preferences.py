"""The add-on's preferences, and whether its native engine could be loaded, in the version that it needs.

Blender must survive a native module that cannot be loaded (see `native_fault`), or another version's (left in use by
an update, or installed elsewhere): the add-on then still registers, and says the reason here, in the render panel, and
in the error of a render.
"""

from __future__ import annotations

import functools
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import bpy

from .native_fault import explain, read_manifest

ADDON = __package__.rpartition(".")[0]  # as Blender knows it
DEFAULT_CACHE_SIZE = 8192  # megabytes
_INSTRUCTIONS = {"avx2": "AVX2", "avx512": "AVX-512", "neon": "NEON"}
_SLOW = "This processor has no AVX2: rays take several times as long. Results are the same"
_LINE = 90  # characters of a label, which does not wrap


@functools.cache
def native_error() -> str | None:
    """Why the native engine cannot be used, in a sentence or two; None if it can."""
    try:
        import perfect_bvh
    except (ImportError, AttributeError, OSError, RuntimeError) as error:
        # The second from parts of two versions, the last from numpy on a processor that is too old for it.
        return explain(error, read_manifest())
    # The add-on's own, which is the engine's: both are built from the manifest.
    found, needed = getattr(perfect_bvh, "__version__", "unknown"), str(read_manifest()["version"])
    if found == needed:
        return None
    return (
        f"The native engine found is version {found}, but this add-on needs {needed}: restart Blender; if that does "
        f"not help, install the add-on again, and remove the engine in {Path(perfect_bvh.__file__ or '').parent}"
    )


def native_summary() -> str:
    """The engine's version, how many threads it uses and which instructions, in one line."""
    import perfect_bvh

    instructions = _INSTRUCTIONS.get(perfect_bvh.available_isas()[-1])
    kind = f", {instructions}" if instructions else ""
    return f"Engine {perfect_bvh.__version__}, {perfect_bvh.thread_count()} threads{kind}"


def is_processor_slow() -> bool:
    """Whether this processor, or the system, lacks the instructions of the engine's fast kernels."""
    import perfect_bvh

    return perfect_bvh.available_isas()[-1] == "scalar"


def cache_byte_limit() -> int | None:
    """How much the trees and images of all scenes may take together; None for any amount."""
    addon = bpy.context.preferences.addons.get(ADDON)
    size = 0 if addon is None or addon.preferences is None else addon.preferences.cache_size
    return size << 20 if size else None


def _set_threads(preferences: PERFECT_BVH_AP_preferences, context: bpy.types.Context | None) -> None:
    if native_error() is None:
        import perfect_bvh

        perfect_bvh.set_thread_count(preferences.threads)


class PERFECT_BVH_AP_preferences(bpy.types.AddonPreferences):
    """The engine's state, and what belongs to the machine; everything else belongs to a scene."""

    bl_idname = ADDON

    threads: bpy.props.IntProperty(
        name="Threads",
        description="Number of threads that build BVHs and cast rays; 0 for all cores. Results do not depend on it",
        default=0,
        min=0,
        max=1024,
        update=_set_threads,
    )

    cache_size: bpy.props.IntProperty(
        name="Cache (MB)",
        description=(
            "Memory in megabytes for the BVHs and images of all scenes and view layers; 0 for no limit. Beyond that "
            "the least recently used data is dropped and read again when it is shown"
        ),
        default=DEFAULT_CACHE_SIZE,
        min=0,
        soft_max=1 << 16,
        max=1 << 24,
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        error = native_error()
        if error is not None:
            for number, line in enumerate(textwrap.wrap(error, _LINE)):
                layout.label(text=line, icon="BLANK1" if number else "ERROR")
            return
        layout.label(text=native_summary(), icon="CHECKMARK")
        if is_processor_slow():
            layout.label(text=_SLOW, icon="INFO")
        layout.use_property_split = True
        layout.prop(self, "threads")
        layout.prop(self, "cache_size")


def register() -> None:
    bpy.utils.register_class(PERFECT_BVH_AP_preferences)
    addon = bpy.context.preferences.addons.get(ADDON)
    if addon is not None and addon.preferences is not None and addon.preferences.threads:
        _set_threads(addon.preferences, None)


def unregister() -> None:
    bpy.utils.unregister_class(PERFECT_BVH_AP_preferences)
    native_error.cache_clear()


# Editors -------------------------------------------------------------------------------------------------------------
# Blender's editors, drawn again: it does so by itself only where its own operators or properties change something.


def redraw_viewports(context: bpy.types.Context | None = None) -> None:
    """Redraws all 3D viewports with their panels, in all windows."""
    _redraw("VIEW_3D", context)


def redraw_properties() -> None:
    """Redraws all Properties editors, in all windows."""
    _redraw("PROPERTIES", None)


def redraw_sidebars() -> None:
    """The sidebars of all 3D viewports, and nothing else of them."""
    for area in _areas("VIEW_3D", None):
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def redraw_for_setting(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """The `update` of a setting that viewports show: panels redraw their own editor alone, scripts nothing."""
    redraw_viewports(context)


def _redraw(kind: str, context: bpy.types.Context | None) -> None:
    for area in _areas(kind, context):
        area.tag_redraw()


def _areas(kind: str, context: bpy.types.Context | None) -> Iterator[bpy.types.Area]:
    for window in (context or bpy.context).window_manager.windows:
        for area in window.screen.areas:
            if area.type == kind:
                yield area


# Denoisers -----------------------------------------------------------------------------------------------------------
# Which denoiser there is on this machine: Blender's own OpenImageDenoise, another one, or the engine's filter.


# The folders of Blender's own library; the module bpy keeps Windows' libraries in its own folder.
_PLACES = {
    "linux": ("lib/libOpenImageDenoise.so.2",),
    "win32": ("blender.shared/OpenImageDenoise.dll", "OpenImageDenoise.dll"),
    "darwin": ("lib/libOpenImageDenoise.dylib",),
}


def denoiser_libraries() -> tuple[Path, ...]:
    """Returns the library in Blender's installation, next to its scripts; empty if a distribution shares it."""
    home = Path(bpy.utils.resource_path("LOCAL")).parent
    return tuple(path for place in _PLACES.get(sys.platform, ()) if (path := home / place).exists())


def denoising_data_settings(view_layer: bpy.types.ViewLayer) -> bpy.types.bpy_struct | None:
    """Returns the owner of a view layer's switch `denoising_store_passes`: Cycles' data, None if Cycles is disabled."""
    settings = getattr(view_layer, "cycles", None)
    return settings if hasattr(settings, "denoising_store_passes") else None


@functools.cache
def denoiser_in_use() -> str:
    """Returns the denoiser's name, for panels."""
    import perfect_bvh

    return perfect_bvh.denoiser_name(denoiser_libraries())
