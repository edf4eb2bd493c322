"""Curves and points of a scene: primitives other than triangles, which are added and moved like meshes."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, as_integers, as_rows, as_steps, as_time_range
from ._checks import check_choice, check_count, check_id, check_number
from .build_config import BuildConfig, Usage, as_config, check_usage

# Curves over control points become chains of spheres, the engine's primitive, within a stated distance of the curves.


CurveKind = Literal["poly", "catmull_rom", "bezier", "b_spline"]
CURVE_KINDS: tuple[str, ...] = get_args(CurveKind)
CurveShape = Literal["round", "ribbon"]
_MOST_SEGMENTS = 1024
_DEFAULT_TOLERANCE = 0.1  # of the mean radius
_LARGEST = 1e18


@dataclass(frozen=True, slots=True)
class CurveChains:
    """The data of curves that is needed to divide them again when they move.

    Attributes:
        offsets, cyclic: Of the control points, int64 and uint8.
        radii: (P,) or (1,), of the points' dtype.
        tolerance: In the mesh's units.
        piece_count: Of every span, or 0 for the number that the tolerance needs.
    """

    kind: CurveKind
    offsets: npt.NDArray[np.int64]
    cyclic: npt.NDArray[np.uint8]
    radii: npt.NDArray[Any]
    tolerance: float
    piece_count: int
    point_count: int
    subdivision: _core.Subdivision

    def moved(
        self, function: str, points: npt.NDArray[Any], radii: npt.ArrayLike | None
    ) -> tuple[CurveChains, npt.NDArray[Any], npt.NDArray[Any]]:
        """Returns the same curves at other points, and the centres and radii of their spheres.

        They keep their number of segments if it equals the number that the tolerance needs; else `subdivision` is new.
        """
        if len(points) != self.point_count:
            raise ValueError(
                f"{function}: points must have {self.point_count} rows, as many as before, got {len(points)}; "
                "replace_curves takes others"
            )
        sizes = self.radii.astype(points.dtype) if radii is None else as_radii(function, radii, points)
        chains = replace(self, radii=sizes)
        if not self.piece_count and self.kind != "poly":
            needed = chains._divided(function, points)
            if not self.subdivision.is_as_fine_as(needed):
                chains = replace(chains, subdivision=needed)
        return chains, *chains.balls(function, points)

    def moved_in_steps(
        self, function: str, points: npt.NDArray[Any], radii: npt.NDArray[Any], steps: int
    ) -> tuple[CurveChains, npt.NDArray[Any], npt.NDArray[Any]]:
        """Moves curves like `moved`, for several steps: all get the segments that the most bent step needs.

        Args:
            radii: Of all steps, one number a step or one a point; empty: the current ones.
        """
        places = np.split(points, steps)
        sizes = [_of_a_step(part) for part in np.split(radii, steps)]
        each = [self.moved(function, place, size)[0] for place, size in zip(places, sizes, strict=True)]
        finest = each[0].subdivision
        for chains in each[1:]:
            finest = finest.finer(chains.subdivision)
        each = [replace(chains, subdivision=finest) for chains in each]
        parts = [chains.balls(function, place) for chains, place in zip(each, places, strict=True)]
        return each[0], np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def balls(self, function: str, points: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """(B, 3) centres and (B,) radii, of the points' dtype."""
        return self.subdivision.balls(points, self.radii, self.offsets, self.cyclic, self.kind, function)

    def _divided(self, function: str, points: npt.NDArray[Any]) -> _core.Subdivision:
        return _core.divide_curves(
            points, self.radii, self.offsets, self.cyclic, self.kind, self.tolerance, self.piece_count, function
        )


def divide(
    function: str,
    points: npt.ArrayLike,
    radii: npt.ArrayLike,
    curve_offsets: npt.ArrayLike,
    kind: str,
    cyclic: npt.ArrayLike,
    tolerance: float | None,
    segments: int | None,
) -> tuple[CurveChains | None, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[np.int64], npt.NDArray[np.uint8]]:
    """Returns the curves' chains (None for curves that are chains already), and the engine's input.

    The input is the spheres' centres, radii and offsets, and which curves are cyclic.
    """
    check_choice(function, "kind", kind, CURVE_KINDS)
    rows = as_rows(function, "points", points)
    sizes = as_radii(function, radii, rows)
    offsets = as_integers(function, "curve_offsets", curve_offsets, np.int64).reshape(-1)
    closed = _as_cyclic(function, cyclic, max(len(offsets) - 1, 0))
    if tolerance is not None and segments is not None:
        raise ValueError(f"{function}: tolerance and segments exclude each other; give one of them")
    if tolerance is None:
        limit = _default_tolerance(sizes)
    else:
        limit = check_number(function, "tolerance", tolerance, 0.0, _LARGEST, above=True)
    piece_count = 0 if segments is None else check_count(function, "segments", segments, 1, _MOST_SEGMENTS)
    if kind == "poly" and not closed.any():
        return None, rows, sizes, offsets, closed
    division = _core.divide_curves(rows, sizes, offsets, closed, kind, limit, piece_count, function)
    chains = CurveChains(kind, offsets, closed, sizes, limit, piece_count, len(rows), division)  # type: ignore[arg-type]
    return chains, *chains.balls(function, rows), division.offsets, closed


def _segments(function: str, segments: int | None, pieces: int | None) -> int | None:
    """Returns the number of segments of a span, which may be given under its former name."""
    if pieces is None:
        return segments
    if segments is not None:
        raise ValueError(f"{function}: segments and pieces are the same; give segments only")
    warnings.warn(f"{function}: pieces is now called segments", DeprecationWarning, stacklevel=3)
    return pieces


def as_radii(function: str, radii: npt.ArrayLike, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Returns one number, or one for each row, as the rows' dtype."""
    array = as_array(function, "radii", radii)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != len(rows)):
        raise ValueError(f"{function}: radii must have shape ({len(rows)},) or be one number, got {array.shape}")
    with np.errstate(over="ignore"):  # the engine refuses infinite values, by their number
        return np.array(array.reshape(-1), dtype=rows.dtype)  # a copy: it may be kept


def _as_cyclic(function: str, cyclic: npt.ArrayLike, curve_count: int) -> npt.NDArray[np.uint8]:
    """Returns one for each curve, or one for all."""
    array = as_array(function, "cyclic", cyclic)
    if array.dtype.kind != "b":
        raise ValueError(f"{function}: cyclic must be True, False, or one of them a curve, got dtype {array.dtype}")
    if array.ndim > 1 or (array.ndim == 1 and len(array) != curve_count):
        raise ValueError(f"{function}: cyclic must have shape ({curve_count},) or be one bool, got {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, curve_count), dtype=np.uint8)


def _default_tolerance(radii: npt.NDArray[Any]) -> float:
    """A tenth of the mean radius; curves without radii are never visible, however they are divided."""
    some = radii[radii > 0]
    mean = float(some.mean(dtype=np.float64)) if len(some) else 1.0
    return _DEFAULT_TOLERANCE * mean if math.isfinite(mean) else 1.0  # the engine refuses infinite radii


# Curves and points ---------------------------------------------------------------------------------------------------


class CurvesAndPoints:
    """Edits of a `Scene`. Ids, instances, masks and usages are those of meshes.

    Both are solids with a surface, except ribbons, see `add_curves`. A ray enters and leaves them. For the ray's
    cull an entry is a front and an exit a back; `list_intersections` has both. Rays are mapped into the mesh's own
    space, so an instance whose transform stretches them shows ellipsoids. If the transform flattens them, no ray hits
    them. Hits hold the number of the curve or the point and the outward normal of the true surface. For curves u runs
    from 0 at the first point to 1 at the last, as their control points divide them.
    """

    __slots__ = ()
    _scene: _core.Scene
    # The divided curves, by the mesh's id. No lock is held while the engine edits: it may wait for a commit whose
    # progress callable waits for the lock. Therefore each edit passes all its data to the engine.
    _chains: dict[int, CurveChains]

    def add_points(
        self,
        centers: npt.ArrayLike,
        radii: npt.ArrayLike,
        *,
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
    ) -> int:
        """Adds points, which are spheres, and returns their id as a mesh. They are visible only through instances.

        Args:
            centers: (N, 3) float; see `Scene.add_mesh` for the detail that is kept.
            radii: (N,) float, or one number for all, not negative. Points of radius 0 are left out: no hit has their
                number, and `statistics()` counts them.
            build, usage: See `Scene.add_mesh`.

        Raises:
            ValueError: For numbers that are not finite or above 1e18, negative radii and wrong shapes.
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
        segments: int | None = None,
        shape: CurveShape = "round",
        build: Literal["auto"] | BuildConfig = "auto",
        usage: Usage = "static",
        pieces: int | None = None,
    ) -> int:
        """Adds curves, and returns their id as a mesh. They are visible only through instances.

        Args:
            points: (P, 3) float, of one curve after another; see `Scene.add_mesh` for the detail that is kept.
            radii: (P,) float, or one number for all, not negative. A curve is traced as a chain of segments. A segment
                is the convex hull of the spheres around two consecutive points: a cone with round ends. Segments
                whose two radii are 0 are left out, and `statistics()` counts them.
            curve_offsets: (C + 1,) int: the index of each curve's first point, from 0 on, and P at the end. A curve
                has 2 points or more.
            kind: "poly": straight from point to point. Else a cubic from one to the next, of the radius too, as Blender
                evaluates it: "catmull_rom" (through all points, the ends counted twice), "bezier" (through points 0, 3,
                6, ..., the two between are handles: 3 n + 1 points, or 3 n of a cyclic one), "b_spline" (uniform, from
                near the second point to near the last but one; with fewer than 4 points a poly).
            cyclic: (C,) bool, or one for all: whether a curve returns to its first point.
            tolerance: The largest distance of the chain's surface from the curve's, in the mesh's units; by default a
                tenth of the mean radius. Spans between points get the number of segments that it needs; all spans of a
                curve get the same number.
            segments: Instead of a tolerance, the number of segments of each span, 1 to 1024. Curves that move keep it.
            shape: "round", or "ribbon": flat strips of the same width, which face each ray. A ray hits a ribbon where
                it is nearest to the axis, if it passes within the radius: once, as a front. Normals are rounded across
                the width, like those of a tube. Bends are filled, also where a cyclic curve returns. Other ends are cut
                off straight, but round where a curve begins or ends with two equal points. In an instance, strips face
                the ray that is mapped into the mesh's space, and normals are those of the tube that the transform
                stretches with them. Closest points are those of the round curve.
            build, usage: See `Scene.add_mesh`.
            pieces: The former name of `segments`, which works for one more version.

        Raises:
            ValueError: For numbers that are not finite or above 1e18, negative radii, offsets that descend, do not add
                up or leave a curve less points than its kind needs, wrong shapes, and more than 2**30 spheres.
        """
        check_usage("add_curves", usage)
        is_ribbon = check_choice("add_curves", "shape", shape, get_args(CurveShape)) == "ribbon"
        settings = as_config("add_curves", build).as_settings()
        count = _segments("add_curves", segments, pieces)
        chains, centres, sizes, offsets, closed = divide(
            "add_curves", points, radii, curve_offsets, kind, cyclic, tolerance, count
        )
        mesh = self._scene.add_curves(centres, sizes, offsets, closed, is_ribbon, settings, usage)
        self._keep(mesh, chains)
        return mesh

    def update_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves points: (N, 3), the same number of rows as before, and radii as in `add_points`; None keeps them.

        The next commit refits the tree. It rebuilds the tree if a refitted one would be too slow, or if points got
        their first radius or lost it. Its report says which, and why.

        Raises:
            ValueError: As `add_points` does.
        """
        self._update("update_points", "centers", mesh, centers, radii)

    def update_curves(self, mesh: int, points: npt.ArrayLike, radii: npt.ArrayLike | None = None) -> None:
        """Moves curves: (P, 3), the same number of rows as before, and radii as in `add_curves`; None keeps them.

        The next commit refits the tree. It rebuilds the tree if a refitted one would be too slow, if segments got
        their first radius or lost it, or if the curves bend so much that the tolerance needs more segments. Its report
        says which, and why. Segments that a straighter curve would not need are kept.

        Raises:
            ValueError: As `add_curves` does.
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

        Args:
            radii: (S, N), or (N,) or one number for all steps; None keeps the current ones. A point whose radius is
                0 at one step must have none at any.
        """
        name = "set_points_motion"
        steps, rows = as_steps(name, "centers", centers, 3)
        sizes, span = _radii_in_steps(name, radii, rows, steps), as_time_range(name, time_range)
        if steps == 1:
            self.update_points(mesh, rows, _of_a_step(sizes))
            return
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

        Args:
            radii: (S, P), or (P,) or one number for all steps; None keeps the current ones. A segment whose radii
                are 0 at one step must have none at any. Curves that are not poly get at every step the number of
                segments that the most bent step needs; the spheres at their ends move in straight lines.
        """
        name = "set_curves_motion"
        number = check_id(name, "mesh", mesh)
        steps, rows = as_steps(name, "points", points, 3)
        sizes, span = _radii_in_steps(name, radii, rows, steps), as_time_range(name, time_range)
        if steps == 1:
            self.update_curves(number, rows, _of_a_step(sizes))
            return
        offsets, chains = np.empty(0, np.int64), self._chains.get(number)
        if chains is not None:
            chains, rows, sizes = chains.moved_in_steps(name, rows, sizes, steps)
            offsets = chains.subdivision.offsets
        self._scene.set_curves_motion(number, rows, sizes, offsets, steps, span)
        if chains is not None:
            self._keep(number, chains)

    def replace_points(self, mesh: int, centers: npt.ArrayLike, radii: npt.ArrayLike) -> None:
        """Replaces the points of a mesh by any number of others, see `add_points`; its instances stay."""
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
        segments: int | None = None,
        shape: CurveShape = "round",
        pieces: int | None = None,
    ) -> None:
        """Replaces the curves of a mesh by others of any shape, see `add_curves`; its instances stay."""
        number = check_id("replace_curves", "mesh", mesh)
        is_ribbon = check_choice("replace_curves", "shape", shape, get_args(CurveShape)) == "ribbon"
        count = _segments("replace_curves", segments, pieces)
        chains, centres, sizes, offsets, closed = divide(
            "replace_curves", points, radii, curve_offsets, kind, cyclic, tolerance, count
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
    """Returns the radii of all steps, concatenated, of the rows' dtype: one a step, or one a row; empty for None."""
    if radii is None:
        return np.empty(0, rows.dtype)
    array = np.asarray(radii)
    if array.ndim == 2:
        if array.shape != (steps, len(rows) // steps):
            raise ValueError(f"{function}: radii must have shape ({steps}, {len(rows) // steps}), got {array.shape}")
        return as_radii(function, array.reshape(-1), rows)
    return np.tile(as_radii(function, array, rows[: len(rows) // steps]), steps)


def _of_a_step(radii: npt.NDArray[Any]) -> npt.ArrayLike | None:
    """Returns a step's part of `_radii_in_steps`, as `as_radii` takes it; None if there are none."""
    if radii.size == 0:
        return None
    return radii if len(radii) > 1 else radii[0]
