"""python tests/wine/install_extension.py EXTENSION.zip FILE.blend IMAGE.png: acts like a user, without windows.

Installs the zip as Blender's preferences do, enables it and renders. Nothing else of the project may be importable.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
from pathlib import Path

USER = Path(tempfile.mkdtemp(prefix="perfect bvh ü "))  # as some users are called
os.environ["BLENDER_USER_RESOURCES"] = str(USER)

import bpy

MODULE = "bl_ext.user_default.perfect_bvh"


def main(extension: str, file: str, image: str) -> None:
    """Raises AssertionError or Blender's own errors."""
    assert importlib.util.find_spec("perfect_bvh") is None
    bpy.ops.extensions.package_install_files(filepath=extension, repo="user_default", enable_on_install=False)
    # Where Blender unpacks wheels when it enables the extension. It must be there from the start, or Python remembers
    # that it was not.
    packages = USER / "extensions/.local/lib/python{}.{}/site-packages".format(*sys.version_info)
    packages.mkdir(parents=True, exist_ok=True)
    sys.path.insert(0, str(packages))
    assert "FINISHED" in bpy.ops.preferences.addon_enable(module=MODULE)
    import perfect_bvh

    assert perfect_bvh.__file__.startswith(str(USER)), perfect_bvh.__file__
    bpy.ops.wm.open_mainfile(filepath=file)
    scene = bpy.context.scene
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.samples = 4
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 160, 90, 100
    scene.render.filepath = image
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    assert Path(image).stat().st_size > 10_000
    print(f"perfect_bvh {perfect_bvh.__version__} by {perfect_bvh.active_isa()} in Blender {bpy.app.version_string}")


if __name__ == "__main__":
    main(*sys.argv[1:])
