"""`perfect-bvh calibrate`: measures this machine for the governor and keeps the numbers. Needs no Blender."""

from __future__ import annotations

import argparse
import sys

from ..settings.native_fault import explain, read_manifest
from .arguments import CommandError, parse_path


def run_calibrate(arguments: argparse.Namespace) -> int:
    """Measure, print and save; the exit status."""
    try:
        from perfect_bvh.calibrate import calibrate
        from perfect_bvh.calibration import BUILDERS, user_file
    except (ImportError, OSError, RuntimeError) as error:
        raise CommandError(explain(error, read_manifest())) from error
    from tqdm import tqdm

    path = user_file() if arguments.output is None else parse_path("-o", arguments.output)
    with tqdm(
        total=1.0, desc="measuring", disable=None, leave=False, file=sys.stderr, bar_format="{l_bar}{bar}|"
    ) as bar:

        def advance(done: float) -> bool:
            bar.update(done - bar.n)
            return True

        measured = calibrate(advance)
    try:
        measured.save(path)
    except OSError as error:
        raise CommandError(f"cannot write {path} ({error.strerror})") from error
    lines = [
        f"a ray's visit to a node {measured.node_nanoseconds:.1f} ns, to a leaf {measured.leaf_nanoseconds:.1f} ns",
        f"refit {measured.refit_nanoseconds:.1f} ns a triangle, rotations {measured.rotate_nanoseconds:.1f} besides, "
        f"new parts {measured.rebuild_parts_nanoseconds:.1f}",
    ]
    for name in BUILDERS:
        cost = measured.builders[name]
        lines.append(
            f"{name}: build {cost.build_nanoseconds:.0f} ns a triangle, trace {cost.trace_nanoseconds:.0f} ns a ray"
        )
    sys.stdout.write("\n".join([*lines, str(path)]) + "\n")
    sys.stdout.flush()  # here it is noticed that nobody reads it
    return 0
