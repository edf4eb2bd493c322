"""What pieces of an open scene depend on: its file and all that it reads, and whose work they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .inputs import inputs_of


def scene_inputs(path: Path, *, autoexec: bool, allow_missing: bool, **options: Any) -> dict[str, Any]:
    """path: of the file that is open. autoexec: whether its scripts may run. options: of the work."""
    import bpy
    import perfect_bvh

    read = [Path(name) for name in bpy.utils.blend_paths(absolute=True)]
    return inputs_of(
        [path, *read],
        **options,
        autoexec=autoexec,
        allow_missing=allow_missing,
        blender=bpy.app.version_string,
        version=perfect_bvh.__version__,
    )
