"""Run by each Blender: install from the repository at REPOSITORY_URL, update to its newer version, remove.

The server shows the newer version after a request for `newer`. Prints the installed version after each step.
"""

from __future__ import annotations

import os
import sys
import urllib.request
from pathlib import Path

import bpy

URL = os.environ["REPOSITORY_URL"]


def show(step: str) -> None:
    folder = Path(repository.directory) / "small"
    text = (folder / "__init__.py").read_text() if folder.is_dir() else "nothing"
    sys.stdout.write(f"STEP {step}: {text.strip()}\n")
    sys.stdout.flush()


preferences = bpy.context.preferences
preferences.system.use_online_access = True
repository = preferences.extensions.repos.new(name="Followed", module="followed", remote_url=f"{URL}/index.json")
place = {"repo_directory": repository.directory}
bpy.ops.extensions.repo_sync(**place)
show("synced")
bpy.ops.extensions.package_install(**place, pkg_id="small", enable_on_install=False)
show("installed")
with urllib.request.urlopen(f"{URL}/newer"):
    pass
bpy.ops.extensions.repo_sync(**place)
bpy.ops.extensions.package_upgrade_all(use_active_only=False)
show("updated")
bpy.ops.extensions.package_uninstall(**place, pkg_id="small")
show("removed")
