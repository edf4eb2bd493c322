"""The native programs of native/benchmarks: found, run, and their JSON read."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.generated_curves import BenchBalls
from benchmarks.generated_motion import BenchMotion
from benchmarks.machine import REPOSITORY
from benchmarks.meshes import BenchMesh

DEFAULT_FOLDER = REPOSITORY / "build" / "benchmarks"  # where `nox -s benchmarks` builds them


class NativeError(Exception):
    """A native program failed; the message says how."""


class NativePrograms:
    """folder: that holds the built programs; those that it lacks are left out."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def has(self, name: str) -> bool:
        return (self._folder / name).is_file()

    def why_not(self, name: str) -> str:
        """The line that names the missing program and how to get it."""
        return f"Embree and all native figures: {self._folder / name} is not built; `nox -s benchmarks` builds it"

    def run(
        self,
        name: str,
        mesh: BenchMesh | BenchBalls | BenchMotion,
        arguments: Sequence[str],
        tell: Callable[[float], object] = lambda share: None,
        *,
        is_timed: bool = True,
    ) -> Any:
        """Runs a program on a mesh and returns its JSON.

        tell: called with the share done, if the program reports it. is_timed: whether it measures times. It then
        ignores the machine's load: this program has checked the load at its start, and its own load is no reason to
        refuse.
        """
        with tempfile.TemporaryDirectory() as folder:
            mesh_file, out = Path(folder) / f"{mesh.name}.bin", Path(folder) / "out.json"
            mesh.write(mesh_file)
            words = [*arguments, *(["--noisy"] if is_timed else []), "--json", str(out)]
            command = [str(self._folder / name), *words, str(mesh_file)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
                said: list[str] = []
                for line in process.stdout or ():
                    if line.startswith("progress "):
                        tell(float(line.split()[1]))
                    else:
                        said.append(line)
            if process.returncode != 0:
                raise NativeError(f"{' '.join(command)} failed:\n{''.join(said[-20:])}")
            return json.loads(out.read_text())
