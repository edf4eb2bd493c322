"""The add-on's manifest: the one place that holds the version."""

from __future__ import annotations

import re
from pathlib import Path

MANIFEST = Path(__file__).resolve().parent.parent / "addon" / "blender_manifest.toml"


def read_version() -> str:
    """The version, 1.2.3 say; SystemExit if the manifest does not have exactly one."""
    found = re.findall(r'^version = "(.+)"$', MANIFEST.read_text(encoding="utf-8"), re.MULTILINE)
    if len(found) != 1:
        raise SystemExit(f"read_version: expected one line `version = ...` in {MANIFEST}, got {len(found)}")
    return str(found[0])
