"""A cross in the corner of what is drawn over a 3D viewport, which closes it.

Drawn by whatever draws the rest, since that may cover Blender's own gizmos; gizmos only ask where the mouse is.
"""

from __future__ import annotations

from . import drawing

# In points.
SIZE, CROSS, INSET, WIDTH = 18.0, 7.0, 6.0, 1.6


def close_rect(right: float, top: float) -> drawing.Rect:
    """Below and left of a corner, in pixels."""
    inset, size = drawing.pixels(INSET), drawing.pixels(SIZE)
    return drawing.Rect(right - inset - size, top - inset - size, right - inset, top - inset)


def draw_close(rect: drawing.Rect, color: drawing.Color) -> None:
    """The cross, in the middle."""
    x, y, half = (rect.left + rect.right) / 2, (rect.bottom + rect.top) / 2, drawing.pixels(CROSS) / 2
    for slope in (-half, half):
        drawing.draw_lines_2d([(x - half, y - slope), (x + half, y + slope)], color, WIDTH)


def contains(rect: drawing.Rect, x: float, y: float) -> bool:
    """Whether a pixel is within."""
    return rect.left <= x < rect.right and rect.bottom <= y < rect.top
