"""The command line in a separate process, as users run it: the ways it ends, and its messages then."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from wine_gaps import console_events

# On Windows a signal is an event of the console, for a whole group of processes.
INTERRUPT = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT)
OWN_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
RUN_MAIN = "import sys; sys.argv[0] = 'perfect-bvh'; from perfect_bvh_addon.cli import main; sys.exit(main())"


@console_events
@pytest.mark.usefixtures("hears_ctrl_c")
def test_ctrl_c_stops_an_animation(small_file: Path, tmp_path: Path) -> None:
    """The signal comes while frames are traced."""
    command = [sys.executable, "-c", RUN_MAIN, "render", str(small_file), "-o", f"{tmp_path}/out/"]
    command += ["--frames", "1-5000", "--samples", "64", "--stats"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, creationflags=OWN_GROUP
    ) as process:
        first = [process.stdout.readline() for _ in range(3)]  # the header, and a frame with the trees that it built
        process.send_signal(INTERRUPT)
        output, errors = process.communicate(timeout=300)
    assert "built tree" in first[2]
    assert process.returncode == 130
    assert "stopped;" in errors
    assert "of 5000 frames are written" in errors
    assert "Traceback" not in output + errors


def test_without_blender_the_command_says_what_to_install(small_file: Path) -> None:
    code = (
        "import sys; sys.modules['bpy'] = None\n"
        "from perfect_bvh_addon.cli import main\n"
        f"sys.exit(main(['info', {str(small_file)!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert "pip install 'perfect-bvh[blender]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_reader_that_goes_away_is_no_error(small_file: Path) -> None:
    """For example in `perfect-bvh info FILE | head`."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "w") as pipe:
        command = [sys.executable, "-c", RUN_MAIN, "info", str(small_file)]
        done = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, text=True, timeout=300)
    assert done.returncode == 141
    assert done.stderr == ""
