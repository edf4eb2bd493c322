"""Polygon soup as plain arrays: boxes, prisms, lathes, tubes, and how to move and join them. Does not use Blender.

Lengths are metres, angles radians, Z is up. Faces run counter-clockwise seen from outside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
Face = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Shape:
    """vertices (V, 3) float64; faces: vertex indices, any number of corners; slots: a material slot for each face."""

    vertices: Points
    faces: list[Face]
    slots: list[int]

    def painted(self, slot: int) -> Shape:
        """The same shape with every face in one material slot."""
        return replace(self, slots=[slot] * len(self.faces))

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        """Moved by metres along each axis."""
        return replace(self, vertices=self.vertices + np.array([x, y, z]))

    def scaled(self, x: float, y: float | None = None, z: float | None = None) -> Shape:
        """Scaled by one factor for each axis, or one for all. Factors must be positive: faces keep their order."""
        factors = (x, x if y is None else y, x if z is None else z)
        return replace(self, vertices=self.vertices * factors)

    def turned(self, matrix: ArrayLike) -> Shape:
        """Turned by a (3, 3) rotation about the origin."""
        return replace(self, vertices=self.vertices @ np.asarray(matrix, dtype=np.float64).T)

    def turned_x(self, angle: float) -> Shape:
        """Turned about X."""
        return self.turned(rotation("X", angle))

    def turned_y(self, angle: float) -> Shape:
        """Turned about Y."""
        return self.turned(rotation("Y", angle))

    def turned_z(self, angle: float) -> Shape:
        """Turned about Z."""
        return self.turned(rotation("Z", angle))


def rotation(axis: str, angle: float) -> Points:
    """(3, 3) rotation about "X", "Y" or "Z", counter-clockwise seen from the axis' tip."""
    first, second = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cos(angle)
    matrix[first, second], matrix[second, first] = -sin(angle), sin(angle)
    return matrix


def shape(vertices: ArrayLike, faces: Iterable[Sequence[int]], slot: int = 0) -> Shape:
    face_list = [tuple(int(index) for index in face) for face in faces]
    return Shape(np.asarray(vertices, dtype=np.float64).reshape(-1, 3), face_list, [slot] * len(face_list))


def joined(shapes: Iterable[Shape]) -> Shape:
    """One shape of many; nothing is welded."""
    parts = list(shapes)
    faces: list[Face] = []
    start = 0
    for part in parts:
        faces += [tuple(index + start for index in face) for face in part.faces]
        start += len(part.vertices)
    slots = [slot for part in parts for slot in part.slots]
    return Shape(np.concatenate([part.vertices for part in parts]), faces, slots)


def box(low: Sequence[float], high: Sequence[float]) -> Shape:
    """An axis-aligned box between two corners."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    corners = [(x, y, z) for z in (z0, z1) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    sides = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    return shape(corners, [(3, 2, 1, 0), (4, 5, 6, 7), *sides])


def prism(outline: ArrayLike, depth: float) -> Shape:
    """A polygon in X and Z, counter-clockwise seen from -Y, drawn out from y = 0 to y = depth. Its ends are n-gons."""
    flat = np.asarray(outline, dtype=np.float64)
    count = len(flat)
    near = np.column_stack([flat[:, 0], np.zeros(count), flat[:, 1]])
    sides = [((k + 1) % count, k, k + count, (k + 1) % count + count) for k in range(count)]
    ends = [tuple(range(count)), tuple(range(2 * count - 1, count - 1, -1))]
    return shape(np.concatenate([near, near + np.array([0.0, depth, 0.0])]), [*ends, *sides])


def lathe(profile: ArrayLike, segments: int, phase: float = 0.0) -> Shape:
    """Rows of (radius, z) from bottom to top, turned about Z; a radius of zero closes that end in a point."""
    rows = np.asarray(profile, dtype=np.float64)
    angles = phase + np.arange(segments) * (2.0 * pi / segments)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    rings: list[list[int]] = []
    vertices: list[Points] = []
    count = 0
    for radius, z in rows:
        ring = np.array([[0.0, 0.0, z]])
        if radius > 0.0:
            ring = np.column_stack([circle * radius, np.full(segments, z)])
        vertices.append(ring)
        rings.append([count + (k % len(ring)) for k in range(segments)])
        count += len(ring)
    faces: list[Face] = []
    for low, high in pairwise(rings):
        for k in range(segments):
            corner = (k + 1) % segments
            face = (low[k], low[corner], high[corner], high[k])
            unique = tuple(dict.fromkeys(face))
            if len(unique) > 2:
                faces.append(unique)
    return shape(np.concatenate(vertices), faces)


def tube(path: ArrayLike, radii: ArrayLike, sides: int = 6) -> Shape:
    """A round bar along a path (P, 3), with one radius a point or one for all; its ends are closed with n-gons."""
    points = np.asarray(path, dtype=np.float64)
    count = len(points)
    radius = np.broadcast_to(np.asarray(radii, dtype=np.float64), count)
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    side = np.cross(tangents[0], (0.0, 0.0, 1.0) if abs(tangents[0, 2]) < 0.9 else (1.0, 0.0, 0.0))
    angles = np.arange(sides) * (2.0 * pi / sides)
    rings = []
    for k in range(count):
        # The frame is carried along, so that the bar does not twist.
        side = side - tangents[k] * (side @ tangents[k])
        side /= np.linalg.norm(side)
        other = np.cross(tangents[k], side)
        rings.append(points[k] + radius[k] * (np.outer(np.cos(angles), side) + np.outer(np.sin(angles), other)))
    faces = [
        (r * sides + k, r * sides + (k + 1) % sides, (r + 1) * sides + (k + 1) % sides, (r + 1) * sides + k)
        for r in range(count - 1)
        for k in range(sides)
    ]
    ends = [tuple(range(sides - 1, -1, -1)), tuple((count - 1) * sides + k for k in range(sides))]
    return shape(np.concatenate(rings), [*faces, *ends])


def ball(middle: ArrayLike, radius: float | Points, rings: int = 6, sides: int = 10) -> Shape:
    """A ball round a point, between two poles along Z; radius: one, or one for each axis."""
    tilt = np.linspace(0.0, pi, rings + 1)[1:-1]
    turn = np.arange(sides) * 2.0 * pi / sides
    ring = [(sin(a) * cos(b), sin(a) * sin(b), cos(a)) for a in tilt for b in turn]
    vertices = np.array([(0.0, 0.0, 1.0), *ring, (0.0, 0.0, -1.0)]) * radius + middle
    last = len(vertices) - 1
    faces: list[tuple[int, ...]] = []
    for b in range(sides):
        c = (b + 1) % sides
        faces += [(0, 1 + b, 1 + c), (last, last - sides + c, last - sides + b)]
        faces += [
            (1 + r * sides + b, 1 + (r + 1) * sides + b, 1 + (r + 1) * sides + c, 1 + r * sides + c)
            for r in range(rings - 2)
        ]
    return shape(vertices, faces)


def grid(columns: int, rows: int, width: float, height: float) -> Shape:
    """A flat sheet of quads about the origin, facing up."""
    xs = np.linspace(-width / 2, width / 2, columns + 1)
    ys = np.linspace(-height / 2, height / 2, rows + 1)
    x, y = np.meshgrid(xs, ys)
    stride = columns + 1
    faces = [
        (r * stride + c, r * stride + c + 1, (r + 1) * stride + c + 1, (r + 1) * stride + c)
        for r in range(rows)
        for c in range(columns)
    ]
    return shape(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), faces)


def wall(width: float, height: float, depth: float, openings: Sequence[tuple[float, float, float, float]]) -> Shape:
    """A wall from x = 0 to width, its face at y = 0, with rectangular openings (x0, x1, z0, z1) cut through it.

    The cuts run on across the whole wall, so that every face is a quad and no corner lies on another's edge.
    """
    xs = sorted({0.0, width, *(x for opening in openings for x in opening[:2])})
    zs = sorted({0.0, height, *(z for opening in openings for z in opening[2:])})
    columns, rows = len(xs), len(zs)
    near = [(x, 0.0, z) for z in zs for x in xs]
    far = [(x, depth, z) for z in zs for x in xs]

    def is_solid(column: int, row: int) -> bool:
        if not (0 <= column < columns - 1 and 0 <= row < rows - 1):
            return False
        x, z = (xs[column] + xs[column + 1]) / 2, (zs[row] + zs[row + 1]) / 2
        return not any(x0 < x < x1 and z0 < z < z1 for x0, x1, z0, z1 in openings)

    faces: list[Face] = []
    back = columns * rows
    for row in range(rows - 1):
        for column in range(columns - 1):
            if not is_solid(column, row):
                continue
            a = row * columns + column
            b, c, d = a + 1, a + 1 + columns, a + columns
            faces += [(a, b, c, d), (d + back, c + back, b + back, a + back)]
            edges = {(0, -1): (a, b), (1, 0): (b, c), (0, 1): (c, d), (-1, 0): (d, a)}
            for (over, up), (start, end) in edges.items():
                if not is_solid(column + over, row + up):
                    faces.append((end, start, start + back, end + back))
    return shape(near + far, faces)


def rounded(profile: Sequence[tuple[float, float]], steps: int = 6) -> Points:
    """A smooth curve (Catmull-Rom) through the rows of a profile, with `steps` points for each of its spans."""
    rows = np.asarray(profile, dtype=np.float64)
    padded = np.concatenate([2 * rows[:1] - rows[1:2], rows, 2 * rows[-1:] - rows[-2:-1]])
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    spans = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        cubic = (3 * p1 - p0 - 3 * p2 + p3) * t + (2 * p0 - 5 * p1 + 4 * p2 - p3)
        spans.append(0.5 * ((cubic * t + (p2 - p0)) * t + 2 * p1))
    return np.concatenate([*spans, rows[-1:]])
