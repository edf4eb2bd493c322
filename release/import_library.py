"""Makes Python's import library for Windows on ARM from the exports of the DLL for x86-64: the names are the same."""

from __future__ import annotations

import struct
import subprocess
from collections.abc import Callable
from pathlib import Path


def make_import_library(zig: Path, machine: str, dll: Path, library: Path) -> None:
    """Write `library`, with which code for `machine` (arm64, for example) can call the exports of `dll`."""
    library.parent.mkdir(parents=True, exist_ok=True)
    definition = library.with_suffix(".def")
    names = "".join(f"  {name}\n" for name in exported_names(dll))
    definition.write_text(f"LIBRARY {dll.name}\nEXPORTS\n{names}", encoding="ascii")
    subprocess.run([zig, "dlltool", "-m", machine, "-d", definition, "-l", library], check=True)


def exported_names(dll: Path) -> list[str]:
    """The names that a 64-bit DLL (the format PE32+) exports, in the order of the file."""
    data = dll.read_bytes()
    (header,) = struct.unpack_from("<I", data, 0x3C)
    (table,) = struct.unpack_from("<I", data, header + 24 + 112)
    offset = address_reader(data, header)
    count, _, names = struct.unpack_from("<3I", data, offset(table) + 24)
    places = struct.unpack_from(f"<{count}I", data, offset(names))
    return [data[start : data.index(0, start)].decode("ascii") for start in map(offset, places)]


def address_reader(data: bytes, header: int) -> Callable[[int], int]:
    """A function from an address relative to the loaded DLL's start to the offset in the file."""
    (count,) = struct.unpack_from("<H", data, header + 6)
    (optional_size,) = struct.unpack_from("<H", data, header + 20)
    first = header + 24 + optional_size
    sections = [struct.unpack_from("<4I", data, first + 40 * index + 8) for index in range(count)]

    def offset(address: int) -> int:
        for _, start, size, place in sections:
            if start <= address < start + size:
                return address - start + place
        raise ValueError(f"exported_names: no section of the DLL holds address {address:#x}")

    return offset
