"""The extension zip: what is in it, what its modules need, and that Blender takes it and renders with it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from oracles.png import read_png

bpy = pytest.importorskip("bpy")

PYTHON_TAGS = {"cp311", "cp313", "cp314"}
GLIBC_FLOOR = (2, 28)
SYSTEM_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "ld-linux-x86-64.so.2"}


@pytest.fixture(scope="module")
def extension(repository: Path) -> Path:
    found = sorted((repository / "dist").glob("perfect_bvh-*.zip"))
    if not found:
        pytest.skip("no zip in dist: `nox -s extension` builds it")
    return found[-1]


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


RENDER = """
import os, sys
from pathlib import Path
import bpy
if os.environ.get("EXTENSION"):
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["EXTENSION"], repo="user_default", enable_on_install=False
    )
    # Before the package that this test may have beside it.
    user = Path(os.environ["BLENDER_USER_RESOURCES"])
    (unpacked,) = user.rglob("site-packages/perfect_bvh")
    sys.path.insert(0, str(unpacked.parent))
    bpy.ops.preferences.addon_enable(module="bl_ext.user_default.perfect_bvh")
    import perfect_bvh
    assert perfect_bvh.__file__.startswith(str(user)), perfect_bvh.__file__
else:
    import perfect_bvh_addon
    perfect_bvh_addon.register()
    import perfect_bvh
print("ISAS", *perfect_bvh.available_isas())
bpy.ops.wm.open_mainfile(filepath=os.environ["BLEND"])
scene = bpy.context.scene
scene.render.engine = "PERFECT_BVH"
scene.perfect_bvh.samples = 4
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
scene.render.filepath = os.environ["IMAGE"]
scene.render.image_settings.file_format = "PNG"
bpy.ops.render.render(write_still=True)
"""


def rendered(tmp_path: Path, blend: Path, **environment: str) -> tuple[np.ndarray, str]:
    image = tmp_path / f"{'extension' if environment else 'package'}.png"
    done = subprocess.run(
        [sys.executable, "-c", RENDER],
        env=os.environ | {"BLEND": str(blend), "IMAGE": str(image)} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0 and image.is_file(), done.stdout + done.stderr
    (kernels,) = re.findall(r"^ISAS .*$", done.stdout, re.MULTILINE)
    return read_png(image), kernels


def test_it_renders_what_the_package_renders(extension: Path, tmp_path: Path, blend_file) -> None:
    user = tmp_path / "user"
    user.mkdir()
    from_zip, kernels = rendered(
        tmp_path, blend_file("courtyard"), EXTENSION=str(extension), BLENDER_USER_RESOURCES=str(user)
    )
    from_package, expected_kernels = rendered(tmp_path, blend_file("courtyard"))
    assert kernels == expected_kernels
    np.testing.assert_array_equal(from_zip, from_package)
