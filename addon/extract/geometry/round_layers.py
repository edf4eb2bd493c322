"""UV maps and colours of hair curves and points: one row a curve, or one a point, as the attribute has them.

As Cycles finds them: the uv map that has no name is the first attribute of curves with two numbers, which is where on
the surface they are rooted; a name stands for whatever attribute has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import Float32Array, Int32Array, LayerRequest
from .layers import CHANNELS


@dataclass(frozen=True, slots=True)
class Kept:
    """Which points and curves are shown; None: all."""

    points: npt.NDArray[np.bool_] | None
    curves: Int32Array | None


def read_uv_maps(data: Any, request: LayerRequest, kept: Kept) -> dict[str, Float32Array]:
    """(R, 2) float32 by name, of those that there are."""
    found: dict[str, Float32Array] = {}
    for name in request.uvs:
        values = _read(data.attributes.get(name) if name else _first_of_curves(data), kept, 2)
        if values is not None:
            found[name] = values
    return found


def read_colors(data: Any, request: LayerRequest, kept: Kept) -> dict[str, Float32Array]:
    """(R, 3) float32, scene-linear, by name, of those that there are; none is active for renders."""
    found: dict[str, Float32Array] = {}
    for name in request.colors - {""}:
        values = _read(data.attributes.get(name), kept, 3)
        if values is not None:
            found[name] = values
    return found


def _first_of_curves(data: Any) -> Any:
    fitting = (one for one in data.attributes if one.data_type == "FLOAT2" and one.domain == "CURVE")
    return next(fitting, None)


def _read(attribute: Any, kept: Kept, width: int) -> Float32Array | None:
    """(R, width) float32: a number is the same in all channels, a place has no third one."""
    if attribute is None or attribute.data_type not in CHANNELS or attribute.domain not in {"POINT", "CURVE"}:
        return None
    name, channel_count = CHANNELS[attribute.data_type]
    values = np.empty((len(attribute.data), channel_count), np.float32)
    attribute.data.foreach_get(name, values.reshape(-1))
    rows = kept.points if attribute.domain == "POINT" else kept.curves
    if rows is not None:
        values = values[rows]
    np.nan_to_num(values, copy=False, nan=0.0, posinf=65504.0, neginf=0.0)
    made = np.zeros((len(values), width), np.float32)
    made[:, : max(channel_count, width if channel_count == 1 else 0)] = values[:, :width]
    return made
