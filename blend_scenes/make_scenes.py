"""Writes the example scenes as small .blend files; the same seed gives the same geometry.

Run it with a Python that has Blender's module (`bpy`) and the add-on, whose settings the files keep:

    python blend_scenes/make_scenes.py [NAME ...] [--output DIR]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
from makers import cloth, courtyard, crowd, gears, meadow, ocean, town, tree_in_wind
from makers.opening import open_rendered, use_engine
from makers.stage import save_stage
from makers.zoo import files as zoo_files

SCENES: dict[str, Callable[[], object]] = {
    "courtyard": courtyard.make,
    "tree_in_wind": tree_in_wind.make,
    "gears": gears.make,
    "crowd": crowd.make,
    "cloth": cloth.make,
    "ocean": ocean.make,
    "meadow": meadow.make,
    "town": town.make,
    **zoo_files.MAKERS,
}


def make(name: str) -> int:
    """Fills the file with a scene, and has it open in a Rendered view. Returns the frame on which it opens."""
    if name in zoo_files.MAKERS:
        return zoo_files.MAKERS[name]()
    SCENES[name]()
    use_engine(bpy.context.scene)
    open_rendered()
    return 1


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Write the example scenes as .blend files.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which scenes: {', '.join(SCENES)} (default: all)")
    parser.add_argument("--output", type=Path, default=Path(__file__).parent, metavar="DIR", help="where to write them")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in SCENES]
    if unknown:
        parser.error(f"unknown scene {', '.join(unknown)}; choose from {', '.join(SCENES)}")
    for name in options.names or SCENES:
        frame = make(name)
        path = (options.output / f"{name}.blend").resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        save_stage(path, frame)
        print(f"{path}: {path.stat().st_size / 1000:.0f} KB")


if __name__ == "__main__":
    main()
