"""The command `perfect-bvh`: render, scan or label a .blend file, look at its trees, measure it or the machine.

Blender and numpy are imported only once a command needs them, so that `--help` answers at once.

arguments        types of arguments: frames, sizes, seeds, file names. The options themselves are in this file
render           `render`: frames, one after the other, into images
labels           `labels`
commands         `scan`, `info`, `bench` and `calibrate`
frames           images of an animation in pieces, which a second run recognises
blender          Blender in this process: opens the file, renders, hears Ctrl-C
blender_command  the same commands in a Blender with the extension: `blender --command perfect_bvh`
report           what frames did to the trees and what they cost, as text
farm             pieces by workers of Dask
piece_child      a process with a Blender that does a worker's pieces
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

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
    parse_frames,
    parse_seed,
    parse_size,
)
from .report import is_reader_gone, write_any_text

DEFAULT_AUDIT = 1e-3


def build_parser(prog: str) -> argparse.ArgumentParser:
    """The parser of the whole command line, which was started as `prog`."""
    parser = argparse.ArgumentParser(
        prog=prog, description="Render .blend files with a native BVH, and look at the trees it builds."
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    _add_render(commands)
    _add_scan(commands)
    _add_labels(commands)
    _add_info(commands)
    _add_bench(commands)
    _add_calibrate(commands)
    return parser


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE.blend", help="the scene")
    _add_file_options(parser)
    _add_viewport(parser)


def _add_file_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--threads", type=POSITIVE, metavar="N", help="threads to use (default: as the file says)")
    parser.add_argument(
        "--autoexec", action="store_true", help="run the Python scripts and drivers inside the file (only if trusted)"
    )
    parser.add_argument(
        "--allow-missing", action="store_true", help="go on without linked libraries that are missing, and name them"
    )


def _add_viewport(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--viewport",
        action="store_true",
        help="see the objects, collections, modifier levels and particles that viewports show (default: those of a "
        "render; the camera is that of the frame's marker either way)",
    )


def _add_frames(parser: argparse.ArgumentParser, default: str = "current") -> None:
    what = f"such as 1-24, 1-48:2 or 1,5,9-12 (default: {default})"
    parser.add_argument("--frames", type=parse_frames, metavar="LIST", help=what)


def _add_quiet(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress bar and no summary")


def _add_pieces(parser: argparse.ArgumentParser) -> None:
    """Adds options of work in chunks, with or without workers."""
    parser.add_argument("--piece", type=POSITIVE, metavar="N", help="most frames of a piece (default: 10)")
    parser.add_argument("--resume", action="store_true", help="keep the pieces that are there and whole")
    parser.add_argument(
        "--workers",
        type=POSITIVE,
        metavar="N",
        help="do pieces in N processes, each with a Blender of its own, by Dask",
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="do pieces on the workers of a Dask scheduler, such as tcp://host:8786"
    )


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
        help="an image (out.png), a pattern (out/frame_####.png) or a folder (out/); .png, .jpg, .webp, .tif or .exr",
    )
    _add_frames(parser)
    parser.add_argument("--mode", metavar="M", help="what the image shows, see below (default: as the file says)")
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="pixels (default: as the file says)")
    parser.add_argument("--samples", type=POSITIVE, metavar="N", help="rays a pixel (default: as the file says)")
    parser.add_argument(
        "--denoise",
        action=argparse.BooleanOptionalAction,
        help="whether the noise of lit and clay is taken out (default: as the file says)",
    )
    parser.add_argument(
        "--time-limit",
        type=SECONDS,
        metavar="S",
        help="seconds for tracing a frame, at the cost of samples; 0 for no limit (default: as the file says)",
    )
    parser.add_argument(
        "--noise-threshold",
        type=THRESHOLD,
        metavar="T",
        help="where the noise of lit and clay is below this, sampling ends; 0: never (default: as the file says)",
    )
    parser.add_argument("--seed", type=parse_seed, metavar="N", help="the pattern of noise (default: as the file says)")
    parser.add_argument(
        "--audit",
        type=SHARE,
        nargs="?",
        const=DEFAULT_AUDIT,
        metavar="SHARE",
        help="check a share of the camera rays again, in double precision and without a tree, and say how many are "
        f"wrong (default share: {DEFAULT_AUDIT:g})",
    )
    parser.add_argument("--stats", action="store_true", help="print what each frame did to the trees, and the times")
    _add_pieces(parser)
    _add_quiet(parser)


def _add_scan(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "scan",
        help="write what a sensor measures, as point clouds",
        description="Scan frames with a LiDAR or a depth camera that an object carries: a file of points for each "
        "piece of some frames, with a manifest that says what is in it. --resume does what is missing or damaged.",
    )
    parser.add_argument("file", metavar="FILE.blend", nargs="?", help="the scene")
    _add_file_options(parser)
    _add_viewport(parser)
    parser.add_argument("-o", "--output", metavar="DIR", help="the folder for the files")
    parser.add_argument(
        "--sensor", default="spinning-16", metavar="NAME", help="a name of --list-sensors, or a .toml file of one's own"
    )
    parser.add_argument("--list-sensors", action="store_true", help="name the sensors, one a line, and do nothing else")
    parser.add_argument("--on", metavar="OBJECT", help="the object that carries it (default: each frame's camera)")
    parser.add_argument(
        "--exclude-mount",
        action=argparse.BooleanOptionalAction,
        help="make that object and its children invisible to the rays (default: if the sensor is inside of its mesh)",
    )
    _add_frames(parser, "one whole pass in the current one")
    parser.add_argument("--steps", type=POSITIVE, metavar="N", help="key moments of a frame (default: 1)")
    *names, last = (one.name for one in CLOUD_FORMATS)
    parser.add_argument(
        "--format", default="npz", metavar="F", help=f"{', '.join(names)} or {last} (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=parse_seed, default=0, metavar="N", help="of the sensor's noise and dropout (default: 0)"
    )
    _add_labels_of(parser, "columns of the points")
    _add_pieces(parser)
    _add_quiet(parser)


def _add_labels(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "labels",
        help="write exact ids, masks and depths of what the camera sees",
        description="Label frames as they would be rendered: for each, files of depths, positions, normals, uvs "
        "and ids, with masks of all that is there, hidden or not; for all together a file of COCO's format, with run "
        "lengths of the masks. One ray a pixel lists all surfaces, so that nothing is blended.",
    )
    _add_file(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="the folder for the files")
    _add_frames(parser)
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="pixels (default: as the file says)")
    parser.add_argument(
        "--category",
        metavar="NAME",
        help="the custom property of objects whose values are categories (default: each object's name is one)",
    )
    parser.add_argument(
        "--layers",
        type=LAYERS,
        default=1,
        metavar="K",
        help="how many surfaces a ray keeps the depths of (default: 1)",
    )
    _add_labels_of(parser, "images, and values of things")
    parser.add_argument(
        "--format",
        nargs="+",
        default=["npz"],
        metavar="F",
        help="npz, npy, png, exr or bop, one or more (default: npz); with npy, png and exr a .json says what numbers "
        "mean; bop is a data set for the estimation of poses: depth, masks, poses and models in the folder bop",
    )
    parser.add_argument(
        "--depth-scale",
        type=SCALE,
        metavar="S",
        help="world units that a step of a PNG's depth is; its 16 bits reach 65535 of them (default: 0.001)",
    )
    parser.add_argument("--flow", action="store_true", help="also how pixels move from the frame before to the next")
    parser.add_argument("--no-coco", action="store_true", help="no file of COCO's format, which needs pycocotools")
    _add_pieces(parser)
    _add_quiet(parser)


def _add_info(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "info",
        help="print the plan: the meshes and their trees",
        description="List each mesh with its class and the reason for it, its builder and bytes, and what building it "
        "and tracing a render's rays through it is expected to take on one thread.",
    )
    _add_file(parser)
    parser.add_argument("--frame", type=int, metavar="N", help="the frame to read (default: the file's current one)")


def _add_bench(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "bench",
        help="measure a scene, as a table and charts",
        description="Measure for about a minute what builders and, over an animation, policies "
        "cost and gain on this scene; print a table with advice and write all figures as JSON, and a chart of each "
        "where matplotlib is installed. "
        "Ctrl-C ends it with what has been measured so far.",
    )
    _add_file(parser)
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="the folder for pictures and bench.json")
    parser.add_argument("--seconds", type=POSITIVE, default=60, metavar="N", help="how long (default: %(default)s)")


def _add_calibrate(commands: argparse._SubParsersAction) -> None:
    parser = commands.add_parser(
        "calibrate",
        help="measure this machine",
        description="Measure once, in a few seconds, what building, refitting and tracing cost on this machine: that "
        "decides whether a tree is refitted or rebuilt. Leave the machine alone meanwhile.",
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="where to keep it (default: the user's cache folder)")


def main(argv: Sequence[str] | None = None, prog: str = "perfect-bvh") -> int:
    """Run the command line; the process's exit status.

    0, 2 for an error, 3 if pieces of the work failed, 130 after Ctrl-C, 141 after a closed pipe.
    """
    write_any_text()
    arguments = build_parser(prog).parse_args(argv)
    try:
        from .commands import run_bench, run_calibrate, run_info, run_scan
        from .labels import run_labels
        from .render import run_render

        runs = {"render": run_render, "scan": run_scan, "labels": run_labels, "info": run_info}
        return (runs | {"bench": run_bench, "calibrate": run_calibrate})[arguments.command](arguments)
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
