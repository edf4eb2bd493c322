"""`perfect-bvh render` of one file in every mode, on Linux and on Windows, each with its own Blender; images compared.

The engine's own images have the same bits on every system (step `images`). But Blender evaluates a scene slightly
differently on each system: matrices and normals differ in their last digits. That does not change an image's bytes,
except in a few pixels where light takes another path because of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from try_wheel import Trial

SCRIPT = Path(__file__).with_name("render_modes.py")
# In randomly sampled modes this share of bytes may differ by more than one step of 255.
BY_CHANCE = {"lit": 1e-4, "lit_denoised": 1e-4}


def compare_command_lines(trial: Trial, file: Path, folder: Path) -> None:
    """Raises SystemExit where images are further apart than that."""
    from oracles.png import read_png

    here, there = folder / "linux", folder / "windows"
    for place in (here, there):
        place.mkdir(exist_ok=True)
        for old in place.glob("*.png"):
            old.unlink()
    trial.run_here(SCRIPT, file, here)
    trial.run(SCRIPT, file, there, seconds=1800, blender=True)
    names = sorted(image.stem for image in here.glob("*.png"))
    if names != sorted(image.stem for image in there.glob("*.png")):
        raise SystemExit(f"Windows' command line did not write {', '.join(names)}")
    wrong = []
    for name in names:
        linux, windows = (read_png(place / f"{name}.png").astype(np.int16) for place in (here, there))
        apart = np.abs(linux - windows)
        others, beyond = (apart > 0).mean(), (apart > 1).mean()
        print(f"{name:14}{others:9.4%} of the bytes differ, {beyond:9.4%} by more than 1, at most by {apart.max()}")
        is_right = beyond < BY_CHANCE[name] if name in BY_CHANCE else others == 0.0
        if not is_right or np.ptp(linux[..., :3]) < 25:
            wrong.append(name)
    if wrong:
        raise SystemExit(f"Images of Linux and Windows differ: {', '.join(wrong)}")
