"""Options that the benchmarks' command lines share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.machine import describe, headline, require_quiet
from benchmarks.meshes import BenchMesh, MeshError, default_meshes, load
from benchmarks.native import DEFAULT_FOLDER
from benchmarks.rows import write_rows


def parser(description: str, *, is_timed: bool = True) -> argparse.ArgumentParser:
    """Output, how long and how often. is_timed: whether times are measured, in rounds and on a quiet machine."""
    result = argparse.ArgumentParser(description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    add = result.add_argument
    add("--json", type=Path, required=True, metavar="OUT.json", help="where the figures go")
    add("--size", default="640x400", metavar="WxH", help="of the image that the primary rays make")
    add("--native", type=Path, default=DEFAULT_FOLDER, metavar="DIR", help="holds the built native benchmarks")
    if is_timed:
        add("--rounds", type=int, default=5, metavar="N", help="interleaved rounds of each measurement")
        add("--noisy", action="store_true", help="measure at any load; the figures mean little")
    else:
        result.set_defaults(noisy=True)
    return result


def add_meshes(options: argparse.ArgumentParser, *, detail: float = 1.0) -> None:
    """Adds the options that `meshes_of` reads."""
    add_named_meshes(options, detail=detail)
    options.add_argument(
        "--default-meshes", action="store_true", help="those that Blender makes, too (without --mesh they are all)"
    )


def add_named_meshes(options: argparse.ArgumentParser, *, detail: float = 1.0) -> None:
    """Adds the options of programs that always measure generated meshes as well."""
    options.add_argument(
        "--mesh",
        nargs="+",
        action="extend",
        type=Path,
        metavar="FILE",
        help=".npz (positions, triangles), .ply, .obj, .blend",
    )
    options.add_argument(
        "--detail", type=float, default=detail, metavar="X", help="triangles of generated meshes, times this"
    )


def add_ray_limit(options: argparse.ArgumentParser) -> None:
    """Adds the option of programs with slow peers such as Blender's."""
    options.add_argument(
        "--ray-limit", type=int, default=20_000, metavar="N", help="rays for peers that take one a call"
    )


def parse(options: argparse.ArgumentParser) -> argparse.Namespace:
    """The command line, and as `load_before` the load, which ends the program if it is too high to measure."""
    chosen = options.parse_args()
    chosen.load_before = require_quiet(chosen.noisy)
    return chosen


def size_of(options: argparse.Namespace) -> tuple[int, int]:
    """Width and height."""
    width, _, height = options.size.partition("x")
    return int(width), int(height)


def meshes_of(options: argparse.Namespace) -> list[BenchMesh]:
    """Returns all chosen meshes; ends the program with a sentence if one is unavailable."""
    try:
        meshes = [load(path) for path in options.mesh or ()]
        if options.default_meshes or not meshes:
            meshes += default_meshes(options.detail)
    except MeshError as error:
        raise SystemExit(f"{error}; name meshes to measure with --mesh FILE.npz") from None
    return meshes


def save(chosen: argparse.Namespace, results: dict[str, Any]) -> None:
    """Writes the figures with a description of the machine, and prints its headline."""
    machine = describe(chosen.load_before)
    print(headline(machine))
    write_rows(chosen.json, {"machine": machine, **results})
