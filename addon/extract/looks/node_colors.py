"""What a material's nodes come to, roughly: a base colour, its own light, how much of it is there, how shiny it is.

Only what a preview shows is followed. What a procedural texture would give is taken from the material's viewport
colour.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...sync.look_records import HairRecord
from .lobes import (
    DIFFUSE,
    Color,
    HairReader,
    Lobes,
    Part,
    Tint,
    add_translucent,
    averaged,
    base_share,
    fixed,
    mix_lobes,
    plain_number,
    sum_hair,
)
from .node_graph import DIFFUSE as DIFFUSE_SURFACE
from .node_graph import (
    GROUPS,
    IGNORED_INPUTS,
    SHOWN_NODES,
    SIMPLIFIED_NODES,
    USES_NODES,
    Omissions,
    Scope,
    find_output,
    inputs_of,
    is_fed,
    name_of,
    trace_back,
)
from .node_values import HALF, ValueReader
from .values import AskInstances, ImageMeans, Pixels, Source, Value, constant, same_value

BLACK = constant(0.0, 0.0, 0.0)
WHOLE = constant(1.0)
NOTHING = constant(0.0)

LEAST_IOR = 1e-5
_DEEPEST = 64
_COLOR_INPUTS = ("Base Color", "Color")


@dataclass(frozen=True, slots=True)
class Surface:
    """base, emission: colours; emission is radiance, of `brightness` times as much. alpha: 0 to 1.

    lobes: what of it mirrors, refracts and lets light through. hair: what curves of it are instead. holdout: of what is
    there, how much cuts a hole into the image; a number for all of the surface. has_volume: it is nothing but the
    border of one, and shows nothing.
    """

    base: Value
    emission: Value = BLACK
    brightness: float = 1.0
    alpha: Value = WHOLE
    lobes: Lobes = DIFFUSE
    hair: HairRecord | None = None
    holdout: float = 0.0
    has_volume: bool = False


_FIXED_SURFACES = {"BSDF_TRANSPARENT": Surface(BLACK, alpha=NOTHING), "HOLDOUT": Surface(BLACK, holdout=1.0)}


def read_surface(
    material: Any,
    images: ImageMeans,
    omissions: Omissions,
    instances: AskInstances | None = None,
    asked: set[Source] | None = None,
) -> Surface:
    """The surface of an evaluated `bpy.types.Material`. omissions: takes what of its nodes is not shown.

    instances: answers what its nodes ask of instances: then values, and numbers of lobes, may have a row for each.
    asked: takes these questions.
    """
    red, green, blue, _ = material.diffuse_color
    plain = constant(red, green, blue)
    tree = material.node_tree if USES_NODES or material.use_nodes else None
    if tree is None:
        return Surface(plain)
    found = find_output(tree)
    if found is None:
        omissions.note_no_output("black is")
        return Surface(BLACK)
    output, scope = found
    inputs = output.inputs
    has_surface = is_fed(inputs["Surface"], scope)
    if is_fed(inputs["Volume"], scope):
        _note_source(inputs["Volume"], scope, omissions, "its surface alone is" if has_surface else "nothing is")
        if not has_surface:
            return Surface(BLACK, alpha=NOTHING, has_volume=True)  # fog has no surface
    if is_fed(inputs["Displacement"], scope):
        _note_source(inputs["Displacement"], scope, omissions, "the mesh without it is")
    values = ValueReader(images, plain, omissions, pass_index=material.pass_index, instances=instances)
    surface = _SurfaceReader(plain, values).follow(inputs["Surface"], scope, 0)
    if asked is not None:
        asked |= values.asked
    return surface


def _note_source(socket: Any, scope: Scope | None, omissions: Omissions, instead: str) -> None:
    """What is linked to a socket that is not shown."""
    output, _ = trace_back(socket, scope)
    omissions.note_node(output.node, output, instead)


class _SurfaceReader:
    def __init__(self, plain: Value, values: ValueReader) -> None:
        self._plain = plain
        self._values = values
        self._omissions = values.omissions

    def follow(self, socket: Any, scope: Scope | None, depth: int) -> Surface:
        """What a shader socket gets."""
        output, source_scope = trace_back(socket, scope, self._omissions.note_foreign)
        if not output.is_output or output.node.type in GROUPS or depth > _DEEPEST:  # an empty group
            return Surface(BLACK)
        if output.type != "SHADER":  # a colour shines
            return Surface(BLACK, emission=self._values.without_tint(self._values.read(socket, scope)))
        return self._shader(output.node, source_scope, depth)

    def _shader(self, node: Any, scope: Scope | None, depth: int) -> Surface:
        """Read a shader node."""
        if node.type == "MIX_SHADER":
            factor = self._values.read_or(constant(0.5), HALF, node.inputs[0], scope)
            if factor.texture is None and factor.color[0] in (0.0, 1.0):  # of the other nothing is to be seen
                return self.follow(node.inputs[1 + int(factor.color[0])], scope, depth + 1)
            return self._mix(*(self.follow(node.inputs[index], scope, depth + 1) for index in (1, 2)), factor)
        if node.type == "ADD_SHADER":
            return self._add(*(self.follow(socket, scope, depth + 1) for socket in node.inputs))
        inputs = inputs_of(node) if node.type in IGNORED_INPUTS else {}
        self._omissions.note_ignored(node.type, inputs, scope)
        if node.type in _FIXED_SURFACES:
            return _FIXED_SURFACES[node.type]
        if node.type == "EMISSION":
            return self._emission(Surface(BLACK), node.inputs["Color"], node.inputs["Strength"], scope)
        if node.type == "BSDF_PRINCIPLED":
            return self._principled(node, scope)
        if node.type == "BSDF_HAIR_PRINCIPLED":
            base, hair = HairReader(self._values).read(node, scope)
            return Surface(base, hair=hair)
        if node.type not in SHOWN_NODES:
            self._omissions.note_node(node, instead=SIMPLIFIED_NODES.get(node.type, DIFFUSE_SURFACE))
        sockets = (node.inputs[name] for name in _COLOR_INPUTS if name in node.inputs)
        color = next((socket for socket in sockets if socket.enabled), None)
        base = self._plain if color is None else self._values.read(color, scope)
        return Surface(base, lobes=self._lobes_by_name(node, base, scope))

    def _principled(self, node: Any, scope: Scope | None) -> Surface:
        values, inputs = self._values, inputs_of(node)
        surface = Surface(
            values.read(inputs["Base Color"], scope),
            alpha=values.read_or(WHOLE, "all of the surface is", inputs["Alpha"], scope),
            lobes=Lobes(
                metallic=self._share(inputs["Metallic"], 0.0, scope),
                **self._facets(node, 0.5, scope),
                reflectance=self._reflectance(inputs["IOR"], scope)
                * (2.0 * np.maximum(values.number(inputs["Specular IOR Level"], 0.5, scope), 0.0)),
                transmission=self._share(inputs["Transmission Weight"], 0.0, scope),
                ior=self._ior(inputs["IOR"], scope),
                specular_tint=self._tint(inputs["Specular Tint"], scope),
            ),
        )
        return self._emission(surface, inputs["Emission Color"], inputs["Emission Strength"], scope)

    def _emission(self, surface: Surface, color: Any, strength: Any, scope: Scope | None) -> Surface:
        """The surface with light of its own; a strength that cannot be known is none."""
        if not strength.is_linked and not strength.default_value:
            return surface
        bright = self._values.read_or(NOTHING, "no light of its own is", strength, scope)
        if bright.texture is None and not bright.color.any():
            return surface
        emitted = self._values.without_tint(self._values.read(color, scope))
        if bright.is_even:
            return replace(surface, emission=emitted, brightness=float(bright.color[0]))
        return replace(
            surface, emission=self._values.combine(lambda one, other: one * other, [emitted, bright], "emission")
        )

    def _lobes_by_name(self, node: Any, base: Value, scope: Scope | None) -> Lobes:
        """What of a surface a simple shader node makes."""
        if node.type in {"BSDF_GLOSSY", "BSDF_ANISOTROPIC"}:
            return Lobes(metallic=1.0, **self._facets(node, 0.5, scope), even_metal=1.0)
        if node.type == "BSDF_METALLIC":
            if getattr(node, "fresnel_type", "F82") == "PHYSICAL_CONDUCTOR":  # without Base Color and Edge Tint
                self._omissions.note(f"the Fresnel type Physical Conductor of {name_of(node)}")
                return Lobes(metallic=1.0, **self._facets(node, 0.5, scope))
            edge = self._tint(node.inputs["Edge Tint"], scope)
            return Lobes(metallic=1.0, **self._facets(node, 0.5, scope), specular_tint=edge)
        if node.type in {"BSDF_GLASS", "BSDF_REFRACTION"}:
            is_plain = node.type == "BSDF_REFRACTION"
            return Lobes(
                **self._facets(node, 0.0, scope),
                reflectance=0.0 if is_plain else self._reflectance(node.inputs["IOR"], scope),
                transmission=1.0,
                ior=self._ior(node.inputs["IOR"], scope),
                tinted_glass=float(not is_plain),
                plain_refraction=float(is_plain),
                clear_tint=Tint(power=1.0),
            )
        if node.type == "BSDF_TRANSLUCENT" or (node.type == "BSDF_HAIR" and node.component == "Transmission"):
            red, green, blue = self._values.overall(base)[:3].tolist()
            tint = Tint((red, green, blue)) if base.is_even else Tint(power=1.0)
            return Lobes(translucency=1.0, translucent_tint=tint)
        return DIFFUSE

    def _facets(self, node: Any, unknown: float, scope: Scope | None) -> dict[str, Any]:
        """Roughness and losses of the nearest distribution that is shown, and a note if the node has another one."""
        roughness = self._share(node.inputs["Roughness"], unknown, scope)
        is_lossy = node.type == "BSDF_REFRACTION" or node.distribution in {"GGX", "ASHIKHMIN_SHIRLEY"}
        if node.distribution in {"BECKMANN", "ASHIKHMIN_SHIRLEY"} and np.any(roughness):
            name = node.distribution.replace("_", "-").title()
            nearest = "GGX is" if is_lossy else "Multiscatter GGX is"
            self._omissions.note(f"the distribution {name} of {name_of(node)}", nearest)
        return {"roughness": roughness, "lossy_facets": float(is_lossy)}

    def _share(self, socket: Any, unknown: float, scope: Scope | None) -> Any:
        """A number of 0 to 1 for all of the surface."""
        value = self._values.number(socket, unknown, scope)
        return plain_number(np.clip(np.where(np.isfinite(value), value, unknown), 0.0, 1.0))

    def _tint(self, socket: Any, scope: Scope | None) -> Color:
        """A colour for all of the surface; white where it cannot be known."""
        value = self._values.read_or(WHOLE, f"{socket.name} white is", socket, scope)
        if value.texture is not None:
            self._omissions.note(f"{value.texture.image.name} as {socket.name}", "its mean is")
        elif value.varies:
            self._omissions.note(f"{socket.name} of each instance", "one for all of them is")
        red, green, blue = np.clip(self._values.overall(value)[:3], 0.0, None).tolist()
        return red, green, blue

    def _ior(self, socket: Any, scope: Scope | None) -> Any:
        ior = self._values.number(socket, 1.5, scope)
        return plain_number(np.maximum(np.where(np.isfinite(ior), ior, 1.5), LEAST_IOR))

    def _reflectance(self, ior_socket: Any, scope: Scope | None) -> Any:
        """What a surface of this index of refraction mirrors of what comes from straight above."""
        ior = self._ior(ior_socket, scope)
        return ((ior - 1.0) / (ior + 1.0)) ** 2

    def _radiance(self, surface: Surface) -> Value:
        if surface.brightness == 1.0:
            return surface.emission
        scale = np.float32(surface.brightness)
        return self._values.combine(lambda color: color * scale, [surface.emission], ("times", surface.brightness))

    def _mix(self, first: Surface, second: Surface, factor: Value) -> Surface:
        """By alpha the colours count: a transparent share adds nothing but its transparency."""
        values = self._values
        share = float(np.clip(values.overall(factor)[0], 0.0, 1.0))
        alpha = values.combine(_lerp, [factor, first.alpha, second.alpha], "mix")
        weights = (1.0 - share) * values.overall(first.alpha)[0], share * values.overall(second.alpha)[0]
        emission = self._lerp_emission(first, second, factor)
        if not weights[0] or not weights[1]:
            # Its colour counts wherever it is: not what alpha's mask would leave of it.
            only = second if weights[1] else first
            return replace(only, emission=emission, brightness=1.0, alpha=alpha)
        second_share = float(weights[1] / (weights[0] + weights[1]))
        if factor.varies and first.lobes != second.lobes:
            self._omissions.note(
                "how much of each shader an instance has", "for reflections one share for all of them is"
            )
        lobe_share = _share_of_lobes(first, second, second_share)
        parts = self._part(first, 1.0 - lobe_share), self._part(second, lobe_share)
        base = self._mix_bases(first, second, factor, base_share(*parts), second_share)
        holdout = first.holdout * (1.0 - second_share) + second.holdout * second_share
        hair = self._sum_hair((first, 1.0 - second_share), (second, second_share), base=base)
        return Surface(base, emission, 1.0, alpha, mix_lobes(*parts, values.overall(base)), hair, holdout)

    def _sum_hair(self, *parts: tuple[Surface, float], base: Value) -> HairRecord | None:
        """On a surface of this base colour, the hair of which other base colours count by their means."""
        rows = []
        for surface, weight in parts:
            hair = surface.hair
            if hair is not None and hair.colored and not same_value(surface.base, base):
                self._omissions.note("the changing colour of hair that is mixed with other colours", "its mean is")
                hair = fixed(hair, self._values.overall(surface.base))
            rows.append((hair, weight))
        return sum_hair(rows)

    def _part(self, surface: Surface, weight: float) -> Part:
        return Part(averaged(surface.lobes), weight, self._values.overall(surface.base), not surface.base.is_even)

    def _mix_bases(
        self, first: Surface, second: Surface, factor: Value, base_share: float | None, second_share: float
    ) -> Value:
        if base_share is not None and base_share in {0.0, 1.0}:
            return second.base if base_share else first.base
        by = constant(second_share if base_share is None else base_share)
        if base_share is None and first.alpha is WHOLE and second.alpha is WHOLE:
            by = factor
        return self._values.combine(_lerp, [by, first.base, second.base], "mix")

    def _lerp_emission(self, first: Surface, second: Surface, factor: Value) -> Value:
        emissions = self._radiance(first), self._radiance(second)
        if all(emitted.texture is None and not emitted.color[..., :3].any() for emitted in emissions):
            return BLACK
        return self._values.combine(_lerp, [factor, *emissions], "mix")

    def _add(self, first: Surface, second: Surface) -> Surface:
        if first.holdout + second.holdout >= 1.0:
            return Surface(BLACK, holdout=1.0)
        emissions = self._radiance(first), self._radiance(second)
        emission = self._values.combine(lambda one, other: one + other, emissions, "add")
        kept, other = sorted((first, second), key=self._brightness, reverse=True)
        if kept.lobes.translucency == 1.0 > other.lobes.translucency and self._brightness(other):
            kept, other = other, kept
        lobes = kept.lobes
        if other.lobes.translucency == 1.0:
            lobes = add_translucent(lobes, self._values.overall(kept.base), self._part(other, 1.0))
        holdout = first.holdout + second.holdout
        hair = self._sum_hair((first, 1.0), (second, 1.0), base=kept.base)
        return replace(kept, emission=emission, brightness=1.0, holdout=holdout, lobes=lobes, hair=hair)

    def _brightness(self, surface: Surface) -> float:
        return float(self._values.overall(surface.base)[:3].sum())


def _share_of_lobes(first: Surface, second: Surface, second_share: float) -> float:
    """How much the second of a mix counts in what is no hair."""
    amounts = [
        weight * (1.0 if surface.hair is None else surface.hair.surface)
        for surface, weight in ((first, 1.0 - second_share), (second, second_share))
    ]
    return amounts[1] / sum(amounts) if sum(amounts) > 0.0 else second_share


def _lerp(share: Pixels, one: Pixels, other: Pixels) -> Pixels:
    part = np.clip(share, 0.0, 1.0)
    return one * (1.0 - part) + other * part
