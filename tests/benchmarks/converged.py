"""The difference between our image and Cycles' once both have converged: the same light, apart from remaining noise.

    python tests/benchmarks/converged.py --json converged.json

Renders each example scene without motion blur and denoisers; each engine draws its own random numbers. Reports the
difference of the means by channel, and the difference of pixels and of blocks of 8 x 8 (an eighth of the noise),
relative to their brightness, which counts as at least 0.02 of the image's mean. A scene takes some 20 minutes at 2,048
samples on two cores.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import bpy
import numpy as np
import numpy.typing as npt
import perfect_bvh_addon
from benchmarks.image_error import REFERENCE_SEED, SCENES, file_of
from benchmarks.machine import describe
from benchmarks.rows import write_rows
from benchmarks.tables import format_table
from oracles.cycles import preserved, render_beside
from tqdm import tqdm

Image = npt.NDArray[np.float64]
BLOCK = 8
DARKEST = 0.02
HEADINGS = ("scene", "red %", "green %", "blue %", "pixels p50 %", "p95 %", "blocks p50 %", "p95 %")


def main() -> None:
    """Render, write the JSON, print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add(
        "--scenes",
        nargs="+",
        default=sorted(path.stem for path in SCENES.glob("*.blend")),
        help="names in blend_scenes, or paths of .blend files",
    )
    add("--size", type=int, default=480, metavar="W", help="of the images, 16:9")
    add("--samples", type=int, default=2048, metavar="N", help="of each pixel")
    chosen = parser.parse_args()
    perfect_bvh_addon.register()
    rows = [measure(file_of(name), chosen.size, chosen.samples) for name in tqdm(chosen.scenes, unit="scene")]
    figures = {"machine": describe(), "width": chosen.size, "samples": chosen.samples, "scenes": rows}
    write_rows(chosen.json, figures)
    print(format_table(HEADINGS, [cells_of(row) for row in rows]))


def measure(file: Path, width: int, samples: int) -> dict[str, Any]:
    """Return the differences for one scene."""
    bpy.ops.wm.open_mainfile(filepath=str(file))
    scene = bpy.context.scene
    render = scene.render
    with preserved(
        (render, "resolution_x", width),
        (render, "resolution_y", width * 9 // 16),
        (render, "resolution_percentage", 100),
        (render, "use_motion_blur", False),
        (scene.cycles, "seed", REFERENCE_SEED),
    ):
        ours, theirs = (image[..., :3].astype(np.float64) for image in render_beside(scene, samples))
    off = ours.mean(axis=(0, 1)) / theirs.mean(axis=(0, 1)) - 1.0
    return {
        "name": file.stem,
        "mean": off.tolist(),
        "pixels": quantiles(ours, theirs),
        "blocks": quantiles(blocks(ours), blocks(theirs)),
    }


def blocks(image: Image) -> Image:
    """The means of the blocks; incomplete blocks at the right and below are left out."""
    height, width = image.shape[0] // BLOCK, image.shape[1] // BLOCK
    whole = image[: height * BLOCK, : width * BLOCK]
    means: Image = whole.reshape(height, BLOCK, width, BLOCK, 3).mean(axis=(1, 3))
    return means


def quantiles(ours: Image, theirs: Image) -> dict[str, float]:
    """Returns quantiles of the differences, relative to the brightness."""
    brightness = np.maximum(theirs.mean(axis=2), DARKEST * theirs.mean())
    difference = np.abs(ours - theirs).mean(axis=2) / brightness
    return {f"p{part}": float(np.quantile(difference, part / 100)) for part in (50, 95)}


def cells_of(row: dict[str, Any]) -> tuple[str, ...]:
    """Returns the cells of a line of the table."""
    parts = [*row["mean"], *(row[kind][part] for kind in ("pixels", "blocks") for part in ("p50", "p95"))]
    return row["name"], *(f"{100 * part:.2f}" for part in parts)


if __name__ == "__main__":
    main()
