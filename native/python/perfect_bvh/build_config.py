"""The settings of a tree's build."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from ._checks import check_choice, check_count, check_number

Builder = Literal["auto", "median", "sweep", "binned", "spatial", "fast"]
BUILDERS: tuple[str, ...] = get_args(Builder)
Usage = Literal["static", "deforming", "changing"]

# Minimum and maximum, both allowed. The engine checks the same ranges.
_WHOLE_NUMBERS = {"optimize": (0, 1000), "bins": (2, 256), "axes": (1, 3), "max_leaf_size": (1, 255)}


@dataclass(frozen=True, slots=True)
class BuildConfig:
    """The build settings of a mesh's tree. The defaults are good for most meshes.

    Every builder's tree gives the same hits; builders differ in the time to build and to trace. Most take 50 to
    70 bytes a triangle, positions and indices included.

    builder: the method that divides the triangles.
        "auto": the engine's choice, by the mesh's usage: "fast" if its topology changes, else "binned". This "binned"
            stops when triangles fill a leaf of the tree that rays are traced through (8 triangles over 8 vertices): it
            takes less time and memory than splitting down to the last split that pays, and rays are as fast. It does
            not stop there if the leaf size is set.
        "median": halves of equal number, at any tracing cost. The naive reference: quick to build and by far
            the slowest to trace, twice the tests or more. For comparisons, not for use.
        "sweep": the surface area heuristic at every one of the 3(N-1) planes of each node (MacDonald and Booth
            1990). Slower to build than "binned" for a tree that is a few per cent better at best: the
            yardstick for the others.
        "binned": the heuristic at a fixed number of planes (Wald 2007). The usual choice; its trees can be refitted.
        "spatial": also splits space where that is cheaper, and references cut triangles from both sides (Stich,
            Friedrich and Dietrich 2009). Takes several times as long as "binned" and more memory. It pays for long,
            large or crossed triangles, hardly for evenly tessellated ones. Rebuilt when positions change.
        "fast": triangles along a Morton curve (Morton 1966), cut into leaves and clustered with their neighbours there
            (Meister and Bittner 2018). The fastest builder that considers cost, for a slightly worse tree: for a
            topology that changes every frame. Slower if a pass of "optimize" or a leaf size is requested: it
            then makes a binary tree first, as the others do.
    optimize: passes of reinsertion after the build, 0 to 1000: nodes are removed and reinserted where they cost less
        (Bittner, Hapala and Havran 2013; Meister and Bittner 2018). Each pass looks at twice as many nodes as the one
        before; it stops by itself when there is no more gain. It lowers the cost of any builder's tree, most of all
        of uneven ones, for up to several times the time of the build.
    bins: intervals an axis, 2 to 256; for "binned" and "spatial" (which cuts space at half as many). Fewer are slightly
        faster and worse.
    axes: 3 tries planes on all axes, 1 only on the longest one; for "binned". One is faster and worse.
    max_leaf_size: the largest number of triangles of a leaf, 1 to 255. "median" splits until no leaf holds more. The
        others also split smaller nodes: they make a split if it costs less than the leaf.
    duplication_budget: for "spatial", the limit of added references, as a share of the triangles, 0 to 10.

    Raises ValueError, naming the setting, for anything else.
    """

    builder: Builder = "auto"
    optimize: int = 0
    bins: int = 16
    axes: int = 3
    max_leaf_size: int = 8
    duplication_budget: float = 0.3

    def __post_init__(self) -> None:
        check_choice("BuildConfig", "builder", self.builder, BUILDERS)
        for name, (least, most) in _WHOLE_NUMBERS.items():  # accepts numpy's integers, and stores plain ones
            object.__setattr__(self, name, check_count("BuildConfig", name, getattr(self, name), least, most))
        if self.axes == 2:
            raise ValueError("BuildConfig: axes must be 1 or 3, got 2")
        budget = check_number("BuildConfig", "duplication_budget", self.duplication_budget, 0.0, 10.0)
        object.__setattr__(self, "duplication_budget", budget)

    def as_settings(self) -> dict[str, Any]:
        """Returns the settings as the native module takes them."""
        return asdict(self)


def as_config(function: str, build: str | BuildConfig) -> BuildConfig:
    """Converts a caller's `build`; raises ValueError for anything but "auto" and a `BuildConfig`."""
    if isinstance(build, BuildConfig):
        return build
    if build == "auto":
        return BuildConfig()
    raise ValueError(f"{function}: build must be 'auto' or a BuildConfig, got {build!r}")


def check_usage(function: str, usage: str) -> None:
    """Raises ValueError for an unknown usage."""
    check_choice(function, "usage", usage, get_args(Usage))
