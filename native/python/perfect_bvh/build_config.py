"""What may be chosen about a tree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Builder = Literal["auto", "binned", "fast", "spatial"]
BUILDERS: tuple[str, ...] = ("auto", "binned", "fast", "spatial")


@dataclass(frozen=True, slots=True)
class BuildConfig:
    """How a mesh's tree is built. The defaults need no thought.

    builder: "binned" evaluates the surface area heuristic at a fixed number of planes (Wald 2007);
        "fast" does the same over clusters of up to 8 triangles along a Morton curve (Garanzha et al. 2011): a
        quarter less time for a slightly worse tree, for a topology that changes every frame;
        "spatial" also cuts space where that is cheaper, and refers to what it cuts from both sides (Stich 2009):
        the best trees for long, large or crossed triangles, slower to build, and built anew when positions change;
        "auto" leaves the choice to the engine, which goes by the mesh's usage.
    bins: intervals an axis, 2 to 256.
    axes: 3 tries planes on all axes, 1 only on the longest one (faster, slightly worse).
    max_leaf_size: triangles a leaf holds at most, 1 to 64.
    traversal_cost, intersection_cost: of visiting a node and of testing a triangle, for the heuristic.
    duplication_budget: for "spatial", references it may add, as a share of the triangles, 0 to 10.
    """

    builder: Builder = "auto"
    bins: int = 16
    axes: int = 3
    max_leaf_size: int = 8
    traversal_cost: float = 1.0
    intersection_cost: float = 1.0
    duplication_budget: float = 0.3

    def __post_init__(self) -> None:
        if self.builder not in BUILDERS:
            raise ValueError(f"BuildConfig: builder must be one of {', '.join(BUILDERS)}, got {self.builder!r}")
        for name in ("bins", "axes", "max_leaf_size"):
            if not isinstance(getattr(self, name), int):
                raise ValueError(f"BuildConfig: {name} must be an integer, got {getattr(self, name)!r}")
        if not 2 <= self.bins <= 256:
            raise ValueError(f"BuildConfig: bins must be 2 to 256, got {self.bins}")
        if self.axes not in (1, 3):
            raise ValueError(f"BuildConfig: axes must be 1 or 3, got {self.axes}")
        if not 1 <= self.max_leaf_size <= 64:
            raise ValueError(f"BuildConfig: max_leaf_size must be 1 to 64, got {self.max_leaf_size}")
        if not (0.0 < self.traversal_cost < 1e6 and 0.0 < self.intersection_cost < 1e6):
            raise ValueError(
                "BuildConfig: traversal_cost and intersection_cost must be positive and below 1e6, got "
                f"{self.traversal_cost} and {self.intersection_cost}"
            )
        if not 0.0 <= self.duplication_budget <= 10.0:
            raise ValueError(f"BuildConfig: duplication_budget must be 0 to 10, got {self.duplication_budget}")
