"""The command `perfect-bvh`: render, scan, label or bake a .blend file, look at its trees, measure it or the machine.

Blender and numpy are imported only once a command needs them, so that `--help` answers at once.

arguments        types of arguments: frames, sizes, seeds, file names. The options themselves are in this file
render           `render`: frames, one after the other, into images
labels           `labels`
bake             `bake`
commands         `scan`, `info`, `bench` and `calibrate`
frames           images of an animation in chunks, which a second run recognises
blender          Blender in this process: opens the file, renders, hears Ctrl-C
blender_command  the same commands in a Blender with the extension: `blender --command perfect_bvh`
report           what frames did to the trees and what they cost, as text
farm             chunks on workers of Dask
piece_child      a process with a Blender that makes a worker's chunks
"""

from __future__ import annotations

import argparse
import atexit
import os
import sys
from collections.abc import Sequence
from typing import Any

from ..settings.bake_choices import BAKE_KINDS, DOMAINS
from ..settings.modes import MODES
from ..settings.scan_choices import CLOUD_FORMATS
from .arguments import (
    EXIT_ERROR,
    EXIT_INTERRUPTED,
    EXIT_PIPE,
    LAYERS,
    POSITIVE,
    SCALE,
    SECONDS,
    SHARE,
    THRESHOLD,
    CommandError,
    parse_day,
    parse_frames,
    parse_seed,
    parse_size,
)
from .report import is_reader_gone, write_any_text

DEFAULT_AUDIT = 1e-3


class _OldName(argparse.Action):
    """Accepts --piece, the former name of --chunk, for one more version."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option_string: str | None = None) -> None:
        sys.stderr.write(f"perfect-bvh: {option_string} is now --chunk; the old name ends with the next version\n")
        setattr(namespace, self.dest, values)


def build_parser(prog: str) -> argparse.ArgumentParser:
    """Return the parser of the whole command line. prog: the name under which it was started."""
    parser = argparse.ArgumentParser(
        prog=prog, description="Render, scan and label .blend files with a native BVH, and inspect its trees."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_render(commands)
    _add_scan(commands)
    _add_labels(commands)
    _add_bake(commands)
    _add_info(commands)
    _add_bench(commands)
    _add_calibrate(commands)
    return parser


def _add_file(parser: argparse.ArgumentParser, **how: Any) -> None:
    parser.add_argument("file", metavar="FILE.blend", help="the scene", **how)
    parser.add_argument("--threads", type=POSITIVE, metavar="N", help="number of threads (default: from the file)")
    parser.add_argument(
        "--autoexec", action="store_true", help="run the file's Python scripts and drivers (only if you trust the file)"
    )
    parser.add_argument(
        "--allow-missing", action="store_true", help="continue if linked libraries are missing, and list them"
    )
    parser.add_argument(
        "--viewport",
        action="store_true",
        help="use the objects, collections, modifier levels and particles that viewports show (default: those of a "
        "render). The camera is that of the frame's marker in both cases",
    )


def _add_frames(parser: argparse.ArgumentParser, default: str = "current") -> None:
    what = f"frames such as 1-24, 1-48:2 or 1,5,9-12 (default: {default})"
    parser.add_argument("--frames", type=parse_frames, metavar="LIST", help=what)


def _add_pieces(parser: argparse.ArgumentParser) -> None:
    """Adds options of work in chunks, with or without workers, and of what it prints."""
    parser.add_argument("--chunk", dest="piece", type=POSITIVE, metavar="N", help="frames per chunk (default: 10)")
    parser.add_argument("--piece", action=_OldName, type=POSITIVE, help=argparse.SUPPRESS)
    parser.add_argument("--resume", action="store_true", help="create only missing or damaged chunks")
    parser.add_argument(
        "--workers",
        type=POSITIVE,
        metavar="N",
        help="process chunks in N processes, each with a separate Blender, using Dask",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="process chunks on the workers of a Dask scheduler (tcp://host:8786)"
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="print no progress bar and no summary")


def _add_labels_of(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument(
        "--labels",
        nargs="+",
        default=[],
        metavar="NAME",
        help=f"further {what}: custom properties by name (of objects, instancers, data or materials), or object, "
        "instancer, material, collection",
    )


def _add_render(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "render",
        help="render one frame or an animation",
        description="Render one frame or an animation.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="modes:\n" + "\n".join(f"  {mode.word:<10} {mode.description}" for mode in MODES),
    )
    _add_file(parser)
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="OUT",
        help="an image (out.png), a name with frame numbers (out/frame_####.png) or a folder (out/). Images are .png, "
        ".jpg, .webp, .tif or .exr",
    )
    _add_frames(parser)
    parser.add_argument("--mode", metavar="M", help="what the image shows, see below (default: from the file)")
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="size in pixels (default: from the file)")
    parser.add_argument("--samples", type=POSITIVE, metavar="N", help="camera rays per pixel (default: from the file)")
    parser.add_argument(
        "--denoise",
        action=argparse.BooleanOptionalAction,
        help="denoise images of the modes lit and clay (default: from the file)",
    )
    parser.add_argument(
        "--time-limit",
        type=SECONDS,
        metavar="S",
        help="seconds for tracing a frame, with fewer samples if necessary; 0 for no limit (default: from the file)",
    )
    parser.add_argument(
        "--noise-threshold",
        type=THRESHOLD,
        metavar="T",
        help="stop sampling where the noise of lit and clay is below this; 0: never (default: from the file)",
    )
    parser.add_argument("--seed", type=parse_seed, metavar="N", help="seed of the noise (default: from the file)")
    parser.add_argument(
        "--audit",
        type=SHARE,
        nargs="?",
        const=DEFAULT_AUDIT,
        metavar="SHARE",
        help="check a share of the camera rays again, in double precision and without a tree, and print how many are "
        f"wrong (default share: {DEFAULT_AUDIT:g})",
    )
    parser.add_argument("--stats", action="store_true", help="print updates of trees and times for each frame")
    _add_pieces(parser)


def _add_scan(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "scan",
        help="write the point clouds of a LiDAR or depth camera",
        description="Scan frames with a LiDAR or a depth camera on an object. Each chunk of frames becomes "
        "a file of points and a manifest that describes it. --resume creates only missing or damaged chunks.",
    )
    _add_file(parser, nargs="?")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of the files")
    parser.add_argument(
        "--sensor", default="spinning-16", metavar="NAME", help="a name from --list-sensors, or your own .toml file"
    )
    parser.add_argument("--list-sensors", action="store_true", help="list the included sensors, one per line, and exit")
    parser.add_argument("--on", metavar="OBJECT", help="the object it is mounted on (default: each frame's camera)")
    parser.add_argument(
        "--exclude-mount",
        action=argparse.BooleanOptionalAction,
        help="make that object and its children invisible to the rays (default: if the sensor is inside its mesh)",
    )
    _add_frames(parser, "one whole sweep in the current frame")
    parser.add_argument("--steps", type=POSITIVE, metavar="N", help="time samples per frame (default: 1)")
    *names, last = (one.name for one in CLOUD_FORMATS)
    parser.add_argument(
        "--format",
        default="npz",
        metavar="F",
        help=f"file format: {', '.join(names)} or {last} (default: %(default)s). kitti and mcap (a bag of ROS 2) also "
        "have the camera's images",
    )
    parser.add_argument(
        "--seed", type=parse_seed, default=0, metavar="N", help="seed of the sensor's noise and dropout (default: 0)"
    )
    _add_labels_of(parser, "columns of the points")
    parser.add_argument(
        "--boxes",
        action="store_true",
        help="also write the 3D box of each object in reach, the number of points on it and its visible share",
    )
    parser.add_argument(
        "--category",
        metavar="NAME",
        help="the custom property whose value is an object's class in kitti's boxes; objects without it have no box "
        "(default: the object's name is its class)",
    )
    _add_pieces(parser)


def _add_labels(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "labels",
        help="write exact ids, masks and depth of what the camera sees",
        description="Label frames as they would be rendered. Each frame gets files of depth, positions, normals, UVs, "
        "ids and masks of all objects, visible or hidden. A COCO file with run-length masks covers all frames. "
        "One ray per pixel lists all surfaces, so no values are blended.",
    )
    _add_file(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder of the files")
    _add_frames(parser)
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="size in pixels (default: from the file)")
    parser.add_argument(
        "--category",
        metavar="NAME",
        help="the custom property whose value is an object's category (default: the object's name is its category)",
    )
    parser.add_argument(
        "--layers",
        type=LAYERS,
        default=1,
        metavar="K",
        help="number of surfaces per ray whose depth is kept (default: 1)",
    )
    _add_labels_of(parser, "images, and values of object instances")
    parser.add_argument(
        "--format",
        nargs="+",
        default=["npz"],
        metavar="F",
        help="one or more of npz, npy, png, exr and bop (default: npz). With npy, png and exr, a .json file explains "
        "the numbers. bop is a data set for pose estimation: images, depth, masks, poses and models in the folder bop",
    )
    parser.add_argument(
        "--depth-scale",
        type=SCALE,
        metavar="S",
        help="depth resolution of PNG files in world units; the farthest depth is 65535 times this (default: 0.001)",
    )
    parser.add_argument(
        "--flow", action="store_true", help="also write how pixels move from the previous and to the next frame"
    )
    parser.add_argument("--no-coco", action="store_true", help="write no COCO file")
    _add_pieces(parser)


def _add_bake(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bake",
        help="write how much sun, sky or room each face has, by rays that leave it",
        description="Cast rays from the faces of objects into the whole scene: a table for each frame, with a row for "
        "each element as modifiers make it. Exposure counts frames, so that it has one table for all of them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="kinds:\n" + "\n".join(f"  {_word(kind.name):<18} {kind.description}" for kind in BAKE_KINDS),
    )
    _add_file(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="the folder for the tables")
    kinds = [_word(kind.name) for kind in BAKE_KINDS]
    parser.add_argument("--kind", required=True, choices=kinds, metavar="K", help="what is asked, see below")
    parser.add_argument("--objects", nargs="+", default=[], metavar="NAME", help="meshes (default: all that are shown)")
    parser.add_argument(
        "--domain",
        default="face",
        choices=[name.lower() for name in DOMAINS if name != "TEXEL"],
        help="what has a row (default: %(default)s)",
    )
    parser.add_argument("--rays", type=POSITIVE, default=256, metavar="N", help="rays a row (default: %(default)s)")
    parser.add_argument("--seed", type=parse_seed, default=0, metavar="N", help="of random rays (default: 0)")
    parser.add_argument("--distance", type=SCALE, metavar="D", help="how far rays reach (default: endless)")
    falloff = "ambient-occlusion: surfaces at distance t count (1 - t / D) ** F (default: 0)"
    parser.add_argument("--falloff", type=float, default=0.0, metavar="F", help=falloff)
    method = "thickness: over a cone, or of the largest sphere (default: %(default)s)"
    parser.add_argument("--method", default="cone", choices=["cone", "sphere"], help=method)
    angle = "thickness: half the cone's opening, in degrees (default: %(default)g)"
    parser.add_argument("--angle", type=float, default=30.0, metavar="A", help=angle)
    cosine = "whether light and sky are weighted by the cosine (default: sky-view and --epw)"
    parser.add_argument("--cosine", action=argparse.BooleanOptionalAction, help=cosine)
    parser.add_argument("--viewer", metavar="OBJECT", help="exposure: whose path it is (default: each frame's camera)")
    place = "sun-hours: degrees to the north and to the east"
    parser.add_argument("--place", nargs=2, type=float, metavar=("LAT", "LON"), help=place)
    zone = "a name such as Europe/Berlin, or hours from UTC (default: by the longitude)"
    parser.add_argument("--zone", default="", metavar="Z", help=zone)
    parser.add_argument("--north", type=float, default=0.0, metavar="A", help="degrees from +Y, clockwise (default: 0)")
    days = "such as 2026-03-21, or the first and the last of more (default: with --epw the year)"
    parser.add_argument("--days", nargs="+", type=parse_day, metavar="DAY", help=days)
    parser.add_argument("--minutes", type=POSITIVE, default=10, metavar="N", help="from sun to sun (default: 10)")
    parser.add_argument("--epw", metavar="FILE", help="sun-hours: a weather file, for kWh/m2 instead of hours")
    parser.add_argument("--instances", action="store_true", help="also rows for instances of the objects")
    parser.add_argument("--format", default="csv", choices=["csv", "parquet"], help="(default: %(default)s)")
    _add_frames(parser)
    _add_pieces(parser)


def _word(name: str) -> str:
    """A name as the command line has it."""
    return name.lower().replace("_", "-")


def _add_info(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "info",
        help="print the meshes, their trees and expected costs",
        description="List each mesh with its class and the reason for it, its builder, its bytes, and the expected "
        "times of building its tree and tracing a render's rays through it on one thread.",
    )
    _add_file(parser)
    parser.add_argument("--frame", type=int, metavar="N", help="the frame to read (default: the file's current one)")


def _add_bench(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bench",
        help="compare builders and update policies on a scene",
        description="Measure for about a minute what each builder and, in an animation, each update policy "
        "costs and gains on this scene. Print a table with advice, and write all figures as JSON, and as charts "
        "if matplotlib is installed. "
        "Ctrl-C stops it and writes the results so far.",
    )
    _add_file(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder of the charts and bench.json")
    parser.add_argument("--seconds", type=POSITIVE, default=60, metavar="N", help="duration (default: %(default)s)")


def _add_calibrate(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "calibrate",
        help="measure the costs of trees on this machine",
        description="Measure once, in a few seconds, what building, refitting and tracing cost on this machine. The "
        "result decides whether trees are refitted or rebuilt. Run nothing else on the machine during that.",
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="file for the result (default: in the cache folder)")


def main(argv: Sequence[str] | None = None, prog: str = "perfect-bvh") -> int:
    """Run the command line; the process's exit status.

    0, 2 for an error, 3 if chunks of the work failed, 130 after Ctrl-C, 141 after a closed pipe.
    """
    write_any_text()
    arguments = build_parser(prog).parse_args(argv)
    try:
        from .bake import run_bake
        from .commands import run_bench, run_calibrate, run_info, run_scan
        from .labels import run_labels
        from .render import run_render

        runs = {"render": run_render, "scan": run_scan, "labels": run_labels, "bake": run_bake}
        return (runs | {"info": run_info, "bench": run_bench, "calibrate": run_calibrate})[arguments.command](arguments)
    except CommandError as error:
        sys.stderr.write(f"perfect-bvh: error: {error}\n")
        return EXIT_ERROR
    except OSError as error:
        if not is_reader_gone(error):
            raise
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - or Python's last flush would complain
        return EXIT_PIPE
    except KeyboardInterrupt:
        sys.stderr.write("perfect-bvh: stopped\n")
        return EXIT_INTERRUPTED


def run() -> int:
    """Runs `main` as a program of its own, and ends it where Blender cannot: see `_ends_badly`."""
    status = main()
    if _ends_badly():
        atexit._run_exitfuncs()  # Blender's own, and ours, which stops threads
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def _ends_badly() -> bool:
    """Whether Blender is a module that crashes or hangs when a process with registered classes ends: before 5.0."""
    bpy = sys.modules.get("bpy")
    return bpy is not None and not bpy.app.binary_path and bpy.app.version < (5, 0, 0)
