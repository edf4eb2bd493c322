"""The repository of extensions: its list, and that Blenders install from it, update from it and remove."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import urllib.request
import zipfile
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from extension.zips import PLATFORMS, REPOSITORY, this_platform, zip_of

pytest.importorskip("bpy")

sys.path.insert(0, str(REPOSITORY / "release"))
from repository import extension_tool, make_repository

SCRIPT = "tests/extension/follow_repository.py"
FOLLOWED = ["synced: nothing", "installed: # 0.1.0", "updated: # 0.2.0", "removed: nothing"]
MANIFEST = """schema_version = "1.0.0"
id = "small"
version = "{version}"
name = "Small"
tagline = "Does nothing"
maintainer = "The Perfect BVH authors"
type = "add-on"
blender_version_min = "4.2.0"
platforms = ["{platform}"]
license = ["SPDX:GPL-3.0-or-later"]
"""


def small_zip(folder: Path, version: str, platform: str) -> Path:
    """Write an extension that has a platform and does nothing."""
    path = folder / f"small-{version}-{platform}.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("blender_manifest.toml", MANIFEST.format(version=version, platform=platform))
        file.writestr("__init__.py", f"# {version}\n")
    return path


class Handler(SimpleHTTPRequestHandler):
    """Serves the repository 0.1.0, and 0.2.0 after a request for `newer`."""

    version = "0.1.0"

    def translate_path(self, path: str) -> str:
        if path == "/newer":
            type(self).version = "0.2.0"
            return super().translate_path("/0.2.0/index.json")
        return super().translate_path(f"/{self.version}{path}")

    def log_message(self, *_arguments: object) -> None:
        pass


@pytest.fixture
def served(tmp_path: Path) -> Iterator[str]:
    """The address of a repository that gets a newer version."""
    other = next(name for name in PLATFORMS if name != this_platform())
    for version in ("0.1.0", "0.2.0"):
        make_repository(tmp_path / version, [small_zip(tmp_path, version, name) for name in (this_platform(), other)])
    handler = partial(type("Handler", (Handler,), {}), directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_it_lists_each_zip_with_its_hash_size_and_platform(tmp_path: Path) -> None:
    zips = [small_zip(tmp_path, "0.1.0", name) for name in PLATFORMS]
    make_repository(tmp_path / "repository", zips)
    listed = json.loads((tmp_path / "repository" / "index.json").read_text())["data"]
    assert sorted(entry["platforms"] for entry in listed) == sorted([name] for name in PLATFORMS)
    page = (tmp_path / "repository" / "index.html").read_text()
    for entry in listed:
        path = tmp_path / "repository" / entry["archive_url"]
        assert entry["archive_hash"] == f"sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"
        assert entry["archive_size"] == path.stat().st_size
        assert entry["blender_version_min"] == "4.2.0"
        # The values that Blender reads from a link that is dragged into it.
        assert re.search(rf'href="{re.escape(entry["archive_url"])}\?repository=[^"]*index.json[^"]*platforms=', page)


def test_it_lists_the_zips_of_a_release(tmp_path: Path) -> None:
    zips = [path for name in PLATFORMS if (path := zip_of(name))]
    if not zips:
        pytest.skip("no zip in dist: `nox -s extension` builds them")
    make_repository(tmp_path / "repository", zips)
    listed = json.loads((tmp_path / "repository" / "index.json").read_text())["data"]
    assert {entry["archive_url"] for entry in listed} == {f"./{path.name}" for path in zips}
    assert all(entry["python_versions"] and entry["id"] == "perfect_bvh" for entry in listed)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ((), "expected at least one"),
        (("bad.zip",), "refused bad.zip"),
        (("small-0.1.0-linux-x64.zip", "small-0.2.0-linux-x64.zip"), "several for linux-x64"),
    ],
)
def test_it_is_refused_if_incomplete(tmp_path: Path, names: tuple[str, ...], message: str) -> None:
    (tmp_path / "bad.zip").write_bytes(b"no zip")
    for version in ("0.1.0", "0.2.0"):
        small_zip(tmp_path, version, "linux-x64")
    with pytest.raises(SystemExit, match=message):
        make_repository(tmp_path / "repository", [tmp_path / name for name in names])


def test_blenders_command_line_installs_updates_and_removes(tmp_path: Path, served: str) -> None:
    local = tmp_path / "local"

    def run(command: str, *options: str | Path) -> None:
        done = subprocess.run(
            [sys.executable, extension_tool(), command, "--local-dir", local, *options], capture_output=True, text=True
        )
        assert done.returncode == 0 and "ERROR" not in done.stdout.upper(), done.stdout + done.stderr

    remote = ("--remote-url", f"{served}/index.json")
    for version in ("0.1.0", "0.2.0"):
        run("sync", *remote)
        run("install", *remote, "--blender-version", "4.2.0", "--python-version", "3.11.0", "small")
        assert (local / "small" / "__init__.py").read_text().startswith(f"# {version}")
        assert this_platform() in (local / "small" / "blender_manifest.toml").read_text()
        urllib.request.urlopen(f"{served}/newer").close()
    run("uninstall", "--user-dir", tmp_path / "user", "small")
    assert not (local / "small").exists()


def steps_of(command: list[str | Path], environment: dict[str, str]) -> list[str]:
    """Return the installed version after each step of SCRIPT."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return re.findall(r"^STEP (.*)$", done.stdout, re.MULTILINE)


@pytest.mark.parametrize("version", ["this", "4.2", "4.5"])
def test_a_blender_follows_it(version: str, served: str, tmp_path: Path) -> None:
    found = sorted((REPOSITORY / ".cache" / "blenders").glob(f"{version}.*/bin/python"))
    interpreters = [Path(sys.executable)] if version == "this" else found
    if not interpreters:
        pytest.skip(f"no Blender {version} in .cache/blenders: `nox -s blenders` installs it")
    (tmp_path / "user").mkdir()
    environment = os.environ | {"REPOSITORY_URL": served, "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    assert steps_of([interpreters[-1], REPOSITORY / SCRIPT], environment) == FOLLOWED


def test_a_blender_with_windows_follows_it(served: str) -> None:
    if not list((REPOSITORY / ".cache" / "blender-gui").glob(".ready-*")):
        pytest.skip("no Blender 5.2 in .cache/blender-gui: `nox -s blenders` installs it")
    user = "/tmp/user-repository"
    blender = f"blender --background --python-exit-code 1 --python /host/{SCRIPT}"
    command = f"rm -rf {user} && mkdir {user} && env REPOSITORY_URL={served} BLENDER_USER_RESOURCES={user} {blender}"
    chroot = REPOSITORY / "tests" / "gui" / "blender_chroot.sh"
    assert steps_of([chroot, "run", "sh", "-c", command], dict(os.environ)) == FOLLOWED
