"""Where tests run: under Wine a few things are missing that Windows has."""

from __future__ import annotations

import ctypes
import sys

import pytest


def is_wine() -> bool:
    """Whether this is Windows' Python under Wine, which says so itself."""
    return sys.platform == "win32" and hasattr(ctypes.WinDLL("ntdll"), "wine_get_version")


def lacking_in_wine(what: str) -> pytest.MarkDecorator:
    """Skips a test for the one thing of Windows that Wine 8 has not."""
    return pytest.mark.skipif(is_wine(), reason=f"Wine lacks {what}")


plain_files = lacking_in_wine(
    "the mapping of files by which Blender reads images and .blend files that are not compressed"
)
symbolic_links = lacking_in_wine("symbolic links")
console_events = lacking_in_wine(
    "a console where a program is started without a terminal: tests/wine/press_ctrl_c.py has one"
)
