"""What curves are made of where a material has hair shaders: a fiber, lobes of the Hair BSDF, shares of all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...sync.records import HairRecord
from .lobes import Color
from .node_graph import Scope, inputs_of, is_fed
from .node_values import Value, ValueReader, constant

LEAST_IOR = 1e-5
_LEAST_COLOR = 1e-5
_LEAST_LEFT = 1e-4
# What light is absorbed by these pigments, by their concentration (d'Eon et al. 2011).
_EUMELANIN, _PHEOMELANIN = np.array([0.506, 0.841, 1.653]), np.array([0.343, 0.733, 1.924])
# Of the fit by which fur looks about like a colour, in powers of the roughness around a fiber (Chiang et al. 2016).
_FIT = (0.245, 5.574, -10.73, 2.532, -0.215, 5.969)

# Of the shares of a record, what else it says of each.
_BY_SHARE = {
    "fiber": ("absorption", "roughness", "coat", "tilt", "ior", "way", "lobes"),
    "reflection": ("reflection_roughness", "reflection_offset"),
    "transmission": ("transmission_roughness", "transmission_offset"),
}


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


def way_through(aspect_ratio: float) -> float:
    """The mean way through an ellipse of this ratio of its axes, the longer one 2, beside that through a circle."""
    flat = min(max(aspect_ratio, 0.0), 1.0 / max(aspect_ratio, 1e-3))
    bulge = ((1.0 - flat) / (1.0 + flat)) ** 2
    around = (1.0 + flat) / 2.0 * (1.0 + 3.0 * bulge / (10.0 + np.sqrt(4.0 - 3.0 * bulge)))  # Ramanujan's perimeter
    return float(flat / around)


class HairReader:
    """Reads the two hair shaders: the colour that they come to, and the record of what strands are."""

    def __init__(self, values: ValueReader) -> None:
        self._values = values
        self._omissions = values.omissions

    def read(self, node: Any, scope: Scope | None) -> tuple[Value, HairRecord]:
        inputs = inputs_of(node)
        return self._bsdf(node, inputs, scope) if node.type == "BSDF_HAIR" else self._principled(node, inputs, scope)

    def _bsdf(self, node: Any, inputs: Mapping[str, Any], scope: Scope | None) -> tuple[Value, HairRecord]:
        base = self._values.read(inputs["Color"], scope)
        roughness = self._number(inputs["RoughnessU"], 0.1, scope), self._number(inputs["RoughnessV"], 1.0, scope)
        name = node.component.lower()
        made = {
            name: _rgb(base.color) if base.is_even else (1.0, 1.0, 1.0),
            f"{name}_roughness": roughness,
            f"{name}_offset": -self._number(inputs["Offset"], 0.0, scope),
        }
        return base, HairRecord(colored=not base.is_even, **made)

    def _principled(self, node: Any, inputs: Mapping[str, Any], scope: Scope | None) -> tuple[Value, HairRecord]:
        is_huang = node.model == "HUANG"
        if is_huang:
            self._omissions.note("the model Huang of hair", "lobes of the model Chiang, fitted to it, are")
        roughness = self._number(inputs["Roughness"], 0.3, scope)
        radial = roughness if is_huang else self._number(inputs["Radial Roughness"], 0.3, scope)
        base, absorption = self._colors(node, inputs, radial, scope)
        lobes = [inputs[f"{name} lobe"] for name in ("R", "TT", "TRT")] if is_huang else []
        if is_fed(inputs["Random Roughness"], scope) or inputs["Random Roughness"].default_value:
            self._omissions.note("Random Roughness of hair", "one for all strands is")
        return base, HairRecord(
            fiber=1.0,
            model="huang" if is_huang else "chiang",
            absorption=_rgb(absorption),
            colored=not base.is_even,
            roughness=(roughness, radial),
            coat=0.0 if is_huang else min(max(self._number(inputs["Coat"], 0.0, scope), 0.0), 1.0),
            tilt=self._number(inputs["Offset"], 0.0, scope),
            ior=max(self._number(inputs["IOR"], 1.55, scope), LEAST_IOR),
            way=way_through(self._number(inputs["Aspect Ratio"], 0.85, scope)) if is_huang else 1.0,
            lobes=_rgb([self._number(socket, 1.0, scope) for socket in lobes]) if lobes else (1.0, 1.0, 1.0),
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
    amounts = {
        "fiber": [hair.fiber * weight for hair, weight in rows],
        "reflection": [sum(hair.reflection) * weight for hair, weight in rows],
        "transmission": [sum(hair.transmission) * weight for hair, weight in rows],
    }
    means = {
        name: _mean([getattr(hair, name) for hair, _ in rows], amounts[kind])
        for kind, names in _BY_SHARE.items()
        for name in names
    }
    sums = {name: _sum(rows, name) for name in ("surface", "fiber", "reflection", "transmission")}
    colored = any(hair.colored for hair, _ in rows)
    model = rows[int(np.argmax(amounts["fiber"]))][0].model
    return HairRecord(colored=colored, model=model, **means, **sums)


def _sum(rows: Sequence[tuple[HairRecord, float]], name: str) -> Any:
    return _plain(sum(np.multiply(getattr(hair, name), weight) for hair, weight in rows))


def _mean(values: Sequence[Any], amounts: Sequence[float]) -> Any:
    total = sum(amounts)
    weights = np.array(amounts) / total if total > 0.0 else np.full(len(amounts), 1.0 / len(amounts))
    return _plain(np.tensordot(weights, np.array(values, np.float64), 1))


def _plain(value: Any) -> Any:
    """A number or a tuple of numbers."""
    return tuple(value.tolist()) if np.ndim(value) else float(value)


def fixed(hair: HairRecord, color: npt.NDArray[Any]) -> HairRecord:
    """With the base colour of this mean, instead of the material's."""
    if not hair.colored:
        return hair
    return replace(
        hair,
        colored=False,
        absorption=_rgb(hair.absorption + absorption_of(color, hair.roughness[1])),
        reflection=_rgb(np.multiply(hair.reflection, color[:3])),
        transmission=_rgb(np.multiply(hair.transmission, color[:3])),
    )


def _rgb(color: Any) -> Color:
    red, green, blue = (float(channel) for channel in np.clip(np.asarray(color)[:3], 0.0, None))
    return red, green, blue
