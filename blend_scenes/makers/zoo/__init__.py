"""Scenes on which usual methods fail, as small meshes made from seeds: for tests, for a table of losses, for teaching.

Knows neither Blender nor the engine.
"""

from __future__ import annotations

from . import (
    few_triangles,
    flat_boxes,
    instances,
    magnitudes,
    methods,
    refits,
    stale_scenes,
    thin_triangles,
    topology,
    uneven_detail,
)
from .case import Body, FailureCase, State

__all__ = ["CASES", "Body", "FailureCase", "State", "find_case"]

_MODULES = (
    uneven_detail,
    thin_triangles,
    instances,
    refits,
    topology,
    few_triangles,
    flat_boxes,
    magnitudes,
    methods,
    stale_scenes,
)
CASES: tuple[FailureCase, ...] = tuple(case for module in _MODULES for case in module.CASES)


def find_case(name: str) -> FailureCase:
    """The case of a name; raises ValueError for another."""
    for case in CASES:
        if case.name == name:
            return case
    raise ValueError(f"find_case: name must be one of {', '.join(case.name for case in CASES)}, got {name!r}")
