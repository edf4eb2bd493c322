"""python tests/wine/render_modes.py FILE.blend FOLDER: `perfect-bvh render` in every mode.

The images are FOLDER/<mode>.png, and FOLDER/lit_denoised.png in addition to the noisy FOLDER/lit.png.
"""

from __future__ import annotations

import sys

from perfect_bvh_addon.cli import main
from perfect_bvh_addon.settings.modes import MODES

OPTIONS = ("--size", "320x180", "--noise-threshold", "0", "--seed", "7", "--quiet")
SAMPLES = {"lit": "256"}  # enough samples that a single different path changes no byte


def render(file: str, folder: str) -> int:
    """The first exit status that is not 0."""
    images = {mode.word: (mode.word, "--no-denoise") for mode in MODES} | {"lit_denoised": ("lit", "--denoise")}
    for name, (mode, denoising) in images.items():
        choice = ("--mode", mode, denoising, "--samples", SAMPLES.get(mode, "16"))
        status = main(["render", file, "-o", f"{folder}/{name}.png", *choice, *OPTIONS])
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(render(*sys.argv[1:]))
