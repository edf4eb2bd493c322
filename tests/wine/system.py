"""Windows' Python under Wine, below .cache/wine: fetched, called with a time limit, ended without remains.

Wine brings its own C libraries, with which numpy does not work: so Microsoft's are put next to python.exe, from a
package that Java programs use. They are for these tests only and are never shipped.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
REPOSITORY = TESTS.parent
sys.path[:0] = [str(REPOSITORY / "release"), str(TESTS)]

from maven_pythons import fetch_package, unpack_package, unpack_python

WINE = Path("/usr/lib/wine/wine64")
SERVER = Path("/usr/lib/wine/wineserver64")
FOLDER = REPOSITORY / ".cache" / "wine"
PYTHON = "3.11"  # of Blender's module as of its releases up to 5.0
C_RUNTIME = "org.bytedeco:javacpp:1.5.13:jar:windows-x86_64"
C_RUNTIME_FOLDER = "org/bytedeco/javacpp/windows-x86_64"
C_RUNTIME_NAMES = ("ucrtbase", "msvcp140", "msvcp140_1", "vcruntime140", "vcruntime140_1")
BLENDER = "bpy==5.0.1"
# numpy of the series that this Blender's module requires; packages that pip leaves out on Linux are named as well.
NUMPY = ("numpy==1.26.4",)
TEST_PACKAGES = (
    *NUMPY,
    "pytest>=8",
    "pytest-xdist>=3.8",
    "hypothesis>=6",
    "trimesh>=4.5",
    "embreex>=4.4",
    "tqdm",
    "colorama",
)
BLENDER_PACKAGES = (BLENDER, "requests", "zstandard", "charset-normalizer", "idna", "urllib3", "certifi")
START_SECONDS = 300  # a prefix takes a minute to make, and so does Blender's first start


def windows_path(path: Path | str) -> str:
    """Returns the path as Windows' programs see it."""
    return "Z:" + str(path).replace("/", "\\")


class WineSystem:
    """One prefix and one Python. Use it in a `with`: every program of the prefix ends with it.

    Raises SystemExit where Wine is not installed.
    """

    def __init__(self, folder: Path = FOLDER) -> None:
        if not WINE.is_file():
            raise SystemExit("Wine is not installed: Debian's package wine64 has it")
        self.folder = folder
        self.python = folder / "python" / "python.exe"
        self.environment = {
            "HOME": str(folder / "home"),
            "PATH": os.environ["PATH"],
            "LC_ALL": "C.UTF-8",  # or Wine finds no file whose name is not ASCII
            "WINEPREFIX": str(folder / "prefix"),
            "WINEARCH": "win64",
            "WINEDEBUG": "-all",
            "PYTHONPYCACHEPREFIX": windows_path(folder / "pycache"),
            "PYTHONUNBUFFERED": "1",
            "WINEDLLOVERRIDES": f"mscoree,mshtml=;winemenubuilder.exe=d;{','.join(C_RUNTIME_NAMES)}=n,b",
        }

    def __enter__(self) -> WineSystem:
        (self.folder / "home").mkdir(parents=True, exist_ok=True)
        self._lock = (self.folder / "lock").open("w")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SystemExit(f"{self.folder} is used by another run, which this one would end") from None
        self._install_python()
        return self

    def __exit__(self, *_: object) -> None:
        self._end_programs()
        self._lock.close()

    def _end_programs(self) -> None:
        subprocess.run([SERVER, "-k"], env=self.environment, check=False, timeout=60)

    def _install_python(self) -> None:
        if self.python.is_file():
            return
        partial = self.folder / "python.partial"
        shutil.rmtree(partial, ignore_errors=True)
        shutil.copytree(unpack_python("windows-x86_64", PYTHON), partial)
        runtime = self.folder / "c_runtime"
        shutil.rmtree(runtime, ignore_errors=True)
        runtime.mkdir(parents=True)
        fetch_package(C_RUNTIME, runtime)
        (package,) = runtime.glob("*.jar")
        unpack_package(package, C_RUNTIME_FOLDER, folder=runtime / "libraries")
        for name in C_RUNTIME_NAMES:
            shutil.copy(runtime / "libraries" / f"{name}.dll", partial)
        partial.rename(self.python.parent)

    def install(self, name: str, packages: Iterable[str]) -> Path:
        """The folder of packages of that name, as pip would install them on Windows; not fetched again."""
        folder = self.folder / "packages" / name
        if not folder.is_dir():
            partial = folder.with_name(f"{name}.partial")
            shutil.rmtree(partial, ignore_errors=True)
            where = ("--platform=win_amd64", f"--python-version={PYTHON}", "--only-binary=:all:", f"--target={partial}")
            pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", *where)
            has_own_needs = ("--no-deps",) if name == "blender" else ()
            subprocess.run([*pip, *has_own_needs, *packages], check=True)
            partial.rename(folder)
        return folder

    def call(self, arguments: Sequence[Path | str], packages: Sequence[Path]) -> tuple[list[str], dict[str, str]]:
        """The command and the environment of a call of Python. packages: folders to import from."""
        words = [windows_path(word) if isinstance(word, Path) else word for word in arguments]
        paths = ";".join(windows_path(path) for path in packages)
        return [str(WINE), str(self.python), *words], self.environment | {"PYTHONPATH": paths}

    def run(self, arguments: Sequence[Path | str], *, packages: Sequence[Path], seconds: float) -> tuple[int, str]:
        """Python's exit status and its output, which is also shown as it comes. packages: folders to import from.

        After `seconds` it is killed, and the status is that of the signal.
        """
        command, environment = self.call(arguments, packages)
        program = subprocess.Popen(
            command,
            cwd=REPOSITORY,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

        def end() -> None:
            os.killpg(program.pid, signal.SIGKILL)
            self._end_programs()  # those that it started as well, which may hold its output open

        timer = threading.Timer(seconds, end)
        timer.start()
        written = []
        assert program.stdout is not None
        for line in program.stdout:
            written.append(line.decode("utf-8", "replace").rstrip("\r\n"))
            print(written[-1], flush=True)
        status = program.wait()
        timer.cancel()
        if status == -signal.SIGKILL:
            print(f"ended after {seconds:g} seconds", flush=True)
        return status, "\n".join(written)
