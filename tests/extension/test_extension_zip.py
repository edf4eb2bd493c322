"""The extension's zips: the content of each, and that Blender accepts it. test_wheels.py looks into their wheels."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from extension.zips import PLATFORMS, REPOSITORY, need_zip, zip_of

bpy = pytest.importorskip("bpy")

PYTHON_TAGS = {"cp311", "cp313", "cp314"}
MOST_BYTES = 4_700_000


@pytest.fixture(params=[name for name in PLATFORMS if zip_of(name)])
def platform(request: pytest.FixtureRequest) -> str:
    """Each that there is a zip for."""
    return str(request.param)


@pytest.fixture
def built(platform: str) -> Path:
    return need_zip(platform)


def names_in(built: Path) -> list[str]:
    with zipfile.ZipFile(built) as file:
        return file.namelist()


def manifest_in(built: Path) -> dict[str, Any]:
    with zipfile.ZipFile(built) as file:
        return tomllib.loads(file.read("blender_manifest.toml").decode())


def blender_script() -> Path:
    """Blender's own tool that validates and builds extensions."""
    return Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"


def test_it_is_for_its_platform_alone(built: Path, platform: str) -> None:
    generated = manifest_in(built)["build"]["generated"]
    assert generated["platforms"] == [platform]
    wheels = {f"./{name}" for name in names_in(built) if name.startswith("wheels/")}
    assert len(generated["wheels"]) == len(wheels)
    assert set(generated["wheels"]) == wheels


def test_it_has_the_engine_for_blenders_pythons(built: Path) -> None:
    wheels = [name for name in names_in(built) if name.startswith("wheels/perfect_bvh_engine-")]
    assert {Path(name).name for name in wheels} <= {path.name for path in (REPOSITORY / "dist/wheels").glob("*.whl")}
    tags = {name.split("-")[2] for name in wheels}
    assert tags and tags <= PYTHON_TAGS
    if len(tags) < len(PYTHON_TAGS):
        pytest.skip(f"{built.name} was built for {', '.join(sorted(tags))} alone")


def test_it_brings_what_its_command_line_needs(built: Path) -> None:
    others = {name for name in names_in(built) if name.startswith("wheels/") and "perfect_bvh" not in name}
    assert [name.partition("-")[0] for name in others] == ["wheels/tqdm"]


@pytest.mark.parametrize("name", PLATFORMS)
def test_it_is_small(name: str) -> None:
    assert need_zip(name).stat().st_size < MOST_BYTES


def test_blenders_validator_accepts_it(built: Path) -> None:
    done = subprocess.run([sys.executable, blender_script(), "validate", built], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Success parsing TOML" in done.stdout


def test_it_holds_no_leftovers(built: Path) -> None:
    names = names_in(built)
    assert {"blender_manifest.toml", "__init__.py", "LICENSE"} <= set(names)
    compiled = (".pyc", ".blend", ".so", ".pyd", ".dylib")
    assert not [name for name in names if "__pycache__" in name or name.endswith(compiled)]


def test_the_manifest_names_all_platforms_in_the_order_of_the_wheels() -> None:
    manifest = (REPOSITORY / "addon" / "blender_manifest.toml").read_text(encoding="utf-8")
    assert tomllib.loads(manifest)["platforms"] == list(PLATFORMS)
    table = (REPOSITORY / "release" / "wheel_platforms.py").read_text(encoding="utf-8")
    assert re.findall(r'^    "(\w+-\w+)": Platform', table, re.MULTILINE) == list(PLATFORMS)
