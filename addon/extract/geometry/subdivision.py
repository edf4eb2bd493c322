"""Subdivision that Cycles does itself, as finely as the image needs; Blender evaluates a number of levels instead."""

from __future__ import annotations

from typing import Any


class AdaptiveSubdivision:
    """Tells which of the evaluated objects of a depsgraph Cycles would subdivide so."""

    def __init__(self, depsgraph: Any) -> None:
        self._for_viewport = depsgraph.mode == "VIEWPORT"
        # Before Blender 5.0 an object is asked for it, and only where experimental features are.
        self._is_experimental = getattr(getattr(depsgraph.scene, "cycles", None), "feature_set", "") == "EXPERIMENTAL"

    def is_asked_for(self, obj: Any) -> bool:
        """It is the last modifier that counts."""
        if not len(obj.modifiers):
            return False
        modifier = obj.modifiers[-1]
        if modifier.type != "SUBSURF" or not (modifier.show_viewport if self._for_viewport else modifier.show_render):
            return False
        is_asked = getattr(modifier, "use_adaptive_subdivision", None)
        return bool(self._is_experimental and obj.cycles.use_adaptive_subdivision if is_asked is None else is_asked)
