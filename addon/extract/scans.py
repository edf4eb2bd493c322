"""Objects that are the result of a scan, and how they are known."""

from __future__ import annotations

from typing import Any

OBJECT_NAMES = "object_names"  # a custom property of the data
# Cycles finds no attribute that is called "color" on points.
COLOR, RADIUS = "Color", "radius"


def has_points(obj: Any) -> bool:
    """Whether an object is a scan that still has its colours and radii."""
    if obj.type not in {"POINTCLOUD", "MESH"}:
        return False
    data: Any = obj.data
    return (
        OBJECT_NAMES in data
        and {COLOR, RADIUS}.issubset(data.attributes.keys())
        and len(data.attributes[COLOR].data) > 0
    )
