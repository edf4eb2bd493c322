"""What volumes inside closed meshes absorb of light: one colour for all of a mesh. What else they do is not shown."""

from __future__ import annotations

from typing import Any

from .node_graph import Scope, trace_back
from .node_values import ValueReader
from .values import Value, constant

Absorption = tuple[float, float, float]

NO_ABSORPTION: Absorption = (0.0, 0.0, 0.0)
ALONE = "only its absorption is used"
_DEEPEST = 64


def read_absorption(values: ValueReader, socket: Any, scope: Scope | None, depth: int = 0) -> Absorption:
    """Read the absorption of light by length, of each channel, from a volume socket."""
    output, scope = trace_back(socket, scope, values.omissions.note_foreign)
    node = output.node
    if not output.is_output or depth > _DEEPEST:
        return NO_ABSORPTION
    if node.type == "ADD_SHADER":
        parts = [read_absorption(values, each, scope, depth + 1) for each in node.inputs]
        return _weighted(parts, (1.0, 1.0))
    if node.type == "MIX_SHADER":
        share = min(max(values.even_number(node.inputs[0], 0.5, scope), 0.0), 1.0)
        parts = [read_absorption(values, each, scope, depth + 1) for each in (node.inputs[1], node.inputs[2])]
        return _weighted(parts, (1.0 - share, share))
    read = _READERS.get(node.type)
    if read is None:
        values.omissions.note_node(node, output, "only its surface is used")
        return NO_ABSORPTION
    return read(values, node, scope)


def _weighted(parts: list[Absorption], weights: tuple[float, float]) -> Absorption:
    red, green, blue = (
        sum(weight * part for weight, part in zip(weights, channel, strict=True))
        for channel in zip(*parts, strict=True)
    )
    return red, green, blue


def _even_color(values: ValueReader, socket: Any, scope: Scope | None) -> Absorption:
    """Read a colour, at least 0; the mean of one that varies."""
    color = values.read_or(constant(0.5, 0.5, 0.5), "grey is used", socket, scope)
    if not color.is_even:
        values.omissions.note(f"varying {socket.name} of a volume", "its mean is used")
    red, green, blue = (max(channel, 0.0) for channel in values.overall(Value(color.operand)))
    return red, green, blue


def _density(values: ValueReader, node: Any, scope: Scope | None) -> float:
    return max(values.even_number(node.inputs["Density"], 1.0, scope), 0.0)


def _absorbing(values: ValueReader, node: Any, scope: Scope | None) -> Absorption:
    density = _density(values, node, scope)
    red, green, blue = (density * max(1.0 - part, 0.0) for part in _even_color(values, node.inputs["Color"], scope))
    return red, green, blue


def _principled(values: ValueReader, node: Any, scope: Scope | None) -> Absorption:
    color, absorbed = (_even_color(values, node.inputs[name], scope) for name in ("Color", "Absorption Color"))
    if any(color) or any(node.inputs[name].default_value for name in ("Emission Strength", "Blackbody Intensity")):
        values.omissions.note_node(node, instead=ALONE)
    density = _density(values, node, scope)
    red, green, blue = (
        density * max(1.0 - part, 0.0) * max(1.0 - other**0.5, 0.0) for part, other in zip(color, absorbed, strict=True)
    )
    return red, green, blue


def _coefficients(values: ValueReader, node: Any, scope: Scope | None) -> Absorption:
    if any(any(node.inputs[name].default_value) for name in ("Scatter Coefficients", "Emission Coefficients")):
        values.omissions.note_node(node, instead=ALONE)
    return _even_color(values, node.inputs["Absorption Coefficients"], scope)


_READERS = {
    "VOLUME_ABSORPTION": _absorbing,
    "PRINCIPLED_VOLUME": _principled,
    "VOLUME_COEFFICIENTS": _coefficients,
}
