"""How far a scene lets light bounce: what Cycles keeps of it in the file, as both engines show the same scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from perfect_bvh import LightPaths

# Of Cycles' settings and ours.
_NAMES = {
    "max_bounces": "max_bounces",
    "diffuse_bounces": "diffuse_bounces",
    "glossy_bounces": "glossy_bounces",
    "transmission_bounces": "transmission_bounces",
    "transparent_max_bounces": "transparent_bounces",
    "sample_clamp_direct": "clamp_direct",
    "sample_clamp_indirect": "clamp_indirect",
    "blur_glossy": "filter_glossy",
    "caustics_reflective": "reflective_caustics",
    "caustics_refractive": "refractive_caustics",
}
_MOST_BOUNCES = 250


def light_path_settings(scene: bpy.types.Scene) -> bpy.types.bpy_struct | None:
    """What holds them; None where Cycles is disabled."""
    return getattr(scene, "cycles", None)


def read_light_paths(scene: bpy.types.Scene) -> LightPaths:
    """Cycles' settings of `scene`; the engine's own where Cycles is not there."""
    import perfect_bvh

    settings = light_path_settings(scene)
    if settings is None:
        return perfect_bvh.LightPaths()
    values = {ours: getattr(settings, name) for name, ours in _NAMES.items()}
    return perfect_bvh.LightPaths(
        **{name: min(value, _MOST_BOUNCES) if name.endswith("_bounces") else value for name, value in values.items()}
    )
