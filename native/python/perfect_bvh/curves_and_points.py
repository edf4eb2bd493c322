"""Curves and points of a scene: primitives beside triangles, which a scene is given and which move like meshes."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, as_integers, as_rows, check_id
from .build_config import BuildConfig, Usage, as_config, check_usage

CurveKind = Literal["poly"]


class CurvesAndPoints:
    """Edits of a `Scene`. Ids, instances, masks, usages and lazy trees are those of meshes.

    Both are solids with a surface: a ray enters and leaves them, `list_intersections` has both, and to the ray's cull
    an entry is a front and an exit a back. Rays are mapped into the mesh's own space, so that an instance whose
    transform stretches them shows ellipsoids. Of a transform that flattens them nothing is left, and no ray meets them.
    Hits tell the number of the curve or the point, the normal outward of the true surface, and of curves u from 0 at
    the first point to 1 at the last.
    """

    __slots__ = ()
    _scene: _core.Scene

    def add_points(
        self,
        centers: npt.ArrayLike,
        radii: npt.ArrayLike,
        *,
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
        lazy: bool = False,
    ) -> int:
        """Adds points, which are balls, and returns their id as a mesh. They are seen only through instances.

        centers: (N, 3) float; float64 keeps its detail however far from zero it lies.
        radii: (N,) float, or one number for all, not negative. Points of radius 0 are left out: no hit has their
            number, and `statistics()` counts them.
        build, usage, lazy: see `Scene.add_mesh`. The layout of leaves is "compact", whichever is asked for.

        Raises ValueError for numbers that are not finite or above 1e18, negative radii and wrong shapes.
        """
        check_usage("add_points", usage)
        rows = as_rows("add_points", "centers", centers)
        sizes = _radii("add_points", radii, rows)
        return self._scene.add_points(rows, sizes, as_config("add_points", build).as_settings(), usage, bool(lazy))

    def add_curves(
        self,
        points: npt.ArrayLike,
        radii: npt.ArrayLike,
        curve_offsets: npt.ArrayLike,
        *,
        kind: CurveKind = "poly",
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
        lazy: bool = False,
    ) -> int:
        """Adds curves, and returns their id as a mesh. They are seen only through instances.

        points: (P, 3) float, of one curve after another; float64 keeps its detail however far from zero it lies.
        radii: (P,) float, or one number for all, not negative. A curve is the union of its segments, a segment the
            convex hull of the balls around two points that follow each other: a cone with round ends. Segments whose
            two radii are 0 are left out, and `statistics()` counts them.
        curve_offsets: (C + 1,) int: where each curve begins among the points, from 0 on, and P at the end. A curve has
            2 points or more.
        kind: "poly": straight from point to point.
        build, usage, lazy: see `Scene.add_mesh`. The layout of leaves is "compact", whichever is asked for.

        Raises ValueError for numbers that are not finite or above 1e18, negative radii, offsets that descend, do not
        add up or leave a curve less than 2 points, and wrong shapes.
        """
        if kind != "poly":
            raise ValueError(f"add_curves: kind must be 'poly', got {kind!r}; divide other curves into segments first")
        check_usage("add_curves", usage)
        rows = as_rows("add_curves", "points", points)
        sizes = _radii("add_curves", radii, rows)
        offsets = as_integers("add_curves", "curve_offsets", curve_offsets, np.int64).reshape(-1)
        settings = as_config("add_curves", build).as_settings()
        return self._scene.add_curves(rows, sizes, offsets, settings, usage, bool(lazy))

    def update_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves points: (N, 3) with as many rows as before, and radii as in `add_points`; None keeps them.

        The next commit refits the tree, or rebuilds it where a refitted one would be too slow, or where points got
        their first radius or lost it, and reports which and why. Raises ValueError as `add_points` does.
        """
        self._update("update_points", "centers", mesh, centers, radii)

    def update_curves(self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves curves: (P, 3) with as many rows as before, and radii as in `add_curves`; None keeps them.

        The next commit refits the tree, or rebuilds it where a refitted one would be too slow, or where segments got
        their first radius or lost it, and reports which and why. Raises ValueError as `add_curves` does.
        """
        self._update("update_curves", "points", mesh, points, radii)

    def _update(self, name: str, what: str, mesh: int, places: npt.ArrayLike, radii: npt.ArrayLike | None) -> None:
        number = check_id(name, "mesh", mesh)
        rows = as_rows(name, what, places)
        sizes = np.empty(0, rows.dtype) if radii is None else _radii(name, radii, rows)
        (self._scene.update_points if name == "update_points" else self._scene.update_curves)(number, rows, sizes)


def _radii(function: str, radii: npt.ArrayLike, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """One number, or as many as rows, as the rows' dtype."""
    array = as_array(function, "radii", radii)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != len(rows)):
        raise ValueError(f"{function}: radii must have shape ({len(rows)},) or be one number, got {array.shape}")
    return np.ascontiguousarray(array.reshape(-1), dtype=rows.dtype)
