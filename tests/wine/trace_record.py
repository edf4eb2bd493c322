"""python tests/wine/trace_record.py RECORD IMAGES.npz: every mode's image of a record of `read_blend.py`.

Needs no Blender: with the same record on two systems, differences come from the engine only.
"""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

import numpy as np
import perfect_bvh
from perfect_bvh_addon.sync.appearance import as_camera, make_appearance
from perfect_bvh_addon.sync.state import SceneState

SAMPLES = 4


def main(file: Path, images: Path) -> None:
    """One array a mode, (height, width, 4) float32."""
    record = pickle.loads(file.read_bytes())
    state = SceneState(perfect_bvh.Scene)
    state.update(record)
    appearance = make_appearance(record, state.instance_ids, state.mesh_ids)
    camera = as_camera(record.camera)
    options = {"size": record.size, "samples": SAMPLES, "appearance": appearance}
    np.savez(
        images, **{mode: perfect_bvh.render(state.scene, camera, mode=mode, **options) for mode in perfect_bvh.MODES}
    )


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
