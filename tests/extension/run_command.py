"""Runs `perfect-bvh info` with the extension in Blender's module, and ends as the program does.

The environment says what to do, as for render_scene.py: BLEND, EXTENSION, BLENDER_USER_RESOURCES.
"""

from __future__ import annotations

import importlib
import os
import sys

from render_scene import install

if __name__ == "__main__":
    cli = importlib.import_module(f"{install(os.environ['EXTENSION'])}.cli")
    sys.argv = ["perfect-bvh", "info", os.environ["BLEND"]]
    sys.exit(cli.run())
