"""What a bake asks, checked. Does not depend on Blender."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from perfect_bvh._checks import check_choice, check_count, check_number

from ..settings.bake_choices import DOMAINS, KINDS, METHODS
from .sun import DirectionTable

NAME = "bake_rays"
MOST_RAYS = 1 << 20
MOST_FRAME = 1_048_574  # Blender's
CHOICES = {"kind": KINDS, "domain": DOMAINS, "method": METHODS}


@dataclass(frozen=True, slots=True, eq=False)
class BakeSettings:
    """The settings of `bake_rays`, which explains each. Raises ValueError for settings that make no bake."""

    kind: str
    domain: str = "FACE"
    directions: Any = None
    cosine: bool | None = None
    keep_visible: bool = False
    rays: int = 256
    seed: int = 0
    distance: float = math.inf
    falloff: float = 0.0
    method: str = "CONE"
    angle: float = math.radians(30.0)
    viewers: Any = None
    frames: Sequence[int] | None = None
    uv_map: str | None = None
    image_size: tuple[int, int] = (1024, 1024)
    instances: bool = False
    evaluated: bool = False

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            check_choice(NAME, name, getattr(self, name), tuple(choices))
        for name in ("cosine", "keep_visible", "instances", "evaluated"):
            if not isinstance(getattr(self, name), (bool, np.bool_, type(None))):
                raise ValueError(f"{NAME}: {name} must be True or False, got {getattr(self, name)!r}")
        check_count(NAME, "rays", self.rays, 1, MOST_RAYS)
        check_count(NAME, "seed", self.seed, 0, 2**31 - 1)
        check_number(NAME, "falloff", self.falloff, 0.0)
        check_number(NAME, "angle", self.angle, 0.0, math.pi / 2)
        if self.distance != math.inf:
            check_number(NAME, "distance", self.distance, 0.0, above=True)
        if self.falloff and math.isinf(self.distance):
            raise ValueError(f"{NAME}: falloff needs a distance at which it ends, got distance {self.distance!r}")
        self._check_image()
        self._check_frames()
        if self.keep_visible and (self.kind, self.domain) != ("SUN_HOURS", "FACE"):
            raise ValueError(f"{NAME}: keep_visible is for the kind 'SUN_HOURS' on the domain 'FACE'")
        if self.kind == "SUN_HOURS" and self.directions is None:
            raise ValueError(f"{NAME}: the kind 'SUN_HOURS' needs directions, (N, 3) unit vectors towards the sun")
        if self.kind == "SUN_HOURS" and not isinstance(self.directions, DirectionTable):
            object.__setattr__(self, "directions", DirectionTable(self.directions))

    def _check_image(self) -> None:
        if not isinstance(self.uv_map, str | None):
            raise ValueError(f"{NAME}: uv_map must be a text, got {self.uv_map!r}")
        if np.shape(self.image_size) != (2,):
            raise ValueError(f"{NAME}: image_size must be (width, height), got {self.image_size!r}")
        for length in self.image_size:
            check_count(NAME, "image_size", length, 1, 1 << 15)

    def _check_frames(self) -> None:
        if self.frames is None:
            return
        if not isinstance(self.frames, Iterable):
            raise ValueError(f"{NAME}: frames must be a sequence of integers, got {self.frames!r}")
        frames = tuple(check_count(NAME, "frames", frame, -MOST_FRAME, MOST_FRAME) for frame in self.frames)
        if len(frames) != 1 and (self.kind != "EXPOSURE" or not frames):
            raise ValueError(f"{NAME}: frames must be one, or more for the kind 'EXPOSURE'; got {frames!r}")
        object.__setattr__(self, "frames", frames)

    @property
    def has_cosine(self) -> bool:
        """Whether light is weighted by the cosine to the normal."""
        default = self.directions.has_cosine if self.kind == "SUN_HOURS" else True
        return default if self.cosine is None else bool(self.cosine)

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column, the main one first."""
        columns = dict(KINDS[self.kind].columns)
        return dict.fromkeys(columns, self.directions.unit) if self.kind == "SUN_HOURS" else columns
