"""The file names that each system accepts, and long paths on Windows; all tested on any system."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath, PureWindowsPath

import pytest
from perfect_bvh_addon.support.files import extended_name, find_fault, reachable

LONG = "\\".join(["x" * 50] * 6)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (r"C:\images\a.png", r"C:\images\a.png"),
        (rf"C:\{LONG}\a.png", rf"\\?\C:\{LONG}\a.png"),
        (rf"C:\{LONG}\..\b c\ü.png", "\\\\?\\C:\\" + "\\".join(["x" * 50] * 5) + r"\b c\ü.png"),
        (rf"\\server\share\{LONG}\a.png", rf"\\?\UNC\server\share\{LONG}\a.png"),
        (r"\\server\share\a.png", r"\\server\share\a.png"),
        (rf"\\?\C:\{LONG}", rf"\\?\C:\{LONG}"),
    ],
)
def test_a_long_name_is_prefixed_on_windows(name: str, expected: str) -> None:
    assert extended_name(name) == expected


@pytest.mark.parametrize(
    ("system", "path", "fault"),
    [
        ("linux", PurePosixPath("/home/me/a:b?.png"), None),
        ("linux", PurePosixPath("/home/me/nul.png"), None),
        ("linux", PurePosixPath("/", "ü" * 127), None),
        ("linux", PurePosixPath("/", "ü" * 128), "a name may have 255 bytes, got 256 (üüüü"),
        ("linux", PurePosixPath("/", *["x" * 100] * 41), "a path may have 4095 bytes, got 4141;"),
        ("darwin", PurePosixPath("/", *["x" * 100] * 11), "a path may have 1023 bytes, got 1111;"),
        ("freebsd14", PurePosixPath("/", *["x" * 100] * 11), None),
        ("win32", PureWindowsPath(r"C:\Users\Jörg Müller\立方体.png"), None),
        ("win32", PureWindowsPath(r"\\server\share\a.png"), None),
        ("win32", PureWindowsPath(rf"\\?\C:\{LONG}\a.png"), None),
        ("win32", PureWindowsPath("C:\\", "ü" * 255), None),
        ("win32", PureWindowsPath("C:\\", "ü" * 256), "a name may have 255 characters, got 256 (üüüü"),
        ("win32", PureWindowsPath("C:\\", "🦊" * 128), "a name may have 255 characters, got 256"),
        ("win32", PureWindowsPath("C:\\", *["x" * 200] * 170), "a path may have 32766 characters, got 34172;"),
        ("win32", PureWindowsPath(r"C:\a:b.png"), "a name cannot hold ':' on Windows, got 'a:b.png'; remove it"),
        ("win32", PureWindowsPath(r"C:\frames?\a.png"), "a name cannot hold '?' on Windows"),
        ("win32", PureWindowsPath("C:\\a\tb.png"), r"a name cannot hold '\t' on Windows"),
        ("win32", PureWindowsPath(r"C:\nul.png"), "'nul.png' is a device on Windows; give another name"),
        ("win32", PureWindowsPath(r"C:\Com1 .x\a.png"), "'Com1 .x' is a device on Windows"),
        ("win32", PureWindowsPath(r"C:\console.png"), None),
        ("win32", PureWindowsPath(r"C:\images.\a.png"), "a name cannot end with '.' on Windows, got 'images.';"),
        ("win32", PureWindowsPath(r"C:\images \a.png"), "a name cannot end with ' ' on Windows"),
        ("win32", PureWindowsPath(r"C:\a\..\b.png"), None),
        ("win32", PureWindowsPath("C:\\a\0b.png"), "a name cannot hold a zero byte"),
    ],
)
def test_what_a_system_could_not_hold_is_named(system: str, path: Path, fault: str | None) -> None:
    found = find_fault(path, system)
    assert found is None if fault is None else found is not None and found.startswith(fault)


def test_a_file_of_any_length_is_reached(tmp_path: Path) -> None:
    folder = tmp_path.joinpath("Jörg Müller", *["x" * 60] * 5)
    reachable(folder).mkdir(parents=True)
    reachable(folder / "立方体.txt").write_text("here")
    assert len(str(folder)) > 300
    assert reachable(folder / "立方体.txt").read_text() == "here"
    assert [path.name for path in reachable(folder).iterdir()] == ["立方体.txt"]
    assert str(reachable(folder)).startswith("\\\\?\\") == (os.name == "nt")
