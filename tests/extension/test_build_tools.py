"""The tools that make wheels and zips for other systems, on small inputs written here byte by byte."""

from __future__ import annotations

import argparse
import hashlib
import importlib
import itertools
import struct
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from extension.zips import REPOSITORY

TOOLS = (
    "debian_packages",
    "extension_folder",
    "import_library",
    "manifest",
    "maven_pythons",
    "mend_mach_o",
    "weak_symbols",
    "wheel_platforms",
)


@pytest.fixture
def tools(monkeypatch: pytest.MonkeyPatch) -> dict[str, ModuleType]:
    monkeypatch.syspath_prepend(str(REPOSITORY / "release"))
    return {name: importlib.import_module(name) for name in TOOLS}


# Object files --------------------------------------------------------------------------------------------------------


def coff(selection: int) -> bytes:
    """A COFF object with one function in a section that the linker may merge, as `selection` says."""
    flags = 0x20 | 0x1000  # code, merged
    header = struct.pack("<2H 3I 2H", 0x8664, 1, 0, 60, 3, 0, 0)
    section = struct.pack("<8s 6I 2H I", b".text$f", 0, 0, 0, 0, 0, 0, 0, 0, flags)
    own = struct.pack("<8s I h H 2B", b".text$f", 0, 1, 0, 3, 1) + struct.pack(
        "<I 2H I H B 3x", 4, 0, 0, 0, 1, selection
    )
    function = struct.pack("<2I I h H 2B", 0, 4, 0, 1, 0x20, 2, 0)
    return header + section + own + function + struct.pack("<I", 4 + 12) + b"long_name_f\0"


def mach_o_object(description: int) -> bytes:
    """A Mach-O object with one function of that description, and one that is defined elsewhere."""
    header = struct.pack("<8I", 0xFEEDFACF, 0x0100000C, 0, 1, 1, 24, 0, 0)
    command = struct.pack("<6I", 2, 24, 56, 2, 88, 8)
    symbols = struct.pack("<I2BHQ", 1, 0x0F, 1, description, 0) + struct.pack("<I2BHQ", 4, 0x01, 0, 0x80, 0)
    return header + command + symbols + b"\0_f\0_g\0\0"


@pytest.mark.parametrize(("content", "weak"), [(coff(2), ["long_name_f"]), (coff(1), [])], ids=["any", "one only"])
def test_functions_that_windows_linker_may_merge_are_named(content, weak, tools, tmp_path: Path) -> None:
    (tmp_path / "object").write_bytes(content)
    assert tools["weak_symbols"].weak_functions(tmp_path / "object") == weak


@pytest.mark.parametrize(("description", "weak"), [(0x80, ["_f"]), (0, [])])
def test_functions_that_macos_linker_may_merge_are_named(description, weak, tools, tmp_path: Path) -> None:
    (tmp_path / "object").write_bytes(mach_o_object(description))
    assert tools["weak_symbols"].weak_functions(tmp_path / "object") == weak


def test_other_objects_are_refused(tools, tmp_path: Path) -> None:
    (tmp_path / "object").write_bytes(b"\x7fELF")
    with pytest.raises(ValueError, match="neither a COFF nor a 64-bit Mach-O object"):
        tools["weak_symbols"].weak_functions(tmp_path / "object")


def test_kernels_that_the_linker_may_merge_end_the_build(tools, tmp_path: Path) -> None:
    folder = tmp_path / "src" / "perfect_bvh_avx2.dir" / "traverse"
    folder.mkdir(parents=True)
    with pytest.raises(SystemExit, match="found none to check"):
        tools["weak_symbols"].check_kernels(tmp_path)
    (folder / "kernel_avx2.cpp.obj").write_bytes(coff(1))
    tools["weak_symbols"].check_kernels(tmp_path)
    (folder / "kernel_avx2.cpp.obj").write_bytes(coff(2))
    with pytest.raises(SystemExit, match=r"kernel_avx2\.cpp\.obj: long_name_f"):
        tools["weak_symbols"].check_kernels(tmp_path)


# Builds and releases -----------------------------------------------------------------------------------------


def test_platforms_are_read_with_their_pythons(tools) -> None:
    platforms = tools["wheel_platforms"]
    read = [platforms.read_platform(text) for text in ("windows-x64:3.13", "linux-x64", "windows-x64:3.11,3.13")]
    gathered = platforms.gather_pythons(read, ("3.14",))
    assert gathered == {"windows-x64": ("3.13", "3.11"), "linux-x64": ("3.14",)}
    for text in ("windows", "linux-x64:2.7"):
        with pytest.raises(argparse.ArgumentTypeError, match="is not PLATFORM or PLATFORM:PYTHON"):
            platforms.read_platform(text)


def test_a_release_has_a_wheel_for_each_python_of_each_platform(tools) -> None:
    platforms = tools["wheel_platforms"]
    names = platforms.package_names("1.2.3")
    assert len(names) == len(set(names)) == 6 * 3 + 1
    assert "perfect_bvh_engine-1.2.3-cp311-cp311-win_amd64.whl" in names
    assert "perfect_bvh_engine-1.2.3-cp314-cp314-manylinux_2_28_aarch64.whl" in names
    assert "perfect_bvh_engine-1.2.3.tar.gz" in names
    assert platforms.zip_name("1.2.3", "macos-arm64") == "perfect_bvh-1.2.3-macos_arm64.zip"


def test_each_python_has_somewhere_to_come_from(tools) -> None:
    pythons = set(tools["wheel_platforms"].PYTHONS)
    maven = tools["maven_pythons"]
    assert set(tools["debian_packages"].RELEASES) == set(maven.VERSIONS) == pythons
    assert set(maven.DIGESTS) == {f"{system}-x86_64-{python}" for system in ("windows", "macosx") for python in pythons}


def test_the_engine_has_a_copy_of_the_licence() -> None:
    """No link: Windows' checkouts have a file with its target's name instead, which a wheel would then carry."""
    copy = REPOSITORY / "native" / "LICENSE"
    assert not copy.is_symlink()
    assert copy.read_bytes() == (REPOSITORY / "LICENSE").read_bytes()


def test_the_manifest_holds_the_version(tools, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest = tools["manifest"]
    assert manifest.read_version() == tomllib.loads(manifest.MANIFEST.read_text(encoding="utf-8"))["version"]
    (tmp_path / "manifest.toml").write_text('id = "x"\n', encoding="utf-8")
    monkeypatch.setattr(manifest, "MANIFEST", tmp_path / "manifest.toml")
    with pytest.raises(SystemExit, match="expected one line `version = "):
        manifest.read_version()


# Libraries to link with on Windows -----------------------------------------------------------------------------------


def dll(names: list[str], section_size: int = 0x200) -> bytes:
    """A 64-bit DLL of one section, at address 0x1000 and place 0x200, whose table of exports has these names."""
    texts = [name.encode() + b"\0" for name in names]
    starts = itertools.accumulate(map(len, texts[:-1]), initial=0)
    first_text = 0x1000 + 40 + 4 * len(names)
    table = struct.pack("<10I", 0, 0, 0, 0, 1, len(names), len(names), 0, 0x1000 + 40, 0)
    table += struct.pack(f"<{len(names)}I", *(first_text + start for start in starts)) + b"".join(texts)
    header = b"MZ".ljust(0x3C, b"\0") + struct.pack("<I", 0x40)
    header += b"PE\0\0" + struct.pack("<2H 3I 2H", 0x8664, 1, 0, 0, 0, 240, 0x2000)
    header += (b"\x0b\x02".ljust(112, b"\0") + struct.pack("<2I", 0x1000, len(table))).ljust(240, b"\0")
    header += struct.pack("<8s 8I", b".edata", len(table), 0x1000, section_size, 0x200, 0, 0, 0, 0)
    return header.ljust(0x200, b"\0") + table


def test_what_a_dll_exports_is_read(tools, tmp_path: Path) -> None:
    (tmp_path / "python.dll").write_bytes(dll(["PyList_New", "Py_Exit"]))
    assert tools["import_library"].exported_names(tmp_path / "python.dll") == ["PyList_New", "Py_Exit"]


def test_a_dll_whose_addresses_lead_nowhere_is_refused(tools, tmp_path: Path) -> None:
    (tmp_path / "python.dll").write_bytes(dll(["PyList_New"], section_size=40))
    with pytest.raises(ValueError, match="no section of the DLL holds address 0x1028"):
        tools["import_library"].exported_names(tmp_path / "python.dll")


# Modules for macOS ---------------------------------------------------------------------------------------------------

TRIE = (
    bytes([0, 2])
    + b"_PyInit_x\0"
    + bytes([21])
    + b"_other\0"
    + bytes([26])
    + bytes([3, 0, 0x80, 0x20, 0])
    + bytes([2, 0, 8, 0])
)
PAGE = 0x1000


def mach_o_module() -> bytearray:
    """A module of one page that exports two names, looks one up among others', and names the dynamic linker."""
    linker = struct.pack("<3I", 0xE, 32, 12) + b"/usr/lib/dyld".ljust(20, b"\0")
    info = struct.pack("<12I", 0x80000022, 48, 0, 0, 0, 0, 0x400, 8, 0, 0, 0x500, len(TRIE))
    signature = struct.pack("<4I", 0x1D, 16, PAGE, 120)
    commands = linker + info + signature
    flags = 0x4 | 0x8000 | 0x10000
    module = bytearray(struct.pack("<8I", 0xFEEDFACF, 0x0100000C, 0, 6, 3, len(commands), flags, 0) + commands)
    module = module.ljust(PAGE, b"\0")
    module[0x400:0x408] = b"weakbind"
    module[0x500 : 0x500 + len(TRIE)] = TRIE
    directory = struct.pack(">9I4B I", 0xFADE0C02, 76, 0x20400, 2, 44, 0, 0, 1, PAGE, 32, 2, 0, 12, 0) + bytes(32)
    return module + struct.pack(">5I", 0xFADE0CC0, 96, 1, 0, 20) + directory


def test_a_module_is_mended(tools) -> None:
    mend = tools["mend_mach_o"]
    module = mach_o_module()
    mend.mend_module(module)
    assert [command for command, _, _ in mend.load_commands(module)] == [0x80000022, 0x1D]
    assert list(mend.read_trie(bytes(module[0x500 : 0x500 + len(TRIE)]))) == [("_PyInit_x", bytes([0, 0x80, 0x20]))]
    assert struct.unpack_from("<I", module, 24) == (0x4,)
    assert module[0x400:0x408] == bytes(8)
    assert module[PAGE + 20 + 44 : PAGE + 20 + 76] == hashlib.sha256(module[:PAGE]).digest()
    assert len(module) == len(mach_o_module())


def test_a_module_without_entry_point_is_refused(tools) -> None:
    module = mach_o_module()
    place = module.index(b"_PyInit_x")
    module[place : place + 9] = b"_PyOther_"
    with pytest.raises(ValueError, match=r"expected one _PyInit_\* that is exported"):
        tools["mend_mach_o"].mend_module(module)


# The extension's folder ----------------------------------------------------------------------------------------------


def test_the_manifest_names_the_wheels_and_their_platforms(tools) -> None:
    manifest = (REPOSITORY / "addon" / "blender_manifest.toml").read_text(encoding="utf-8")
    names = ["perfect_bvh_engine-1-cp311-cp311-win_amd64.whl", "other-1-py3-none-any.whl"]
    listed = tomllib.loads(tools["extension_folder"].list_wheels(manifest, names))
    assert listed["platforms"] == ["windows-x64"]
    assert listed["wheels"] == [f"./wheels/{name}" for name in sorted(names)]
    assert listed["permissions"] == tomllib.loads(manifest)["permissions"]


def test_an_extension_for_no_platform_is_refused(tools) -> None:
    with pytest.raises(SystemExit, match="no wheel of the engine"):
        tools["extension_folder"].list_wheels("", ["other-1-py3-none-any.whl"])
