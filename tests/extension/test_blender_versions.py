"""The same zip in every Blender that can be had here, and the installed package, render the same and show each setting.

`nox -s blenders` puts older modules of Blender into .cache/blenders, together with a chroot that has Blender 5.2 as
Debian ships it (CPython 3.14) and as a module (3.13).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy")

# Blender and its Python, as `.cache/blenders` and the chroot have them.
MODULES = {"4.2": "3.11", "4.5": "3.11"}
IN_CHROOT = {
    "5.2 as a module": ("3.13", ("/opt/bpy-5.2/bin/python",)),
    "5.2 of Debian": ("3.14", ("blender", "--background", "--python-exit-code", "1", "--python")),
}
SCRIPT = "tests/extension/render_scene.py"
SETTINGS_SCRIPT = "tests/extension/shown_settings.py"
COMMAND_SCRIPT = "tests/extension/run_command.py"
MODES = ("preview", "clay", "normal", "depth", "instance")

# Blender's versions round colors and matrices differently: by a fortieth of an 8-bit step, and where a value is above
# one (a highlight), by a thousandth of it.
BLENDERS_ROUNDING = 1e-4

Render = dict[str, Any]


def render(command: list[str | Path], output: Path, environment: dict[str, str]) -> Render:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and output.is_file(), done.stdout + done.stderr
    with np.load(output) as file:
        return dict(file)


def render_here(interpreter: Path, repository: Path, folder: Path, blend: Path, extension: Path | None) -> Render:
    user = folder / "user"
    user.mkdir()
    output = folder / "image.npz"
    places = {"BLEND": blend, "OUTPUT": output, "EXTENSION": extension or "", "BLENDER_USER_RESOURCES": user}
    environment = os.environ | {name: str(place) for name, place in places.items()}
    return render([interpreter, repository / SCRIPT], output, environment)


@pytest.fixture(scope="module")
def expected(repository: Path, blend_file, tmp_path_factory) -> Render:
    """The image of the package that this Python has."""
    folder = tmp_path_factory.mktemp("package")
    return render_here(Path(sys.executable), repository, folder, blend_file("courtyard"), None)


def check_settings(command: list[str | Path], environment: dict[str, str], version: str) -> None:
    """Check that every setting is shown, and nothing twice."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and f"ALL SETTINGS SHOWN in {version}." in done.stdout, done.stdout + done.stderr


def check_same(rendered: Render, expected: Render, tolerance: float = BLENDERS_ROUNDING) -> None:
    assert list(rendered["isas"]) == list(expected["isas"])
    for mode in MODES:
        assert np.ptp(expected[mode][..., :3]) > 0.1
        if mode == "preview" and tolerance > 0.0:
            # Where a colour rounds differently, a path may take another branch: few of them do.
            is_same = np.isclose(rendered[mode], expected[mode], rtol=10 * tolerance, atol=tolerance)
            assert is_same.mean() > 0.998
            assert np.abs(rendered[mode] - expected[mode]).mean() < tolerance
            continue
        np.testing.assert_allclose(rendered[mode], expected[mode], rtol=10 * tolerance, atol=tolerance, err_msg=mode)


def test_the_zip_renders_what_the_package_renders(
    extension: Path, expected: Render, repository: Path, tmp_path: Path, blend_file
) -> None:
    rendered = render_here(Path(sys.executable), repository, tmp_path, blend_file("courtyard"), extension)
    assert rendered["blender"] == expected["blender"]
    check_same(rendered, expected, tolerance=0.0)


@pytest.mark.parametrize("version", MODULES)
def test_an_older_blender_renders_the_same(
    version: str, extension: Path, expected: Render, repository: Path, tmp_path: Path, blend_file
) -> None:
    interpreters = sorted((repository / ".cache" / "blenders").glob(f"{version}.*/bin/python"))
    if not interpreters:
        pytest.skip(f"no Blender {version} in .cache/blenders: `nox -s blenders` installs it")
    rendered = render_here(interpreters[-1], repository, tmp_path, blend_file("courtyard"), extension)
    assert str(rendered["blender"]).startswith(f"{version}.")
    assert str(rendered["python"]).startswith(f"{MODULES[version]}.")
    check_same(rendered, expected)


@pytest.mark.parametrize("version", MODULES)
def test_an_older_blender_shows_each_setting(version: str, extension: Path, repository: Path, tmp_path: Path) -> None:
    interpreters = sorted((repository / ".cache" / "blenders").glob(f"{version}.*/bin/python"))
    if not interpreters:
        pytest.skip(f"no Blender {version} in .cache/blenders: `nox -s blenders` installs it")
    environment = os.environ | {"EXTENSION": str(extension), "BLENDER_USER_RESOURCES": str(tmp_path)}
    check_settings([interpreters[-1], repository / SETTINGS_SCRIPT], environment, version)


@pytest.mark.parametrize("version", MODULES)
def test_a_command_ends_in_an_older_blender(
    version: str, extension: Path, repository: Path, tmp_path: Path, blend_file
) -> None:
    """Modules before 5.0 crash or hang when a process with registered classes ends."""
    interpreters = sorted((repository / ".cache" / "blenders").glob(f"{version}.*/bin/python"))
    if not interpreters:
        pytest.skip(f"no Blender {version} in .cache/blenders: `nox -s blenders` installs it")
    places = {"BLEND": blend_file("gears"), "EXTENSION": extension, "BLENDER_USER_RESOURCES": tmp_path}
    environment = os.environ | {name: str(place) for name, place in places.items()}
    command = [interpreters[-1], repository / COMMAND_SCRIPT]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Gears" in done.stdout


@pytest.mark.parametrize("name", IN_CHROOT)
def test_a_newer_blender_renders_the_same(name: str, extension: Path, expected: Render, repository: Path) -> None:
    if not list((repository / ".cache" / "blender-gui").glob(".ready-*")):
        pytest.skip("no Blender 5.2 in .cache/blender-gui: `nox -s blenders` installs it")
    python, interpreter = IN_CHROOT[name]
    places = {
        "BLEND": "/host/blend_scenes/courtyard.blend",
        "OUTPUT": f"/tmp/image-{python}.npz",
        "EXTENSION": f"/host/{extension.relative_to(repository)}",
        "BLENDER_USER_RESOURCES": f"/tmp/user-{python}",
    }
    variables = [f"{name}={place}" for name, place in places.items()]
    output = repository / ".cache" / f"image-{python}.npz"
    output.unlink(missing_ok=True)
    chroot = repository / "tests" / "gui" / "blender_chroot.sh"
    script = " && ".join(
        (
            f"rm -rf /tmp/user-{python} /tmp/image-{python}.npz",
            f"mkdir /tmp/user-{python}",
            " ".join(("env", *variables, *interpreter, f"/host/{SCRIPT}")),
            f"cp /tmp/image-{python}.npz /host/{output.relative_to(repository)}",
        )
    )
    rendered = render([chroot, "run", "sh", "-c", script], output, dict(os.environ))
    assert str(rendered["blender"]).startswith("5.2.")
    assert str(rendered["python"]).startswith(f"{python}.")
    check_same(rendered, expected)


@pytest.mark.parametrize("name", IN_CHROOT)
def test_a_newer_blender_shows_each_setting(name: str, extension: Path, repository: Path) -> None:
    if not list((repository / ".cache" / "blender-gui").glob(".ready-*")):
        pytest.skip("no Blender 5.2 in .cache/blender-gui: `nox -s blenders` installs it")
    python, interpreter = IN_CHROOT[name]
    user = f"/tmp/user-{python}"
    variables = (f"EXTENSION=/host/{extension.relative_to(repository)}", f"BLENDER_USER_RESOURCES={user}")
    started = " ".join(("env", *variables, *interpreter, f"/host/{SETTINGS_SCRIPT}"))
    chroot = repository / "tests" / "gui" / "blender_chroot.sh"
    check_settings([chroot, "run", "sh", "-c", f"rm -rf {user} && mkdir {user} && {started}"], dict(os.environ), "5.2")
