"""What a socket may come to: one colour, the pixels of one image, or another value for each instance that is seen."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from ...sync.records import Extension, UvTransform
from .color_math import Pixels

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
