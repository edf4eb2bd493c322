"""The engine's wheels, one for each Python and platform: names, metadata, and systems' demands on their modules.

`nox -s extension` leaves them in dist/wheels. Most are for other systems than this: they are read, not run.
"""

from __future__ import annotations

import base64
import csv
import email
import hashlib
import io
import os
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from extension.zips import REPOSITORY

lief = pytest.importorskip("lief", reason="lief, which reads the modules, is not installed: pip install lief")

PYTHONS = ("3.11", "3.13", "3.14")
WHEEL_TAGS = {
    "linux-x64": "manylinux_2_28_x86_64",
    "linux-arm64": "manylinux_2_28_aarch64",
    "windows-x64": "win_amd64",
    "windows-arm64": "win_arm64",
    "macos-x64": "macosx_11_0_x86_64",
    "macos-arm64": "macosx_11_0_arm64",
}
MODULE_SUFFIXES = {
    "linux-x64": ".cpython-{}-x86_64-linux-gnu.so",
    "linux-arm64": ".cpython-{}-aarch64-linux-gnu.so",
    "windows-x64": ".cp{}-win_amd64.pyd",
    "windows-arm64": ".cp{}-win_arm64.pyd",
    "macos-x64": ".cpython-{}-darwin.so",
    "macos-arm64": ".cpython-{}-darwin.so",
}
ALL = [(platform, python) for platform in WHEEL_TAGS for python in PYTHONS]
FOLDER = REPOSITORY / "dist" / "wheels"
MOST_BYTES = 1_290_000  # three are in a zip, which must stay below 4.7 MB
ENTRY_POINT = "PyInit__core"

GLIBC_FLOOR = (2, 28)
LOADERS = {"linux-x64": "ld-linux-x86-64.so.2", "linux-arm64": "ld-linux-aarch64.so.1"}
LINUX_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2"}
MACOS_FLOOR = (11, 0)
MACOS_LIBRARIES = ["/usr/lib/libSystem.B.dylib"]
# Windows 10 has the C runtime of these names; earlier ones got it by an update.
UCRT = "api-ms-win-crt-"


@dataclass(frozen=True)
class Wheel:
    platform: str
    digits: str  # of its Python: 313
    path: Path
    files: dict[str, bytes]

    @property
    def module_name(self) -> str:
        return "perfect_bvh/_core" + MODULE_SUFFIXES[self.platform].format(self.digits)

    @property
    def module(self) -> bytes:
        return self.files[self.module_name]

    def metadata(self, name: str) -> email.message.Message:
        (path,) = (path for path in self.files if path.endswith(f".dist-info/{name}"))
        return email.message_from_bytes(self.files[path])


def find_wheel(platform: str, python: str) -> Path | None:
    """Find the wheel in dist/wheels; there is one at most."""
    digits = python.replace(".", "")
    found = list(FOLDER.glob(f"perfect_bvh_engine-*-cp{digits}-cp{digits}-{WHEEL_TAGS[platform]}.whl"))
    assert len(found) <= 1, found
    return found[0] if found else None


def fixture_of(system: str) -> Any:
    """Each wheel that there is in turn, of platforms whose names begin so."""
    params = [names for names in ALL if names[0].startswith(system) and find_wheel(*names)]

    @pytest.fixture(params=params, ids="-".join)
    def wheel(request: pytest.FixtureRequest) -> Wheel:
        platform, python = request.param
        path = find_wheel(platform, python)
        assert path
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}
        return Wheel(platform, python.replace(".", ""), path, files)

    return wheel


wheel, linux, windows, macos = fixture_of(""), fixture_of("linux"), fixture_of("windows"), fixture_of("macos")


# Any system ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("platform", "python"), ALL)
def test_it_is_small(platform: str, python: str) -> None:
    wheel = find_wheel(platform, python)
    if wheel is None:
        pytest.skip(f"dist/wheels has not all for {platform}: `nox -s extension` builds them")
    assert wheel.stat().st_size < MOST_BYTES


def test_it_says_what_its_name_says(wheel: Wheel) -> None:
    assert wheel.metadata("WHEEL").get_all("Tag") == [wheel.path.stem.split("-", 2)[2]]
    assert wheel.metadata("WHEEL")["Root-Is-Purelib"] == "false"
    metadata = wheel.metadata("METADATA")
    assert f"{metadata['Name'].replace('-', '_')}-{metadata['Version']}-" in wheel.path.name
    assert metadata["Requires-Python"] == ">=3.11"
    assert metadata["License-Expression"] == "GPL-3.0-or-later"
    assert metadata["Description-Content-Type"] == "text/markdown"
    assert "Perfect BVH" in metadata.get_payload()
    (licence,) = (name for name in wheel.files if name.endswith(".dist-info/licenses/LICENSE"))
    assert b"GNU GENERAL PUBLIC LICENSE" in wheel.files[licence]


def test_its_record_lists_each_file_with_its_hash(wheel: Wheel) -> None:
    (record,) = (name for name in wheel.files if name.endswith(".dist-info/RECORD"))
    rows = {name: (digest, size) for name, digest, size in csv.reader(io.StringIO(wheel.files[record].decode()))}
    assert set(rows) == set(wheel.files)
    for name, content in wheel.files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        assert rows[name] == (("", "") if name == record else (f"sha256={digest}", str(len(content)))), name


def test_it_holds_the_engine_alone(wheel: Wheel) -> None:
    assert {name.split("/")[0] for name in wheel.files if ".dist-info/" not in name} == {"perfect_bvh"}
    assert [name for name in wheel.files if name.endswith((".so", ".pyd", ".dll", ".dylib"))] == [wheel.module_name]
    assert not [name for name in wheel.files if name.endswith(("entry_points.txt", ".pyc", ".pdb"))]


def test_its_module_names_no_folder_of_the_machine_that_built_it(wheel: Wheel) -> None:
    for place in (str(REPOSITORY), os.path.expanduser("~/"), "ziglang", "/.cache/", "site-packages"):
        assert place.encode() not in wheel.module, place


# Linux ---------------------------------------------------------------------------------------------------------------


def test_on_linux_it_is_for_the_machine_it_names_and_exports_its_entry_point_alone(linux: Wheel) -> None:
    module = lief.ELF.parse(list(linux.module))
    arch = {"linux-x64": lief.ELF.ARCH.X86_64, "linux-arm64": lief.ELF.ARCH.AARCH64}[linux.platform]
    assert module.header.machine_type == arch
    assert [symbol.name for symbol in module.exported_symbols] == [ENTRY_POINT]


def test_on_linux_it_runs_on_old_systems(linux: Wheel) -> None:
    module = lief.ELF.parse(list(linux.module))
    assert "libc.so.6" in module.libraries
    assert set(module.libraries) <= {*LINUX_LIBRARIES, LOADERS[linux.platform]}
    names = [version.name for need in module.symbols_version_requirement for version in need.get_auxiliary_symbols()]
    versions = [name.removeprefix("GLIBC_") for name in names]
    assert versions
    assert max(tuple(int(number) for number in version.split(".")) for version in versions) <= GLIBC_FLOOR


# Windows -------------------------------------------------------------------------------------------------------------


def test_on_windows_it_is_for_the_machine_it_names_and_exports_its_entry_point_alone(windows: Wheel) -> None:
    module = lief.PE.parse(list(windows.module))
    machines = lief.PE.Header.MACHINE_TYPES
    machine = {"windows-x64": machines.AMD64, "windows-arm64": machines.ARM64}[windows.platform]
    assert module.header.machine == machine
    exported = module.get_export()
    assert [entry.name for entry in exported.entries] == [ENTRY_POINT]
    assert exported.name == windows.module_name.split("/")[1]


def test_on_windows_it_needs_python_and_the_system_alone(windows: Wheel) -> None:
    module = lief.PE.parse(list(windows.module))
    libraries = {entry.name.lower() for entry in module.imports}
    python = f"python{windows.digits}.dll"
    assert python in libraries
    assert {name for name in libraries - {python, "kernel32.dll"} if not name.startswith(UCRT)} == set()
    assert not module.delay_imports


def test_on_windows_it_may_be_placed_anywhere_and_data_does_not_run(windows: Wheel) -> None:
    wanted = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    module = lief.PE.parse(list(windows.module))
    found = module.optional_header.dll_characteristics_lists
    assert {wanted.DYNAMIC_BASE, wanted.HIGH_ENTROPY_VA, wanted.NX_COMPAT} <= set(found)


# macOS ---------------------------------------------------------------------------------------------------------------


@pytest.fixture
def read_file(macos: Wheel) -> Any:
    """The reader's object for a module's file; the module that it returns is valid only while this object lives."""
    binaries = lief.MachO.parse(list(macos.module))
    assert binaries.size == 1
    return binaries


@pytest.fixture
def mach_o(read_file: Any) -> Any:
    return read_file.at(0)


def commands_of(module: Any, command: Any) -> list[Any]:
    return [found for found in module.commands if found.command == command]


def test_on_macos_it_is_for_the_machine_it_names_and_exports_its_entry_point_alone(macos: Wheel, mach_o: Any) -> None:
    kinds = lief.MachO.Header.CPU_TYPE
    assert mach_o.header.cpu_type == {"macos-x64": kinds.X86_64, "macos-arm64": kinds.ARM64}[macos.platform]
    assert [symbol.name for symbol in mach_o.exported_symbols] == [f"_{ENTRY_POINT}"]


def test_on_macos_nothing_of_other_modules_takes_the_place_of_its_own(mach_o: Any) -> None:
    """Its operator new, and the types of its exceptions: of each, Blender's process has other copies."""
    flags = lief.MachO.Header.FLAGS
    assert not {flags.WEAK_DEFINES, flags.BINDS_TO_WEAK} & set(mach_o.header.flags_list)
    assert not [name for name in map(name_of, mach_o.bindings) if name.startswith(("__Zn", "__Zd", "__ZT", "__ZN"))]


def test_on_macos_each_of_its_references_leads_somewhere(mach_o: Any) -> None:
    (table,) = (section for section in mach_o.sections if section.name == "__got")
    filled = {place.address for place in (*mach_o.relocations, *mach_o.bindings)}
    places = set(range(table.virtual_address, table.virtual_address + table.size, 8))
    assert places and places <= filled


def name_of(binding: Any) -> str:
    return str(binding.symbol.name)


def test_on_macos_it_runs_on_old_systems(mach_o: Any) -> None:
    assert tuple(mach_o.build_version.minos)[:2] == MACOS_FLOOR
    needed = commands_of(mach_o, lief.MachO.LoadCommand.TYPE.LOAD_DYLIB)
    assert [library.name for library in needed] == MACOS_LIBRARIES
    assert not [command for command in mach_o.commands if command.command.name.startswith(("RPATH", "LOAD_WEAK"))]


def test_on_macos_it_is_a_library_and_no_program(macos: Wheel, mach_o: Any) -> None:
    """Python loads libraries as well as bundles."""
    kinds = lief.MachO.LoadCommand.TYPE
    assert mach_o.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
    (identity,) = commands_of(mach_o, kinds.ID_DYLIB)
    assert identity.name.split("/")[-1] == macos.module_name.split("/")[1]
    assert not commands_of(mach_o, kinds.LOAD_DYLINKER) + commands_of(mach_o, kinds.MAIN)


def test_on_macos_its_signature_holds_the_hash_of_each_page(macos: Wheel, mach_o: Any) -> None:
    """64-bit ARM checks the hashes before it runs a page; the signature names no signer ("ad hoc")."""
    signatures = commands_of(mach_o, lief.MachO.LoadCommand.TYPE.CODE_SIGNATURE)
    if macos.platform == "macos-x64":
        assert not signatures, "that for Intel has one: check its hashes as well"
        return
    (signature,) = signatures
    assert signature.data_offset + signature.data_size == len(macos.module)
    (directory,) = code_directories(macos.module[signature.data_offset :])
    flags, hashes, count, limit = (word(directory, place) for place in (12, 16, 28, 32))
    digest_size, digest_kind, page = directory[36], directory[37], 1 << directory[39]
    assert (flags & 0x2, digest_size, digest_kind, limit) == (0x2, 32, 2, signature.data_offset)
    pages = [macos.module[start : min(start + page, limit)] for start in range(0, limit, page)]
    assert len(pages) == count
    for number, content in enumerate(pages):
        start = hashes + 32 * number
        assert directory[start : start + 32] == hashlib.sha256(content).digest(), number


def word(data: bytes, place: int) -> int:
    return int.from_bytes(data[place : place + 4], "big")


def code_directories(signature: bytes) -> Iterator[bytes]:
    assert word(signature, 0) == 0xFADE0CC0
    for index in range(word(signature, 8)):
        blob = signature[word(signature, 16 + 8 * index) :]
        if word(blob, 0) == 0xFADE0C02:
            yield blob
