"""The shares of a surface that mirror, refract, or transmit light diffusely; mixes of shaders combine them.

A surface is split into shares that add up to one: metal, then of the rest glass, then of the rest translucent; the
remainder is diffuse under a dielectric reflection, as in Blender's Principled BSDF. Each share, colour
and roughness may vary over the surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from perfect_bvh.nodes import Operand

from ...sync.look_records import HairRecord
from .finishes import NO_FINISH, Finish, add_sheen, mix_finishes
from .node_graph import Scope, inputs_of, is_fed
from .node_values import ValueReader
from .values import Nodes, Value, constant, is_number

Color = tuple[float, float, float]

WHITE_COLOR: Color = (1.0, 1.0, 1.0)
NO_COLOR: Color = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Lobes:
    """See `perfect_bvh.MaterialTable`, whose columns these are.

    even_metal: the share of the metal that reflects equally at all angles. tinted_glass, plain_refraction: the shares
    of the glass whose reflections are tinted, and that has no reflections. metal, tint, translucent: colours of metal,
    glass and the translucent share; None for the default from the base colour: the colour itself, its square root,
    none.
    """

    metallic: Operand = 0.0
    roughness: Operand = 1.0
    reflectance: Operand = 0.0
    transmission: Operand = 0.0
    translucency: Operand = 0.0
    ior: Operand = 1.5
    even_metal: float = 0.0
    tinted_glass: float = 0.0
    plain_refraction: float = 0.0
    lossy_facets: float = 0.0
    specular_tint: Operand = WHITE_COLOR
    metal: Operand | None = None
    tint: Operand | None = None
    translucent: Operand = NO_COLOR
    finish: Finish = NO_FINISH


DIFFUSE = Lobes()


class Shares(NamedTuple):
    """Shares of a whole surface."""

    metal: Operand
    clear: Operand
    translucent: Operand
    rest: Operand


class Part(NamedTuple):
    """One of those that are mixed. weight: both weights add up to one. base: its base colour."""

    lobes: Lobes
    weight: Operand
    base: Operand

    def shares(self, nodes: Nodes) -> Shares:
        """Return the fraction of each share in the mix."""
        lobes = self.lobes
        below_metal = nodes.times(self.weight, nodes.less(1.0, lobes.metallic))
        below_clear = nodes.times(below_metal, nodes.less(1.0, lobes.transmission))
        return Shares(
            nodes.times(self.weight, lobes.metallic),
            nodes.times(below_metal, lobes.transmission),
            nodes.times(below_clear, lobes.translucency),
            nodes.times(below_clear, nodes.less(1.0, lobes.translucency)),
        )

    def metal(self) -> Operand:
        return self.base if self.lobes.metal is None else self.lobes.metal

    def tint(self, nodes: Nodes) -> Operand:
        return (
            nodes.add("vector_math", self.base, 0.5, 0.0, 0.0, mode="POWER")
            if self.lobes.tint is None
            else self.lobes.tint
        )


def mix_parts(nodes: Nodes, first: Part, second: Part, constant_share: float) -> tuple[Operand, Lobes]:
    """Return the base colour and the lobes of a mix.

    constant_share: of the second part on average, for properties of which a material has only one number.
    """
    parts = first, second
    metals, clears, thins, rests = zip(*(part.shares(nodes) for part in parts), strict=True)
    weight = second.weight
    shiny = tuple(
        nodes.plus(nodes.plus(metals[row], clears[row]), nodes.times(rests[row], part.lobes.reflectance))
        for row, part in enumerate(parts)
    )
    dielectric = tuple(
        nodes.plus(clears[row], nodes.times(rests[row], part.lobes.reflectance)) for row, part in enumerate(parts)
    )
    clear, thin, rest = (nodes.plus(*both) for both in (clears, thins, rests))

    def mean(weights: Any, name: str, otherwise: Operand = weight) -> Operand:
        return nodes.weighted(weights, (getattr(first.lobes, name), getattr(second.lobes, name)), otherwise)

    def fixed(kind: str, name: str) -> float:
        """Mix a property that has only one number, by the average share of each part that is of that kind."""
        amounts = [
            _amount(part, kind) * share
            for part, share in zip(parts, (1.0 - constant_share, constant_share), strict=True)
        ]
        share = amounts[1] / sum(amounts) if sum(amounts) > 0.0 else constant_share
        return (1.0 - share) * getattr(first.lobes, name) + share * getattr(second.lobes, name)

    def has_none(weights: Any) -> bool:
        return is_number(nodes.plus(*weights), 0.0)

    base = nodes.weighted(rests, (first.base, second.base), weight)
    if is_number(rest, 0.0):  # nothing is diffuse: all is metal or glass
        base = nodes.weighted(clears if has_none(metals) else metals, (first.base, second.base), weight)
    return base, Lobes(
        metallic=nodes.plus(*metals),
        roughness=mean(shiny, "roughness"),
        reflectance=mean(rests, "reflectance", mean(clears, "reflectance")),
        transmission=nodes.over(clear, nodes.plus(clear, nodes.plus(thin, rest))),
        translucency=nodes.over(thin, nodes.plus(thin, rest)),
        ior=mean(dielectric, "ior"),
        even_metal=fixed("metal", "even_metal"),
        tinted_glass=fixed("clear", "tinted_glass"),
        plain_refraction=fixed("clear", "plain_refraction"),
        lossy_facets=fixed("bouncing", "lossy_facets"),
        specular_tint=mean(shiny, "specular_tint"),
        metal=None if has_none(metals) else nodes.weighted(metals, (first.metal(), second.metal()), weight),
        tint=None if has_none(clears) else nodes.weighted(clears, (first.tint(nodes), second.tint(nodes)), weight),
        # This one is no colour of a share, but of all of the surface.
        translucent=nodes.mix(weight, first.lobes.translucent, second.lobes.translucent),
        finish=mix_finishes(nodes, weight, [part.lobes.finish for part in parts], shiny, rests),
    )


def _amount(part: Part, kind: str) -> float:
    """Estimate the share of a part that is metal, glass, or has facets between which light may be lost."""
    metallic, transmission, reflectance = (
        operand if isinstance(operand, float) else 0.5
        for operand in (part.lobes.metallic, part.lobes.transmission, part.lobes.reflectance)
    )
    clear = (1.0 - metallic) * transmission
    if kind == "metal":
        return metallic
    # Without plain refractions, whose facets always lose light.
    bouncing = metallic + clear * (1.0 - part.lobes.plain_refraction) + (1.0 - metallic - clear) * reflectance
    return clear if kind == "clear" else bouncing


def add_thin(nodes: Nodes, lobes: Lobes, more: Lobes) -> Lobes:
    """Add what another surface lets through, and its sheen, to lobes."""
    translucent = lobes.translucent
    if is_number(more.translucency, 1.0):
        translucent = nodes.plus(translucent, more.translucent)
    return replace(lobes, translucent=translucent, finish=add_sheen(nodes, lobes.finish, more.finish))


# Hair ----------------------------------------------------------------------------------------------------------------
# What curves are made of where a material has a Principled Hair BSDF: a fiber, and a share of other surfaces.


LEAST_IOR = 1e-5
_LEAST_COLOR = 1e-5
_LEAST_LEFT = 1e-4
# What light is absorbed by these pigments, by their concentration (d'Eon et al. 2011).
_EUMELANIN, _PHEOMELANIN = np.array([0.506, 0.841, 1.653]), np.array([0.343, 0.733, 1.924])
# Of the fit by which fur looks about like a colour, in powers of the roughness around a fiber (Chiang et al. 2016).
_FIT = (0.245, 5.574, -10.73, 2.532, -0.215, 5.969)

# What else a record says of its fiber.
_OF_FIBER = ("absorption", "roughness", "coat", "tilt", "ior")


def absorption_of(color: npt.ArrayLike, radial_roughness: float) -> npt.NDArray[np.float64]:
    """(3,): the absorption by which fur looks about like the colour."""
    shares = np.maximum(np.asarray(color, np.float64)[:3], _LEAST_COLOR)
    return (np.log(shares) / np.polyval(_FIT, radial_roughness)) ** 2


def color_of(absorption: npt.ArrayLike, radial_roughness: float) -> npt.NDArray[np.float64]:
    """The other way round."""
    return np.exp(-np.sqrt(absorption) * np.polyval(_FIT, radial_roughness))


def absorption_of_melanin(amount: float, redness: float) -> npt.NDArray[np.float64]:
    """(3,). amount: 0 to 1, as Blender spreads concentrations out; redness: the share of pheomelanin."""
    concentration = -np.log(max(1.0 - amount, _LEAST_LEFT))
    return np.asarray(np.maximum(concentration * ((1.0 - redness) * _EUMELANIN + redness * _PHEOMELANIN), 0.0))


class HairReader:
    """Reads the hair shader: the colour that it comes to, and the record of what strands are."""

    def __init__(self, values: ValueReader) -> None:
        self._values = values
        self._omissions = values.omissions

    def read(self, node: Any, scope: Scope | None) -> tuple[Value, HairRecord]:
        inputs = inputs_of(node)
        roughness = radial = self._number(inputs["Roughness"], 0.3, scope)
        coat = 0.0
        if node.model == "HUANG":
            self._omissions.note("the model Huang of Principled Hair BSDF", "Chiang is used")
        else:
            radial = self._number(inputs["Radial Roughness"], 0.3, scope)
            coat = min(max(self._number(inputs["Coat"], 0.0, scope), 0.0), 1.0)
        base, absorption = self._colors(node, inputs, radial, scope)
        if is_fed(inputs["Random Roughness"], scope) or inputs["Random Roughness"].default_value:
            self._omissions.note("Random Roughness of hair", "one value for all strands is used")
        return base, HairRecord(
            fiber=1.0,
            absorption=_rgb(absorption),
            colored=not base.is_even,
            roughness=(roughness, radial),
            coat=coat,
            tilt=self._number(inputs["Offset"], 0.0, scope),
            ior=max(self._number(inputs["IOR"], 1.55, scope), LEAST_IOR),
        )

    def _colors(
        self, node: Any, inputs: Mapping[str, Any], radial: float, scope: Scope | None
    ) -> tuple[Value, npt.NDArray[np.float64]]:
        """Return the base colour, and the additional absorption if it varies over the surface."""
        if node.parametrization == "ABSORPTION":
            socket = inputs["Absorption Coefficient"]
            absorption = np.maximum(np.float64(self._even(socket, scope)[:3]), 0.0)
            return constant(*color_of(absorption, radial).tolist()), absorption
        if node.parametrization == "COLOR":
            base, pigments = self._values.read(inputs["Color"], scope), np.zeros(3)
        else:
            base = self._values.read(inputs["Tint"], scope)
            amount, redness = (self._number(inputs[name], 0.5, scope) for name in ("Melanin", "Melanin Redness"))
            pigments = absorption_of_melanin(amount, redness)
            if is_fed(inputs["Random Color"], scope) or inputs["Random Color"].default_value:
                self._omissions.note("Random Color of hair", "one value for all strands is used")
        if not base.is_even:
            return base, pigments
        absorption = pigments + absorption_of(self._values.overall(base), radial)
        return constant(*color_of(absorption, radial).tolist()), absorption

    def _number(self, socket: Any, unknown: float, scope: Scope | None) -> float:
        """One for all strands."""
        number = self._values.even_number(socket, unknown, scope)
        return number if np.isfinite(number) else unknown

    def _even(self, socket: Any, scope: Scope | None) -> npt.NDArray[Any]:
        value = self._values.read(socket, scope)
        if not value.is_even:
            self._omissions.note(f"varying {socket.name}", "its mean is used")
        return np.array(self._values.overall(value))


SURFACE_ALONE = HairRecord(surface=1.0)


def sum_hair(parts: Sequence[tuple[HairRecord | None, float]]) -> HairRecord | None:
    """Return the sum of weighted parts. None is an ordinary surface, and is the result if there is nothing else."""
    if all(hair is None for hair, _ in parts):
        return None
    rows = [(hair or SURFACE_ALONE, weight) for hair, weight in parts]
    fibers = [hair.fiber * weight for hair, weight in rows]
    return HairRecord(
        surface=sum(hair.surface * weight for hair, weight in rows),
        fiber=sum(fibers),
        colored=any(hair.colored for hair, _ in rows),
        **{name: _mean([getattr(hair, name) for hair, _ in rows], fibers) for name in _OF_FIBER},
    )


def _mean(values: Sequence[Any], amounts: Sequence[float]) -> Any:
    total = sum(amounts)
    weights = np.array(amounts) / total if total > 0.0 else np.full(len(amounts), 1.0 / len(amounts))
    mean = np.tensordot(weights, np.array(values, np.float64), 1)
    return tuple(mean.tolist()) if np.ndim(mean) else float(mean)


def fixed(hair: HairRecord, color: npt.NDArray[Any]) -> HairRecord:
    """Fix the base colour to this mean, instead of the material's."""
    if not hair.colored:
        return hair
    return replace(
        hair,
        colored=False,
        absorption=_rgb(hair.absorption + absorption_of(color, hair.roughness[1])),
    )


def _rgb(color: Any) -> Color:
    red, green, blue = (float(channel) for channel in np.clip(np.asarray(color)[:3], 0.0, None))
    return red, green, blue
