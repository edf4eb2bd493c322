"""What a material's nodes come to, roughly: a base colour, its own light, how much of it is there, how shiny it is.

Only what a preview shows is followed. What a procedural texture would give is taken from the material's viewport
colour.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .node_graph import Scope, trace_back
from .node_values import ImageMeans, Pixels, Value, ValueReader, constant

BLACK = constant(0.0, 0.0, 0.0)
WHOLE = constant(1.0)
NOTHING = constant(0.0)
DIFFUSE: Mapping[str, float] = {"metallic": 0.0, "roughness": 1.0, "reflectance": 0.0, "transmission": 0.0}

_DEEPEST = 64
_COLOR_INPUTS = ("Base Color", "Color")


@dataclass(frozen=True, slots=True)
class Surface:
    """base, emission: colours; emission is radiance, of `brightness` times as much. alpha: 0 to 1.

    specular: metallic, roughness, reflectance, transmission, see `perfect_bvh.MaterialTable`. holdout: of what is
    there, how much cuts a hole into the image; a number for all of the surface.
    """

    base: Value
    emission: Value = BLACK
    brightness: float = 1.0
    alpha: Value = WHOLE
    specular: Mapping[str, float] = field(default_factory=lambda: DIFFUSE)
    holdout: float = 0.0


def read_surface(material: Any, images: ImageMeans) -> Surface:
    """The surface of an evaluated `bpy.types.Material`."""
    red, green, blue, _ = material.diffuse_color
    plain = constant(red, green, blue)
    tree = material.node_tree if material.use_nodes else None
    output = None if tree is None else tree.get_output_node("CYCLES")
    if output is None:
        return Surface(plain)
    if not output.inputs["Surface"].is_linked and output.inputs["Volume"].is_linked:
        return Surface(BLACK, alpha=NOTHING)  # fog has no surface
    return _SurfaceReader(plain, images).follow(output.inputs["Surface"], None, 0)


class _SurfaceReader:
    def __init__(self, plain: Value, images: ImageMeans) -> None:
        self._plain = plain
        self._values = ValueReader(images, plain)

    def follow(self, socket: Any, scope: Scope | None, depth: int) -> Surface:
        """What a shader socket gets."""
        output, scope = trace_back(socket, scope)
        if not output.is_output or output.node.type == "GROUP" or depth > _DEEPEST:  # an empty group
            return Surface(BLACK)
        node = output.node
        if node.type == "MIX_SHADER":
            first, second = (self.follow(node.inputs[index], scope, depth + 1) for index in (1, 2))
            return self._mix(first, second, self._values.read(node.inputs[0], scope))
        if node.type == "ADD_SHADER":
            return self._add(*(self.follow(socket, scope, depth + 1) for socket in node.inputs))
        if node.type == "BSDF_TRANSPARENT":
            return Surface(BLACK, alpha=NOTHING)
        if node.type == "HOLDOUT":
            return Surface(BLACK, holdout=1.0)
        if node.type == "EMISSION":
            return self._emission(Surface(BLACK), node.inputs["Color"], node.inputs["Strength"], scope)
        if node.type == "BSDF_PRINCIPLED":
            return self._principled(node, scope)
        color = next((node.inputs[name] for name in _COLOR_INPUTS if name in node.inputs), None)
        base = self._plain if color is None else self._values.read(color, scope)
        return Surface(base, specular={**DIFFUSE, **self._specular_by_name(node, scope)})

    def _principled(self, node: Any, scope: Scope | None) -> Surface:
        inputs, values = node.inputs, self._values
        alpha = values.read(inputs["Alpha"], scope)
        surface = Surface(
            values.read(inputs["Base Color"], scope),
            alpha=WHOLE if alpha.is_guess else alpha,
            specular={
                "metallic": values.number(inputs["Metallic"], 0.0, scope),
                "roughness": values.number(inputs["Roughness"], 0.5, scope),
                "reflectance": self._reflectance(inputs["IOR"], scope)
                * (2.0 * values.number(inputs["Specular IOR Level"], 0.5, scope)),
                "transmission": values.number(inputs["Transmission Weight"], 0.0, scope),
            },
        )
        return self._emission(surface, inputs["Emission Color"], inputs["Emission Strength"], scope)

    def _emission(self, surface: Surface, color: Any, strength: Any, scope: Scope | None) -> Surface:
        """The surface with light of its own; a strength that cannot be known is none."""
        if not strength.is_linked and not strength.default_value:
            return surface
        bright = self._values.read(strength, scope)
        if bright.is_guess or (bright.texture is None and not bright.color[0]):
            return surface
        emitted = self._values.read(color, scope)
        if bright.texture is None:
            return replace(surface, emission=emitted, brightness=float(bright.color[0]))
        return replace(
            surface, emission=self._values.combine(lambda one, other: one * other, [emitted, bright], "emission")
        )

    def _specular_by_name(self, node: Any, scope: Scope | None) -> dict[str, float]:
        """What of a surface a simple shader node adds to its colour."""
        number = self._values.number
        if node.type in {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"}:
            return {"metallic": 1.0, "roughness": number(node.inputs["Roughness"], 0.5, scope)}
        if node.type == "BSDF_GLASS":
            roughness = number(node.inputs["Roughness"], 0.0, scope)
            reflectance = self._reflectance(node.inputs["IOR"], scope)
            return {"roughness": roughness, "reflectance": reflectance, "transmission": 1.0}
        return {"transmission": 1.0} if node.type == "BSDF_REFRACTION" else {}

    def _reflectance(self, ior_socket: Any, scope: Scope | None) -> float:
        """What a surface of this index of refraction mirrors of what comes from straight above."""
        ior = self._values.number(ior_socket, 1.5, scope)
        return ((ior - 1.0) / (ior + 1.0)) ** 2 if ior > -1.0 else 0.0

    def _radiance(self, surface: Surface) -> Value:
        if surface.brightness == 1.0:
            return surface.emission
        scale = np.float32(surface.brightness)
        return self._values.combine(lambda color: color * scale, [surface.emission], ("times", surface.brightness))

    def _mix(self, first: Surface, second: Surface, factor: Value) -> Surface:
        """By alpha the colours count: a transparent share adds nothing but its transparency."""
        values = self._values
        if factor.is_guess:
            factor = constant(0.5)
        share = float(np.clip(values.mean(factor)[0], 0.0, 1.0))
        alpha = values.combine(_lerp, [factor, first.alpha, second.alpha], "mix")
        weights = (1.0 - share) * values.mean(first.alpha)[0], share * values.mean(second.alpha)[0]
        emission = self._lerp_emission(first, second, factor)
        if not weights[0] or not weights[1]:
            # Its colour counts wherever it is: not what alpha's mask would leave of it.
            only = second if weights[1] else first
            return replace(only, emission=emission, brightness=1.0, alpha=alpha)
        second_share = float(weights[1] / (weights[0] + weights[1]))
        by = factor if first.alpha is WHOLE and second.alpha is WHOLE else constant(second_share)
        specular = {
            name: first.specular[name] * (1.0 - second_share) + second.specular[name] * second_share for name in DIFFUSE
        }
        holdout = first.holdout * (1.0 - second_share) + second.holdout * second_share
        base = values.combine(_lerp, [by, first.base, second.base], "mix")
        return Surface(base, emission, 1.0, alpha, specular, holdout)

    def _lerp_emission(self, first: Surface, second: Surface, factor: Value) -> Value:
        emissions = self._radiance(first), self._radiance(second)
        if all(emitted.texture is None and not emitted.color[:3].any() for emitted in emissions):
            return BLACK
        return self._values.combine(_lerp, [factor, *emissions], "mix")

    def _add(self, first: Surface, second: Surface) -> Surface:
        if first.holdout + second.holdout >= 1.0:
            return Surface(BLACK, holdout=1.0)
        emissions = self._radiance(first), self._radiance(second)
        emission = self._values.combine(lambda one, other: one + other, emissions, "add")
        brightest = max((first, second), key=lambda surface: float(self._values.mean(surface.base)[:3].sum()))
        return replace(brightest, emission=emission, brightness=1.0, holdout=first.holdout + second.holdout)


def _lerp(share: Pixels, one: Pixels, other: Pixels) -> Pixels:
    part = np.clip(share, 0.0, 1.0)
    return one * (1.0 - part) + other * part
