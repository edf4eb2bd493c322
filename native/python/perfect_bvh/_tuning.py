"""What only tests, benchmarks, the add-on's bench and its bakes choose. No choice changes a hit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeVar, get_args

from . import _core
from ._checks import check_choice
from .build_config import BuildConfig
from .queries import Queries
from .scene import Scene, Snapshot

Policy = Literal["governed", "refit", "rotate", "rebuild_parts", "rebuild"]
POLICIES: tuple[str, ...] = get_args(Policy)
AnyScene = TypeVar("AnyScene", bound=Scene)
STRATEGIES = ("auto", "packets", "stream", "single")


def with_policy(scene: AnyScene, policy: str) -> AnyScene:
    """Returns the scene, which from now on always does the same with a tree whose vertices moved.

    Args:
        policy: "governed" is the default: the least expected cost. "refit" (if a tree can be refitted),
            "rotate" and "rebuild_parts" (refit, and then always restructure in that way), "rebuild".
    """
    scene._policy = check_choice("with_policy", "policy", policy, POLICIES)
    return scene


class Traced(Queries):
    """The queries of a scene or snapshot; `cast_rays` and `test_occlusions` are traced in one way.

    Args:
        strategy: "packets": 64 consecutive rays share a traversal, which is several times as fast where they go much
            the same way; "stream": many are under way, each for itself; "single": one after the other. "auto" is every
            scene's: it looks at the rays, and takes packets where they are coherent, else the stream. Batches that
            count their work are not traced in packets. Into what moves within the shutter, rays of packets go one by
            one: where that is most of a scene, "auto" takes the stream.
    """

    __slots__ = ("_source", "_strategy")

    def __init__(self, source: Scene | Snapshot, strategy: str) -> None:
        self._source = source
        self._strategy = check_choice("Traced", "strategy", strategy, STRATEGIES)

    def _committed(self) -> _core.Snapshot:
        return self._source._committed()


@dataclass(frozen=True, slots=True)
class CostedBuild(BuildConfig):
    """A `BuildConfig` with other costs; the engine checks them.

    Attributes:
        traversal_cost: Of visiting a node, 0 to 1e6, in the same unit as
            intersection_cost.
        intersection_cost: Of testing a triangle, 1e-6 to 1e6: a split is made if it costs less than the leaf.
    """

    traversal_cost: float = 1.0
    intersection_cost: float = 1.0
