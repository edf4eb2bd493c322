"""How far paths of light are followed in the mode "preview": a scene's *Light Paths*, by Blender's names."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ._arrays import check_count
from ._render_arguments import check_number

_MOST_BOUNCES = 250
_LARGEST_CLAMP = 1e30


@dataclass(frozen=True, slots=True)
class LightPaths:
    """Limits of paths; the defaults are for a preview, Blender's own allow more bounces.

    max_bounces: how often light may bounce in all, 0 to 250; 0 is light that comes straight from its source.
    diffuse_bounces, glossy_bounces, transmission_bounces: how often of that kind, 0 to 250. Translucent surfaces count
        as transmission.
    transparent_bounces: how many transparent surfaces are passed, one behind another, besides; 0 to 250.
    clamp_direct, clamp_indirect: what a path that bounced not at all, or ever, brings at most, as the mean of its
        channels; 0 for no limit.
    filter_glossy: by how much surfaces look rougher in light that has bounced off a rough one, 0 for not at all.
    reflective_caustics, refractive_caustics: whether mirrors and glass throw light on diffuse surfaces.
    """

    max_bounces: int = 4
    diffuse_bounces: int = 4
    glossy_bounces: int = 4
    transmission_bounces: int = 4
    transparent_bounces: int = 8
    clamp_direct: float = 0.0
    clamp_indirect: float = 10.0
    filter_glossy: float = 1.0
    reflective_caustics: bool = True
    refractive_caustics: bool = True


def light_path_arguments(function: str, paths: object) -> dict[str, Any]:
    """The fields as the native module takes them, checked."""
    if not isinstance(paths, LightPaths):
        raise ValueError(f"{function}: light_paths must be a perfect_bvh.LightPaths, got {type(paths).__name__}")
    arguments = asdict(paths)
    for name, value in arguments.items():
        place = f"light_paths.{name}"
        if name.endswith("_bounces"):
            arguments[name] = check_count(function, place, value, 0, _MOST_BOUNCES)
        elif name.endswith("_caustics"):
            arguments[name] = bool(value)
        else:
            arguments[name] = check_number(function, place, value, 0.0, _LARGEST_CLAMP)
    return arguments
