"""Makes the folder that Blender's tool packs as the extension: the add-on, its licence, manual and wheels.

python release/extension_folder.py FOLDER WHEELS

FOLDER is replaced; WHEELS is a folder with the engine's wheels and those of the add-on's other requirements. The
manifest in FOLDER names them, and only those of Blender's platforms that the engine has wheels for.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

from manual import write_manual
from wheel_platforms import PLATFORMS

REPOSITORY = Path(__file__).resolve().parent.parent


def make_folder(folder: Path, wheels: list[Path]) -> None:
    """The content of the zip; SystemExit if there is no wheel for any platform."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(REPOSITORY / "addon", folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(REPOSITORY / "LICENSE", folder)
    write_manual(folder / "manual")
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copy(wheel, folder / "wheels")
    manifest = folder / "blender_manifest.toml"
    names = [wheel.name for wheel in wheels]
    manifest.write_text(list_wheels(manifest.read_text(encoding="utf-8"), names), encoding="utf-8")


def list_wheels(manifest: str, names: list[str]) -> str:
    """The manifest of addon/, which lists no wheels because none are in that folder, with the wheels of these names."""
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
