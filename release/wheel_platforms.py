"""Blender's platforms, and what compiler, wheel and Python call each."""

from __future__ import annotations

from dataclasses import dataclass

PYTHONS = ("3.11", "3.13", "3.14")  # Blender 4.2 to 5.0, Blender 5.1 and later, Debian's Blender


@dataclass(frozen=True)
class Platform:
    """One platform that wheels are built for, the oldest system that they run on included."""

    target: str  # what ziglang's compiler is told
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


PLATFORMS = {
    "linux-x64": Platform("x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64", ".cpython-{}-x86_64-linux-gnu.so"),
    "linux-arm64": Platform("aarch64-linux-gnu.2.28", "manylinux_2_28_aarch64", ".cpython-{}-aarch64-linux-gnu.so"),
    "windows-x64": Platform("x86_64-windows-gnu", "win_amd64", ".cp{}-win_amd64.pyd"),
    "windows-arm64": Platform("aarch64-windows-gnu", "win_arm64", ".cp{}-win_arm64.pyd"),
    "macos-x64": Platform("x86_64-macos.11.0-none", "macosx_11_0_x86_64", ".cpython-{}-darwin.so"),
    "macos-arm64": Platform("aarch64-macos.11.0-none", "macosx_11_0_arm64", ".cpython-{}-darwin.so"),
}
