"""What a Python that a test starts is given, to import what the test itself can."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def environment_with_paths(*first: Path) -> dict[str, str]:
    """This process's environment, with its `sys.path` as PYTHONPATH. first: folders that are looked into before.

    Not for a process that imports bpy: here that has put folders of its own into the path.
    """
    return {**os.environ, "PYTHONPATH": os.pathsep.join((*map(str, first), *(path for path in sys.path if path)))}
