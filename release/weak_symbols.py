"""Lists the symbols in object files that the linker may merge: inline functions and templates that were not inlined.

native/cmake/check_weak_symbols.cmake does this where `nm` reads the objects; this reads Windows' (COFF) and macOS's
(Mach-O), which it does not. A merged function could be the copy that is compiled for AVX-512, and run on any machine.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

MACH_O_64 = 0xFEEDFACF
LC_SYMTAB = 0x2
WEAK_DEFINITION = 0x0080
COFF_MACHINES = (0x8664, 0xAA64)
CODE, MERGED = 0x20, 0x1000  # a section's flags
ONE_ONLY = 1  # a merged section that may occur once; others are a choice among several
STATIC = 3  # a symbol's storage class


def check_kernels(build: Path) -> None:
    """End the program if the linker may have merged a kernel's function with one that is compiled for any machine.

    `build` is CMake's folder of a build for x86-64 on Windows or macOS.
    """
    kernels = [*build.rglob("perfect_bvh_*.dir/traverse/*_avx*.o*")]
    if not kernels:
        raise SystemExit(f"check_kernels: expected the kernels' object files below {build}, found none to check")
    found = [f"{kernel.name}: {name}" for kernel in kernels for name in weak_functions(kernel)]
    if found:
        raise SystemExit("check_kernels: weak symbols; give them internal linkage:\n  " + "\n  ".join(found))


def weak_functions(path: Path) -> list[str]:
    """The names of functions in the object file that the linker may take from another one; ValueError for others."""
    data = path.read_bytes()
    if int.from_bytes(data[:4], "little") == MACH_O_64:
        return list(_weak_in_mach_o(data))
    if int.from_bytes(data[:2], "little") in COFF_MACHINES:
        return list(_weak_in_coff(data))
    raise ValueError(f"weak_functions: {path} is neither a COFF nor a 64-bit Mach-O object")


def _text(data: bytes, offset: int) -> str:
    return data[offset : data.index(0, offset)].decode()


def _weak_in_mach_o(data: bytes) -> Iterator[str]:
    (commands,) = struct.unpack_from("<I", data, 16)
    at = 32
    for _ in range(commands):
        command, size = struct.unpack_from("<2I", data, at)
        if command == LC_SYMTAB:
            symbols, count, names = struct.unpack_from("<3I", data, at + 8)
            for index in range(count):
                name, _, section, description, _ = struct.unpack_from("<I2BHQ", data, symbols + 16 * index)
                if section and description & WEAK_DEFINITION:
                    yield _text(data, names + name)
        at += size


def _weak_in_coff(data: bytes) -> Iterator[str]:
    section_count, _, symbols, symbol_count, header_size = struct.unpack_from("<2x H 3I H", data)
    sections = 20 + header_size
    flags = [struct.unpack_from("<I", data, sections + 40 * index + 36)[0] for index in range(section_count)]
    names = symbols + 18 * symbol_count
    chosen: set[int] = set()  # sections of which the linker takes any
    index = 0
    while index < symbol_count:
        at = symbols + 18 * index
        zeros, name, section, storage, extra = struct.unpack_from("<2I 4x h 2x 2B", data, at)
        index += 1 + extra
        if section <= 0 or not flags[section - 1] & MERGED or not flags[section - 1] & CODE:
            continue
        if storage == STATIC and extra:  # the section's own symbol comes before those in it
            if data[at + 18 + 14] != ONE_ONLY:
                chosen.add(section)
        elif section in chosen:
            yield data[at : at + 8].rstrip(b"\0").decode() if zeros else _text(data, names + name)
