"""What nodes make of colours, vectors and numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from perfect_bvh.nodes import Operand, channels_of

from .node_graph import Scope
from .node_values import HALF, ValueReader, own_value, reads
from .values import COLDEST, HOTTEST, Nodes, Value, blackbody, constant, observer, xyz_to_rgb

_TABLE = 256  # rows of what Cycles keeps of a ramp or a curve
_SPECTRUM = (375.0, 780.0)  # nanometres
_BRIGHTEST_WAVE = 2.52  # Cycles' scale, by which all channels are about 1 at most
# Arithmetic that is left out where it changes nothing.
_ARITHMETIC: dict[str, Callable[..., Operand]] = {
    "ADD": lambda nodes, a, b, _: nodes.plus(a, b),
    "SUBTRACT": lambda nodes, a, b, _: nodes.minus(a, b),
    "MULTIPLY": lambda nodes, a, b, _: nodes.times(a, b),
    "DIVIDE": lambda nodes, a, b, _: nodes.over(a, b),
}
_NUMBER_RANGE = ("Value", "From Min", "From Max", "To Min", "To Max", "Steps")
_VECTOR_RANGE = ("Vector", "From_Min_FLOAT3", "From_Max_FLOAT3", "To_Min_FLOAT3", "To_Max_FLOAT3", "Steps_FLOAT3")


def _extreme(nodes: Nodes, one: Operand, other: Operand, mode: str, is_vector: bool) -> Operand:
    if is_vector:
        return nodes.add("vector_math", one, other, 0.0, 0.0, mode=mode)
    return nodes.add("math", one, other, 0.0, mode=mode)


@reads("HUE_SAT")
def _hue_saturation(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("Hue", "Saturation", "Value", "Fac", "Color")
    return reader.work("hue_saturation", *reader.inputs(node, names, scope))


@reads("RGBTOBW")
def _luminance(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    return reader.work("luminance", *reader.inputs(node, ("Color",), scope))


@reads("RGB", "VALUE")
def _own(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    return own_value(output)


@reads("MIX", "MIX_RGB")
def _mix(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    kind = "RGBA" if node.type == "MIX_RGB" else node.data_type.replace("FLOAT", "VALUE")
    enabled = [socket for socket in node.inputs if socket.enabled]
    inputs = [socket for socket in enabled if socket.type == kind][-2:]
    if len(inputs) < 2 or kind not in {"RGBA", "VALUE", "VECTOR"}:
        return reader.fallback
    factor = reader.read_or(constant(0.5), HALF, enabled[0], scope).operand
    if node.type == "MIX_RGB" or node.clamp_factor:
        factor = reader.nodes.clamp(factor)
    first, second = (reader.read(socket, scope) for socket in inputs)
    blend = node.blend_type if kind == "RGBA" else "MIX"
    mixed = reader.nodes.mix(factor, first.operand, second.operand, blend)
    if kind == "RGBA" and (getattr(node, "use_clamp", False) or getattr(node, "clamp_result", False)):
        mixed = reader.nodes.clamp(mixed)
    return Value(mixed, first.is_guess and second.is_guess)


@reads("VALTORGB")
def _ramp(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    ramp = node.color_ramp
    table = np.array([ramp.evaluate(step / (_TABLE - 1)) for step in range(_TABLE)], np.float32)
    is_alpha = output.identifier == "Alpha"
    factor = reader.read(node.inputs[0], scope)
    if factor.is_guess:
        mean = table.mean(axis=0).tolist()
        return constant(mean[3]) if is_alpha else constant(*mean)
    mode = "CONSTANT" if ramp.interpolation == "CONSTANT" and ramp.color_mode == "RGB" else "LINEAR"
    found = reader.nodes.add("table", factor.operand, mode=mode, numbers=table.ravel().tolist())
    return Value(channels_of(found, 3) if is_alpha else channels_of(found, 0, 3))


@reads("CURVE_RGB", "CURVE_VEC", "CURVE_FLOAT")
def _curves(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    mapping = node.mapping
    mapping.initialize()
    curves = list(mapping.curves)
    low = min(point.location[0] for curve in curves for point in curve.points)
    high = max(point.location[0] for curve in curves for point in curve.points)
    steps = np.linspace(min(low, 0.0), max(high, 1.0), _TABLE)
    if node.type == "CURVE_RGB":
        through = [mapping.evaluate(curves[3], step) for step in steps]
        rows = [[mapping.evaluate(curves[channel], step) for channel in range(3)] for step in through]
    else:
        rows = [[mapping.evaluate(curves[c % len(curves)], step) for c in range(3)] for step in steps]
    name = "Value" if node.type == "CURVE_FLOAT" else "Vector" if node.type == "CURVE_VEC" else "Color"
    factor, value = reader.inputs(node, ("Fac", name), scope)
    numbers = [float(steps[0]), float(steps[-1]), *np.array(rows, np.float32).ravel().tolist()]
    bent = reader.work("curves", factor, value, mode=mapping.extend, numbers=numbers)
    return Value(channels_of(bent.operand, 0), bent.is_guess) if node.type == "CURVE_FLOAT" else bent


@reads("MATH")
def _math(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    values = [reader.read(socket, scope) for socket in node.inputs if socket.enabled][:3]
    if any(value.is_guess for value in values):
        return reader.fallback
    operands = [value.operand for value in values] + [0.0] * (3 - len(values))
    if node.operation in _ARITHMETIC:
        made = _ARITHMETIC[node.operation](reader.nodes, *operands)
    else:
        made = reader.nodes.add("math", *operands, mode=node.operation)
    return Value(reader.nodes.clamp(made) if node.use_clamp else made)


@reads("VECT_MATH")
def _vector_math(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    sockets = {socket.identifier: socket for socket in node.inputs if socket.enabled}
    names = ("Vector", "Vector_001", "Vector_002", "Scale")
    values = [reader.read(sockets[name], scope) if name in sockets else constant(0.0) for name in names]
    if any(value.is_guess for value in values):
        return reader.fallback
    made = reader.work("vector_math", *values, mode=node.operation)
    return Value(channels_of(made.operand, 0)) if output.identifier == "Value" else made


@reads("SEPARATE_COLOR", "SEPRGB", "SEPHSV", "SEPXYZ")
def _separate(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    color = reader.read(node.inputs[0], scope)
    mode = "HSV" if node.type == "SEPHSV" else getattr(node, "mode", "RGB")
    operand = color.operand if mode == "RGB" else reader.nodes.add("convert", color.operand, mode=f"RGB_TO_{mode}")
    return Value(channels_of(operand, list(node.outputs).index(output)), color.is_guess)


@reads("COMBINE_COLOR", "COMBRGB", "COMBHSV", "COMBXYZ")
def _combine_channels(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    values = [reader.read(socket, scope) for socket in list(node.inputs)[:3]]
    mode = "HSV" if node.type == "COMBHSV" else getattr(node, "mode", "RGB")
    made = reader.work("combine", *values)
    return made if mode == "RGB" else reader.work("convert", made, mode=f"{mode}_TO_RGB")


@reads("MAP_RANGE")
def _map_range(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    is_vector = node.data_type == "FLOAT_VECTOR"
    names = _VECTOR_RANGE if is_vector else _NUMBER_RANGE
    values = reader.inputs(node, names, scope)
    if values[0].is_guess:
        return reader.fallback
    mode = f"VECTOR_{node.interpolation_type}" if is_vector else node.interpolation_type
    made = reader.work("map_range", *values, mode=mode).operand
    made = made if is_vector else channels_of(made, 0)
    if node.clamp and node.interpolation_type in {"LINEAR", "STEPPED"}:
        low, high = values[3].operand, values[4].operand
        least, most = (_extreme(reader.nodes, low, high, mode, is_vector) for mode in ("MINIMUM", "MAXIMUM"))
        above = _extreme(reader.nodes, made, least, "MAXIMUM", is_vector)
        made = _extreme(reader.nodes, above, most, "MINIMUM", is_vector)
    return Value(made)


@reads("CLAMP")
def _clamp(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    value, low, high = reader.inputs(node, ("Value", "Min", "Max"), scope)
    least, most = low.operand, high.operand
    if node.clamp_type == "RANGE":
        least, most = (
            _extreme(reader.nodes, low.operand, high.operand, mode, False) for mode in ("MINIMUM", "MAXIMUM")
        )
    return Value(reader.nodes.add("math", value.operand, least, most, mode="CLAMP"), value.is_guess)


@reads("VECTOR_ROTATE")
def _vector_rotate(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    sockets = [node.inputs.get(name) for name in ("Vector", "Center", "Axis", "Angle", "Rotation")]
    values = [
        constant(0.0) if socket is None or not socket.enabled else reader.read(socket, scope) for socket in sockets
    ]
    if values[0].is_guess:
        return reader.fallback
    return reader.work("vector_rotate", *values, mode=node.rotation_type, numbers=(float(node.invert),))


@reads("INVERT")
def _invert(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    factor, color = reader.inputs(node, ("Fac", "Color"), scope)
    turned = reader.nodes.minus((1.0, 1.0, 1.0), color.operand)
    return Value(reader.nodes.mix(factor.operand, color.operand, turned), color.is_guess)


@reads("BRIGHTCONTRAST")
def _bright_contrast(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    color, bright, contrast = reader.inputs(node, ("Color", "Bright", "Contrast"), scope)
    nodes = reader.nodes
    scaled = nodes.times(color.operand, nodes.plus(contrast.operand, 1.0))
    shifted = nodes.plus(scaled, nodes.minus(bright.operand, nodes.times(contrast.operand, 0.5)))
    return Value(nodes.add("vector_math", shifted, 0.0, 0.0, 0.0, mode="MAXIMUM"), color.is_guess)


@reads("GAMMA")
def _gamma(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Apply a gamma; negative channels are not changed."""
    color, power = reader.inputs(node, ("Color", "Gamma"), scope)
    nodes = reader.nodes
    above, below = (
        nodes.add("vector_math", color.operand, 0.0, 0.0, 0.0, mode=mode) for mode in ("MAXIMUM", "MINIMUM")
    )
    raised = nodes.add("vector_math", above, power.operand, 0.0, 0.0, mode="POWER")
    return Value(nodes.plus(raised, below), color.is_guess)


@reads("NORMAL")
def _normal(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    nodes, given = reader.nodes, node.outputs["Normal"].default_value
    direction = nodes.add("vector_math", tuple(given), 0.0, 0.0, 0.0, mode="NORMALIZE")
    if output.identifier == "Normal":
        return Value(direction)
    normal = reader.read(node.inputs[0], scope)
    unit = nodes.add("vector_math", normal.operand, 0.0, 0.0, 0.0, mode="NORMALIZE")
    dot = nodes.add("vector_math", direction, unit, 0.0, 0.0, mode="DOT_PRODUCT")
    return Value(channels_of(dot, 0), normal.is_guess)


@reads("WAVELENGTH")
def _wavelength(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    nodes, waves = reader.nodes, reader.read(node.inputs[0], scope)
    least, most = _SPECTRUM
    seen_waves = np.vstack([2.0 * observer()[:1] - observer()[1:2], observer()])  # Cycles goes on for a step below
    table = np.ones((len(seen_waves), 4))
    table[:, :3] = xyz_to_rgb(seen_waves) / _BRIGHTEST_WAVE
    place = nodes.times(nodes.minus(waves.operand, least), 1.0 / (most - least))
    color = nodes.add("table", place, mode="LINEAR", numbers=table.ravel().tolist())
    is_seen = nodes.add("math", waves.operand, 0.5 * (least + most), 0.5 * (most - least), mode="COMPARE")
    seen = nodes.times(channels_of(color, 0, 3), is_seen)
    return Value(nodes.add("vector_math", seen, 0.0, 0.0, 0.0, mode="MAXIMUM"), waves.is_guess)


@reads("BLACKBODY")
def _blackbody(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    kelvin = reader.number(node.inputs[0], 6500.0, scope)
    if isinstance(kelvin, float):
        return constant(*np.maximum(blackbody(kelvin), 0.0).tolist())
    nodes, table = reader.nodes, np.ones((4 * _TABLE, 4))
    table[:, :3] = blackbody(np.linspace(COLDEST, HOTTEST, len(table)))
    share = nodes.times(nodes.minus(kelvin, COLDEST), 1.0 / (HOTTEST - COLDEST))
    color = channels_of(nodes.add("table", share, mode="LINEAR", numbers=table.ravel().tolist()), 0, 3)
    return Value(nodes.add("vector_math", color, 0.0, 0.0, 0.0, mode="MAXIMUM"))
