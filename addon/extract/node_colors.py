"""What a material's nodes come to, roughly: a base colour or an image, its own light, how much of it is there.

Only what a preview shows is followed: the shader's colour, gloss, emission and alpha through the nodes that pass a
colour on. What a procedural texture would give is taken from the material's viewport colour.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

Color = tuple[float, float, float]

BLACK: Color = (0.0, 0.0, 0.0)
# How many nodes are looked at, shared out between the branches of mixes: so trees with loops end, too, and so do those
# whose branches meet again and again.
_MOST_NODES = 256

# The input of a node that its colour comes from, of nodes that change a colour but little.
_PASSED_ON = {
    "REROUTE": 0,
    "HUE_SAT": "Color",
    "BRIGHTCONTRAST": "Color",
    "GAMMA": "Color",
    "CURVE_RGB": "Color",
    "SEPARATE_COLOR": 0,
}
_COLOR_INPUTS = ("Base Color", "Color")


@dataclass(frozen=True, slots=True)
class ColorSource:
    """color: scene-linear. image_node: the image texture node that stands for it, None if there is none."""

    color: Color
    image_node: Any = None


@dataclass(frozen=True, slots=True)
class Surface:
    """base, emission: see `ColorSource`; emission is radiance. alpha: 0 to 1; alpha_node: whose image multiplies it.

    metallic, roughness, reflectance, transmission: see `perfect_bvh.MaterialTable`.
    """

    base: ColorSource
    emission: Color = BLACK
    alpha: float = 1.0
    alpha_node: Any = None
    metallic: float = 0.0
    roughness: float = 1.0
    reflectance: float = 0.0
    transmission: float = 0.0


def read_surface(material: Any) -> Surface:
    """The surface of an evaluated `bpy.types.Material`."""
    red, green, blue, _ = material.diffuse_color
    plain = ColorSource((red, green, blue))
    tree = material.node_tree if material.use_nodes else None
    output = None if tree is None else tree.get_output_node("CYCLES")
    if output is None:
        return Surface(plain)
    return _follow_shader(_source(output.inputs["Surface"]), plain, _MOST_NODES)


def read_color(socket: Any, fallback: ColorSource, left: int = _MOST_NODES) -> ColorSource:
    """What a colour socket gets. left: how many nodes may still be looked at."""
    node = _source(socket)
    if node is None:
        value = socket.default_value
        return ColorSource((value[0], value[1], value[2])) if hasattr(value, "__len__") else ColorSource((value,) * 3)
    if left == 0:
        return fallback
    if node.type in {"TEX_IMAGE", "TEX_ENVIRONMENT"}:
        return ColorSource(fallback.color, node) if node.image is not None else fallback
    if node.type == "RGB":
        red, green, blue, _ = node.outputs[0].default_value
        return ColorSource((red, green, blue))
    if node.type == "VALTORGB":
        return ColorSource(_mean([tuple(node.color_ramp.evaluate(step / 8)[:3]) for step in range(9)]))
    if node.type in {"MIX", "MIX_RGB", "TEX_CHECKER", "TEX_BRICK"}:
        return _mix_colors(node, fallback, left // 2)
    if node.type in _PASSED_ON:
        return read_color(node.inputs[_PASSED_ON[node.type]], fallback, left - 1)
    return fallback


def _follow_shader(node: Any, plain: ColorSource, left: int) -> Surface:
    if node is None or left == 0:
        return Surface(ColorSource(BLACK))
    if node.type == "REROUTE":
        return _follow_shader(_source(node.inputs[0]), plain, left - 1)
    if node.type == "MIX_SHADER":
        first, second = (_follow_shader(_source(node.inputs[index]), plain, left // 2) for index in (1, 2))
        return _mix_surfaces(first, second, _number(node.inputs[0], 0.5))
    if node.type == "ADD_SHADER":
        first, second = (_follow_shader(_source(socket), plain, left // 2) for socket in node.inputs)
        brightest = max((first, second), key=lambda surface: sum(surface.base.color))
        return replace(brightest, emission=_add(first.emission, second.emission))
    if node.type == "BSDF_TRANSPARENT":
        return Surface(ColorSource(BLACK), alpha=0.0)
    if node.type == "EMISSION":
        color = read_color(node.inputs["Color"], plain).color
        return Surface(ColorSource(BLACK), _scale(color, _number(node.inputs["Strength"], 1.0)))
    if node.type == "BSDF_PRINCIPLED":
        return _read_principled(node, plain)
    socket = next((node.inputs[name] for name in _COLOR_INPUTS if name in node.inputs), None)
    return Surface(plain if socket is None else read_color(socket, plain), **_read_gloss(node))


def _read_principled(node: Any, plain: ColorSource) -> Surface:
    inputs = node.inputs
    glow = read_color(inputs["Emission Color"], ColorSource(BLACK)).color
    emission = _scale(glow, _number(inputs["Emission Strength"], 0.0))
    alpha_source = _source(inputs["Alpha"])
    alpha_node = alpha_source if alpha_source is not None and alpha_source.type == "TEX_IMAGE" else None
    if alpha_node is not None and alpha_node.image is None:
        alpha_node = None
    return Surface(
        read_color(inputs["Base Color"], plain),
        emission,
        _number(inputs["Alpha"], 1.0),
        alpha_node,
        metallic=_number(inputs["Metallic"], 0.0),
        roughness=_number(inputs["Roughness"], 0.5),
        reflectance=_reflectance(inputs["IOR"]) * 2.0 * _number(inputs["Specular IOR Level"], 0.5),
        transmission=_number(inputs["Transmission Weight"], 0.0),
    )


def _read_gloss(node: Any) -> dict[str, float]:
    """What of a `Surface` a simple shader node adds to its colour."""
    if node.type in {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"}:
        return {"metallic": 1.0, "roughness": _number(node.inputs["Roughness"], 0.5)}
    if node.type == "BSDF_GLASS":
        roughness, reflectance = _number(node.inputs["Roughness"], 0.0), _reflectance(node.inputs["IOR"])
        return {"roughness": roughness, "reflectance": reflectance, "transmission": 1.0}
    return {"transmission": 1.0} if node.type == "BSDF_REFRACTION" else {}


def _reflectance(ior_socket: Any) -> float:
    """What a surface of this index of refraction mirrors of what comes from straight above."""
    ior = _number(ior_socket, 1.5)
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def _mix_colors(node: Any, fallback: ColorSource, left: int) -> ColorSource:
    """Two colours in the middle, or as its factor has it; of two images the one that counts for more."""
    wanted = "RGBA" if node.type in {"MIX", "MIX_RGB"} else None
    sockets = [socket for socket in node.inputs if socket.enabled and socket.type == (wanted or "RGBA")][:2]
    if len(sockets) < 2:
        return fallback
    factor = 0.5
    if wanted is not None:
        factor = _number(next(socket for socket in node.inputs if socket.enabled and socket.type == "VALUE"), 0.5)
    first, second = (read_color(socket, fallback, left) for socket in sockets)
    if first.image_node is not None or second.image_node is not None:
        major, minor = (second, first) if factor >= 0.5 else (first, second)
        return major if major.image_node is not None else minor
    return ColorSource(_lerp(first.color, second.color, factor))


def _mix_surfaces(first: Surface, second: Surface, factor: float) -> Surface:
    """By alpha the colours count: a transparent share adds nothing but its transparency."""
    major = second if factor * second.alpha >= (1.0 - factor) * first.alpha else first
    emission = _lerp(first.emission, second.emission, factor)
    alpha = first.alpha * (1.0 - factor) + second.alpha * factor
    if major.base.image_node is not None or not alpha:
        return replace(major, emission=emission, alpha=alpha)
    share = second.alpha * factor / alpha
    gloss = {
        name: getattr(first, name) * (1.0 - share) + getattr(second, name) * share
        for name in ("metallic", "roughness", "reflectance", "transmission")
    }
    base = ColorSource(_lerp(first.base.color, second.base.color, share))
    return Surface(base, emission, alpha, major.alpha_node, **gloss)


def _source(socket: Any) -> Any:
    """The node that a socket's value comes from; None if it is the socket's own."""
    links = socket.links
    return links[0].from_node if links and not links[0].is_muted else None


def _number(socket: Any, linked: float) -> float:
    """The socket's own value, or `linked` where a node would give it."""
    return linked if _source(socket) is not None else float(socket.default_value)


def _scale(color: Color, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _add(a: Color, b: Color) -> Color:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def _lerp(a: Color, b: Color, share: float) -> Color:
    return _add(_scale(a, 1.0 - share), _scale(b, share))


def _mean(colors: list[Any]) -> Color:
    return (
        sum(color[0] for color in colors) / len(colors),
        sum(color[1] for color in colors) / len(colors),
        sum(color[2] for color in colors) / len(colors),
    )
