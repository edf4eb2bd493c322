"""The values of sockets: a constant, or the output of a program of nodes at each point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from perfect_bvh.nodes import NodeBuilder, Operand, Output, channels_of, width_of

Pixels = npt.NDArray[np.float32]

_XYZ_TO_REC709 = np.array([(3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)])


@dataclass(frozen=True, slots=True)
class Value:
    """operand: a number, or three channels. is_guess: whether it only replaces an unknown value."""

    operand: Operand
    is_guess: bool = False

    @property
    def is_even(self) -> bool:
        """Whether it is the same everywhere."""
        return not isinstance(self.operand, Output)


def constant(*channels: float) -> Value:
    """Make a constant of one number, or of three or more channels, the first three of which count."""
    return Value(float(channels[0]) if len(channels) == 1 else tuple([float(channel) for channel in channels[:3]]))


def is_number(operand: Operand, number: float) -> bool:
    """Whether an operand is this number everywhere, in each channel."""
    if isinstance(operand, Output):
        return False
    return all(channel == number for channel in (operand if isinstance(operand, tuple) else (operand,)))


class Nodes(NodeBuilder):
    """Instructions of one material, with arithmetic that leaves out what changes nothing."""

    def plus(self, one: Operand, other: Operand) -> Operand:
        if is_number(one, 0.0) and width_of(one) <= width_of(other):
            return other
        return one if is_number(other, 0.0) and width_of(other) <= width_of(one) else self._work("ADD", one, other)

    def minus(self, one: Operand, other: Operand) -> Operand:
        return one if is_number(other, 0.0) and width_of(other) == 1 else self._work("SUBTRACT", one, other)

    def times(self, one: Operand, other: Operand) -> Operand:
        if is_number(one, 1.0) and width_of(one) <= width_of(other):
            return other
        if is_number(other, 1.0) and width_of(other) <= width_of(one):
            return one
        if is_number(one, 0.0) or is_number(other, 0.0):
            return 0.0 if max(width_of(one), width_of(other)) == 1 else (0.0, 0.0, 0.0)
        return self._work("MULTIPLY", one, other)

    def over(self, one: Operand, other: Operand) -> Operand:
        """One by the other; 0 where that is 0."""
        return one if is_number(other, 1.0) and width_of(other) == 1 else self._work("DIVIDE", one, other)

    def less(self, whole: float, part: Operand) -> Operand:
        """Subtract from a number."""
        return whole - part if isinstance(part, float) else self.minus(whole, part)

    def clamp(self, operand: Operand, least: float = 0.0, most: float = 1.0) -> Operand:
        if width_of(operand) == 1:
            return self.add("math", operand, least, most, mode="CLAMP")
        above = self.add("vector_math", operand, least, 0.0, 0.0, mode="MAXIMUM")
        return self.add("vector_math", above, most, 0.0, 0.0, mode="MINIMUM")

    def mix(self, share: Operand, one: Operand, other: Operand, mode: str = "MIX") -> Operand:
        """Blend two values; `share` is not clamped."""
        if mode == "MIX" and (is_number(share, 0.0) or one == other):
            return one
        if mode == "MIX" and is_number(share, 1.0):
            return other
        mixed = self.add("mix", share, one, other, mode=mode)
        return channels_of(mixed, 0) if max(width_of(one), width_of(other), width_of(share)) == 1 else mixed

    def weighted(
        self, weights: tuple[Operand, Operand], values: tuple[Operand, Operand], otherwise: Operand
    ) -> Operand:
        """The mean of two values by weights of 0 or more; by the share `otherwise` of the second where both are 0."""
        if is_number(weights[0], 0.0) and is_number(weights[1], 0.0):
            return self.mix(otherwise, *values)
        if values[0] == values[1] or is_number(weights[1], 0.0):
            return values[0]
        if is_number(weights[0], 0.0):
            return values[1]
        whole = self.plus(*weights)
        share = self.over(weights[1], whole)
        if isinstance(whole, Output):
            is_none = self.add("math", whole, 1e-12, 0.0, mode="LESS_THAN")
            share = self.mix(is_none, share, otherwise)
        return self.mix(share, *values)

    def _work(self, mode: str, one: Operand, other: Operand) -> Operand:
        if width_of(one) == width_of(other) == 1:
            return self.add("math", one, other, 0.0, mode=mode)
        return self.add("vector_math", one, other, 0.0, 0.0, mode=mode)


class ImageRows(Protocol):
    """Gives images their rows, and averages the values of nodes."""

    def row(self, image: Any, extension: str, interpolation: str) -> int: ...

    def has_alpha(self, image: Any, row: int) -> bool: ...

    def mean(self, nodes: Nodes, value: Value) -> tuple[float, ...]: ...


# Light ---------------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def observer() -> npt.NDArray[np.float64]:
    """(81, 3): how the eye's three curves (CIE 1931) weigh light, from 380 to 780 nanometres in steps of 5."""
    found: npt.NDArray[np.float64] = np.load(Path(__file__).with_name("cie_1931.npy")) / 1e4
    return found


def xyz_to_rgb(xyz: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(..., 3): scene-linear Rec.709; negative outside of it."""
    return xyz @ _XYZ_TO_REC709.T


COLDEST, HOTTEST = 800.0, 12000.0  # black bodies beyond these have their colours, as in Cycles


def blackbody(kelvins: npt.NDArray[np.float64] | float) -> npt.NDArray[np.float64]:
    """(..., 3): the colours of black bodies, of luminance one, by Planck's law; negative outside of Rec.709."""
    waves = np.arange(380.0, 781.0, 5.0)
    clipped = np.clip(kelvins, COLDEST, HOTTEST)[..., None]
    tristimulus = waves**-5.0 / np.expm1(1.4388e7 / (waves * clipped)) @ observer()
    return xyz_to_rgb(tristimulus / tristimulus[..., 1:2])


# Instances -----------------------------------------------------------------------------------------------------------

# What nodes may ask of the instance that is seen.
Kind = Literal["random", "color", "alpha", "object_index", "location", "object", "instancer"]


class Source(NamedTuple):
    """Something that each instance has: kind "object" and "instancer" are attributes of that name."""

    kind: Kind
    name: str = ""

    @property
    def stand_in(self) -> tuple[float, ...]:
        """The value if no instance is known: products with it do not vanish."""
        return (0.5 if self.kind == "random" else 1.0,) * 4


RANDOM = Source("random")

# Returns (N, 4): the values of a source for each of the instances in question.
AskInstances = Callable[[Source], Pixels]

# The outputs of the node Object Info.
OBJECT_INFO: dict[str, Source] = {
    "Random": RANDOM,
    "Color": Source("color"),
    "Alpha": Source("alpha"),
    "Object Index": Source("object_index"),
    "Location": Source("location"),
}
ATTRIBUTE_KINDS: dict[str, Kind] = {"OBJECT": "object", "INSTANCER": "instancer"}
