"""What of a surface mirrors, refracts, or lets light through diffuse: shares of it, which mixes of shaders combine.

A surface is split into shares that add up to one: metal, then of the rest what is clear, then of the rest what is
translucent; what remains is diffuse under a dielectric reflection, as in Blender's Principled BSDF.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...sync.look_records import HairRecord
from .node_graph import Scope, inputs_of, is_fed
from .node_values import ValueReader
from .values import Value, constant

Color = tuple[float, float, float]

WHITE_COLOR: Color = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Tint:
    """The colour of a lobe: `color` times the base colour to the power of `power`, channel by channel."""

    color: Color = WHITE_COLOR
    power: float = 0.0

    def over(self, base: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
        """(3,): what it comes to over a base colour."""
        return np.asarray(self.color) * np.clip(np.float64(base[:3]), 0.0, None) ** self.power


class Shares(NamedTuple):
    """Of a whole surface."""

    metal: float
    clear: float
    translucent: float
    rest: float


@dataclass(frozen=True, slots=True)
class Lobes:
    """See `perfect_bvh.MaterialTable`, whose columns these are.

    even_metal: of the metal, how much mirrors alike at all angles. tinted_glass, plain_refraction: of what is clear,
    how much has its own tint on what it mirrors, too, and how much mirrors nothing.
    """

    metallic: float = 0.0
    roughness: float = 1.0
    reflectance: float = 0.0
    transmission: float = 0.0
    translucency: float = 0.0
    ior: float = 1.5
    even_metal: float = 0.0
    tinted_glass: float = 0.0
    plain_refraction: float = 0.0
    lossy_facets: float = 0.0
    specular_tint: Color = WHITE_COLOR
    metal_tint: Tint = Tint(power=1.0)
    clear_tint: Tint = Tint(power=0.5)
    translucent_tint: Tint = Tint((0.0, 0.0, 0.0))

    @property
    def shares(self) -> Shares:
        below_metal = 1.0 - self.metallic
        below_clear = below_metal * (1.0 - self.transmission)
        return Shares(
            metal=self.metallic,
            clear=below_metal * self.transmission,
            translucent=below_clear * self.translucency,
            rest=below_clear * (1.0 - self.translucency),
        )


DIFFUSE = Lobes()
# What may be another number for each instance.
LOBE_NUMBERS = ("metallic", "roughness", "reflectance", "transmission", "ior")


def averaged(lobes: Lobes) -> Lobes:
    """With one number each instead of one for each instance."""
    arrays = {name: getattr(lobes, name) for name in LOBE_NUMBERS if np.ndim(getattr(lobes, name))}
    return replace(lobes, **{name: float(np.mean(array)) for name, array in arrays.items()}) if arrays else lobes


def plain_number(value: Any) -> Any:
    """A float if it is a single number; arrays as they are."""
    return value if np.ndim(value) else float(value)


class Part(NamedTuple):
    """One of those that are mixed. weight: all weights add up to one. base: (4,), the mean of its base colour."""

    lobes: Lobes
    weight: float
    base: npt.NDArray[Any]
    varies: bool  # whether the base colour is not the same all over


def base_share(first: Part, second: Part) -> float | None:
    """How much the second's base colour counts in a mix, None for as much as the mix's own factor says.

    What is diffuse has the base colour alone, where anything is; metal and glass keep theirs in their tints.
    """
    one, other = first.lobes.shares, second.lobes.shares
    if one == other:
        return None
    for kind in ("rest", "metal", "clear"):
        weights = first.weight * getattr(one, kind), second.weight * getattr(other, kind)
        if any(weights):
            return _ratio(weights[1], weights[0])
    return second.weight


def mix_lobes(first: Part, second: Part, base: npt.NDArray[Any]) -> Lobes:
    """The lobes of a mix whose base colour has the mean `base`."""
    parts = first, second
    shares = [Shares(*(part.weight * share for share in part.lobes.shares)) for part in parts]
    metals, clears, thins, rests = (tuple(column) for column in zip(*shares, strict=True))
    metal, clear, thin, rest = sum(metals), sum(clears), sum(thins), sum(rests)
    reflecting = [rests[row] * part.lobes.reflectance for row, part in enumerate(parts)]
    dielectric = [clears[row] + reflecting[row] for row in range(2)]
    shiny = [metals[row] + dielectric[row] for row in range(2)]
    # Without plain refractions, whose facets always lose it.
    bouncing = [shiny[row] - clears[row] * part.lobes.plain_refraction for row, part in enumerate(parts)]

    def mean(name: str, *weights: Any) -> Any:
        """Of what all of the parts have, by the first of the weights that are not all zero."""
        counted = next((each for each in weights if sum(each) > 0.0), [part.weight for part in parts])
        values = np.array([getattr(part.lobes, name) for part in parts], np.float64)
        return np.tensordot(np.float64(counted) / sum(counted), values, 1)

    return Lobes(
        metallic=metal,
        roughness=float(mean("roughness", shiny)),
        reflectance=float(mean("reflectance", rests, clears)),
        transmission=_ratio(clear, thin + rest),
        translucency=_ratio(thin, rest),
        ior=float(mean("ior", dielectric)),
        even_metal=float(mean("even_metal", metals)),
        tinted_glass=float(mean("tinted_glass", clears)),
        plain_refraction=float(mean("plain_refraction", clears)),
        lossy_facets=float(mean("lossy_facets", bouncing)),
        specular_tint=_color(mean("specular_tint", shiny)),
        metal_tint=_mix_tints(parts, "metal_tint", metals, base),
        clear_tint=_mix_tints(parts, "clear_tint", clears, base),
        # This one is no colour of a share, but of all of the surface.
        translucent_tint=_mix_tints(parts, "translucent_tint", [part.weight for part in parts], base),
    )


def add_translucent(lobes: Lobes, base: npt.NDArray[Any], more: Part) -> Lobes:
    """Lobes with what another surface lets through beside them, on a base colour of the mean `base`."""
    color = lobes.translucent_tint.over(base) + more.lobes.translucent_tint.over(more.base)
    return replace(lobes, translucent_tint=Tint(_color(color)))


def _mix_tints(parts: tuple[Part, Part], name: str, weights: Any, base: npt.NDArray[Any]) -> Tint:
    """One tint for the shares of both parts: their mean over their own base colours, in terms of the new one."""
    tints: list[Tint] = [getattr(part.lobes, name) for part in parts]
    total = sum(weights)
    if total <= 0.0 or tints[0] == tints[1]:
        same_base = np.allclose(parts[0].base[:3], parts[1].base[:3]) or total <= 0.0
        if same_base or not tints[0].power or parts[0].lobes.shares == parts[1].lobes.shares:
            return tints[0]
    color = sum(weight / total * tint.over(part.base) for weight, tint, part in zip(weights, tints, parts, strict=True))
    power = max(
        (tint.power for tint, part, weight in zip(tints, parts, weights, strict=True) if part.varies and weight),
        default=0.0,
    )
    if not power:
        return Tint(_color(color))
    return Tint(_color(color / np.maximum(np.float64(base[:3]) ** power, 1e-3)), power)


def _ratio(part: float, others: float) -> float:
    """What share of the whole a part is."""
    return part / (part + others) if part > 0.0 else 0.0


def _color(values: Any) -> Color:
    red, green, blue = (float(value) for value in values)
    return red, green, blue


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
            self._omissions.note("the model Huang of Principled Hair BSDF", "Chiang is")
        else:
            radial = self._number(inputs["Radial Roughness"], 0.3, scope)
            coat = min(max(self._number(inputs["Coat"], 0.0, scope), 0.0), 1.0)
        base, absorption = self._colors(node, inputs, radial, scope)
        if is_fed(inputs["Random Roughness"], scope) or inputs["Random Roughness"].default_value:
            self._omissions.note("Random Roughness of hair", "one for all strands is")
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
        """The base colour, and what is absorbed beside what that says if it is not the same all over."""
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
                self._omissions.note("Random Color of hair", "one for all strands is")
        if not base.is_even:
            return base, pigments
        absorption = pigments + absorption_of(base.color, radial)
        return constant(*color_of(absorption, radial).tolist()), absorption

    def _number(self, socket: Any, unknown: float, scope: Scope | None) -> float:
        """One for all strands."""
        number = np.mean(self._values.number(socket, unknown, scope))
        if self._values.read(socket, scope).varies:
            self._omissions.note(f"{socket.name} of each instance", "one for all of them is")
        return float(number) if np.isfinite(number) else unknown

    def _even(self, socket: Any, scope: Scope | None) -> npt.NDArray[Any]:
        value = self._values.without_tint(self._values.read(socket, scope))
        if value.texture is not None:
            self._omissions.note(f"{value.texture.image.name} as {socket.name}", "its mean is")
        elif value.varies:
            self._omissions.note(f"{socket.name} of each instance", "one for all of them is")
        return self._values.overall(value)


SURFACE_ALONE = HairRecord(surface=1.0)


def sum_hair(parts: Sequence[tuple[HairRecord | None, float]]) -> HairRecord | None:
    """So much of each; None stands for an ordinary surface alone, and is the sum if there is nothing else."""
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
    """With the base colour of this mean, instead of the material's."""
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
