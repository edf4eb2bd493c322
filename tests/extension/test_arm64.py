"""The zip's modules for 64-bit ARM, run by an emulator, answer every ray as this machine's engine does, bit for bit.

They do so with NEON, which they choose by themselves, and without; and every pixel of their images has the same bits.

`nox -s arm64_pythons` puts Pythons of that kind into .cache/arm64_pythons; the system must have qemu-user-static.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from oracles import meshes

EMULATOR = "qemu-aarch64-static"
SCRIPT = "tests/extension/trace_scene.py"
HIT_TABLE = "tests/hit_table/table.py"
PYTHONS = ("3.11", "3.13", "3.14")
Answers = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with meshes, places for them, and rays."""
    random = np.random.default_rng(7)
    positions, triangles = meshes.soup(300, 1)
    floor_positions, floor_triangles = meshes.grid(12, 4.0)
    scattered_origins, scattered_directions = meshes.random_rays(1000, 2)
    across, up = np.meshgrid(np.linspace(-0.4, 0.4, 32), np.linspace(-0.4, 0.4, 32))
    coherent_directions = np.stack([across, np.ones_like(up), up - 0.3], axis=-1).reshape(-1, 3)
    file = tmp_path_factory.mktemp("rays") / "inputs.npz"
    np.savez(
        file,
        positions=positions,
        triangles=triangles,
        moved_positions=positions + random.normal(0.0, 0.2, positions.shape),
        floor_positions=floor_positions,
        floor_triangles=floor_triangles,
        transforms=random.normal(size=(4, 3, 4)),
        scattered_origins=scattered_origins,
        scattered_directions=scattered_directions,
        coherent_origins=np.broadcast_to([0.0, -5.0, 1.5], coherent_directions.shape),
        coherent_directions=coherent_directions,
    )
    return file


def answers_of(command: list[str | Path], inputs: Path, folder: Path, environment: dict[str, str]) -> Answers:
    output = folder / "answers.npz"
    done = subprocess.run([*command, inputs, output], env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    with np.load(output) as file:
        return dict(file)


@pytest.fixture(scope="module")
def expected(repository: Path, inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Answers:
    """The answers of this Python's engine."""
    folder = tmp_path_factory.mktemp("here")
    return answers_of([sys.executable, repository / SCRIPT], inputs, folder, dict(os.environ))


@dataclass(frozen=True)
class Emulated:
    """A Python for 64-bit ARM with the zip's engine: how it is called, and in which environment."""

    python: str
    command: list[str | Path]
    environment: dict[str, str]


@pytest.fixture(scope="module", params=PYTHONS)
def emulated(
    request: pytest.FixtureRequest, repository: Path, arm64_extension: Path, tmp_path_factory: pytest.TempPathFactory
) -> Emulated:
    python = str(request.param)
    root = repository / ".cache" / "arm64_pythons" / python
    if not (root / "packages").is_dir():
        pytest.skip("no Python in .cache/arm64_pythons: `nox -s arm64_pythons` unpacks it")
    if shutil.which(EMULATOR) is None:
        pytest.skip(f"no {EMULATOR}: Debian's qemu-user-static has it")
    folder = tmp_path_factory.mktemp("engine")
    with zipfile.ZipFile(arm64_extension) as file:
        tag = "cp" + python.replace(".", "")
        names = [name for name in file.namelist() if f"-{tag}-" in name and name.endswith("_aarch64.whl")]
        if not names:
            pytest.skip(f"{arm64_extension.name} has no wheel for {python}: `nox -s extension` builds all")
        wheel = file.extract(names[0], folder)
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "engine")
    packages = os.pathsep.join(str(path) for path in (folder / "engine", root / "packages"))
    command = [EMULATOR, "-L", root, root / "usr" / "bin" / f"python{python}"]
    # In an emulator compiling numpy takes longer than all else here, so the first run's result is kept.
    return Emulated(python, command, os.environ | {"PYTHONPATH": packages, "PYTHONDONTWRITEBYTECODE": ""})


def check_answers(emulated: Emulated, isa: str, script: Path, inputs: Path, expected: Answers, folder: Path) -> None:
    answers = answers_of([*emulated.command, script], inputs, folder, emulated.environment)
    assert str(answers.pop("machine")) == "aarch64"
    assert str(answers.pop("python")) == emulated.python
    assert str(answers.pop("module")).startswith(emulated.environment["PYTHONPATH"].split(os.pathsep)[0])
    assert list(answers.pop("isas")) == ["scalar", "neon"]
    assert str(answers.pop("isa")) == isa
    assert "sse9" in str(answers.pop("refusal"))
    check_same(answers, expected)


def test_it_answers_as_this_machine_does(
    emulated: Emulated, repository: Path, inputs: Path, expected: Answers, tmp_path: Path
) -> None:
    check_answers(emulated, "neon", repository / SCRIPT, inputs, expected, tmp_path)


@pytest.mark.parametrize("emulated", ["3.13"], indirect=True)
def test_so_it_does_without_neon(
    emulated: Emulated, repository: Path, inputs: Path, expected: Answers, tmp_path: Path
) -> None:
    scalar = replace(emulated, environment=emulated.environment | {"PERFECT_BVH_ISA": "scalar"})
    check_answers(scalar, "scalar", repository / SCRIPT, inputs, expected, tmp_path)


@pytest.mark.parametrize("emulated", ["3.13"], indirect=True)
def test_twelve_scenes_are_hit_as_recorded(emulated: Emulated, repository: Path) -> None:
    command = [*emulated.command, repository / HIT_TABLE]
    done = subprocess.run(command, env=emulated.environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert "aarch64" in lines[0] and emulated.python in lines[0]
    assert lines[-1] == "Every row is as recorded."


def check_same(answers: Answers, expected: Answers) -> None:
    assert np.isfinite(expected["auto: scattered t_hit"]).sum() > 250
    assert np.isfinite(expected["auto: coherent t_hit"]).sum() > 500
    assert np.ptp(expected["image: preview"][..., :3]) > 0.1
    assert set(answers) == set(expected) - {"machine", "python", "module", "isas", "isa", "refusal"}
    for name, value in answers.items():
        assert value.dtype == expected[name].dtype
        assert value.tobytes() == expected[name].tobytes(), name
