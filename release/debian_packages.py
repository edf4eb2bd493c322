"""Unpacks Debian's packages into a folder, of any release and for any machine, without installing anything."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable
from pathlib import Path

CACHE = Path(__file__).resolve().parent.parent / ".cache"
KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"
# Debian's names of Blender's platforms.
ARCHITECTURES = {"linux-x64": "amd64", "linux-arm64": "arm64"}
# Python and the release that has it: Blender 4.2 to 5.0, Blender 5.1 and later, Debian's Blender.
RELEASES = {"3.11": "bookworm", "3.13": "trixie", "3.14": "sid"}


def unpack_packages(folder: Path, release: str, packages: Iterable[str]) -> None:
    """Unpack `packages`, named like libc6:arm64, from `release` into `folder`; nothing that they depend on.

    An apt of our own does it, which touches no system file. A failure ends the program.
    """
    apt = prepare_apt(release)
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run([*apt, "download", *packages], check=True, cwd=folder)
    for package in sorted(folder.glob("*.deb")):
        subprocess.run(["dpkg", "-x", package, folder], check=True)
        package.unlink()


def prepare_apt(release: str) -> list[str]:
    """The command of an apt configured with `release` for all architectures, with its current package lists."""
    folder = CACHE / "debian" / release
    (folder / "lists" / "partial").mkdir(parents=True, exist_ok=True)
    (folder / "status").touch()
    names = ",".join(ARCHITECTURES.values())
    sources = folder / "sources.list"
    origin = f"deb [arch={names} signed-by={KEYRING}] {debian_mirror()} {release} main\n"
    sources.write_text(origin, encoding="utf-8")
    options = {
        "Dir::Etc::SourceList": sources,
        "Dir::Etc::SourceParts": "/dev/null",
        "Dir::State::Lists": folder / "lists",
        "Dir::State::Status": folder / "status",
        "Dir::Cache": folder,
        "APT::Architecture": "amd64",
        "APT::Architectures": names,
        "APT::Sandbox::User": "",
        "Acquire::Check-Valid-Until": "false",
        "Acquire::Languages": "none",
    }
    apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in options.items())]
    subprocess.run([*apt, "update"], check=True)
    return apt


def debian_mirror() -> str:
    """The mirror that this machine's own packages come from."""
    for path in (Path("/etc/apt/sources.list.d/debian.sources"), Path("/etc/apt/sources.list")):
        if not path.is_file():
            continue
        for line in path.read_text(encoding="utf-8").splitlines():
            words = line.split()
            if words[:1] == ["URIs:"] or words[:1] == ["deb"]:
                addresses = [word for word in words[1:] if "://" in word]
                if addresses:
                    return addresses[0]
    raise SystemExit("debian_packages: no Debian mirror in /etc/apt to fetch packages from")
