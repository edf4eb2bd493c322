"""What a socket may come to: one colour, the pixels of one image, or another value for each instance that is seen."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ...sync.look_records import Extension, UvTransform

# What nodes do to colours and numbers, on arrays whose last axis holds the channels; scene-linear throughout.


Pixels = npt.NDArray[np.float32]

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_XYZ_TO_REC709 = np.array([(3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)])


def clamp(values: Pixels) -> Pixels:
    return np.clip(values, 0.0, 1.0)


def grey(color: Pixels) -> Pixels:
    """The luminance, in each channel."""
    return (color[..., :3] @ _LUMINANCE)[..., None].repeat(4, axis=-1)


def average(vector: Pixels) -> Pixels:
    """The mean of three channels, in each: what a vector is as a number."""
    return vector[..., :3].mean(axis=-1, keepdims=True).repeat(4, axis=-1)


def _by_alpha(blended: Callable[[Pixels, Pixels], Pixels]) -> Callable[[Pixels, Pixels, Pixels], Pixels]:
    """A blend mode: so much of what `blended` makes of both, the rest is the first."""

    def work(share: Pixels, one: Pixels, other: Pixels) -> Pixels:
        return one + (blended(one, other) - one) * share

    return work


def _overlay(one: Pixels, other: Pixels) -> Pixels:
    return np.where(one < 0.5, 2.0 * one * other, 1.0 - 2.0 * (1.0 - one) * (1.0 - other))


def _soft_light(one: Pixels, other: Pixels) -> Pixels:
    return (1.0 - one) * other * one + one * (1.0 - (1.0 - other) * (1.0 - one))


def _divide(one: Pixels, other: Pixels) -> Pixels:
    return np.divide(one, other, out=np.zeros(np.broadcast(one, other).shape, np.float32), where=other != 0.0)


BLENDS: dict[str, Callable[[Pixels, Pixels, Pixels], Pixels]] = {
    "MIX": _by_alpha(lambda one, other: other),
    "MULTIPLY": _by_alpha(lambda one, other: one * other),
    "ADD": _by_alpha(lambda one, other: one + other),
    "SUBTRACT": _by_alpha(lambda one, other: one - other),
    "SCREEN": _by_alpha(lambda one, other: 1.0 - (1.0 - one) * (1.0 - other)),
    "OVERLAY": _by_alpha(_overlay),
    "SOFT_LIGHT": _by_alpha(_soft_light),
    "LINEAR_LIGHT": lambda share, one, other: one + share * 2.0 * (other - 0.5),
    "DARKEN": _by_alpha(np.minimum),
    "LIGHTEN": _by_alpha(np.maximum),
    "DIFFERENCE": _by_alpha(lambda one, other: np.abs(one - other)),
    "DIVIDE": _by_alpha(_divide),
}

# Nodes that change one colour, with the inputs that they take.
FILTERS: dict[str, tuple[Any, ...]] = {
    "RGBTOBW": (grey, "Color"),
    "GAMMA": (lambda color, power: np.maximum(color, 0.0) ** power, "Color", "Gamma"),
    "INVERT": (lambda share, color: color + (1.0 - 2.0 * color) * share, "Fac", "Color"),
    "BRIGHTCONTRAST": (
        lambda color, bright, contrast: np.maximum((1.0 + contrast) * color + bright - contrast * 0.5, 0.0),
        *("Color", "Bright", "Contrast"),
    ),
}

# Each of two or three inputs; Blender shows a node as many as its operation has, and a script may get more.
MATHS: dict[str, Callable[..., Pixels]] = {
    "ADD": lambda a, b, *_: a + b,
    "SUBTRACT": lambda a, b, *_: a - b,
    "MULTIPLY": lambda a, b, *_: a * b,
    "DIVIDE": lambda a, b, *_: _divide(a, b),
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": lambda a, b, *_: np.maximum(a, 0.0) ** b,
    "MINIMUM": lambda a, b, *_: np.minimum(a, b),
    "MAXIMUM": lambda a, b, *_: np.maximum(a, b),
    "GREATER_THAN": lambda a, b, *_: (a > b).astype(np.float32),
    "LESS_THAN": lambda a, b, *_: (a < b).astype(np.float32),
    "ABSOLUTE": lambda a, *_: np.abs(a),
    "SQRT": lambda a, *_: np.sqrt(np.maximum(a, 0.0)),
    "ROUND": lambda a, *_: np.floor(a + 0.5),
}


def adjust_hsv(hue: Pixels, saturation: Pixels, value: Pixels, share: Pixels, color: Pixels) -> Pixels:
    """The node Hue/Saturation/Value: hue is turned by `hue` less a half, the others are multiplied."""
    high, low = color[..., :3].max(axis=-1), color[..., :3].min(axis=-1)
    spread = high - low
    red, green, blue = color[..., 0], color[..., 1], color[..., 2]
    safe = np.where(spread > 0.0, spread, 1.0)
    sector = np.where(high == red, (green - blue) / safe, np.where(high == green, 2 + (blue - red) / safe, 0.0))
    sector = np.where((high == blue) & (high != red) & (high != green), 4 + (red - green) / safe, sector)
    turned = (sector / 6.0 + hue[..., 0] - 0.5) % 1.0 * 6.0
    new_saturation = clamp(np.where(high > 0.0, spread / np.where(high > 0.0, high, 1.0), 0.0) * saturation[..., 0])
    bright = high * value[..., 0]
    changed = np.broadcast_to(color, (*np.broadcast(turned, new_saturation, high * value[..., 0]).shape, 4)).copy()
    for channel, place in enumerate((0.0, 4.0, 2.0)):  # how full a channel is falls off with its distance in hue
        fullness = clamp(np.abs((turned + place) % 6.0 - 3.0) - 1.0)
        changed[..., channel] = bright * (1.0 - new_saturation * (1.0 - fullness))
    return np.maximum(color + (changed - color) * share, 0.0)


def tristimulus_curves(waves: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(3, N): how the eye's three curves (CIE 1931) weigh light of these wavelengths, in nanometres.

    The fits are those of Wyman, Sloan and Shirley, "Simple analytic approximations to the CIE XYZ color matching
    functions" (2013).
    """

    def bell(middle: float, below: float, above: float) -> Any:
        return np.exp(-0.5 * ((waves - middle) / np.where(waves < middle, below, above)) ** 2)

    return np.stack(
        [
            1.056 * bell(599.8, 37.9, 31.0) + 0.362 * bell(442.0, 16.0, 26.7) - 0.065 * bell(501.1, 20.4, 26.2),
            0.821 * bell(568.8, 46.9, 40.5) + 0.286 * bell(530.9, 16.3, 31.1),
            1.217 * bell(437.0, 11.8, 36.0) + 0.681 * bell(459.0, 26.0, 13.8),
        ]
    )


def xyz_to_rgb(xyz: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(..., 3): scene-linear Rec.709; negative outside of it."""
    return xyz @ _XYZ_TO_REC709.T


@lru_cache(maxsize=64)
def blackbody(kelvin: float) -> tuple[float, float, float]:
    """The colour of a black body, of luminance one, by Planck's law."""
    waves = np.arange(380.0, 781.0, 5.0)
    spectrum = waves**-5.0 / np.expm1(1.4388e7 / (waves * max(kelvin, 800.0)))
    tristimulus = tristimulus_curves(waves) @ spectrum
    red, green, blue = np.maximum(xyz_to_rgb(tristimulus / tristimulus[1]), 0.0).tolist()
    return red, green, blue


# Values --------------------------------------------------------------------------------------------------------------


OWN_ALPHA = ("alpha", (None,))  # the key of a texture's own alpha


@dataclass(frozen=True, slots=True)
class Texture:
    """An image as a node shows it."""

    image: Any
    extension: Extension
    uv_transform: UvTransform
    uv_map: str


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """color: (4,), of a number the same in each channel; counts where there is no texture. (N, 4) of N instances.

    change: what becomes of the texture's pixels, None if they stay as they are. key: which change that is.
    tint: the name of those of the mesh's own colours that multiply it, "" for the active ones, None for none.
    varies: whether it is another one for each instance, and this what stands for them.
    """

    color: Pixels
    texture: Texture | None = None
    change: Callable[[Pixels], Pixels] | None = None
    key: Hashable = None
    is_guess: bool = False
    tint: str | None = None
    varies: bool = False

    @property
    def is_even(self) -> bool:
        """Whether it is the same all over every surface that shows it."""
        return self.texture is None and self.tint is None and not self.varies and self.color.ndim == 1

    def of(self, pixels: Pixels) -> Pixels:
        """(..., 4): the value where the texture has these pixels."""
        if self.texture is None:
            return self.color
        return pixels if self.change is None else self.change(pixels)


def same_value(first: Value, second: Value) -> bool:
    """Whether two values are known to be the same all over every surface."""
    if first is second:
        return True
    kinds = [(value.texture, value.key, value.tint, value.varies) for value in (first, second)]
    return kinds[0] == kinds[1] and (first.texture is not None or np.array_equal(first.color, second.color))


class ImageMeans(Protocol):
    """What tells the mean of a value with a texture."""

    def mean(self, value: Value) -> Pixels: ...


def constant(*channels: float) -> Value:
    """Of one number, or of three or four channels."""
    return Value(np.array(channels * 4 if len(channels) == 1 else [*channels, 1.0][:4], np.float32))


def guess(color: Pixels) -> Value:
    return Value(color, is_guess=True)


def first_channel(color: Pixels) -> Any:
    """A number: a float of (4,), (N,) of (N, 4)."""
    return float(color[0]) if color.ndim == 1 else np.float64(color[:, 0])


# What nodes may ask of the instance that is seen, and what stands for the answer as long as there is no instance.
Kind = Literal["random", "color", "alpha", "object_index", "location", "object", "instancer"]


class Source(NamedTuple):
    """Something that each instance has: kind "object" and "instancer" are attributes of that name."""

    kind: Kind
    name: str = ""

    @property
    def stand_in(self) -> Pixels:
        """(4,): a value that nothing vanishes by which is multiplied with it."""
        return np.full(4, 0.5 if self.kind == "random" else 1.0, np.float32)


RANDOM = Source("random")

# (N, 4): what a source gives for each of the instances in question, and in the last row what stands in for it.
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
