"""Find faults in the extension's zips that reviewers of extension listings reject.

python release/listing_check.py ZIP [ZIP ...]

Prints each fault as `ZIP: file:line: what`, and fails if there is one that EXPLAINED gives no reason for. Those with a
reason are printed as well, to be mentioned to the reviewers.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from wheel_platforms import PLATFORMS

MOST_BYTES = 200_000_000
FIELDS = ("id", "version", "name", "tagline", "maintainer", "type", "blender_version_min", "license", "permissions")
BINARIES = (".so", ".pyd", ".dll", ".dylib", ".exe")
STRANGE = re.compile(r"(^|/)(\.|__pycache__|__MACOSX|tests?/)|\.(pyc|blend\d*|zip|log|orig)$")
UPDATER = re.compile(r"addon_updater|releases/latest|api\.github\.com|package_install|repo_sync|-m pip|ensurepip")
NETWORK = {"aiohttp", "distributed", "ftplib", "http", "httpx", "requests", "smtplib", "socket", "ssl", "urllib"}
WRITERS = {"open", "write_bytes", "write_text", "mkdir", "unlink", "rmtree"}
CHANGES = {"append", "clear", "extend", "insert", "pop", "remove", "setdefault", "update"}
# Start of a file's path, word of the fault, and why it is so.
EXPLAINED = (
    ("support/files.py", "-m pip", "text of an error: the command that a user may run; nothing runs it"),
    (
        "cli/farm/",
        "network",
        "Dask's, on the command line with --workers or --scheduler; no panel uses it",
    ),
    ("cli/farm/cluster.py", "sys.modules", "while Dask starts workers, so that they do not run the user's script"),
)


def sources_in(file: zipfile.ZipFile) -> Iterator[tuple[str, str]]:
    """Yield name and text of each of our Python files, those of the engine's wheels included."""
    for name in file.namelist():
        if name.endswith(".py"):
            yield name, file.read(name).decode()
        elif name.startswith("wheels/perfect_bvh"):
            with zipfile.ZipFile(io.BytesIO(file.read(name))) as wheel:
                yield from sources_in(wheel)


def faults_of_code(name: str, text: str, permissions: dict[str, Any]) -> Iterator[str]:
    """Yield actions of a source that an extension may not do, or not without a permission."""
    for node in ast.walk(ast.parse(text)):
        line = f"{name}:{getattr(node, 'lineno', 0)}"
        called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
        if called in ("eval", "exec"):
            yield f"{line}: calls {called}"
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and UPDATER.search(node.value):
            yield f"{line}: updates or installs by itself: {node.value[:60]!r}"
        if isinstance(node, ast.Attribute) and UPDATER.search(node.attr):
            yield f"{line}: updates or installs by itself: {node.attr}"
        changed = called.rpartition(".")[0] if called.rpartition(".")[2] in CHANGES else ""
        if isinstance(node, ast.Attribute | ast.Subscript) and isinstance(node.ctx, ast.Store | ast.Del):
            changed = ast.unparse(node.value if isinstance(node, ast.Subscript) else node)
        if changed in ("sys.path", "sys.modules"):
            yield f"{line}: changes {changed}"
        if called.rpartition(".")[2] in WRITERS and "files" not in permissions:
            yield f"{line}: {called} without the permission `files`"
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else names
        used = [name for name in names if name.partition(".")[0] in NETWORK and name != "urllib.parse"]
        if used and "network" not in permissions:
            yield f"{line}: imports {used[0]} without the permission `network`"


def faults_of_zip(path: Path) -> Iterator[str]:
    """Yield all faults of a zip, those that EXPLAINED has included."""
    if path.stat().st_size > MOST_BYTES:
        yield f"{path.stat().st_size:,} bytes; at most {MOST_BYTES:,} are taken"
    with zipfile.ZipFile(path) as file:
        names = file.namelist()
        yield from (f"{name}: does not belong in an extension" for name in names if STRANGE.search(name))
        yield from (f"{name}: is compiled and in no wheel" for name in names if name.endswith(BINARIES))
        if "LICENSE" not in names:
            yield "LICENSE: is missing"
        manifest = tomllib.loads(file.read("blender_manifest.toml").decode())
        yield from (f"blender_manifest.toml: has no `{field}`" for field in FIELDS if not manifest.get(field))
        generated = manifest.get("build", {}).get("generated", {})
        platforms = generated.get("platforms", manifest.get("platforms", []))
        if len(platforms) != 1 or platforms[0] not in PLATFORMS:
            yield f"blender_manifest.toml: expected one platform in a zip, got {', '.join(platforms) or 'none'}"
        tags = tuple(PLATFORMS[name].wheel_tag for name in platforms if name in PLATFORMS)
        for wheel in (PurePosixPath(name).stem for name in names if name.endswith(".whl")):
            if not wheel.endswith(("-any", *tags)):
                yield f"wheels/{wheel}.whl: is for another platform than {', '.join(platforms)}"
            if wheel.startswith("numpy-"):
                yield f"wheels/{wheel}.whl: Blender has numpy"
        for name, text in sources_in(file):
            yield from faults_of_code(name, text, manifest.get("permissions", {}))


def reason_for(fault: str) -> str:
    """Return the reason for a fault, "" if there is none."""
    found = (reason for start, word, reason in EXPLAINED if fault.startswith(start) and word in fault)
    return next(found, "")


def main() -> int:
    """The command line; the exit status."""
    parser = argparse.ArgumentParser(description="Find what reviewers of extension listings refuse.")
    parser.add_argument("zips", type=Path, nargs="+", metavar="ZIP", help="zips that `nox -s extension` built")
    count = 0
    for path in parser.parse_args().zips:
        for fault in faults_of_zip(path):
            reason = reason_for(fault)
            count += not reason
            sys.stdout.write(f"{path.name}: {fault}{f' (explained: {reason})' if reason else ''}\n")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
