"""Finds the lines of the Python interface that a call reaches, to guide the search for new inputs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import perfect_bvh

from .bytes import Features

FACE = str(Path(perfect_bvh.__file__).parent)


def with_lines(call: Callable[[bytes], Features], data: bytes) -> Features:
    """The features that the call returns, and the lines of `perfect_bvh` that it ran, as features."""
    lines: Features = set()

    def on_line(frame: FrameType, event: str, argument: object) -> Any:
        if event == "line":
            lines.add(("line", Path(frame.f_code.co_filename).name, str(frame.f_lineno)))
        return on_line

    def on_call(frame: FrameType, event: str, argument: object) -> Any:
        return on_line if frame.f_code.co_filename.startswith(FACE) else None

    before = sys.gettrace()
    sys.settrace(on_call)
    try:
        return call(data) | lines
    finally:
        sys.settrace(before)
