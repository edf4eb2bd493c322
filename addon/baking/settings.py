"""What a bake asks, checked. Does not depend on Blender."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from perfect_bvh._checks import check_choice, check_count, check_number

from ..settings.bake_choices import DOMAINS, KINDS

NAME = "bake_rays"
MOST_RAYS = 1 << 20
MOST_FRAME = 1_048_574  # Blender's
FLAGS = ("cosine", "keep_visible", "instances", "evaluated")
CHOICES = {"kind": KINDS, "domain": DOMAINS, "method": ("CONE", "SPHERE"), "casters": ("AUTO", "SCENE", "OWN")}


def numbers_of(name: str, value: Any, expected: str) -> npt.NDArray[np.float64]:
    """Returns an array of an argument. Raises ValueError, which says what was expected."""
    try:
        return np.array(value, np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{NAME}: {name} must be {expected}, got {value!r}") from error


@dataclass(frozen=True, slots=True, eq=False)
class BakeSettings:
    """The settings of `bake_rays`, which explains each. Raises ValueError for settings that make no bake."""

    kind: str
    domain: str = "FACE"
    directions: npt.ArrayLike | None = None
    weights: npt.ArrayLike | None = None
    cosine: bool | None = None
    unit: str = "h"
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
    casters: str = "AUTO"

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            check_choice(NAME, name, getattr(self, name), tuple(choices))
        self._check_types()
        check_count(NAME, "rays", self.rays, 1, MOST_RAYS)
        check_count(NAME, "seed", self.seed, 0, 2**31 - 1)
        check_number(NAME, "falloff", self.falloff, 0.0)
        check_number(NAME, "angle", self.angle, 0.0, math.pi / 2)
        if self.distance != math.inf:
            check_number(NAME, "distance", self.distance, 0.0, above=True)
        if self.falloff and math.isinf(self.distance):
            raise ValueError(f"{NAME}: falloff needs a distance at which it ends, got distance {self.distance!r}")
        if self.frames is not None and len(self.frames) != 1 and (self.kind != "EXPOSURE" or not self.frames):
            raise ValueError(f"{NAME}: frames must be one, or more for the kind 'EXPOSURE'; got {self.frames!r}")
        if self.keep_visible and (self.kind, self.domain) != ("SUN_HOURS", "FACE"):
            raise ValueError(f"{NAME}: keep_visible is for the kind 'SUN_HOURS' on the domain 'FACE'")
        if self.kind == "SUN_HOURS":
            self._check_table()

    def _check_types(self) -> None:
        for name in FLAGS:
            if not isinstance(getattr(self, name), (bool, np.bool_, type(None))):
                raise ValueError(f"{NAME}: {name} must be True or False, got {getattr(self, name)!r}")
        for name, text in (("unit", self.unit), ("uv_map", self.uv_map)):
            if not isinstance(text, str | None):
                raise ValueError(f"{NAME}: {name} must be a text, got {text!r}")
        if np.shape(self.image_size) != (2,):
            raise ValueError(f"{NAME}: image_size must be (width, height), got {self.image_size!r}")
        for length in self.image_size:
            check_count(NAME, "image_size", length, 1, 1 << 15)
        if self.frames is not None:
            if not isinstance(self.frames, Iterable):
                raise ValueError(f"{NAME}: frames must be a sequence of integers, got {self.frames!r}")
            frames = tuple(check_count(NAME, "frames", frame, -MOST_FRAME, MOST_FRAME) for frame in self.frames)
            object.__setattr__(self, "frames", frames)

    def _check_table(self) -> None:
        """Replaces the table by (D, 3) and (D,) float64 arrays."""
        if self.directions is None:
            raise ValueError(f"{NAME}: the kind 'SUN_HOURS' needs directions, (D, 3) unit vectors towards the sun")
        directions = numbers_of("directions", self.directions, "numbers of shape (D, 3)")
        if directions.ndim != 2 or directions.shape[1] != 3:
            raise ValueError(f"{NAME}: directions must have shape (D, 3), got {directions.shape}")
        off = np.flatnonzero(~(np.abs(np.linalg.norm(directions, axis=1) - 1.0) <= 1e-6))
        if len(off):
            wrong = directions[off[0]].tolist()
            raise ValueError(f"{NAME}: directions must be unit vectors, got {wrong} in row {off[0]}")
        given = np.ones(len(directions)) if self.weights is None else self.weights
        weights = numbers_of("weights", given, f"{len(directions)} finite numbers")
        if weights.shape != (len(directions),) or not np.isfinite(weights).all():
            raise ValueError(f"{NAME}: weights must be {len(directions)} finite numbers, got shape {weights.shape}")
        object.__setattr__(self, "directions", directions)
        object.__setattr__(self, "weights", weights)

    @property
    def has_own_casters(self) -> bool:
        """Whether only the object itself is in the way of its rays."""
        return self.casters == "OWN" or (self.casters == "AUTO" and self.kind == "THICKNESS")

    @property
    def units(self) -> dict[str, str]:
        """The unit of each column, the main one first."""
        columns = dict(KINDS[self.kind].columns)
        return dict.fromkeys(columns, self.unit) if self.kind == "SUN_HOURS" else columns
