"""The extension zip: what is in it, what its modules need, and that Blender takes it."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

PYTHON_TAGS = {"cp311", "cp313", "cp314"}
PROCESSORS = {"linux-x64": "x86_64", "linux-arm64": "aarch64"}
MACHINES = {"x86_64": "Advanced Micro Devices X86-64", "aarch64": "AArch64"}
LOADERS = {"x86_64": "ld-linux-x86-64.so.2", "aarch64": "ld-linux-aarch64.so.1"}
GLIBC_FLOOR = (2, 28)
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"}

Modules = dict[tuple[str, str], Path]


@pytest.fixture(scope="module")
def modules(extension: Path, tmp_path_factory: pytest.TempPathFactory) -> Modules:
    """The compiled module of each wheel, by its Python's tag and its processor."""
    folder = tmp_path_factory.mktemp("wheels")
    with zipfile.ZipFile(extension) as file:
        file.extractall(folder)
    found = {}
    for wheel in folder.glob("wheels/perfect_bvh_engine-*.whl"):
        python, _, platform = wheel.stem.split("-")[2:]
        processor = platform.removeprefix("manylinux_{}_{}_".format(*GLIBC_FLOOR))
        place = folder / python / processor
        with zipfile.ZipFile(wheel) as file:
            file.extractall(place)
        (found[python, processor],) = (place / "perfect_bvh").glob("_core.*.so")
    return found


def output_of(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def blender_script() -> Path:
    """Blender's own tool that validates and builds extensions."""
    return Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"


def manifest_in(extension: Path) -> dict[str, Any]:
    with zipfile.ZipFile(extension) as file:
        return tomllib.loads(file.read("blender_manifest.toml").decode())


def test_it_has_a_wheel_for_each_python_of_blender_on_each_platform(modules: Modules, extension: Path) -> None:
    assert set(modules) == {(python, processor) for python in PYTHON_TAGS for processor in PROCESSORS.values()}
    assert manifest_in(extension)["platforms"] == list(PROCESSORS)
    for (python, processor), module in modules.items():
        assert module.name == f"_core.cpython-{python.removeprefix('cp')}-{processor}-linux-gnu.so"


def test_its_manifest_lists_what_is_in_it(extension: Path) -> None:
    with zipfile.ZipFile(extension) as file:
        wheels = {f"./{name}" for name in file.namelist() if name.startswith("wheels/")}
    listed = manifest_in(extension)["wheels"]
    assert len(listed) == len(wheels)
    assert set(listed) == wheels


def test_it_brings_what_its_command_line_needs(extension: Path) -> None:
    with zipfile.ZipFile(extension) as file:
        others = {name for name in file.namelist() if name.startswith("wheels/") and "perfect_bvh" not in name}
    assert [name.partition("-")[0] for name in others] == ["wheels/tqdm"]


def test_its_modules_are_for_the_machine_that_their_wheels_name(modules: Modules) -> None:
    for (_, processor), module in modules.items():
        header = output_of("readelf", "--file-header", module)
        assert re.findall(r"^ *Machine: +(.+)$", header, re.MULTILINE) == [MACHINES[processor]]


def test_releases_are_built_for_the_same_pythons(repository: Path) -> None:
    settings = tomllib.loads((repository / "native" / "pyproject.toml").read_text(encoding="utf-8"))
    builds = settings["tool"]["cibuildwheel"]["build"]
    assert set(builds) == {f"{tag}-manylinux_{processor}" for tag in PYTHON_TAGS for processor in PROCESSORS.values()}


def test_its_wheels_hold_the_engine_alone(modules: Modules) -> None:
    for module in modules.values():
        packages = {path.name for path in module.parent.parent.iterdir()}
        assert {name for name in packages if not name.endswith(".dist-info")} == {"perfect_bvh"}
        assert not list(module.parent.parent.rglob("entry_points.txt"))


def test_its_modules_export_only_their_entry_point(modules: Modules) -> None:
    for module in modules.values():
        assert output_of("nm", "-D", "--defined-only", "--format=just-symbols", module).split() == ["PyInit__core"]


def test_its_modules_run_on_old_systems(modules: Modules) -> None:
    for (_, processor), module in modules.items():
        needed = set(re.findall(r"\(NEEDED\).*\[(.+)\]", output_of("readelf", "--dynamic", "--wide", module)))
        assert "libc.so.6" in needed
        assert needed <= {*SYSTEM_LIBRARIES, LOADERS[processor]}
        versions = re.findall(r"GLIBC_(\d+)\.(\d+)", output_of("readelf", "--version-info", module))
        assert versions
        assert max((int(major), int(minor)) for major, minor in versions) <= GLIBC_FLOOR


def test_blenders_validator_accepts_it(extension: Path) -> None:
    done = subprocess.run([sys.executable, blender_script(), "validate", extension], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Success parsing TOML" in done.stdout


def test_it_holds_no_leftovers(extension: Path) -> None:
    with zipfile.ZipFile(extension) as file:
        names = file.namelist()
    assert {"blender_manifest.toml", "__init__.py", "LICENSE"} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.endswith((".pyc", ".blend", ".so"))]
