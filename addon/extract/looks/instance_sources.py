"""What nodes may ask of the instance that is seen, and what stands for the answer as long as there is no instance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from .color_math import Pixels

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
