"""Curves and points of a scene: primitives beside triangles, which a scene is given and which move like meshes."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_rows, as_steps, as_time_range, check_id
from .build_config import BuildConfig, Usage, as_config, check_usage
from .curve_chains import CurveChains, CurveKind, CurveShape, as_radii, as_shape, divide


class CurvesAndPoints:
    """Edits of a `Scene`. Ids, instances, masks and usages are those of meshes.

    Both are solids with a surface, but for ribbons, see `add_curves`: a ray enters and leaves them, and to the ray's
    cull an entry is a front and an exit a back; `list_intersections` has both. Rays are mapped into the mesh's own
    space, so that an instance whose transform stretches them shows ellipsoids. Of a transform that flattens them
    nothing is left, and no ray meets them. Hits tell the number of the curve or the point, the normal outward of the
    true surface, and of curves u from 0 at the first point to 1 at the last, as their control points divide them.
    """

    __slots__ = ()
    _scene: _core.Scene
    # Of the curves that are divided, by the mesh's id. No lock is held while the engine edits, which may wait for a
    # commit whose progress callable waits for the lock; each edit tells the engine all of what it is made of instead.
    _chains: dict[int, CurveChains]

    def add_points(
        self,
        centers: npt.ArrayLike,
        radii: npt.ArrayLike,
        *,
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
    ) -> int:
        """Adds points, which are balls, and returns their id as a mesh. They are seen only through instances.

        centers: (N, 3) float; float64 keeps its detail however far from zero it lies.
        radii: (N,) float, or one number for all, not negative. Points of radius 0 are left out: no hit has their
            number, and `statistics()` counts them.
        build, usage: see `Scene.add_mesh`.

        Raises ValueError for numbers that are not finite or above 1e18, negative radii and wrong shapes.
        """
        check_usage("add_points", usage)
        rows = as_rows("add_points", "centers", centers)
        sizes = as_radii("add_points", radii, rows)
        return self._scene.add_points(rows, sizes, as_config("add_points", build).as_settings(), usage)

    def add_curves(
        self,
        points: npt.ArrayLike,
        radii: npt.ArrayLike,
        curve_offsets: npt.ArrayLike,
        *,
        kind: CurveKind = "poly",
        cyclic: npt.ArrayLike = False,
        tolerance: float | None = None,
        pieces: int | None = None,
        shape: CurveShape = "round",
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
    ) -> int:
        """Adds curves, and returns their id as a mesh. They are seen only through instances.

        points: (P, 3) float, of one curve after another; float64 keeps its detail however far from zero it lies.
        radii: (P,) float, or one number for all, not negative. What is traced is a chain of segments, a segment the
            convex hull of the balls around two points that follow each other: a cone with round ends. Segments whose
            two radii are 0 are left out, and `statistics()` counts them.
        curve_offsets: (C + 1,) int: where each curve begins among the points, from 0 on, and P at the end. A curve has
            2 points or more.
        kind: "poly": straight from point to point. Else a cubic from one to the next, of the radius too, as Blender
            evaluates it: "catmull_rom" (through all points, the ends counted twice), "bezier" (points 0, 3, 6, ... are
            passed through, the two between are handles: 3 n + 1 points, or 3 n of a cyclic one), "b_spline" (uniform,
            from near the second point to near the last but one; with fewer than 4 points a poly).
        cyclic: (C,) bool, or one for all: whether a curve returns to where it begins.
        tolerance: how far the chain's surface may be from the curve's, in the mesh's units; by default a tenth of the
            mean radius. Spans between points get as many pieces as that takes, all those of a curve as many.
        pieces: instead of it, how many each span gets, 1 to 1024: then chains of curves that move keep theirs.
        shape: "round", or "ribbon": flat strips as wide, which face each ray. A ray meets one where it is nearest to
            the axis, if it passes that no farther than the radius: once, as a front; normals are rounded across the
            width, as those of a tube. Bends are filled, also where a cyclic curve returns; the ends of others are cut
            off straight, but round where a curve begins or ends with two equal points. In an instance strips face the
            ray as it is mapped into the mesh's space, and normals are those of the tube that the transform stretches
            with them. Closest points are those of the round curve.
        build, usage: see `Scene.add_mesh`.

        Raises ValueError for numbers that are not finite or above 1e18, negative radii, offsets that descend, do not
        add up or leave a curve less points than its kind takes, wrong shapes, and more than 2**30 balls.
        """
        check_usage("add_curves", usage)
        is_ribbon = as_shape("add_curves", shape) == "ribbon"
        settings = as_config("add_curves", build).as_settings()
        chains, centres, sizes, offsets, closed = divide(
            "add_curves", points, radii, curve_offsets, kind, cyclic, tolerance, pieces
        )
        mesh = self._scene.add_curves(centres, sizes, offsets, closed, is_ribbon, settings, usage)
        self._keep(mesh, chains)
        return mesh

    def update_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves points: (N, 3) with as many rows as before, and radii as in `add_points`; None keeps them.

        The next commit refits the tree, or rebuilds it where a refitted one would be too slow, or where points got
        their first radius or lost it, and reports which and why. Raises ValueError as `add_points` does.
        """
        self._update("update_points", "centers", mesh, centers, radii)

    def update_curves(self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves curves: (P, 3) with as many rows as before, and radii as in `add_curves`; None keeps them.

        The next commit refits the tree, or rebuilds it where a refitted one would be too slow, where segments got
        their first radius or lost it, or where the curves bend so much that the tolerance asks for more pieces, and
        reports which and why. Pieces that a straighter curve would not need are kept. Raises ValueError as
        `add_curves` does.
        """
        number = check_id("update_curves", "mesh", mesh)
        rows = as_rows("update_curves", "points", points)
        chains = self._chains.get(number)
        if chains is None:
            self._update("update_curves", "points", number, rows, radii)
            return
        moved, centres, sizes = chains.moved("update_curves", rows, radii)
        self._scene.set_chains(number, centres, sizes, moved.subdivision.offsets)
        self._keep(number, moved)

    def set_points_motion(
        self,
        mesh: int,
        centers: npt.ArrayLike,
        radii: npt.ArrayLike | None = None,
        time_range: tuple[float, float] = (0.0, 1.0),
    ) -> None:
        """Moves points within the shutter, as `Scene.set_mesh_motion` moves vertices: (S, N, 3) at S steps.

        radii: (S, N), or (N,) or one number for all steps; None keeps those that they have. A point whose radius is 0
            at one step must have none at any.
        """
        name = "set_points_motion"
        steps, rows = as_steps(name, "centers", centers, 3)
        if steps == 1:
            self.update_points(mesh, rows, None if radii is None else np.asarray(radii).reshape(-1))
            return
        sizes = _radii_in_steps(name, radii, rows, steps)
        span = as_time_range(name, time_range)
        none = np.empty(0, np.int64)
        self._scene.set_points_motion(check_id(name, "mesh", mesh), rows, sizes, none, steps, span)

    def set_curves_motion(
        self,
        mesh: int,
        points: npt.ArrayLike,
        radii: npt.ArrayLike | None = None,
        time_range: tuple[float, float] = (0.0, 1.0),
    ) -> None:
        """Moves curves within the shutter, as `Scene.set_mesh_motion` moves vertices: (S, P, 3) at S steps.

        radii: (S, P), or (P,) or one number for all steps; None keeps those that they have. A segment whose radii are 0
            at one step must have none at any. Curves that are not poly get the pieces that the most bent step asks for,
            at every step; the balls between which their segments are go in straight lines.
        """
        name = "set_curves_motion"
        number = check_id(name, "mesh", mesh)
        steps, rows = as_steps(name, "points", points, 3)
        if steps == 1:
            self.update_curves(number, rows, None if radii is None else np.asarray(radii).reshape(-1))
            return
        sizes = _radii_in_steps(name, radii, rows, steps)
        span, offsets, chains = as_time_range(name, time_range), np.empty(0, np.int64), self._chains.get(number)
        if chains is not None:
            chains, rows, sizes = chains.moved_in_steps(name, rows, sizes, steps)
            offsets = chains.subdivision.offsets
        self._scene.set_curves_motion(number, rows, sizes, offsets, steps, span)
        if chains is not None:
            self._keep(number, chains)

    def replace_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike) -> None:
        """Gives a mesh of points others, as many as there are, see `add_points`; its instances stay."""
        number = check_id("replace_points", "mesh", mesh)
        rows = as_rows("replace_points", "centers", centers)
        self._scene.replace_points(number, rows, as_radii("replace_points", radii, rows))

    def replace_curves(
        self,
        mesh: int,
        points: npt.ArrayLike,
        radii: npt.ArrayLike,
        curve_offsets: npt.ArrayLike,
        *,
        kind: CurveKind = "poly",
        cyclic: npt.ArrayLike = False,
        tolerance: float | None = None,
        pieces: int | None = None,
        shape: CurveShape = "round",
    ) -> None:
        """Gives a mesh of curves others, of whichever shape, see `add_curves`; its instances stay."""
        number = check_id("replace_curves", "mesh", mesh)
        is_ribbon = as_shape("replace_curves", shape) == "ribbon"
        chains, centres, sizes, offsets, closed = divide(
            "replace_curves", points, radii, curve_offsets, kind, cyclic, tolerance, pieces
        )
        self._scene.replace_curves(number, centres, sizes, offsets, closed, is_ribbon)
        self._keep(number, chains)

    def _keep(self, mesh: int, chains: CurveChains | None) -> None:
        if chains is None:
            self._chains.pop(mesh, None)
        else:
            self._chains[mesh] = chains

    def _update(self, name: str, what: str, mesh: int, places: npt.ArrayLike, radii: npt.ArrayLike | None) -> None:
        number = check_id(name, "mesh", mesh)
        rows = as_rows(name, what, places)
        sizes = np.empty(0, rows.dtype) if radii is None else as_radii(name, radii, rows)
        (self._scene.update_points if name == "update_points" else self._scene.update_curves)(number, rows, sizes)


def _radii_in_steps(function: str, radii: npt.ArrayLike | None, rows: npt.NDArray[Any], steps: int) -> npt.NDArray[Any]:
    """Of all steps, one after another, of the rows' dtype: one number a step, or one a row; empty for None."""
    if radii is None:
        return np.empty(0, rows.dtype)
    array = np.asarray(radii)
    if array.ndim == 2:
        if array.shape != (steps, len(rows) // steps):
            raise ValueError(f"{function}: radii must have shape ({steps}, {len(rows) // steps}), got {array.shape}")
        return as_radii(function, array.reshape(-1), rows)
    return np.tile(as_radii(function, array, rows[: len(rows) // steps]), steps)
