"""The run in windows fails if Blender's console has a crash, an exception or a leak on it, and only then."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from gui.console_alarms import find_alarms

# The console of a run that passed, its repeated lines left out.
CLEAN = """\
00:00.600  system.path      | WARNING Could not get a list of mounted file-systems
00:02.529  blend            | Read blend: "/host/blend_scenes/tree_in_wind.blend"
PASSED  1 enable (9.7 s)
01:00.170  operator         | Scan: 90,708 points on 62 objects, 230,400 rays, 0.97 s
MEASURED frames per second, tree_in_wind at 960x540: 1.9
PASSED 15 report (0.5 s)
ALL STEPS PASSED
06:04.515  blend            | Saved session recovery to "/tmp/quit.blend"
06:04.516  blend            | Writing user preferences: "/host/.cache/windows/user/config/userpref.blend"\x20
06:04.519  reports          | Preferences saved

Blender quit
"""
# As Blender 4.2 to 5.2, Python and the shell print them.
ALARMING = (
    "Error: Not freed memory blocks: 4, total unfreed memory 0.000420 MB",
    "Not freed memory blocks: 4294967295",
    "Freeing memory after the leak detector has run. This can happen when using static variables in C++ that are",
    "Traceback (most recent call last):",
    "Error: Python: Traceback (most recent call last):",
    "Fatal Python error: Segmentation fault",
    "windows.sh: line 36: 4711 Segmentation fault      (core dumped) blender",
)


def judge(script: Path, console: Path) -> subprocess.CompletedProcess[str]:
    """Run the check as windows.sh does, on a Python without this one's packages."""
    return subprocess.run([sys.executable, "-I", "-S", script, console], capture_output=True, text=True, check=False)


@pytest.fixture
def script(repository: Path) -> Path:
    return repository / "tests" / "gui" / "console_alarms.py"


def test_a_clean_console_passes(script: Path, tmp_path: Path) -> None:
    console = tmp_path / "console.log"
    console.write_text(CLEAN, encoding="utf-8")
    done = judge(script, console)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("line", ALARMING)
def test_an_alarm_fails_and_is_named(line: str, script: Path, tmp_path: Path) -> None:
    console = tmp_path / "console.log"
    console.write_bytes(CLEAN.encode() + b"\xff no UTF-8\n" + line.encode() + b"\n")
    done = judge(script, console)
    assert done.returncode == 1
    assert done.stdout == f"{len(CLEAN.splitlines()) + 2}: {line}\n"


def test_what_only_speaks_of_memory_is_no_alarm() -> None:
    assert find_alarms("Mem:72.31M (Peak 90.00M)\nMemory was freed\nRead blend: /tmp/segmentation.blend\n") == []


@pytest.mark.skipif(find_spec("bpy") is None, reason="Blender's module is not installed")
@pytest.mark.parametrize(
    ("leak", "alarms"), [("", 0), ("ctypes.pythonapi.Py_IncRef(ctypes.py_object(bmesh.new()))", 1)]
)
def test_what_blender_prints_of_a_leak_is_an_alarm(leak: str, alarms: int) -> None:
    code = f"import ctypes, bpy, bmesh; {leak}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert len(find_alarms(done.stdout + done.stderr)) == alarms, done.stdout + done.stderr


def test_the_run_in_windows_asks_this_check(script: Path) -> None:
    text = (script.parent / "windows.sh").read_text(encoding="utf-8")
    assert f'if ! python3 "$repository/tests/gui/{script.name}" "$console"; then' in text
