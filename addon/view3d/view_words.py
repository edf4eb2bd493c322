"""One legend and one tip in a 3D viewport, for all its contents: the boxes of trees, the costs of rays, bakes."""

from __future__ import annotations

import bpy

from . import baked_view, cost_scale
from .legend import DrawHandler, draw_legend, draw_tip
from .tree_overlay import overlay

_SHOWN = (cost_scale, overlay, baked_view)


def _draw() -> None:
    context = bpy.context
    draw_legend(context, [part for shown in _SHOWN for part in shown.sections(context)])
    baked_view.draw_chart(context)
    tips = [found for shown in _SHOWN if (found := shown.tip(context)) is not None]
    if tips:
        draw_tip(context, tips[0][0], [line for _, lines in tips for line in lines])


_handler = DrawHandler(_draw, "POST_PIXEL")


def register() -> None:
    _handler.add()


def unregister() -> None:
    _handler.remove()
