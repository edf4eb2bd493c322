"""Places that nodes ask for, what is looked up there, and how a surface is met: images, attributes, normals."""

from __future__ import annotations

from typing import Any

import numpy as np
from perfect_bvh.nodes import Operand, channels_of, width_of

from .node_graph import Scope, is_fed
from .node_values import ValueReader, reads
from .sky import read_sky
from .values import ATTRIBUTE_KINDS, OBJECT_INFO, Source, Value, constant

_WORLD_WAYS = frozenset({"Generated", "Object", "Camera", "Normal"})
_PROJECTIONS = {"FLAT": "FLAT", "SPHERE": "SPHERE", "TUBE": "TUBE"}
_EXTENSIONS = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "mirror"}


@reads("TEX_COORD")
def _coordinates(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    kind = output.identifier
    if reader.omissions.kind == "world":
        return reader.way() if kind in _WORLD_WAYS else reader.fallback
    if kind == "UV":
        return reader.input("UV")
    if kind == "Generated":
        return reader.input("GENERATED")
    if kind == "Object" and node.object is None:
        return reader.input("OBJECT")
    if kind == "Object":
        reader.follows_objects = True
        inverse = np.array(node.object.matrix_world.inverted_safe(), np.float64)
        return reader.work("transform", reader.input("POSITION"), numbers=inverse[:3].ravel().tolist())
    if kind == "Normal":
        return reader.input("OBJECT_NORMAL")
    return reader.input("REFLECTION") if kind == "Reflection" else reader.fallback


@reads("UVMAP")
def _uv_map(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    return reader.fallback if node.from_instancer else reader.input("UV", node.uv_map)


@reads("NEW_GEOMETRY")
def _geometry(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
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
        reader.omissions.note(f"{node.image.name} as Color", "its mean is")
    is_around = node.type == "TEX_ENVIRONMENT"
    vector = reader.vector(node, scope, "UV")
    if is_around and reader.omissions.kind != "world" and not is_fed(node.inputs["Vector"], scope):
        vector = reader.input("POSITION")
    mode = "EQUIRECTANGULAR" if is_around else _PROJECTIONS.get(node.projection, "FLAT")
    if node.projection not in {"EQUIRECTANGULAR", *_PROJECTIONS}:
        name = node.projection.replace("_", " ").title()
        reader.omissions.note(f"the projection {name} of {node.image.name}", f"{mode.title()} is")
    extension = _EXTENSIONS.get(getattr(node, "extension", "REPEAT"), "repeat")
    interpolation = "closest" if node.interpolation == "Closest" else "linear"
    row = reader.images.row(node.image, "repeat" if is_around else extension, interpolation)
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
    """Its mean above the horizon, where it does not stand round the scene as it is."""
    reader.omissions.note_node(node, instead="its mean is")
    pixels = read_sky(node)[0].pixels
    return constant(*pixels[len(pixels) // 2 :].mean(axis=(0, 1)).tolist())


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
    """What a mesh has, or what an object or its instancer has; of the alpha of a mesh's colours nothing is read."""
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
        reader.omissions.note(f"Alpha of {node.bl_label}", "1 is")
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
    ways = [reader.input("SIDE", number=side) for side in (1, 2)]
    far = reader.nodes.times(distance.operand, -1.0) if node.invert else distance.operand
    return reader.work("bump", strength, far, height.operand, *shifted, normal, *ways)


@reads("LIGHT_FALLOFF")
def _falloff(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Light fades with the square of the distance."""
    if output.identifier != "Quadratic" or is_fed(node.inputs["Smooth"], scope) or node.inputs["Smooth"].default_value:
        reader.omissions.note_node(node, instead="a quadratic one is")
    return reader.read(node.inputs["Strength"], scope)
