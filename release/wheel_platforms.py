"""Blender's platforms, their names for compiler, wheel and Python, and the Pythons of each in a release."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import dataclass

PYTHONS = ("3.11", "3.13", "3.14")  # Blender 4.2 to 5.0, Blender 5.1 and later, Debian's Blender


@dataclass(frozen=True)
class Platform:
    """One platform that wheels are built for, the oldest system that they run on included."""

    target: str  # arguments of ziglang's compiler
    wheel_tag: str
    module_suffix: str  # with the place of a Python's two numbers

    @property
    def system(self) -> str:
        """linux, windows or macos."""
        return self.target.split("-")[1].partition(".")[0]

    @property
    def processor(self) -> str:
        """x86_64 or aarch64."""
        return self.target.partition("-")[0]

    def tag(self, python: str) -> str:
        """The tags in a wheel's name for a CPython, for example 3.13, and this platform: cp313-cp313-win_amd64."""
        digits = python.replace(".", "")
        return f"cp{digits}-cp{digits}-{self.wheel_tag}"


PLATFORMS = {
    "linux-x64": Platform("x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64", ".cpython-{}-x86_64-linux-gnu.so"),
    "linux-arm64": Platform("aarch64-linux-gnu.2.28", "manylinux_2_28_aarch64", ".cpython-{}-aarch64-linux-gnu.so"),
    "windows-x64": Platform("x86_64-windows-gnu", "win_amd64", ".cp{}-win_amd64.pyd"),
    "windows-arm64": Platform("aarch64-windows-gnu", "win_arm64", ".cp{}-win_arm64.pyd"),
    "macos-x64": Platform("x86_64-macos.11.0-none", "macosx_11_0_x86_64", ".cpython-{}-darwin.so"),
    "macos-arm64": Platform("aarch64-macos.11.0-none", "macosx_11_0_arm64", ".cpython-{}-darwin.so"),
}


def zip_name(version: str, platform: str) -> str:
    """The zip for one platform, as Blender's tool names it."""
    return f"perfect_bvh-{version}-{platform.replace('-', '_')}.zip"


def package_names(version: str) -> list[str]:
    """The engine's files that pip is offered: a wheel for each platform and Python, and the sources."""
    tags = (platform.tag(python) for platform in PLATFORMS.values() for python in PYTHONS)
    return [*(f"perfect_bvh_engine-{version}-{tag}.whl" for tag in tags), f"perfect_bvh_engine-{version}.tar.gz"]


def read_platform(text: str) -> tuple[str, tuple[str, ...]]:
    """A platform and the Pythons named after it, if any: windows-x64:3.11,3.13."""
    name, _, pythons = text.partition(":")
    chosen = tuple(pythons.split(",")) if pythons else ()
    if name not in PLATFORMS or not set(chosen) <= set(PYTHONS):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not PLATFORM or PLATFORM:PYTHON,... of {', '.join(PLATFORMS)} and {', '.join(PYTHONS)}"
        )
    return name, chosen


def gather_pythons(
    platforms: Iterable[tuple[str, tuple[str, ...]]], unless_named: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """The Pythons of each platform, in order; one that is named twice has both times' Pythons."""
    gathered: dict[str, tuple[str, ...]] = {}
    for name, pythons in platforms:
        gathered[name] = tuple(dict.fromkeys((*gathered.get(name, ()), *(pythons or unless_named))))
    return gathered
