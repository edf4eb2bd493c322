"""The result of a material's nodes: base colour, emission, alpha, roughness and lobes.

Properties that are the same everywhere are numbers or colours; the others are instructions of the material's program.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from perfect_bvh.nodes import Operand

from ...sync.look_records import HairRecord
from . import node_maths, node_places, node_textures  # noqa: F401 what reads the nodes of values
from .finishes import FinishReader, walked
from .lobes import DIFFUSE, HairReader, Lobes, Part, add_thin, fixed, mix_parts, sum_hair
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
from .values import ImageRows, Nodes, Source, Value, constant, is_number
from .volumes import NO_ABSORPTION, read_absorption

BLACK: Operand = (0.0, 0.0, 0.0)

LEAST_IOR = 1e-5
_DEEPEST = 64
_COLOR_INPUTS = ("Base Color", "Color")


@dataclass(frozen=True, slots=True)
class Surface:
    """base, emission: colours; emission is the radiance of the opaque part. alpha: 0 to 1.

    lobes: the shares that mirror, refract and transmit. normal: None for the mesh's. hair: the shading of
    curves. holdout: the share of the opaque part that cuts a hole
    into the image; a number for the whole surface. has_volume: it is only the border of a volume, and is invisible.
    absorption: of light inside the mesh, by length.
    """

    base: Operand
    emission: Operand = BLACK
    alpha: Operand = 1.0
    lobes: Lobes = DIFFUSE
    normal: Operand | None = None
    hair: HairRecord | None = None
    holdout: float = 0.0
    has_volume: bool = False
    absorption: tuple[float, float, float] = (0.0, 0.0, 0.0)


_FIXED_SURFACES = {"BSDF_TRANSPARENT": Surface(BLACK, alpha=0.0), "HOLDOUT": Surface(BLACK, holdout=1.0)}


@dataclass(frozen=True, slots=True)
class ReadSurface:
    """A surface, and the reader whose instructions it is made of."""

    surface: Surface
    values: ValueReader


def read_surface(
    material: Any, images: ImageRows, omissions: Omissions, sources: dict[Source, int] | None = None
) -> ReadSurface:
    """Read the surface of an evaluated `bpy.types.Material`. omissions: takes what of its nodes is not shown.

    sources: takes what its nodes ask of instances, with its row among the instances' values.
    """
    red, green, blue, _ = material.diffuse_color
    plain = constant(red, green, blue)
    values = ValueReader(images, plain, omissions, pass_index=material.pass_index, sources=sources)
    return ReadSurface(_read(material, plain, values, omissions), values)


def _read(material: Any, plain: Value, values: ValueReader, omissions: Omissions) -> Surface:
    tree = material.node_tree if USES_NODES or material.use_nodes else None
    if tree is None:
        return Surface(plain.operand)
    found = find_output(tree)
    if found is None:
        omissions.note_no_output("black is used")
        return Surface(BLACK)
    output, scope = found
    inputs = output.inputs
    has_surface = is_fed(inputs["Surface"], scope)
    absorption = NO_ABSORPTION
    if is_fed(inputs["Volume"], scope):
        if not has_surface:
            _note_source(inputs["Volume"], scope, omissions, "nothing is shown")
            return Surface(BLACK, alpha=0.0, has_volume=True)  # fog has no surface
        absorption = read_absorption(values, inputs["Volume"], scope)
    if is_fed(inputs["Displacement"], scope):
        _note_source(inputs["Displacement"], scope, omissions, "the mesh is shown without it")
    return replace(_SurfaceReader(plain.operand, values).follow(inputs["Surface"], scope, 0), absorption=absorption)


def _note_source(socket: Any, scope: Scope | None, omissions: Omissions, instead: str) -> None:
    """Note the unsupported nodes that are linked to a socket."""
    output, _ = trace_back(socket, scope)
    omissions.note_node(output.node, output, instead)


class _SurfaceReader:
    def __init__(self, plain: Operand, values: ValueReader) -> None:
        self._plain = plain
        self._values = values
        self._nodes: Nodes = values.nodes
        self._omissions = values.omissions
        self._finishes = FinishReader(values)

    def follow(self, socket: Any, scope: Scope | None, depth: int) -> Surface:
        """Read the surface of a shader socket."""
        output, source_scope = trace_back(socket, scope, self._omissions.note_foreign)
        if not output.is_output or output.node.type in GROUPS or depth > _DEEPEST:  # an empty group
            return Surface(BLACK)
        if output.type != "SHADER":  # a colour shines
            return Surface(BLACK, emission=_as_color(self._values.read(socket, scope).operand))
        return self._shader(output.node, source_scope, depth)

    def _shader(self, node: Any, scope: Scope | None, depth: int) -> Surface:
        """Read a shader node."""
        if node.type == "MIX_SHADER":
            factor = self._nodes.clamp(self._values.read_or(constant(0.5), HALF, node.inputs[0], scope).operand)
            for side in (0, 1):
                if is_number(factor, float(side)):  # the other side is invisible
                    return self.follow(node.inputs[1 + side], scope, depth + 1)
            return self._mix(*(self.follow(node.inputs[index], scope, depth + 1) for index in (1, 2)), factor)
        if node.type == "ADD_SHADER":
            return self._add(*(self.follow(socket, scope, depth + 1) for socket in node.inputs))
        inputs = inputs_of(node) if node.type in IGNORED_INPUTS else {}
        self._omissions.note_ignored(node.type, inputs, scope)
        if node.type in _FIXED_SURFACES:
            return _FIXED_SURFACES[node.type]
        if node.type == "EMISSION":
            return Surface(BLACK, self._emission(node.inputs["Color"], node.inputs["Strength"], scope))
        if node.type == "BSDF_PRINCIPLED":
            return self._principled(node, scope)
        if node.type == "BSDF_HAIR_PRINCIPLED":
            base, hair = HairReader(self._values).read(node, scope)
            return Surface(_as_color(base.operand), hair=hair)
        if node.type not in SHOWN_NODES:
            self._omissions.note_shader(node, SIMPLIFIED_NODES.get(node.type, DIFFUSE_SURFACE))
        base = self._color(node, scope)
        diffuse = BLACK if node.type == "BSDF_SHEEN" else base
        return Surface(diffuse, lobes=self._lobes_by_name(node, base, scope), normal=self._normal(node, scope))

    def _color(self, node: Any, scope: Scope | None) -> Operand:
        """Read a simple shader's colour."""
        sockets = (node.inputs[name] for name in _COLOR_INPUTS if name in node.inputs)
        socket = next((socket for socket in sockets if socket.enabled), None)
        base = self._plain if socket is None else _as_color(self._values.read(socket, scope).operand)
        if node.type == "SUBSURFACE_SCATTERING":
            return walked(self._values, base, node.falloff, inputs_of(node)["Anisotropy"], scope)
        return base

    def _principled(self, node: Any, scope: Scope | None) -> Surface:
        values, inputs, nodes = self._values, inputs_of(node), self._nodes
        level = self._least(values.number(inputs["Specular IOR Level"], 0.5, scope), 0.0)
        base = _as_color(values.read(inputs["Base Color"], scope).operand)
        below, kept = self._subsurface(node, inputs, base, scope)
        return Surface(
            below,
            self._emission(inputs["Emission Color"], inputs["Emission Strength"], scope),
            nodes.clamp(values.read_or(constant(1.0), "an opaque surface is used", inputs["Alpha"], scope).operand),
            Lobes(
                metallic=self._share(inputs["Metallic"], 0.0, scope),
                **self._facets(node, 0.5, scope),
                reflectance=nodes.times(self._reflectance(inputs["IOR"], scope), nodes.times(level, 2.0)),
                transmission=self._share(inputs["Transmission Weight"], 0.0, scope),
                ior=self._ior(inputs["IOR"], scope),
                specular_tint=self._tint(inputs["Specular Tint"], scope),
                finish=self._finishes.principled(node, inputs, scope),
                **kept,
            ),
            self._normal(node, scope),
        )

    def _subsurface(
        self, node: Any, inputs: dict[str, Any], base: Operand, scope: Scope | None
    ) -> tuple[Operand, dict[str, Operand]]:
        """Read the colour of the diffuse part, and the colours of lobes that keep the base colour."""
        weight = self._share(inputs["Subsurface Weight"], 0.0, scope)
        if is_number(weight, 0.0):
            return base, {}
        color = walked(self._values, base, node.subsurface_method, inputs["Subsurface Anisotropy"], scope)
        tint = self._nodes.add("vector_math", base, 0.5, 0.0, 0.0, mode="POWER")
        return self._nodes.mix(weight, base, color), {"metal": base, "tint": tint}

    def _normal(self, node: Any, scope: Scope | None) -> Operand | None:
        socket = node.inputs.get("Normal")
        return self._values.normal(socket, scope) if socket is not None and is_fed(socket, scope) else None

    def _emission(self, color: Any, strength: Any, scope: Scope | None) -> Operand:
        """Read the emission; an unknown strength counts as 0."""
        if not strength.is_linked and not strength.default_value:
            return BLACK
        bright = self._values.read_or(constant(0.0), "no emission is used", strength, scope).operand
        if is_number(bright, 0.0):
            return BLACK
        return self._nodes.times(_as_color(self._values.read(color, scope).operand), bright)

    def _lobes_by_name(self, node: Any, base: Operand, scope: Scope | None) -> Lobes:
        """Read the lobes of a simple shader node."""
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
                tint=base,
            )
        if node.type == "BSDF_TRANSLUCENT" or (node.type == "BSDF_HAIR" and node.component == "Transmission"):
            return Lobes(translucency=1.0, translucent=base)
        if node.type == "BSDF_SHEEN":
            return Lobes(finish=self._finishes.of_sheen(node, base, scope))
        return Lobes(finish=self._finishes.of_diffuse(node, scope)) if node.type == "BSDF_DIFFUSE" else DIFFUSE

    def _facets(self, node: Any, unknown: float, scope: Scope | None) -> dict[str, Any]:
        """Roughness, losses and finish of facets: those of Multiscatter GGX alone lose no light."""
        roughness = self._share(node.inputs["Roughness"], unknown, scope)
        fields: dict[str, Any] = {"roughness": roughness, "lossy_facets": float(node.distribution != "MULTI_GGX")}
        if node.type != "BSDF_PRINCIPLED":
            fields["finish"] = self._finishes.of_facets(node, scope)
        return fields

    def _share(self, socket: Any, unknown: float, scope: Scope | None) -> Operand:
        """Read a number and clamp it to 0 to 1."""
        return self._nodes.clamp(self._values.number(socket, unknown, scope))

    def _least(self, number: Operand, least: float) -> Operand:
        return (
            max(number, least)
            if isinstance(number, float)
            else self._nodes.add("math", number, least, 0.0, mode="MAXIMUM")
        )

    def _tint(self, socket: Any, scope: Scope | None) -> Operand:
        """Read a colour, white where it cannot be known."""
        white = constant(1.0, 1.0, 1.0)
        return _as_color(self._values.read_or(white, f"{socket.name} white is used", socket, scope).operand)

    def _ior(self, socket: Any, scope: Scope | None) -> Operand:
        return self._least(self._values.number(socket, 1.5, scope), LEAST_IOR)

    def _reflectance(self, ior_socket: Any, scope: Scope | None) -> Operand:
        """Return the reflectance, seen from straight above, of a surface of this index of refraction."""
        nodes, ior = self._nodes, self._ior(ior_socket, scope)
        if isinstance(ior, float):
            return ((ior - 1.0) / (ior + 1.0)) ** 2
        ratio = nodes.over(nodes.minus(ior, 1.0), nodes.plus(ior, 1.0))
        return nodes.times(ratio, ratio)

    def _mean(self, number: Operand) -> float:
        return self._values.overall(Value(number))[0]

    def _mix(self, first: Surface, second: Surface, factor: Operand) -> Surface:
        """Mix two surfaces. Colours are weighted by alpha: a transparent share adds only its transparency."""
        nodes = self._nodes
        amounts = nodes.times(nodes.less(1.0, factor), first.alpha), nodes.times(factor, second.alpha)
        alpha = nodes.plus(*amounts)
        if is_number(amounts[0], 0.0) or is_number(amounts[1], 0.0):
            return replace(first if is_number(amounts[1], 0.0) else second, alpha=alpha)
        weight = (
            factor if is_number(first.alpha, 1.0) and is_number(second.alpha, 1.0) else nodes.over(amounts[1], alpha)
        )
        share = self._mean(weight)
        base, lobes = mix_parts(nodes, *self._parts(first, second, weight), share)
        normal = first.normal
        if first.normal is not second.normal:
            normals = [
                self._values.input("NORMAL").operand if each.normal is None else each.normal for each in (first, second)
            ]
            normal = nodes.mix(weight, *normals)
        return Surface(
            base,
            nodes.mix(weight, first.emission, second.emission),
            alpha,
            lobes,
            normal,
            self._sum_hair((first, 1.0 - share), (second, share), base=base),
            first.holdout * (1.0 - share) + second.holdout * share,
        )

    def _parts(self, first: Surface, second: Surface, weight: Operand) -> tuple[Part, Part]:
        """Return the weights of both in everything but hair."""
        nodes = self._nodes
        whole = [1.0 if surface.hair is None else surface.hair.surface for surface in (first, second)]
        if whole != [1.0, 1.0] and any(whole):
            amounts = nodes.times(nodes.less(1.0, weight), whole[0]), nodes.times(weight, whole[1])
            weight = nodes.over(amounts[1], nodes.plus(*amounts))
        return Part(first.lobes, nodes.less(1.0, weight), first.base), Part(second.lobes, weight, second.base)

    def _sum_hair(self, *parts: tuple[Surface, float], base: Operand) -> HairRecord | None:
        """Sum up hair on a surface of this base colour; the base colours of other hair count by their means."""
        rows = []
        for surface, weight in parts:
            hair = surface.hair
            if hair is not None and hair.colored and surface.base != base:
                self._omissions.note("the changing colour of hair that is mixed with other colours", "its mean is used")
                hair = fixed(hair, self._values.overall(Value(surface.base)))
            rows.append((hair, weight))
        return sum_hair(rows)

    def _add(self, first: Surface, second: Surface) -> Surface:
        if first.holdout + second.holdout >= 1.0:
            return Surface(BLACK, holdout=1.0)
        nodes = self._nodes
        kept, other = sorted((first, second), key=self._brightness, reverse=True)
        is_thin = is_number(kept.lobes.translucency, 1.0), is_number(other.lobes.translucency, 1.0)
        if is_thin == (True, False) and self._brightness(other):
            kept, other = other, kept
        lobes = add_thin(nodes, kept.lobes, other.lobes)
        emission = nodes.plus(first.emission, second.emission)
        hair = self._sum_hair((first, 1.0), (second, 1.0), base=kept.base)
        return replace(kept, emission=emission, holdout=first.holdout + second.holdout, lobes=lobes, hair=hair)

    def _brightness(self, surface: Surface) -> float:
        return sum(self._values.overall(Value(surface.base)))


def _as_color(operand: Operand) -> Operand:
    """Three channels of what may be a number."""
    return (operand,) * 3 if isinstance(operand, float) else operand
