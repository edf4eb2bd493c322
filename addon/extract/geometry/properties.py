"""Properties of data-blocks by name, as colours: custom ones and Blender's own, as attribute nodes find them."""

from __future__ import annotations

from typing import Any

Color = tuple[float, float, float, float]


def find_shown_property(obj: Any, name: str) -> Color | None:
    """Of an evaluated object, or else of what it shows."""
    found = find_property(obj, name)
    return found if found is not None or obj.data is None else find_property(obj.data, name)


def find_property(block: Any, name: str) -> Color | None:
    """(R, G, B, A); a number is grey. None for what is not there, or is neither a number nor up to four of them."""
    if not name:
        return None
    value = block.get(name)
    if value is None:
        try:
            value = block.path_resolve(name)
        except ValueError:  # no such path
            return None
    return _as_color(value)


def _as_color(value: Any) -> Color | None:
    if isinstance(value, bool | int | float):
        return (float(value),) * 3 + (1.0,)  # type: ignore[return-value]
    if isinstance(value, str) or not hasattr(value, "__len__") or not 0 < len(value) <= 4:
        return None
    channels = list(value)
    if not all(isinstance(channel, float) for channel in channels):
        return None
    red, green, blue, alpha = channels + [0.0, 0.0, 0.0, 1.0][len(channels) :]
    return red, green, blue, alpha
