"""The extension zip: what is in it, what its modules need, and that Blender takes it."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

PYTHON_TAGS = {"cp311", "cp313", "cp314"}
GLIBC_FLOOR = (2, 28)
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "ld-linux-x86-64.so.2"}


@pytest.fixture(scope="module")
def modules(extension: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The compiled module of each wheel, by its Python's tag."""
    folder = tmp_path_factory.mktemp("wheels")
    with zipfile.ZipFile(extension) as file:
        file.extractall(folder)
    found = {}
    for wheel in folder.glob("wheels/*.whl"):
        tag = wheel.name.split("-")[2]
        with zipfile.ZipFile(wheel) as file:
            file.extractall(folder / tag)
        (found[tag],) = (folder / tag / "perfect_bvh").glob("_core.*.so")
    return found


def output_of(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def blender_script() -> Path:
    """Blender's own tool that validates and builds extensions."""
    return Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"


def test_it_has_a_wheel_for_each_python_of_blender(modules: dict[str, Path]) -> None:
    assert set(modules) == PYTHON_TAGS
    for tag, module in modules.items():
        assert module.name == f"_core.cpython-{tag.removeprefix('cp')}-x86_64-linux-gnu.so"


def test_releases_are_built_for_the_same_pythons(repository: Path) -> None:
    settings = tomllib.loads((repository / "native" / "pyproject.toml").read_text(encoding="utf-8"))
    builds = settings["tool"]["cibuildwheel"]["build"]
    assert set(builds) == {f"{tag}-manylinux_x86_64" for tag in PYTHON_TAGS}


def test_its_wheels_hold_the_engine_alone(modules: dict[str, Path]) -> None:
    for module in modules.values():
        packages = {path.name for path in module.parent.parent.iterdir()}
        assert {name for name in packages if not name.endswith(".dist-info")} == {"perfect_bvh"}
        assert not list(module.parent.parent.rglob("entry_points.txt"))


def test_its_modules_export_only_their_entry_point(modules: dict[str, Path]) -> None:
    for module in modules.values():
        assert output_of("nm", "-D", "--defined-only", "--format=just-symbols", module).split() == ["PyInit__core"]


def test_its_modules_run_on_old_systems(modules: dict[str, Path]) -> None:
    for module in modules.values():
        needed = set(re.findall(r"\(NEEDED\).*\[(.+)\]", output_of("readelf", "--dynamic", "--wide", module)))
        assert "libc.so.6" in needed
        assert needed <= SYSTEM_LIBRARIES
        versions = re.findall(r"GLIBC_(\d+)\.(\d+)", output_of("objdump", "-T", module))
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
