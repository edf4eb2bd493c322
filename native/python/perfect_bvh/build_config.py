"""What may be chosen about a tree."""

from __future__ import annotations

import math
import operator
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

Builder = Literal["auto", "median", "sweep", "binned", "spatial", "fast"]
BUILDERS: tuple[str, ...] = get_args(Builder)
Usage = Literal["static", "deforming", "changing"]

# Least and greatest, both allowed. The engine checks the same ranges.
_WHOLE_NUMBERS = {"bins": (2, 256), "max_leaf_size": (1, 255), "optimize": (0, 1000)}
COSTS = {"traversal_cost": (0.0, 1e6), "intersection_cost": (1e-6, 1e6)}
_REAL_NUMBERS = {**COSTS, "duplication_budget": (0.0, 10.0)}


@dataclass(frozen=True, slots=True)
class BuildConfig:
    """How a mesh's tree is built. The defaults need no thought.

    Every builder's tree gives the same hits; they differ in how long they take to build and to trace. Most take 50 to
    70 bytes a triangle, positions and indices included.

    builder: what divides the triangles.
        "auto": the engine's choice, by the mesh's usage: "fast" if its topology changes, else "binned", which then goes
            on only until triangles fill a leaf of the tree that rays meet (8 triangles over 8 vertices): less time and
            memory than down to the last split that pays, for rays as fast. Not where leaf size or costs are set.
        "median": halves of equal number, whatever they cost to trace. The naive reference: quick to build and by far
            the slowest to trace, twice the tests or more. For comparisons, not for use.
        "sweep": the surface area heuristic at every one of the 3(N-1) planes of each node (MacDonald and Booth
            1990). Slower to build than "binned" for a tree that is a few per cent better at best: the
            yardstick for the others.
        "binned": the heuristic at a fixed number of planes (Wald 2007). The usual choice; its trees can be refitted.
        "spatial": cuts space too where that is cheaper, and refers to what it cuts from both sides (Stich, Friedrich
            and Dietrich 2009). Takes several times as long as "binned" and more memory, and pays for long,
            large or crossed triangles, hardly for evenly tessellated ones. Rebuilt when positions change.
        "fast": triangles along a Morton curve (Morton 1966), cut into leaves and clustered with their neighbours there
            (Meister and Bittner 2018). The least time of all that look at cost, for a slightly worse tree: for a
            topology that changes every frame. Slower where a pass of "optimize", leaf size or costs are asked for: it
            then goes by a binary tree, as the others do.
    optimize: passes of reinsertion after the build, 0 to 1000: nodes are taken out and put where they cost less
        (Bittner, Hapala and Havran 2013; Meister and Bittner 2018). Each pass looks at twice as many nodes as the one
        before; it stops by itself where nothing is left to gain. Lowers the cost of any builder's tree, most of all
        of uneven ones, for up to several times the time of the build.
    optimize_milliseconds: no pass starts after so much time; None for no limit. With a limit, which tree comes out
        depends on the machine; hits do not.
    bins: intervals an axis, 2 to 256; for "binned" and "spatial" (space is cut at half as many). Fewer are slightly
        faster and worse.
    axes: 3 tries planes on all axes, 1 only on the longest one; for "binned". One is faster and worse.
    max_leaf_size: triangles a leaf holds at most, 1 to 255; "median" splits until no leaf holds more, the others
        earlier where that costs less.
    traversal_cost: of visiting a node, 0 to 1e6, relative to
    intersection_cost: of testing a triangle, 1e-6 to 1e6: a split is made if it costs less than the leaf.
    duplication_budget: for "spatial", references it may add, as a share of the triangles, 0 to 10.

    Raises ValueError, naming the setting, for anything else.
    """

    builder: Builder = "auto"
    optimize: int = 0
    optimize_milliseconds: float | None = None
    bins: int = 16
    axes: int = 3
    max_leaf_size: int = 8
    traversal_cost: float = 1.0
    intersection_cost: float = 1.0
    duplication_budget: float = 0.3

    def __post_init__(self) -> None:
        if self.builder not in BUILDERS:
            raise ValueError(f"BuildConfig: builder must be one of {', '.join(BUILDERS)}, got {self.builder!r}")
        for name, (least, most) in _WHOLE_NUMBERS.items():
            value = self._whole_number(name, f"an integer from {least} to {most}")
            if not least <= value <= most:
                raise ValueError(f"BuildConfig: {name} must be from {least} to {most}, got {value}")
        if self._whole_number("axes", "1 or 3") not in (1, 3):
            raise ValueError(f"BuildConfig: axes must be 1 or 3, got {self.axes}")
        for name, (low, high) in _REAL_NUMBERS.items():
            number = checked_number("BuildConfig", name, getattr(self, name), low, high)
            object.__setattr__(self, name, number)
        if self.optimize_milliseconds is not None:
            limit = checked_number("BuildConfig", "optimize_milliseconds", self.optimize_milliseconds, 0.0, 1e9)
            object.__setattr__(self, "optimize_milliseconds", limit)

    def as_settings(self) -> dict[str, Any]:
        """What the native module takes."""
        limit = math.inf if self.optimize_milliseconds is None else self.optimize_milliseconds
        return {**asdict(self), "optimize_milliseconds": limit}

    def _whole_number(self, name: str, expected: str) -> int:
        """The setting as a plain int, which is what is kept: numpy's integers are welcome too."""
        value = getattr(self, name)
        try:
            if isinstance(value, bool):
                raise TypeError
            whole = operator.index(value)
        except TypeError:
            raise ValueError(f"BuildConfig: {name} must be {expected}, got {value!r}") from None
        object.__setattr__(self, name, whole)
        return whole


def as_config(function: str, build: str | BuildConfig) -> BuildConfig:
    """What a caller's `build` means; raises ValueError for anything but "auto" and a `BuildConfig`."""
    if isinstance(build, BuildConfig):
        return build
    if build == "auto":
        return BuildConfig()
    raise ValueError(f"{function}: build must be 'auto' or a BuildConfig, got {build!r}")


def check_usage(function: str, usage: str) -> None:
    """Raises ValueError for a usage that there is not."""
    if usage not in ("static", "deforming", "changing"):
        raise ValueError(f"{function}: usage must be 'static', 'deforming' or 'changing', got {usage!r}")


def checked_number(function: str, name: str, value: Any, low: float, high: float) -> float:
    """The value as a float within low and high, both allowed; raises ValueError otherwise."""
    try:
        if isinstance(value, (bool, str)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not low <= number <= high:
        raise ValueError(f"{function}: {name} must be a number from {low:g} to {high:g}, got {value!r}")
    return number
