"""Committed states of a scene, and rays through them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_vectors, per_ray
from .build_config import COSTS, checked_number
from .errors import EngineError
from .hits import DEFAULT_FIELDS, Hits, allocate_columns
from .report import SceneStatistics

Cull = Literal["none", "back", "front"]
Precision = Literal["robust", "fast"]
Progress = Callable[[float], object]

ALL_MASK = 0xFFFFFFFF


class Snapshot:
    """An immutable committed scene. Any number of threads may query it while its scene is edited.

    Get one from `Scene.snapshot()`; `Scene` has the same queries, for the snapshot of the moment.
    """

    __slots__ = ("_snapshot",)

    def __init__(self, core_snapshot: _core.Snapshot) -> None:
        self._snapshot = core_snapshot

    @property
    def generation(self) -> int:
        """Counts the scene's commits from 1."""
        return self._snapshot.generation

    def cast_rays(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        fields: Iterable[str] | None = None,
        precision: Precision = "robust",
        threads: int = 0,
        audit: float = 0.0,
        out: dict[str, npt.NDArray[Any]] | None = None,
        progress: Progress | None = None,
    ) -> Hits:
        """The first thing that each ray meets.

        origins, directions: (..., 3), broadcast against each other; float32 or float64. Directions need not be
            unit vectors: t is in multiples of their length.
        t_min, t_max: scalars or (...), float32: a hit counts if t_min <= t <= t_max.
        mask: scalar or (...): an instance is seen if its mask shares a bit with the ray's.
        cull: "back" passes through triangles seen from behind (clockwise), "front" through the others.
        fields: names of the fields to compute; None for the usual ones, see `Hits`.
        precision: "robust": watertight, no ray passes between triangles that share an edge or a vertex.
        threads: at most so many; 0 for all that the process may use.
        audit: the share of rays to check against a double-precision reference. Only 0 in this version.
        out: arrays to write fields into, by name: contiguous, of the field's dtype and shape, for fields that are
            computed; none may overlap another or the rays.
        progress: called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

        Returns `Hits`, one row a ray, always. Rays that are not finite, have no direction or an empty range are
        misses, counted in `invalid_count`.

        Raises ValueError for arrays of the wrong shape or kind, StaleSceneError (on a `Scene`) if edits wait,
        EngineError for what this version cannot do yet (precision="fast", audit).
        """
        _check_precision("cast_rays", precision)
        _check_audit("cast_rays", audit)
        rays = _Rays("cast_rays", origins, directions, t_min, t_max, mask, cull, threads)
        names = DEFAULT_FIELDS if fields is None else (fields,) if isinstance(fields, str) else tuple(fields)
        columns = allocate_columns("cast_rays", names, rays.shape, out, rays.columns)
        invalid = self._snapshot.cast_rays(*rays.columns, cull, columns, threads, progress)
        return Hits(columns, invalid)

    def test_occlusions(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike = 0.0,
        t_max: npt.ArrayLike = np.inf,
        mask: npt.ArrayLike = ALL_MASK,
        cull: Cull = "none",
        precision: Precision = "robust",
        threads: int = 0,
        progress: Progress | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Whether anything lies on each ray between t_min and t_max: (...) bool.

        True exactly where `cast_rays` finds a hit, but faster. Arguments as there; invalid rays are False.
        """
        _check_precision("test_occlusions", precision)
        rays = _Rays("test_occlusions", origins, directions, t_min, t_max, mask, cull, threads)
        occluded = np.empty(rays.shape, np.bool_)
        self._snapshot.test_occlusions(*rays.columns, cull, occluded, threads, progress)
        return occluded

    def statistics(
        self,
        detailed: bool = False,
        *,
        traversal_cost: float = 1.0,
        intersection_cost: float = 1.0,
        progress: Progress | None = None,
    ) -> SceneStatistics:
        """Sizes and quality of all trees, as `SceneStatistics`.

        detailed: also end-point overlap and leaf-count variability (Aila, Karras and Laine 2013). They take
            microseconds for each triangle, and binary trees that are no longer kept are built again for them, with
            the same settings.
        traversal_cost, intersection_cost: of visiting a node, 0 to 1e6, and of testing a triangle, 1e-6 to 1e6:
            what `sah` and `epo` are reckoned with.
        progress: called with the share done, 0 to 1; returning False raises `Cancelled`. Ctrl-C works too.

        Raises ValueError for other costs, StaleSceneError (on a `Scene`) if edits wait.
        """
        visit = checked_number("statistics", "traversal_cost", traversal_cost, *COSTS["traversal_cost"])
        test = checked_number("statistics", "intersection_cost", intersection_cost, *COSTS["intersection_cost"])
        return SceneStatistics.from_core(_core.measure(self._snapshot, bool(detailed), visit, test, progress))


def _check_precision(function: str, precision: str) -> None:
    if precision == "fast":
        raise EngineError(f"{function}: precision='fast' is not available in this version; use 'robust'")
    if precision != "robust":
        raise ValueError(f"{function}: precision must be 'robust' or 'fast', got {precision!r}")


def _check_audit(function: str, audit: float) -> None:
    if not 0.0 <= audit <= 1.0:
        raise ValueError(f"{function}: audit must be a share of the rays, 0 to 1, got {audit!r}")
    if audit > 0.0:
        raise EngineError(f"{function}: audit is not available in this version; leave it at 0")


class _Rays:
    """Checked and flattened columns of a batch."""

    __slots__ = ("columns", "shape")

    def __init__(
        self,
        function: str,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        t_min: npt.ArrayLike,
        t_max: npt.ArrayLike,
        mask: npt.ArrayLike,
        cull: str,
        threads: int,
    ) -> None:
        if cull not in ("none", "back", "front"):
            raise ValueError(f"{function}: cull must be 'none', 'back' or 'front', got {cull!r}")
        if not isinstance(threads, (int, np.integer)) or not 0 <= threads < 2**31:
            raise ValueError(f"{function}: threads must be 0 (all) or a positive integer, got {threads!r}")
        first = as_vectors(function, "origins", origins)
        second = as_vectors(function, "directions", directions)
        try:
            first, second = np.broadcast_arrays(first, second)
        except ValueError:
            raise ValueError(
                f"{function}: origins of shape {first.shape} and directions of shape {second.shape} do not fit together"
            ) from None
        self.shape: tuple[int, ...] = first.shape[:-1]
        self.columns = (
            np.ascontiguousarray(first).reshape(-1, 3),
            np.ascontiguousarray(second).reshape(-1, 3),
            per_ray(function, "t_min", t_min, self.shape, np.float32),
            per_ray(function, "t_max", t_max, self.shape, np.float32),
            per_ray(function, "mask", mask, self.shape, np.uint32),
        )
