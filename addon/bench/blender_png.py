"""Pictures by Blender itself, which has no matplotlib: numpy fills the shapes, Blender's own font writes the words.

To bundle matplotlib would add some 20 MB of wheels for each Python that Blender has had, for a handful of pictures.
Writing into an image needs `blf.bind_imbuf`, which Blender 5.0 has and 4.2 lacks.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from .picture import HALO, Disc, DrawingError, Line, Picture, Point, Shape, Text, width_of

Canvas = npt.NDArray[np.float32]  # (H, W, 3), display-referred, row 0 on top
FONT = 0


def write(picture: Picture, path: Path, zoom: float) -> None:
    """As a PNG. Raises DrawingError where Blender cannot write words into images."""
    try:
        import blf
        import bpy
        import imbuf
    except ImportError as error:
        raise DrawingError(_way_out("there is neither matplotlib nor Blender")) from error
    if not hasattr(blf, "bind_imbuf"):
        raise DrawingError(_way_out(f"Blender {bpy.app.version_string} cannot write words into an image"))
    width, height = round(picture.width * zoom), round(picture.height * zoom)
    canvas = np.ones((height, width, 3), np.float32)
    for mark in picture.marks:
        _paint(canvas, mark, zoom)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "marks.png"
        _save(canvas, base)
        image = imbuf.load(str(base))
        with blf.bind_imbuf(FONT, image):
            for text in picture.texts:
                _write_words(blf, text, zoom, height)
        imbuf.write(image, filepath=str(path))
        image.free()


def _way_out(problem: str) -> str:
    return (
        f"no picture can be drawn: {problem}; the figures are in the JSON file. Use Blender 5.0 or later, or "
        "`pip install 'perfect-bvh[bench]'` and the command `perfect-bvh bench`"
    )


# Words --------------------------------------------------------------------------------------------------------------


def _write_words(blf: object, text: Text, zoom: float, height: int) -> None:
    size = text.size * zoom * 1.08  # Blender's font is a little smaller than its size says
    blf.size(FONT, size)  # type: ignore[attr-defined]
    wide, _ = blf.dimensions(FONT, text.words)  # type: ignore[attr-defined]
    room = width_of(text.words, text.size, bold=text.bold) * zoom * 1.1
    if wide > room:
        blf.size(FONT, size * room / wide)  # type: ignore[attr-defined]
        wide = room
    left = text.at[0] * zoom - {"left": 0.0, "middle": 0.5, "right": 1.0}[text.anchor] * wide
    bottom = height - text.at[1] * zoom
    offsets = [(HALO * 0.5 * zoom * math.cos(a), HALO * 0.5 * zoom * math.sin(a)) for a in np.arange(8) * math.pi / 4]
    passes = [((1.0, 1.0, 1.0), offset) for offset in offsets]
    passes += [(_rgb(text.color), (shift, 0.0)) for shift in ((0.0, 0.35 * zoom) if text.bold else (0.0,))]
    for color, (x, y) in passes:
        blf.color(FONT, *color, 1.0)  # type: ignore[attr-defined]
        blf.position(FONT, left + x, bottom + y, 0.0)  # type: ignore[attr-defined]
        blf.draw_buffer(FONT, text.words)  # type: ignore[attr-defined]


# Shapes -------------------------------------------------------------------------------------------------------------


def _paint(canvas: Canvas, mark: Line | Shape | Disc, zoom: float) -> None:
    if isinstance(mark, Disc):
        centre, radius = _zoomed([mark.centre], zoom)[0], mark.radius * zoom
        _blend(canvas, [centre], radius, mark.color, 1.0, lambda x, y: np.hypot(x - centre[0], y - centre[1]) - radius)
    elif isinstance(mark, Shape):
        corners = _zoomed(mark.points, zoom)
        _blend(canvas, corners, 0.0, mark.color, mark.opacity, lambda x, y: _outside_polygon(corners, x, y))
    else:
        for start, end in _segments(_zoomed(mark.points, zoom), mark.dashes, zoom):
            half = 0.5 * mark.width * zoom
            reach = lambda x, y, a=start, b=end, h=half: _from_segment(a, b, x, y) - h  # noqa: E731
            _blend(canvas, [start, end], half, mark.color, 1.0, reach)


def _blend(canvas: Canvas, points: Sequence[Point], reach: float, color: str, opacity: float, outside: object) -> None:
    """Where `outside(x, y)`, pixels beyond the shape's rim, is below a half, by the share of the pixel covered."""
    xs, ys = zip(*points, strict=True)
    left, right = max(0, math.floor(min(xs) - reach - 1)), min(canvas.shape[1], math.ceil(max(xs) + reach + 2))
    top, bottom = max(0, math.floor(min(ys) - reach - 1)), min(canvas.shape[0], math.ceil(max(ys) + reach + 2))
    if left >= right or top >= bottom:
        return
    x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    share = np.clip(0.5 - outside(x, y), 0.0, 1.0)[..., None] * opacity  # type: ignore[operator]
    part = canvas[top:bottom, left:right]
    part += (np.array(_rgb(color), np.float32) - part) * share.astype(np.float32)


def _from_segment(a: Point, b: Point, x: Canvas, y: Canvas) -> Canvas:
    """Distances from a segment."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = np.clip(((x - a[0]) * dx + (y - a[1]) * dy) / max(dx * dx + dy * dy, 1e-9), 0.0, 1.0)
    return np.hypot(x - a[0] - along * dx, y - a[1] - along * dy)


def _outside_polygon(corners: Sequence[Point], x: Canvas, y: Canvas) -> Canvas:
    """Of a convex polygon: the farthest beyond any side, negative inside."""
    area = sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
    side = 1.0 if area > 0.0 else -1.0
    beyond = np.full_like(x, -np.inf)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        length = math.dist(a, b)
        if length > 1e-6:
            beyond = np.maximum(beyond, side * ((b[1] - a[1]) * (x - a[0]) - (b[0] - a[0]) * (y - a[1])) / length)
    return beyond


def _segments(points: Sequence[Point], dashes: tuple[float, float] | None, zoom: float) -> list[tuple[Point, Point]]:
    """The line's parts, cut into dashes that go on around its corners."""
    whole = list(pairwise(points))
    if dashes is None:
        return whole
    on, period = dashes[0] * zoom, sum(dashes) * zoom
    found, passed = [], 0.0
    for a, b in whole:
        length = math.dist(a, b)
        first = math.floor(passed / period)
        for number in range(first, math.floor((passed + length) / period) + 1):
            start, end = max(number * period - passed, 0.0), min(number * period + on - passed, length)
            if end > start:
                found.append(
                    tuple((a[0] + (b[0] - a[0]) * t / length, a[1] + (b[1] - a[1]) * t / length) for t in (start, end))
                )
        passed += length
    return found  # type: ignore[return-value]


# Pixels -------------------------------------------------------------------------------------------------------------


def _zoomed(points: Sequence[Point], zoom: float) -> list[Point]:
    return [(x * zoom, y * zoom) for x, y in points]


def _rgb(color: str) -> tuple[float, float, float]:
    red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue


def _save(canvas: Canvas, path: Path) -> None:
    """Through a data-block of Blender's that is not kept."""
    import bpy

    height, width, _ = canvas.shape
    image = bpy.data.images.new("picture", width, height, alpha=False)
    try:
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., :3] = canvas[::-1]
        image.pixels.foreach_set(pixels.ravel())
        image.file_format = "PNG"
        image.save(filepath=str(path))
    finally:
        bpy.data.images.remove(image)
