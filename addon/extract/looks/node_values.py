"""What the value of a node's socket comes to: one colour everywhere, or the pixels of one image, changed in some way.

Nodes that change colours are worked out, for an image pixel by pixel. What cannot be known without rendering
(procedural textures, attributes, angles) is a guess, and so is what is made of guesses alone. A second image counts by
its mean.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...sync.look_records import UNMAPPED, Extension
from .node_graph import GROUPS, Omissions, Scope, find_coordinates, is_fed, trace_back
from .sky import read_sky
from .values import (
    ATTRIBUTE_KINDS,
    BLENDS,
    FILTERS,
    MATHS,
    OBJECT_INFO,
    AskInstances,
    ImageMeans,
    Pixels,
    Source,
    Texture,
    Value,
    adjust_hsv,
    average,
    blackbody,
    clamp,
    constant,
    first_channel,
    grey,
    guess,
)

HALF = "half of each is"
_DEEPEST = 150
_RENAMED = {"Fac": "Factor", "Bright": "Brightness"}
_EXTENSIONS: dict[str, Extension] = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "repeat"}
_TABLE = 257


class ValueReader:
    """Reads sockets of one node tree. fallback: the colour that stands for what cannot be known.

    omissions: takes what of the nodes is not shown.
    is_camera: whether nodes that ask what kind of ray looks are told that the camera's does. pass_index: of the
    material. instances: answers what nodes ask of the instance that is seen; then values are those of so many
    instances, and images count by their means. Without it the questions are noted in `asked`.
    """

    def __init__(
        self,
        images: ImageMeans,
        fallback: Value,
        omissions: Omissions | None = None,
        is_camera: bool = True,
        pass_index: int = 0,
        instances: AskInstances | None = None,
    ) -> None:
        self._images = images
        self.omissions = omissions or Omissions("material")
        self._pass_index = float(pass_index)
        self._instances = instances
        self.asked: set[Source] = set()
        self.fallback = guess(fallback.color)
        self._is_camera = float(is_camera)
        self.was_asked_for_rays = False
        self._known: dict[tuple[int, ...], Value] = {}
        self._depth = 0

    def read(self, socket: Any, scope: Scope | None = None) -> Value:
        """What an input socket gets."""
        if not socket.is_linked:  # most are not
            return _own_value(socket)
        output, scope = trace_back(socket, scope, self.omissions.note_foreign)
        if not output.is_output:
            return _own_value(output)
        value = self._read_output(output, scope)
        if socket.type == "VALUE" and output.type in {"RGBA", "VECTOR"}:
            return self.combine(grey if output.type == "RGBA" else average, [value], "grey")
        return value

    def number(self, socket: Any, unknown: float, scope: Scope | None = None) -> Any:
        """A number for all of the surface: the mean of an image, `unknown` for a guess; (N,) of N instances."""
        if not socket.is_linked and socket.type == "VALUE":
            return float(socket.default_value)
        mark = self.omissions.mark
        value = self.without_tint(self.read(socket, scope))
        if value.is_guess:
            number: Any = unknown
        else:
            number = float(value.color[0]) if value.is_even else first_channel(self.mean(value))
        if value.texture is not None:
            self.omissions.note(f"{value.texture.image.name} as {socket.name}")
        self.omissions.since(mark, f"{socket.name} {np.mean(number):.3g} is")
        return number

    def read_or(self, unknown: Value, instead: str, socket: Any, scope: Scope | None) -> Value:
        """What an input socket gets, `unknown` for a guess, of which users are told that `instead` is shown."""
        mark = self.omissions.mark
        value = self.without_tint(self.read(socket, scope))
        if not value.is_guess:
            return value
        self.omissions.since(mark, instead)
        return unknown

    def without_tint(self, value: Value) -> Value:
        """A value that goes where the mesh's own colours are not looked up."""
        if value.tint is None:
            return value
        self.omissions.note(f"Color Attribute {value.tint}".strip())
        return replace(value, tint=None)

    def mean(self, value: Value) -> Pixels:
        return value.color if value.texture is None else self._images.mean(value)

    def overall(self, value: Value) -> Pixels:
        """(4,): the mean, over all instances, too."""
        mean = self.mean(value)
        return mean if mean.ndim == 1 else np.asarray(mean.mean(axis=0), np.float32)

    def combine(self, work: Callable[..., Pixels], values: Sequence[Value], key: Hashable) -> Value:
        """`work` done on values; key: what tells it from other work. The first texture is worked on."""
        values = [self.without_tint(value) for value in values]
        texture = next((value.texture for value in values if value.texture is not None), None)
        is_guess = all(value.is_guess for value in values)
        varies = any(value.varies for value in values)
        if texture is None:
            color = np.asarray(work(*(value.color for value in values)), np.float32)
            return Value(color, is_guess=is_guess, varies=varies)
        values = [value if value.texture in (None, texture) else self._only_mean(value) for value in values]
        keys = tuple([value.key if value.texture is not None else value.color.tobytes() for value in values])

        def change(pixels: Pixels) -> Pixels:
            return np.asarray(work(*(value.of(pixels) for value in values)), np.float32)

        return Value(values[0].color, texture, change, (key, keys), varies=varies)

    def _only_mean(self, value: Value) -> Value:
        assert value.texture is not None
        self.omissions.note(f"{value.texture.image.name}, a second image,", "its mean is")
        return Value(self.mean(value), is_guess=value.is_guess)

    def _read_output(self, output: Any, scope: Scope | None) -> Value:
        place = (output.as_pointer(), *(scope.key if scope is not None else ()))
        known = self._known.get(place)
        if known is not None:
            self.omissions.count += known.is_guess  # why it is one was noted at first
            return known
        self._known[place] = self.fallback  # so that loops end
        read = _READERS.get(output.node.type)
        if read is None or self._depth >= _DEEPEST:
            self.omissions.note_node(output.node, output)
            return self.fallback
        self._depth += 1
        count = self.omissions.count
        value = self._known[place] = read(self, output.node, output, scope)
        self._depth -= 1
        if self.omissions.count == count and value.is_guess and value.tint is None:  # nothing before it is to blame
            self.omissions.note_node(output.node, output)
        return value

    def _read_all(self, node: Any, names: Sequence[str], scope: Scope | None) -> list[Value]:
        """By the inputs' identifiers: what users read changes with Blender's versions and language."""
        sockets = {socket.identifier: socket for socket in node.inputs}
        found = [sockets.get(name) or sockets.get(_RENAMED.get(name, "")) for name in names]
        return [self.fallback if socket is None else self.read(socket, scope) for socket in found]

    # Nodes -----------------------------------------------------------------------------------------------------------

    def _image(self, node: Any, output: Any, scope: Scope | None) -> Value:
        if node.image is None:
            return self.fallback
        if self._instances is not None:
            mean = self._images.mean(Value(self.fallback.color, Texture(node.image, "repeat", UNMAPPED, "")))
            return Value(mean[3:].repeat(4) if output.identifier == "Alpha" else mean)
        self._note_image_settings(node)
        transform, uv_map = find_coordinates(node.inputs["Vector"], scope, self)
        extension = _EXTENSIONS.get(getattr(node, "extension", "REPEAT"), "repeat")
        value = Value(self.fallback.color, Texture(node.image, extension, transform, uv_map))
        if output.identifier == "Alpha":
            return self.combine(lambda pixels: pixels[..., 3:].repeat(4, axis=-1), [value], "alpha")
        return value

    def _note_image_settings(self, node: Any) -> None:
        """How an image is laid over the surface, where that is not shown."""
        is_world, is_surroundings = self.omissions.kind == "world", node.type == "TEX_ENVIRONMENT"
        plain = "EQUIRECTANGULAR" if is_surroundings else "FLAT"
        if is_world != is_surroundings or node.projection != plain:
            place = "all round it" if is_world else "in the UV map"
            projection = node.projection.replace("_", " ").title()
            self.omissions.note(f"the projection {projection} of {node.image.name}", f"the image is, {place}")
        if node.interpolation == "Closest":
            self.omissions.note(f"{node.interpolation} interpolation of {node.image.name}", "Linear is")
        if getattr(node, "extension", "") == "MIRROR":
            self.omissions.note(f"the mirrored extension of {node.image.name}", "Repeat is")

    def _own(self, node: Any, output: Any, scope: Scope | None) -> Value:
        return _own_value(output)

    def _mix(self, node: Any, output: Any, scope: Scope | None) -> Value:
        wanted = "RGBA" if node.type == "MIX_RGB" else node.data_type.replace("FLOAT", "VALUE")
        enabled = [socket for socket in node.inputs if socket.enabled]
        inputs = [socket for socket in enabled if socket.type == wanted][-2:]
        factor = self.read_or(constant(0.5), HALF, enabled[0], scope)
        if len(inputs) < 2 or (node.type == "MIX" and wanted not in {"RGBA", "VALUE"}):
            return self.fallback
        first, second = (self.read(socket, scope) for socket in inputs)
        blend = node.blend_type if wanted == "RGBA" else "MIX"
        is_clamped = bool(getattr(node, "use_clamp", False) or getattr(node, "clamp_result", False))
        if blend not in BLENDS:
            self.omissions.note(f"the blending mode {blend.replace('_', ' ').title()}", "Mix is")
        blending = BLENDS.get(blend, BLENDS["MIX"])

        is_whole = bool((factor.color[..., 0] == 1.0).all())
        if blend == "MULTIPLY" and (first.tint is None) != (second.tint is None) and is_whole:
            return replace(second, tint=first.tint) if second.tint is None else replace(first, tint=second.tint)

        def work(share: Pixels, one: Pixels, other: Pixels) -> Pixels:
            mixed = blending(clamp(share), one, other)
            return clamp(mixed) if is_clamped else mixed

        return self.combine(work, [factor, first, second], (blend, is_clamped))

    def _ramp(self, node: Any, output: Any, scope: Scope | None) -> Value:
        table = np.array([node.color_ramp.evaluate(step / (_TABLE - 1)) for step in range(_TABLE)], np.float32)
        if output.identifier == "Alpha":
            table = table[:, 3:].repeat(4, axis=1)
        factor = self.read(node.inputs[0], scope)
        if factor.is_guess:
            return Value(table.mean(axis=0))

        def work(share: Pixels) -> Pixels:
            return table[np.rint(clamp(share[..., 0]) * (_TABLE - 1)).astype(np.int64)]

        return self.combine(work, [factor], ("ramp", table.tobytes()))

    def _curves(self, node: Any, output: Any, scope: Scope | None) -> Value:
        mapping, steps = node.mapping, np.linspace(0.0, 1.0, _TABLE)
        mapping.initialize()
        tables = np.array([[mapping.evaluate(curve, step) for step in steps] for curve in mapping.curves])

        def work(share: Pixels, color: Pixels) -> Pixels:
            changed = color.copy()
            for channel in range(3):
                through = np.interp(color[..., channel], steps, tables[3])
                changed[..., channel] = np.interp(through, steps, tables[channel])
            return color + (changed - color) * share

        return self.combine(work, self._read_all(node, ("Fac", "Color"), scope), ("curves", tables.tobytes()))

    def _hue_saturation(self, node: Any, output: Any, scope: Scope | None) -> Value:
        names = ("Hue", "Saturation", "Value", "Fac", "Color")
        return self.combine(adjust_hsv, self._read_all(node, names, scope), "hsv")

    def _math(self, node: Any, output: Any, scope: Scope | None) -> Value:
        work = MATHS.get(node.operation)
        values = [self.read(socket, scope) for socket in node.inputs if socket.enabled]
        if work is None or any(value.is_guess for value in values):
            return self.fallback
        if node.use_clamp:
            return self.combine(lambda *arrays: clamp(work(*arrays)), values, (node.operation, True))
        return self.combine(work, values, (node.operation, False))

    def _separate(self, node: Any, output: Any, scope: Scope | None) -> Value:
        if getattr(node, "mode", "RGB") != "RGB":
            return self.fallback
        channel = list(node.outputs).index(output)
        color = self.read(node.inputs[0], scope)
        return self.combine(lambda pixels: pixels[..., channel, None].repeat(4, axis=-1), [color], ("channel", channel))

    def _combine_channels(self, node: Any, output: Any, scope: Scope | None) -> Value:
        if getattr(node, "mode", "RGB") != "RGB":
            return self.fallback

        def work(*channels: Pixels) -> Pixels:
            red, green, blue = np.broadcast_arrays(*(channel[..., 0] for channel in channels))
            return np.stack([red, green, blue, np.ones_like(red)], axis=-1)

        return self.combine(work, [self.read(socket, scope) for socket in list(node.inputs)[:3]], "combine")

    def _blackbody(self, node: Any, output: Any, scope: Scope | None) -> Value:
        kelvin = self.number(node.inputs[0], 6500.0, scope)
        if not np.ndim(kelvin):
            return constant(*blackbody(kelvin))
        steps = np.linspace(kelvin.min(), kelvin.max(), _TABLE)
        table = np.array([(*blackbody(step), 1.0) for step in steps.tolist()])
        return Value(np.stack([np.interp(kelvin, steps, channel) for channel in table.T], axis=-1).astype(np.float32))

    def _light_path(self, node: Any, output: Any, scope: Scope | None) -> Value:
        self.was_asked_for_rays = True
        if self.omissions.kind != "world" or output.identifier != "Is Camera Ray":
            self.omissions.note_simplified(node, output)
        is_short = output.identifier in {"Ray Length", "Ray Depth"} or "Depth" in output.identifier
        return constant(0.0 if is_short or output.identifier != "Is Camera Ray" else self._is_camera)

    def _middle(self, node: Any, output: Any, scope: Scope | None) -> Value:
        """Of a pattern of two colours: what lies between them."""
        self.omissions.note_simplified(node)
        colors = [self.read(socket, scope) for socket in node.inputs if socket.type == "RGBA"][:2]
        return self.combine(lambda one, other: (one + other) / 2, colors, "middle")

    def _attribute(self, node: Any, output: Any, scope: Scope | None) -> Value:
        """What a mesh was painted with, or what an object or its instancer has; a number of a mesh is a guess."""
        kind = getattr(node, "attribute_type", "GEOMETRY")
        if kind in ATTRIBUTE_KINDS:
            value = self._ask(Source(ATTRIBUTE_KINDS[kind], node.attribute_name))
            if output.identifier == "Alpha":
                return self.combine(lambda color: color[..., 3:].repeat(4, axis=-1), [value], "alpha")
            return self.combine(average, [value], "average") if output.identifier == "Fac" else value
        if output.identifier != "Color" or kind != "GEOMETRY":
            return self.fallback
        if node.type == "VERTEX_COLOR":
            return replace(self.fallback, tint=node.layer_name)
        return replace(self.fallback, tint=node.attribute_name) if node.attribute_name else constant(0.0, 0.0, 0.0)

    def _object_info(self, node: Any, output: Any, scope: Scope | None) -> Value:
        if output.identifier == "Material Index":
            return constant(self._pass_index)
        source = OBJECT_INFO.get(output.identifier)
        return self.fallback if source is None else self._ask(source)

    def _ask(self, source: Source) -> Value:
        if self.omissions.kind != "material":  # lights and the world are no instances
            return self.fallback
        if self._instances is None:
            self.asked.add(source)
            return Value(source.stand_in, varies=True)
        return Value(self._instances(source))

    def _sky(self, node: Any, output: Any, scope: Scope | None) -> Value:
        """Its mean above the horizon, where it does not stand round the scene as it is."""
        self.omissions.note_node(node, instead="its mean is")
        pixels = read_sky(node)[0].pixels
        return Value(pixels[len(pixels) // 2 :].mean(axis=(0, 1)))

    def _geometry(self, node: Any, output: Any, scope: Scope | None) -> Value:
        """Fronts are what one looks at."""
        if output.identifier != "Backfacing":
            return self.fallback
        self.omissions.note_simplified(node, output)
        return constant(0.0)

    def _mirrored_share(self, node: Any, output: Any, scope: Scope | None) -> Value:
        self.omissions.note_simplified(node)
        return constant(0.3 if output.identifier == "Facing" else 0.1)


def _falloff(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
    """Light fades with the square of the distance."""
    if output.identifier != "Quadratic" or is_fed(node.inputs["Smooth"], scope) or node.inputs["Smooth"].default_value:
        reader.omissions.note_node(node, instead="a quadratic one is")
    return reader.read(node.inputs["Strength"], scope)


def _simple(work: Callable[..., Pixels], *names: str) -> Callable[..., Value]:
    """The reader of a node that does nothing but `work` on the inputs of these names."""

    def read(reader: ValueReader, node: Any, output: Any, scope: Scope | None) -> Value:
        return reader.combine(work, reader._read_all(node, names, scope), node.type)

    return read


def _own_value(socket: Any) -> Value:
    value = getattr(socket, "default_value", 0.0)
    return constant(*value) if hasattr(value, "__len__") else constant(float(value))


_READERS: dict[str, Callable[..., Value]] = {
    **dict.fromkeys(GROUPS, lambda *_: constant(0.0)),  # those that lead nothing to an output
    **dict.fromkeys(("TEX_IMAGE", "TEX_ENVIRONMENT"), ValueReader._image),
    **dict.fromkeys(("RGB", "VALUE"), ValueReader._own),
    **dict.fromkeys(("MIX", "MIX_RGB"), ValueReader._mix),
    "VALTORGB": ValueReader._ramp,
    "CURVE_RGB": ValueReader._curves,
    "HUE_SAT": ValueReader._hue_saturation,
    "MATH": ValueReader._math,
    **dict.fromkeys(("SEPARATE_COLOR", "SEPRGB"), ValueReader._separate),
    **dict.fromkeys(("COMBINE_COLOR", "COMBRGB"), ValueReader._combine_channels),
    "BLACKBODY": ValueReader._blackbody,
    "LIGHT_PATH": ValueReader._light_path,
    **dict.fromkeys(("TEX_CHECKER", "TEX_BRICK"), ValueReader._middle),
    **dict.fromkeys(("ATTRIBUTE", "VERTEX_COLOR"), ValueReader._attribute),
    "OBJECT_INFO": ValueReader._object_info,
    "TEX_SKY": ValueReader._sky,
    "NEW_GEOMETRY": ValueReader._geometry,
    **dict.fromkeys(("FRESNEL", "LAYER_WEIGHT"), ValueReader._mirrored_share),
    "LIGHT_FALLOFF": _falloff,
    **{kind: _simple(work, *names) for kind, (work, *names) in FILTERS.items()},
}
