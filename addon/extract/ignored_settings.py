"""Settings of a scene and its view layer that change Cycles' image, and that this engine ignores."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..sync.not_shown import NotShown
from ..sync.records import AttributeRequest
from .geometry.hair_shape import MOST_SUBDIVISIONS

# The passes of a view layer that are written; "sample_count" and the like are no pictures of the scene.
_WRITTEN_PASSES = frozenset(
    (
        "use_pass_combined",
        "use_pass_z",
        "use_pass_normal",
        "use_pass_vector",
        "use_pass_object_index",
        "use_pass_material_index",
    )
)
_NO_PASSES = frozenset(("use_pass_cryptomatte_accurate", "use_pass_cryptomatte_asset"))


def find_ignored_settings(
    depsgraph: Any, attributes: AttributeRequest, for_viewport: bool, in_time: bool
) -> list[NotShown]:
    """Return a row for each setting that differs from the shown value. for_viewport: no passes are written there.

    in_time: motion within the shutter is read as well.
    """
    found = [_pieces_of_hair(depsgraph.scene)]
    if attributes.shading:
        found += [*_of_layer(depsgraph.view_layer), *_of_cycles(depsgraph.scene)]
    if not for_viewport:  # as with Blender's own engines, nothing is blurred there
        found += [None if in_time else _motion_blur(depsgraph), _passes(depsgraph.view_layer)]
    return [NotShown("setting", name, 0, text) for name, text in filter(None, found)]


def _motion_blur(depsgraph: Any) -> tuple[str, str] | None:
    is_on = depsgraph.scene.render.use_motion_blur and getattr(depsgraph.view_layer, "use_motion_blur", True)
    return ("Motion Blur", "it is unsupported here; a single moment is used") if is_on else None


def _pieces_of_hair(scene: Any) -> tuple[str, str] | None:
    curves = getattr(scene, "cycles_curves", None)
    if curves is None or curves.shape != "RIBBONS" or curves.subdivisions <= MOST_SUBDIVISIONS:
        return None
    return "Curves", f"{curves.subdivisions} subdivisions of ribbons exceed the limit; {MOST_SUBDIVISIONS} are used"


def _of_layer(layer: Any) -> Iterator[tuple[str, str]]:
    for switch, name in (("use_sky", "Environment"), ("use_solid", "Surfaces")):
        if not getattr(layer, switch):
            yield f"View Layer {layer.name}", f"the filter {name} is ignored, as if it was on"
    if getattr(layer, "world_override", None) is not None:
        yield f"View Layer {layer.name}", "the World Override is unsupported; the scene's own world is used"


def _of_cycles(scene: Any) -> Iterator[tuple[str, str]]:
    settings = getattr(scene, "cycles", None)
    if settings is None:  # the add-on is disabled
        return
    exposure = getattr(settings, "film_exposure", 1.0)
    if exposure != 1.0:
        yield "Film", f"the exposure {exposure:.3g} is ignored; 1 is used"
    if scene.render.film_transparent and getattr(settings, "film_transparent_glass", False):
        yield "Film", "Transparent Glass is unsupported; glass in front of the background is opaque"
    if getattr(settings, "use_fast_gi", False):
        yield "Fast GI Approximation", "it is unsupported; traced light is used"
    culls = any(getattr(settings, name, False) for name in ("use_camera_cull", "use_distance_cull"))
    if scene.render.use_simplify and culls:
        yield "Simplify", "culling is ignored; every object is visible"
    if scene.render.use_freestyle:
        yield "Freestyle", "it is unsupported; no lines are drawn"


def _passes(layer: Any) -> tuple[str, str] | None:
    switches = [name for name in dir(layer) if name.startswith("use_pass_") and getattr(layer, name) is True]
    names = [
        layer.bl_rna.properties[name].name
        for name in switches
        if name not in _WRITTEN_PASSES and name not in _NO_PASSES
    ]
    names += [f"AOV {aov.name}" for aov in layer.aovs] + [f"Light Group {group.name}" for group in layer.lightgroups]
    return (f"View Layer {layer.name}", f"passes are not written: {', '.join(names)}") if names else None
