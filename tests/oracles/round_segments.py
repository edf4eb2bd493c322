"""Hulls of two balls along a ray, by the balls between the two: in the longest float, by independent formulas.

The convex hull of the balls (c0, r0) and (c1, r1) is the union of the balls (c0 + s (c1 - c0), r0 + s (r1 - r0)), s in
[0, 1]. With T(s) how far along the ray a ball's middle is, and h(s) how far from the ray, the ray is in that ball from
T - sqrt(q) to T + sqrt(q), q = r^2 - h^2, a quadratic in s. The hull's interval reaches from the least of these to the
greatest: at an end, or where the derivative is zero. For any s the ball lies in the hull, and near the best s the
interval changes with the square of the error of s: so a small error of s hardly matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Real = np.longdouble  # 64 bits of mantissa on x86, 53 or more elsewhere
Reals = npt.NDArray[np.longdouble]


def dot(a: Reals, b: Reals) -> Reals:
    return (a * b).sum(axis=-1)


@dataclass(frozen=True)
class Hulls:
    """starts, ends: (P, 3), the balls' middles; first_radii, last_radii: (P,)."""

    starts: Reals
    ends: Reals
    first_radii: Reals
    last_radii: Reals

    @classmethod
    def of(cls, starts: npt.ArrayLike, ends: npt.ArrayLike, radii: npt.ArrayLike) -> Hulls:
        """radii: (P, 2)."""
        both = np.asarray(radii, Real).reshape(-1, 2)
        return cls(*(np.asarray(rows, Real).reshape(-1, 3) for rows in (starts, ends)), both[:, 0], both[:, 1])


def intervals(hulls: Hulls, origins: Reals, directions: Reals, growth: npt.ArrayLike = 0.0) -> tuple[Reals, Reals]:
    """Where ray k of origins, directions (P, 3) enters and leaves hull k, in t of the ray; NaN where it misses.

    growth: added to both radii, (P,) or a number. Where it makes one negative, the hull ends where the radius is zero.
    """
    length = np.sqrt(dot(directions, directions))
    along = directions / length[:, None]
    start, axis = hulls.starts - origins, hulls.ends - hulls.starts
    radius = hulls.first_radii + growth
    radius_step = hulls.last_radii - hulls.first_radii
    middle, middle_step = dot(start, along), dot(axis, along)
    off, off_step = start - middle[:, None] * along, axis - middle_step[:, None] * along
    low, high = _shares_of_no_negative_radius(radius, radius_step)
    near, far = np.full(len(start), np.inf, Real), np.full(len(start), -np.inf, Real)
    for candidate in (low, high, *_flat_places(off, off_step, radius, radius_step, middle_step, axis)):
        s = np.clip(np.where(np.isfinite(candidate), candidate, low), low, high)
        place = off + s[:, None] * off_step
        distance = np.sqrt(dot(place, place))
        size = np.maximum(radius + s * radius_step, 0.0)
        is_in = (distance <= size) & (low <= high)
        half = np.sqrt(np.where(is_in, (size - distance) * (size + distance), 0.0))
        near = np.where(is_in, np.minimum(near, middle + s * middle_step - half), near)
        far = np.where(is_in, np.maximum(far, middle + s * middle_step + half), far)
    missed = near > far
    return np.where(missed, np.nan, near / length), np.where(missed, np.nan, far / length)


def _shares_of_no_negative_radius(radius: Reals, step: Reals) -> tuple[Reals, Reals]:
    """Between which s the radius is not negative; the first is above the second where it is so nowhere."""
    last = radius + step
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -radius / step
    low = np.where(radius < 0.0, np.where(last < 0.0, 1.0, zero), 0.0)
    high = np.where(last < 0.0, np.where(radius < 0.0, 0.0, zero), 1.0)
    return low, high


def _flat_places(
    off: Reals, off_step: Reals, radius: Reals, radius_step: Reals, middle_step: Reals, axis: Reals
) -> list[Reals]:
    """The s at which T -+ sqrt(q) may be flat, and that of the greatest q; values that are not finite do not count.

    q(s) = A s^2 + B s + C is flat at m = -B / 2A, and zero as far from there as sqrt(-q(m) / A). With T' constant,
    T' = +-q' / (2 sqrt(q)) holds |T'| / L times as far from m, where L^2 = |c1 - c0|^2 - (r1 - r0)^2 = T'^2 - A; if
    there is no such L, one ball holds the other. The second way to the same s is for A near zero and m far away.
    """
    a = radius_step**2 - dot(off_step, off_step)
    b = 2.0 * (radius * radius_step - dot(off, off_step))
    c = radius**2 - dot(off, off)
    length = dot(axis, axis) - radius_step**2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        m = -b / (2.0 * a)
        nearest = off + np.where(np.isfinite(m), m, 0.0)[:, None] * off_step
        reach = np.sqrt(((radius + m * radius_step) ** 2 - dot(nearest, nearest)) / -a * middle_step**2 / length)
        d = (4.0 * middle_step**2 * c - b * b) / (4.0 * length)
        stable = -(b + np.copysign(np.sqrt(b * b - 4.0 * a * d), b)) / 2.0
        return [m, m - reach, m + reach, stable / a, d / stable]


def touching(hulls: Hulls, points: npt.ArrayLike) -> tuple[Reals, Reals, Reals]:
    """Of hull k's surface at point k of (P, 3): s of the ball that touches there, the outward normal, the distance.

    The distance is from the surface, negative inside. Where the point is the ball's very middle the normal is zero.
    """
    from_start = np.asarray(points, Real) - hulls.starts
    axis = hulls.ends - hulls.starts
    step = hulls.last_radii - hulls.first_radii
    square = dot(axis, axis)
    size = np.sqrt(square)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = dot(from_start, axis) / size
        away = from_start - (height / size)[:, None] * axis
        s = (height + np.sqrt(dot(away, away)) * step / np.sqrt(square - step**2)) / size
    s = np.where(square > step**2, np.clip(s, 0.0, 1.0), np.where(step > 0.0, 1.0, 0.0))
    out = from_start - s[:, None] * axis
    distance = np.sqrt(dot(out, out))
    with np.errstate(invalid="ignore"):
        normals = np.where(distance[:, None] > 0.0, out / distance[:, None], 0.0)
    return s, normals, distance - (hulls.first_radii + s * step)


def distances(points: npt.ArrayLike, hulls: Hulls) -> Reals:
    """Points (P, 3), S hulls -> (P, S): from each hull's surface, negative inside."""
    places = np.asarray(points, Real).reshape(-1, 3)
    count = len(hulls.starts)
    rows, columns = np.repeat(np.arange(len(places)), count), np.tile(np.arange(count), len(places))
    return touching(take(hulls, columns), places[rows])[2].reshape(len(places), count)


def take(hulls: Hulls, rows: npt.NDArray[np.int64]) -> Hulls:
    return Hulls(hulls.starts[rows], hulls.ends[rows], hulls.first_radii[rows], hulls.last_radii[rows])
