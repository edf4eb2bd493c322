"""The environment of a Python that a test starts, so that it can import the same modules as the test."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def environment_with_paths(*first: Path) -> dict[str, str]:
    """This process's environment, with its `sys.path` as PYTHONPATH. first: folders to search before those.

    Not for a process that imports bpy: in this process bpy has added its own folders to the path.
    """
    return {**os.environ, "PYTHONPATH": os.pathsep.join((*map(str, first), *(path for path in sys.path if path)))}
