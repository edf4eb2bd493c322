"""The terminal: any text can be written, Blender's is kept off it, and a reader that goes away ends nothing badly."""

from __future__ import annotations

import errno
import os
import subprocess
import sys

import pytest
from child_process import environment_with_paths
from perfect_bvh_addon.cli.report import is_reader_gone

NAMES = "Würfel, 立方体"


def run(code: str, **options: object) -> subprocess.CompletedProcess[bytes]:
    """Runs code in a process whose output has one code page, like a redirected Windows program."""
    environment = environment_with_paths() | {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    environment |= {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}  # so that Python does not choose UTF-8 by itself
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment, timeout=300, **options)  # type: ignore[call-overload]


OWN_WORDS = f"""
from perfect_bvh_addon.cli.report import quiet_blender
with quiet_blender() as out:
    out.write({NAMES!a})
"""
# {body} is the command's code.
COMMAND = """
import sys
from perfect_bvh_addon import cli
from perfect_bvh_addon.cli import commands

def run(arguments):
    {body}

commands.run_calibrate = run
sys.exit(cli.main(["calibrate"]))
"""
FAILING = COMMAND.format(body=f"sys.stdout.write({NAMES!a}); raise cli.CommandError({NAMES!a})")


@pytest.mark.parametrize("code", [OWN_WORDS, FAILING])
def test_what_the_encoding_lacks_is_written_as_an_escape(code: str) -> None:
    done = run(code, capture_output=True)
    assert done.stdout == b"W\xfcrfel, \\u7acb\\u65b9\\u4f53"
    assert b"Traceback" not in done.stderr


CHATTER = f"""
import ctypes, os, sys
from perfect_bvh_addon.cli.report import quiet_blender
c = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)
c.puts(b"before")
with quiet_blender() as out:
    c.puts(b"of C's")
    print("of Python's", {NAMES!a})
    os.write(1, b"of the system's")
    out.write("own ")
c.puts(b"after")
"""


def test_blender_is_silent_meanwhile_and_nothing_surfaces_later() -> None:
    done = run(CHATTER, capture_output=True)
    assert (done.stdout.split(), done.stderr) == ([b"before", b"own", b"after"], b"")


def test_a_reader_that_goes_away_ends_a_command_in_silence() -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    code = COMMAND.format(body="sys.stdout.write('text'); sys.stdout.flush()")
    with os.fdopen(write_end, "w") as pipe:
        done = run(code, stdout=pipe, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (141, b"")


def test_only_a_closed_pipe_counts_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def bad_argument() -> OSError:
        return OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    told = OSError(errno.EINVAL, "cannot write a.png: Invalid argument")
    with monkeypatch.context() as windows:
        windows.setattr(os, "name", "nt")
        on_windows = [is_reader_gone(error) for error in (bad_argument(), told, BrokenPipeError(), PermissionError())]
    with monkeypatch.context() as linux:
        linux.setattr(os, "name", "posix")
        elsewhere = [is_reader_gone(error) for error in (bad_argument(), BrokenPipeError())]
    assert on_windows == [True, False, True, False]
    assert elsewhere == [False, True]
