"""Positions for nodes, lookups there, and the hit on the surface: images, attributes, normals."""

from __future__ import annotations

from typing import Any

import numpy as np
from perfect_bvh.nodes import Operand, channels_of, width_of

from .node_graph import Scope, is_fed
from .node_values import ValueReader, reads
from .sky import read_sky
from .values import ATTRIBUTE_KINDS, OBJECT_INFO, Source, Value, constant

_WORLD_WAYS = frozenset({"Generated", "Object", "Normal"})
# Inputs of programs by outputs of Texture Coordinate.
_PLACES = {name: name.upper() for name in ("UV", "Generated", "Object", "Window", "Reflection")}
_SPACES = ("WORLD", "OBJECT", "CAMERA")  # as the engine numbers them
_RADIAL = {"X": (None, 2, 1), "Y": (2, None, 0), "Z": (1, 0, None)}  # of a tangent, what Generated gives each channel
_EXTENSIONS = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "mirror"}


@reads("TEX_COORD")
def _coordinates(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    kind = output.identifier
    if reader.omissions.kind == "world":
        return reader.way() if kind in _WORLD_WAYS else reader.fallback
    if node.from_instancer and kind in {"Generated", "UV"}:
        return reader.fallback
    if kind == "Object" and node.object is not None:
        reader.follows_objects = True
        inverse = np.array(node.object.matrix_world.inverted_safe(), np.float64)
        return reader.work("transform", reader.input("POSITION"), numbers=inverse[:3].ravel().tolist())
    if kind == "Normal":
        return _transformed(reader, reader.input("NORMAL").operand, "NORMAL", "WORLD", "OBJECT")
    return _in_camera(reader) if kind == "Camera" else reader.input(_PLACES[kind])


def _in_camera(reader: ValueReader) -> Value:
    return _transformed(reader, reader.input("POSITION").operand, "POINT", "WORLD", "CAMERA")


@reads("CAMERA")
def _camera_data(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    place = _in_camera(reader)
    if output.identifier == "View Z Depth":
        return Value(channels_of(place.operand, 2), place.is_guess)
    mode = "NORMALIZE" if output.identifier == "View Vector" else "LENGTH"
    made = reader.work("vector_math", place, 0.0, 0.0, 0.0, mode=mode)
    return made if mode == "NORMALIZE" else Value(channels_of(made.operand, 0), made.is_guess)


@reads("VECT_TRANSFORM")
def _vector_transform(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    vector = reader.read(node.inputs[0], scope)
    if node.convert_from == node.convert_to:
        return vector
    return _transformed(reader, vector.operand, node.vector_type, node.convert_from, node.convert_to)


def _transformed(reader: ValueReader, vector: Operand, mode: str, source: str, target: str) -> Value:
    """Transform a vector by the object's or the camera's pose; for lights and worlds the result is a guess."""
    if reader.omissions.kind != "material":
        return reader.fallback
    spaces = len(_SPACES) * _SPACES.index(source) + _SPACES.index(target)
    return Value(reader.nodes.add("vector_transform", vector, mode=mode, numbers=(spaces,)))


@reads("TANGENT")
def _tangent(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    if reader.omissions.kind != "material":
        return reader.fallback
    if node.direction_type == "UV_MAP":
        return Value(_beside_normal(reader, reader.input("TANGENT", node.uv_map).operand))
    return Value(radial_tangent(reader, node.axis))


def radial_tangent(reader: ValueReader, axis: str = "Z") -> Operand:
    """Read the direction around an axis through the middle of the mesh's texture space, in addition to the normal."""
    nodes = reader.nodes
    middle = nodes.minus(reader.input("GENERATED").operand, (0.5, 0.5, 0.5))
    parts = [0.0 if channel is None else channels_of(middle, channel) for channel in _RADIAL[axis]]
    first = next(channel for channel, part in enumerate(parts) if part != 0.0)
    parts[first] = nodes.times(parts[first], -1.0)
    return _beside_normal(reader, nodes.add("combine", *parts))


def _beside_normal(reader: ValueReader, direction: Operand) -> Operand:
    """Turn a direction of the object's space into the world's, at a right angle to the normal."""
    nodes, normal = reader.nodes, reader.input("NORMAL").operand
    world = _transformed(reader, direction, "NORMAL", "OBJECT", "WORLD").operand
    aside = nodes.add("vector_math", world, normal, 0.0, 0.0, mode="CROSS_PRODUCT")
    unit = nodes.add("vector_math", aside, 0.0, 0.0, 0.0, mode="NORMALIZE")
    return nodes.add("vector_math", normal, unit, 0.0, 0.0, mode="CROSS_PRODUCT")


@reads("UVMAP")
def _uv_map(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    return reader.fallback if node.from_instancer else reader.input("UV", node.uv_map)


@reads("NEW_GEOMETRY")
def _geometry(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    if output.identifier == "Tangent" and reader.omissions.kind == "material":
        return Value(radial_tangent(reader))
    modes = {"Position": "POSITION", "Normal": "NORMAL", "True Normal": "TRUE_NORMAL", "Incoming": "INCOMING"}
    mode = modes.get(output.identifier, "BACKFACING" if output.identifier == "Backfacing" else "")
    if mode == "POSITION" and reader.omissions.kind == "world":
        return reader.way()
    return reader.input(mode) if mode else reader.fallback


@reads("MAPPING")
def _mapping(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    names = ("Vector", "Location", "Rotation", "Scale")
    values = [reader.read(node.inputs[name], scope) if name in node.inputs else constant(0.0) for name in names]
    if values[0].is_guess:
        return values[0]
    return reader.work("mapping", *values, mode=node.vector_type)


# Textures -------------------------------------------------------------------------------------------------------------


@reads("TEX_IMAGE", "TEX_ENVIRONMENT")
def _image(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    if node.image is None:
        return constant(0.0) if output.identifier == "Alpha" else constant(0.0, 0.0, 0.0)
    if reader.omissions.kind == "light":
        reader.omissions.note(f"{node.image.name} as Color", "its mean is used")
    is_around = node.type == "TEX_ENVIRONMENT"
    vector = reader.vector(node, scope, "UV")
    if is_around and reader.omissions.kind != "world" and not is_fed(node.inputs["Vector"], scope):
        vector = reader.input("POSITION")
    extension = _EXTENSIONS.get(getattr(node, "extension", "REPEAT"), "repeat")
    interpolation = "closest" if node.interpolation == "Closest" else "linear"
    row = reader.images.row(node.image, "repeat" if is_around else extension, interpolation, node.image_user)
    if node.projection == "MIRROR_BALL":
        reader.omissions.note(f"the projection Mirror Ball of {node.image.name}", "Equirectangular is used")
    if node.projection == "BOX" and reader.omissions.kind != "light":
        is_surface = reader.omissions.kind == "material"
        normal = reader.input("NORMAL").operand if is_surface else reader.nodes.times(reader.way().operand, -1.0)
        if is_surface:
            normal = _transformed(reader, normal, "NORMAL", "WORLD", "OBJECT").operand
        numbers = (float(row), node.projection_blend)
        pixels = reader.nodes.add("box_image", vector.operand, normal, numbers=numbers)
    else:
        mode = {"BOX": "FLAT", "MIRROR_BALL": "EQUIRECTANGULAR"}.get(node.projection, node.projection)
        pixels = reader.nodes.add("image", vector.operand, mode=mode, numbers=(float(row),))
    if output.identifier == "Alpha":
        return Value(channels_of(pixels, 3))
    color = channels_of(pixels, 0, 3)
    if reader.images.has_alpha(node.image, row) and _is_multiplied(node):
        color = reader.nodes.times(color, channels_of(pixels, 3))
    return Value(color)


def _is_multiplied(node: Any) -> bool:
    """Whether colours are multiplied by alpha, as in Cycles where nothing asks for alpha."""
    alpha = node.outputs.get("Alpha")
    if alpha is None or alpha.is_linked:
        return False
    return node.image.alpha_mode not in {"CHANNEL_PACKED", "NONE"} and not node.image.colorspace_settings.is_data


@reads("TEX_SKY")
def _sky(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Read its mean above the horizon, unless it surrounds the scene unchanged."""
    reader.omissions.note_node(node, instead="its mean is used")
    pixels = read_sky(node)[0].pixels
    half = len(pixels) // 2
    return constant(*np.average(pixels[half:].mean(axis=1), axis=0, weights=np.arange(half) + 0.5).tolist())


# Surfaces -------------------------------------------------------------------------------------------------------------


@reads("LIGHT_PATH")
def _light_path(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    reader.was_asked_for_rays = True
    if reader.omissions.kind != "world" or output.identifier != "Is Camera Ray":
        reader.omissions.note_simplified(node, output)
    is_short = output.identifier in {"Ray Length", "Ray Depth"} or "Depth" in output.identifier
    return constant(0.0 if is_short or output.identifier != "Is Camera Ray" else reader.is_camera)


@reads("ATTRIBUTE", "VERTEX_COLOR")
def _attribute(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Read an attribute of a mesh, or of an object or its instancer; the alpha of a mesh's colours is not read."""
    kind = getattr(node, "attribute_type", "GEOMETRY")
    if kind in ATTRIBUTE_KINDS:
        found = reader.ask(Source(ATTRIBUTE_KINDS[kind], node.attribute_name))
        if output.identifier == "Alpha":
            return Value(channels_of(found.operand, 3) if width_of(found.operand) == 4 else 1.0, found.is_guess)
        vector = Value(channels_of(found.operand, 0, 3), found.is_guess)
        return reader.work("average", vector) if output.identifier == "Fac" else vector
    name = node.layer_name if node.type == "VERTEX_COLOR" else node.attribute_name
    if kind != "GEOMETRY" or reader.omissions.kind != "material":
        return reader.fallback
    if output.identifier == "Alpha":
        reader.omissions.note(f"Alpha of {node.bl_label}", "1 is used")
        return constant(1.0)
    if not name and node.type == "ATTRIBUTE":
        return constant(0.0, 0.0, 0.0)
    found = reader.input("COLOR", name)
    return reader.work("average", found) if output.identifier == "Fac" else found


@reads("OBJECT_INFO")
def _object_info(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    if output.identifier == "Material Index":
        return constant(reader.pass_index)
    source = OBJECT_INFO.get(output.identifier)
    if source is None:
        return reader.fallback
    found = reader.ask(source)
    return found if found.is_guess else Value(channels_of(found.operand, 0, 1 if output.type == "VALUE" else 3))


@reads("FRESNEL", "LAYER_WEIGHT")
def _fresnel(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Fresnel, and both outputs of Layer Weight."""
    if reader.omissions.kind != "material":
        return reader.fallback
    value = reader.read(node.inputs[0], scope).operand
    normal, incoming = reader.normal(node.inputs["Normal"], scope), reader.input("INCOMING").operand
    if output.identifier == "Facing":
        return Value(reader.nodes.add("facing", value, normal, incoming))
    mode = "FRESNEL" if node.type == "FRESNEL" else "LAYER"
    return Value(reader.nodes.add("fresnel", value, normal, incoming, reader.input("BACKFACING").operand, mode=mode))


@reads("NORMAL_MAP")
def _normal_map(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    strength, color = reader.inputs(node, ("Strength", "Color"), scope)
    if color.is_guess:
        return reader.fallback
    operand = color.operand
    if node.space.startswith("BLENDER_"):  # of which y and z point the other way
        turned = [reader.nodes.less(1.0, channels_of(operand, channel)) for channel in (1, 2)]
        operand = reader.nodes.add("combine", channels_of(operand, 0), *turned)
    tangent: Operand = (0.0, 0.0, 0.0, 0.0)
    if node.space == "TANGENT":
        tangent = reader.nodes.add("input", mode="TANGENT", layer=node.uv_map)
    return reader.work(
        "normal_map",
        *(strength, operand, channels_of(tangent, 0, 3), channels_of(tangent, 3)),
        *(reader.input("OBJECT_NORMAL"), reader.input("NORMAL"), reader.input("BACKFACING")),
        mode=node.space.removeprefix("BLENDER_"),
    )


@reads("BUMP")
def _bump(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    strength, distance, height = reader.inputs(node, ("Strength", "Distance", "Height"), scope)
    normal = reader.normal(node.inputs["Normal"], scope)
    if height.is_guess or height.is_even:
        return Value(normal, height.is_guess)
    shifted = [reader.nodes.shifted(height.operand, side) for side in (1, 2)]
    width = reader.even_number(node.inputs["Filter Width"], 0.1, scope) if "Filter Width" in node.inputs else 1.0
    if reader.bump_width not in {None, width}:
        reader.omissions.note(f"the Filter Width of several nodes {node.bl_label}", "the largest is used")
    reader.bump_width = width
    sides = [reader.nodes.add("input", mode="SIDE", numbers=(side, width)) for side in (1.0, 2.0)]
    ways = [channels_of(side, 0, 3) for side in sides]
    far = reader.nodes.times(distance.operand, -1.0) if node.invert else distance.operand
    return reader.work("bump", strength, far, height.operand, *shifted, normal, *ways)


@reads("LIGHT_FALLOFF")
def _falloff(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Light fades with the square of the distance."""
    if output.identifier != "Quadratic" or is_fed(node.inputs["Smooth"], scope) or node.inputs["Smooth"].default_value:
        reader.omissions.note_node(node, instead="a quadratic falloff is used")
    return reader.read(node.inputs["Strength"], scope)
