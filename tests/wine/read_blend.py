"""python tests/wine/read_blend.py FILE.blend RECORD: record the add-on's reading of a file, for `trace_record.py`."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import bpy
import perfect_bvh_addon

SIZE = (320, 180)


def main(file: Path, record: Path) -> None:
    """Reads as for an image of SIZE, with all that any mode shows."""
    perfect_bvh_addon.register()
    bpy.ops.wm.open_mainfile(filepath=str(file))
    everything = perfect_bvh_addon.AttributeRequest(
        material_slots=True, corner_normals=True, corner_uvs=True, shading=True
    )
    sync = perfect_bvh_addon.SceneSync(everything, for_viewport=False)
    sync.update(bpy.context.evaluated_depsgraph_get(), size=SIZE)
    record.write_bytes(pickle.dumps(sync.record))


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
