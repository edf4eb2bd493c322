"""The command line of a Blender with the extension: `blender --command perfect_bvh render FILE.blend -o OUT.png`."""

from __future__ import annotations

import signal

import bpy

NAME = "perfect_bvh"

_handles: list[object] = []


def run(argv: list[str]) -> int:
    """Runs `perfect-bvh` with the same arguments; Blender ends with the exit status."""
    from . import main

    # Blender's own only sets a flag, which nothing reads outside its own renders. The process ends after the command.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return main(argv, prog=f"blender --command {NAME}")
    except SystemExit as end:  # of argparse: help was asked for, or the arguments are wrong
        return end.code if isinstance(end.code, int) else 0


def register() -> None:
    _handles.append(bpy.utils.register_cli_command(NAME, run))


def unregister() -> None:
    bpy.utils.unregister_cli_command(_handles.pop())
