"""What of a surface mirrors, refracts, or lets light through diffuse: shares of it, which mixes of shaders combine.

A surface is split into shares that add up to one: metal, then of the rest what is clear, then of the rest what is
translucent; what remains is diffuse under a dielectric reflection, as in Blender's Principled BSDF.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

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
