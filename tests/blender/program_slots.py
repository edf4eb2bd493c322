"""The slots of a material that its node program sets."""

from __future__ import annotations

from collections.abc import Iterator

from perfect_bvh.nodes import NODE_SHAPES, NodeProgram


def slots_of(program: NodeProgram | None) -> Iterator[str]:
    """Return the slots' names, or none without a program."""
    shapes, at = list(NODE_SHAPES.values()), 0
    codes = [] if program is None else program.codes.tolist()
    while at < len(codes):
        shape = shapes[codes[at]]
        if shape is NODE_SHAPES["set"]:
            yield list(shape.modes)[codes[at + 1]]
        at += 3 + 2 * len(shape.operands)
