"""Procedural textures of nodes: one instruction each, and the colours that are mixed by it."""

from __future__ import annotations

from typing import Any

from perfect_bvh.nodes import Operand, channels_of

from .node_graph import Scope
from .node_values import ValueReader, reads
from .values import Value

_METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
_PROFILES = ("SIN", "SAW", "TRI")
_DIRECTIONS = ("X", "Y", "Z")
_GABOR = ("Value", "Phase", "Intensity")
# The first channel of each output of a Voronoi Texture in the instruction, and its width.
_VORONOI = {"Distance": (0, 1), "Color": (1, 3), "Position": (4, 3), "W": (7, 1), "Radius": (8, 1)}


def _numbers(reader: ValueReader, node: Any, scope: Scope | None, *names: str) -> list[Operand]:
    """Numbers of inputs, 0 for those that the node does not show."""
    found = [node.inputs.get(name) for name in names]
    return [0.0 if socket is None or not socket.enabled else reader.number(socket, 0.0, scope) for socket in found]


def _mixed(reader: ValueReader, node: Any, share: Operand, scope: Scope | None) -> Value:
    """The second colour by its share of 0 to 1."""
    colors = [reader.read(node.inputs[name], scope).operand for name in ("Color2", "Color1")]
    return Value(reader.nodes.mix(share, *reversed(colors)))


@reads("TEX_CHECKER")
def _checker(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Read a checker; its factor is 1 where the first colour is."""
    vector = reader.vector(node, scope, "GENERATED")
    factor = reader.work("checker", vector, *_numbers(reader, node, scope, "Scale"))
    if vector.is_guess or output.identifier == "Fac":
        return factor
    return _mixed(reader, node, reader.nodes.less(1.0, factor.operand), scope)


@reads("TEX_BRICK")
def _brick(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("Scale", "Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
    settings = (node.offset, node.offset_frequency, node.squash, node.squash_frequency)
    vector = reader.vector(node, scope, "GENERATED")
    made = reader.work("brick", vector, *_numbers(reader, node, scope, *names), numbers=settings)
    mortar = channels_of(made.operand, 0)
    if vector.is_guess or output.identifier == "Fac":
        return Value(mortar, made.is_guess)
    bricks = _mixed(reader, node, channels_of(made.operand, 1), scope)
    return Value(reader.nodes.mix(mortar, bricks.operand, reader.read(node.inputs["Mortar"], scope).operand))


@reads("TEX_NOISE")
def _noise(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Offset", "Gain", "Distortion")
    is_color = output.identifier == "Color"
    made = reader.work(
        "noise",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, *names),
        mode=node.noise_type,
        numbers=(float(node.noise_dimensions[0]), float(node.normalize), float(is_color)),
    )
    return made if is_color else Value(channels_of(made.operand, 0), made.is_guess)


@reads("TEX_VORONOI")
def _voronoi(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("W", "Scale", "Detail", "Roughness", "Lacunarity", "Smoothness", "Exponent", "Randomness")
    made = reader.work(
        "voronoi",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, *names),
        mode=node.feature,
        numbers=(float(node.voronoi_dimensions[0]), float(_METRICS.index(node.distance)), float(node.normalize)),
    )
    return Value(channels_of(made.operand, *_VORONOI[output.identifier]), made.is_guess)


@reads("TEX_GRADIENT")
def _gradient(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    return reader.work("gradient", reader.vector(node, scope, "GENERATED"), mode=node.gradient_type)


@reads("TEX_MAGIC")
def _magic(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    made = reader.work(
        "magic",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, "Scale", "Distortion"),
        numbers=(float(node.turbulence_depth),),
    )
    return made if output.identifier == "Color" else reader.work("average", made)


@reads("TEX_WAVE")
def _wave(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("Scale", "Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")
    is_rings = node.wave_type == "RINGS"
    direction = node.rings_direction if is_rings else node.bands_direction
    row = _DIRECTIONS.index(direction) if direction in _DIRECTIONS else len(_DIRECTIONS)
    return reader.work(
        "wave",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, *names),
        numbers=(float(is_rings), float(row), float(_PROFILES.index(node.wave_profile))),
    )


@reads("TEX_GABOR")
def _gabor(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    sockets = {socket.identifier: socket for socket in node.inputs}
    way = reader.read(sockets["Orientation 3D"], scope)
    made = reader.work(
        "gabor",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, "Scale", "Frequency", "Anisotropy"),
        reader.number(sockets["Orientation 2D"], 0.0, scope),
        way.operand,
        mode=node.gabor_type,
    )
    return Value(channels_of(made.operand, _GABOR.index(output.identifier)), made.is_guess)


@reads("TEX_WHITE_NOISE")
def _white_noise(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    made = reader.work(
        "white_noise",
        reader.vector(node, scope, "GENERATED"),
        *_numbers(reader, node, scope, "W"),
        numbers=(float(node.noise_dimensions[0]),),
    )
    return made if output.identifier == "Color" else Value(channels_of(made.operand, 0), made.is_guess)
