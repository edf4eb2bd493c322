"""Make a repository of extensions from zips: Blender follows it, installs from it and updates from it.

python release/repository.py FOLDER ZIP [ZIP ...]

FOLDER gets copies of the zips, index.json for Blender, and index.html, whose links are dragged into Blender. Blender's
own tool writes both files. It is plain Python and part of the module bpy, so no Blender with windows is needed.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).with_name("repository.html")


def extension_tool() -> Path:
    """Return the path of Blender's command line for extensions, in the installed module bpy."""
    import bpy

    return Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"


def make_repository(folder: Path, zips: list[Path]) -> None:
    """Write a repository of these zips to `folder`, which is emptied first.

    Raises:
        SystemExit: If there is no zip, if the tool leaves one out, or if two are for the same platform.
    """
    if not zips:
        raise SystemExit("make_repository: zips: expected at least one, got none; `nox -s extension` builds them")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for path in zips:
        shutil.copy(path, folder)
    options = ("--repo-dir", str(folder), "--html", "--html-template", str(PAGE))
    subprocess.run([sys.executable, extension_tool(), "server-generate", *options], check=True)
    # The tool only warns of bad archives and of duplicates.
    listed = json.loads((folder / "index.json").read_text(encoding="utf-8"))["data"]
    left_out = {path.name for path in zips} - {entry["archive_url"].removeprefix("./") for entry in listed}
    if left_out:
        raise SystemExit(f"make_repository: zips: Blender's tool refused {', '.join(sorted(left_out))}; see above")
    platforms = [name for entry in listed for name in entry.get("platforms", ["all"])]
    twice = sorted({name for name in platforms if platforms.count(name) > 1})
    if twice:
        raise SystemExit(
            f"make_repository: zips: expected one for each platform, got several for {', '.join(twice)}; "
            "remove those of older versions"
        )


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Make a repository of extensions from zips.")
    parser.add_argument("folder", type=Path, help="folder to write; it is emptied first")
    parser.add_argument("zips", type=Path, nargs="*", metavar="ZIP", help="zips that `nox -s extension` built")
    arguments = parser.parse_args()
    make_repository(arguments.folder, arguments.zips)


if __name__ == "__main__":
    main()
