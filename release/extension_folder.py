"""Makes the folder that Blender's tool packs as the extension: the add-on, its licence and wheels.

python release/extension_folder.py FOLDER WHEELS

FOLDER is made anew; WHEELS is a folder with the engine's wheels, and with those of what the add-on wants of others. The
manifest in FOLDER names them, and of Blender's platforms those alone that the engine has wheels for.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from wheel_platforms import PLATFORMS

REPOSITORY = Path(__file__).resolve().parent.parent


def make_folder(folder: Path, wheels: list[Path]) -> None:
    """What the zip will hold; SystemExit if there is a wheel for no platform."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(REPOSITORY / "addon", folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(REPOSITORY / "LICENSE", folder)
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(wheel, folder / "wheels")
    manifest = folder / "blender_manifest.toml"
    names = [wheel.name for wheel in wheels]
    manifest.write_text(list_wheels(manifest.read_text(encoding="utf-8"), names), encoding="utf-8")


def list_wheels(manifest: str, names: list[str]) -> str:
    """The manifest of addon/, which lists no wheels because there are none beside it, with those of these names."""
    platforms = [name for name, platform in PLATFORMS.items() if any(platform.wheel_tag in wheel for wheel in names)]
    if not platforms:
        raise SystemExit("extension_folder: no wheel of the engine for any platform")
    quoted = ", ".join(f'"{platform}"' for platform in platforms)
    listed = "".join(f'  "./wheels/{name}",\n' for name in sorted(names))
    manifest, count = re.subn(r"^platforms = \[[^]]*\]$", f"platforms = [{quoted}]", manifest, flags=re.MULTILINE)
    if count != 1 or "\n[permissions]" not in manifest:
        raise SystemExit("extension_folder: expected `platforms` and [permissions] in addon/blender_manifest.toml")
    return manifest.replace("\n[permissions]", f"\nwheels = [\n{listed}]\n\n[permissions]")


if __name__ == "__main__":
    make_folder(Path(sys.argv[1]), sorted(Path(sys.argv[2]).glob("*.whl")))
