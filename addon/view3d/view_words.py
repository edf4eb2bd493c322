"""One legend and one tip in a 3D viewport, for all its contents: the boxes of trees, the costs of rays."""

from __future__ import annotations

import bpy

from . import cost_scale
from .legend import DrawHandler, draw_legend, draw_tip
from .tree_overlay import overlay


def _draw() -> None:
    context = bpy.context
    draw_legend(context, [*cost_scale.sections(context), *overlay.sections(context)])
    tips = [found for found in (cost_scale.tip(context), overlay.tip(context)) if found is not None]
    if tips:
        draw_tip(context, tips[0][0], [line for _, lines in tips for line in lines])


_handler = DrawHandler(_draw, "POST_PIXEL")


def register() -> None:
    _handler.add()


def unregister() -> None:
    _handler.remove()
