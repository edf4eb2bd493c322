"""Renders one scene with the extension, or with the package that is installed; runs in any Blender.

python render_scene.py, or blender --background --python render_scene.py. The environment says what to do:

BLEND: the scene. OUTPUT: the .npz file for the image. EXTENSION: the zip to install, "" for pip's package. With a zip
BLENDER_USER_RESOURCES must be a separate folder.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import bpy
import numpy as np

MODULE = "bl_ext.user_default.perfect_bvh"
MODES = ("PREVIEW", "CLAY", "NORMAL", "DEPTH", "INSTANCE")


def install(extension: str) -> str:
    """Install and enable the zip; its package."""
    bpy.ops.extensions.package_install_files(filepath=extension, repo="user_default", enable_on_install=False)
    # Where Blender unpacks wheels when it enables the extension: before any package that the test itself has installed.
    # It must be there from the start, or Python remembers that it was not.
    user = Path(os.environ["BLENDER_USER_RESOURCES"])
    packages = user / "extensions/.local/lib/python{}.{}/site-packages".format(*sys.version_info)
    packages.mkdir(parents=True, exist_ok=True)
    sys.path.insert(0, str(packages))
    bpy.ops.preferences.addon_enable(module=MODULE)
    import perfect_bvh

    assert perfect_bvh.__file__.startswith(str(user)), perfect_bvh.__file__
    return MODULE


def use_package() -> str:
    import perfect_bvh_addon

    perfect_bvh_addon.register()
    return "perfect_bvh_addon"


def main() -> None:
    extension = os.environ.get("EXTENSION", "")
    package = install(extension) if extension else use_package()
    import perfect_bvh

    engine = sys.modules[f"{package}.engine"]
    bpy.ops.wm.open_mainfile(filepath=os.environ["BLEND"])
    scene = bpy.context.scene
    scene.render.engine = "PERFECT_BVH"
    scene.perfect_bvh.samples = 4
    scene.perfect_bvh.use_denoising = False  # each Blender has a different library for that
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    images = {}
    for mode in MODES:
        scene.perfect_bvh.mode = mode
        with engine.attend(engine.RenderJob()) as job:
            bpy.ops.render.render()
        images[mode.lower()] = job.frame.images["combined"]
    np.savez_compressed(
        os.environ["OUTPUT"],
        blender=bpy.app.version_string,
        python=sys.version.split()[0],
        isas=perfect_bvh.available_isas(),
        **images,
    )


if __name__ == "__main__":
    main()
