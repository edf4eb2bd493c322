"""Curves over control points as what the engine traces: chains of balls, within a stated distance of the curves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, as_integers, as_rows, check_count
from .build_config import checked_number

CurveKind = Literal["poly", "catmull_rom", "bezier", "b_spline"]
CURVE_KINDS: tuple[str, ...] = get_args(CurveKind)
CurveShape = Literal["round", "ribbon"]
_MOST_PIECES = 1024
_DEFAULT_TOLERANCE = 0.1  # of the mean radius
_LARGEST = 1e18


@dataclass(frozen=True, slots=True)
class CurveChains:
    """What is kept of curves to divide them again when they move.

    offsets, cyclic: of the control points, int64 and uint8. radii: (P,) or (1,), of the points' dtype. tolerance: in
    the mesh's units. piece_count: of every span, or 0 for as many as the tolerance asks for.
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
        """The same curves elsewhere, and their balls' centres and radii.

        They have the pieces that they had if those are as many as the tolerance asks for; else `subdivision` is new.
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
        """As `moved`, of steps one after another: with the pieces that the most bent of them asks for.

        radii: of all steps, one number a step or one a point; empty: those that there are.
        """
        places = np.split(points, steps)
        sizes = [None if radii.size == 0 else part for part in np.split(radii, steps)]
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
    pieces: int | None,
) -> tuple[CurveChains | None, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[np.int64], npt.NDArray[np.uint8]]:
    """Returns the curves' chains, None for what is a chain as it is, and what the engine makes curves of.

    That is the balls' centres, radii and offsets, and which curves are cyclic.
    """
    if kind not in CURVE_KINDS:
        raise ValueError(f"{function}: kind must be one of {', '.join(CURVE_KINDS)}, got {kind!r}")
    rows = as_rows(function, "points", points)
    sizes = as_radii(function, radii, rows)
    offsets = as_integers(function, "curve_offsets", curve_offsets, np.int64).reshape(-1)
    closed = _as_cyclic(function, cyclic, max(len(offsets) - 1, 0))
    if tolerance is not None and pieces is not None:
        raise ValueError(f"{function}: tolerance and pieces exclude each other; give one of them")
    limit = _default_tolerance(sizes) if tolerance is None else _as_tolerance(function, tolerance)
    piece_count = 0 if pieces is None else check_count(function, "pieces", pieces, 1, _MOST_PIECES)
    if kind == "poly" and not closed.any():
        return None, rows, sizes, offsets, closed
    division = _core.divide_curves(rows, sizes, offsets, closed, kind, limit, piece_count, function)
    chains = CurveChains(kind, offsets, closed, sizes, limit, piece_count, len(rows), division)  # type: ignore[arg-type]
    return chains, *chains.balls(function, rows), division.offsets, closed


def as_shape(function: str, shape: str) -> str:
    """As given, if it is one."""
    if shape not in get_args(CurveShape):
        raise ValueError(f"{function}: shape must be one of {', '.join(get_args(CurveShape))}, got {shape!r}")
    return shape


def as_radii(function: str, radii: npt.ArrayLike, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """One number, or as many as rows, as the rows' dtype."""
    array = as_array(function, "radii", radii)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != len(rows)):
        raise ValueError(f"{function}: radii must have shape ({len(rows)},) or be one number, got {array.shape}")
    with np.errstate(over="ignore"):  # what becomes infinite is refused by the engine, by its number
        return np.array(array.reshape(-1), dtype=rows.dtype)  # a copy: it may be kept


def _as_cyclic(function: str, cyclic: npt.ArrayLike, curve_count: int) -> npt.NDArray[np.uint8]:
    """One a curve, or one for all."""
    array = as_array(function, "cyclic", cyclic)
    if array.dtype.kind != "b":
        raise ValueError(f"{function}: cyclic must be True, False, or one of them a curve, got dtype {array.dtype}")
    if array.ndim > 1 or (array.ndim == 1 and len(array) != curve_count):
        raise ValueError(f"{function}: cyclic must have shape ({curve_count},) or be one bool, got {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, curve_count), dtype=np.uint8)


def _as_tolerance(function: str, tolerance: float) -> float:
    number = checked_number(function, "tolerance", tolerance, 0.0, _LARGEST)
    if number == 0.0:
        raise ValueError(
            f"{function}: tolerance must be above 0, got {tolerance!r}; a tenth of a radius is hardly seen"
        )
    return number


def _default_tolerance(radii: npt.NDArray[Any]) -> float:
    """A tenth of the mean of what radii there are; what has none is never seen, however it is divided."""
    some = radii[radii > 0]
    mean = float(some.mean(dtype=np.float64)) if len(some) else 1.0
    return _DEFAULT_TOLERANCE * mean if math.isfinite(mean) else 1.0  # the engine refuses what is not finite
